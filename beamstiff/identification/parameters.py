"""What is sought: logarithms of stiffness values, tied, bounded and with what is known of them beforehand."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

SPAN = 1e8  # a stiffness is sought within this factor of its start, either way


@dataclass(frozen=True)
class Parameters:
    """Free values theta (t,), the logarithms of stiffness values k (m,).

    ``log k_j = log start_j + theta_i - log start_first(i)``: values that are tied keep the ratio of their
    starts.
    """

    names: tuple[str, ...]  # (m)
    start: Array  # (m,), N/m, N m/rad or Pa
    # (m,): which free value moves each stiffness, 0..t-1; -1 where none does and it stays at its start
    tied: Integers
    # lower, upper, (t,): bounds of theta
    lower: Array
    upper: Array
    # known, known_std, (m,): prior: mean and standard deviation of log k; infinite standard deviation for
    # none
    known: Array
    known_std: Array

    @cached_property
    def first(self) -> Integers:
        """The first stiffness that each free value moves, (t,)."""
        number, first = np.unique(self.tied, return_index=True)
        return first[number >= 0].astype(np.int64)

    @property
    def begin(self) -> Array:
        """Theta at the start, (t,), within the bounds."""
        return np.clip(np.log(self.start)[self.first], self.lower, self.upper)

    @cached_property
    def sums(self) -> Array:
        """Which free value moves which stiffness, (m, t); derivatives by log k times it are by theta."""
        result = np.zeros((self.start.size, self.first.size))
        moved = np.flatnonzero(self.tied >= 0)
        result[moved, self.tied[moved]] = 1.0
        return result

    def stiffness(self, theta: Array) -> Array:
        """Return the stiffness values (..., m) at theta (..., t)."""
        log_start = np.log(self.start)
        shift = theta - log_start[self.first]
        shift = np.concatenate([shift, np.zeros((*shift.shape[:-1], 1))], axis=-1)  # for those that stay
        return self.start * np.exp(shift[..., self.tied])

    def prior(self, stiffness: Array) -> Array:
        """Return how far the values (..., m) are from what was known, in standard deviations."""
        return (self.known - np.log(stiffness)) / self.known_std


def build_parameters(
    names: Sequence[str],
    start: Array,
    ties: Sequence[Sequence[str]] = (),
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    held: Collection[str] = (),
) -> Parameters:
    """Return the free values of an identification.

    `names` (m). `start` (m,): values in the robot. `ties`: parameters that keep the ratio of their starts.
    `bounds` (low, high): least and largest value, SI; None for none. Default a factor of 1e8 either way.
    `priors` (value, factor): known beforehand: the value, and the factor (above 1) by which one standard
    deviation is off. `held`: parameters that stay at their start.
    """
    number = {name: at for at, name in enumerate(names)}

    def at_name(name: str, what: str) -> int:
        if name not in number:
            raise BeamstiffError(f"{what}: {name!r} is not among the parameters{suggest(name, number)}")
        return number[name]

    owner = np.arange(len(names))
    for group in ties:
        members = [at_name(name, "ties") for name in group]
        if len(members) < 2 or len(set(members)) < len(members):
            raise BeamstiffError(
                f"ties: found {', '.join(group)!r}, expected two or more different parameters"
            )
        if (owner[members] != members).any() or np.isin(owner, members).sum() > len(members):
            raise BeamstiffError(f"ties: {', '.join(group)}: a parameter is tied twice")
        owner[members] = min(members)
    free = np.array([name not in held for name in names], dtype=np.bool_)
    tied = np.full(len(names), -1)
    tied[free] = np.unique(owner[free], return_inverse=True)[1].reshape(-1)
    low, high = np.log(start / SPAN), np.log(start * SPAN)
    for name, limits in (bounds or {}).items():
        at = at_name(name, "bounds")
        for limit, into in zip(limits, (low, high), strict=True):
            if limit is not None:
                into[at] = np.log(_positive(limit, f"bounds of {name}"))
        if not low[at] < high[at]:
            raise BeamstiffError(f"bounds of {name}: found {limits[0]} to {limits[1]}, expected low < high")
    known, known_std = np.log(start), np.full(len(names), np.inf)
    for name, (value, factor) in (priors or {}).items():
        at = at_name(name, "priors")
        known[at] = np.log(_positive(value, f"prior of {name}"))
        if not (np.isfinite(factor) and factor > 1.0):
            raise BeamstiffError(f"prior of {name}: found the factor {factor}, expected a number above 1")
        known_std[at] = np.log(factor)
    groups, first = np.unique(tied, return_index=True)
    first = first[groups >= 0]
    lower, upper = np.zeros(first.size), np.zeros(first.size)
    for at, leader in enumerate(first):  # bounds of tied values, as those of the first
        shift = np.log(start) - np.log(start[leader])
        lower[at], upper[at] = (low - shift)[tied == at].max(), (high - shift)[tied == at].min()
    if (lower >= upper).any():
        at = int(np.argmax(lower >= upper))
        raise BeamstiffError(f"bounds: those tied to {names[first[at]]} leave no value for all of them")
    return Parameters(tuple(names), start, tied.astype(np.int64), lower, upper, known, known_std)


def _positive(value: float, what: str) -> float:
    if not (np.isfinite(value) and value > 0):
        raise BeamstiffError(f"{what}: found {value}, expected a positive number")
    return value
