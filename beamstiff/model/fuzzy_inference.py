"""Takagi-Sugeno fuzzy systems of order 0: strong triangular partitions, product conjunction (seed 003).

With one triangular set a modal value, neighbours crossing at one half, the degrees of an input sum to one
(eq. 33), so do the firing strengths ``alpha_i = prod_j mu(x_j)`` (eq. 37), and eq. 36 is a mean::

    y(x) = sum_i alpha_i(x) b_i

It is the multilinear interpolation of the conclusions b on the lattice of modal values. A mean of positive
definite conclusions is positive definite.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.arrays import finite
from beamstiff.se3 import Array

SLACK = 1e-9  # share of a range that rounding may leave it by


@dataclass(frozen=True, eq=False)
class Partition:
    """Strong triangular partitions of the inputs; a rule for every combination of their sets.

    >>> degrees = Partition(("q2", "q8"), (np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0])))
    >>> print(degrees.count, degrees.firing([[2.0, 0.5]]).round(3))
    6 [[0.    0.    0.333 0.333 0.167 0.167]]
    """

    inputs: tuple[str, ...]  # n names
    # (m_j,): of the triangles, strictly increasing; beyond the first and the last the outer set holds fully.
    # An input with one set plays no part
    modal_values: tuple[Array, ...]
    # (n, 2): least and largest value of each input in training; default the outer modal values
    limits: Array | None = None

    def __post_init__(self) -> None:
        """Check the partitions."""
        if not self.inputs or len(self.inputs) != len(self.modal_values):
            raise BeamstiffError(
                f"partition: found {len(self.modal_values)} sequences of modal values for {len(self.inputs)} "
                "inputs, expected one each"
            )
        values = tuple(
            finite(row, f"partition: modal values of {name}", -1)
            for name, row in zip(self.inputs, self.modal_values, strict=True)
        )
        for name, row in zip(self.inputs, values, strict=True):
            if not row.size or (np.diff(row) <= 0).any():
                raise BeamstiffError(
                    f"partition: found the modal values {row.tolist()} of {name}, expected one or more, each "
                    "larger than the one before"
                )
        object.__setattr__(self, "modal_values", values)

    @property
    def trained(self) -> Array:
        """Least and largest value of each input in training, (n, 2)."""
        if self.limits is not None:
            return self.limits
        return np.array([[row[0], row[-1]] for row in self.modal_values])

    @property
    def count(self) -> int:
        """Number of rules R."""
        return int(np.prod(self.sets))

    @property
    def sets(self) -> tuple[int, ...]:
        """Number of sets of each input."""
        return tuple(len(row) for row in self.modal_values)

    def memberships(self, x: ArrayLike) -> list[Array]:
        """Return the degrees of each input in its sets, (N, m_j) each, at inputs (N, n)."""
        values = finite(x, "inputs of the fuzzy system", -1, len(self.inputs))
        result = []
        for column, modal in zip(values.T, self.modal_values, strict=True):
            degrees = np.ones((len(values), 1))
            if modal.size > 1:
                degrees = np.stack([np.interp(column, modal, hat) for hat in np.eye(modal.size)], axis=1)
            result.append(degrees)
        return result

    def firing(self, x: ArrayLike) -> Array:
        """Return the firing strengths (N, R) at inputs (N, n); the last input's sets vary fastest."""
        strength = np.ones((len(np.atleast_2d(np.asarray(x))), 1))
        for degrees in self.memberships(x):
            strength = (strength[:, :, None] * degrees[:, None, :]).reshape(len(strength), -1)
        return strength

    def corners(self) -> Array:
        """Return the inputs (R, n) at which each rule fires alone."""
        lattice = np.meshgrid(*self.modal_values, indexing="ij")
        return np.stack([axis.ravel() for axis in lattice], axis=1)

    def differences(self) -> Array:
        """Return rows (K, R) of differences between conclusions that vanish where these vary smoothly.

        Second differences along each input over its modal values; first ones where it has two.
        """
        rows = [np.zeros((0, self.count))]
        for at, modal in enumerate(self.modal_values):
            along = _bends(modal)
            before, after = int(np.prod(self.sets[:at])), int(np.prod(self.sets[at + 1 :]))
            rows.append(np.kron(np.kron(np.eye(before), along), np.eye(after)))
        return np.concatenate(rows)


def _bends(modal: Array) -> Array:
    """Return rows that vanish on straight lines over modal values; of two values, a fainter difference."""
    size = modal.size
    if size < 3:
        return 0.1 * np.diff(np.eye(size), axis=0)
    slopes = np.diff(np.eye(size), axis=0) * ((modal[-1] - modal[0]) / np.diff(modal))[:, None]
    bends: Array = np.diff(slopes, axis=0) / (size - 1)
    return bends


@dataclass(frozen=True, eq=False)
class FuzzySystem:
    """Rules: premises and conclusions.

    >>> FuzzySystem(Partition(("q",), (np.array([0.0, 1.0]),)), np.array([2.0, 4.0]))([[0.25]])
    array([2.5])
    """

    premises: Partition  # R rules
    conclusions: Array  # (R, ...): numbers, vectors or matrices b
    # (R,): how strongly each rule fired, at most, in training; None where the rules were given
    support: Array | None = None

    def __post_init__(self) -> None:
        """Check that every rule has a conclusion."""
        if len(self.conclusions) != self.premises.count:
            raise BeamstiffError(
                f"fuzzy system: found {len(self.conclusions)} conclusions, expected {self.premises.count}: "
                "one a rule"
            )

    def __call__(self, x: ArrayLike, extrapolate: bool = False) -> Array:
        """Return the outputs (N, ...) at inputs (N, n); outside the training only to `extrapolate`."""
        values = finite(x, "inputs of the fuzzy system", -1, len(self.premises.inputs))
        if not extrapolate:
            self.refuse_outside(values)
        return np.tensordot(self.premises.firing(values), self.conclusions, 1)

    def outside(self, x: ArrayLike) -> NDArray[np.bool_]:
        """Return whether inputs (N, n) are outside what was trained, (N,).

        Outside the range of an input, or where more than half of the answer comes from rules that hardly
        fired in training.
        """
        values = np.asarray(x, dtype=np.float64)
        away = out_of_range(self.premises, values)
        if self.support is not None:
            untrained = self.premises.firing(values) @ (self.support < LEAST_SUPPORT) > 0.5
            away = np.column_stack([away, untrained])
        return np.asarray(away.any(axis=1))

    def refuse_outside(self, x: Array) -> None:
        """Raise an error that names the first row outside what was trained."""
        ranges = out_of_range(self.premises, x)
        if ranges.any():
            row, at = (int(i) for i in np.argwhere(ranges)[0])
            low, high = self.premises.trained[at].tolist()
            raise BeamstiffError(
                f"row {row}: found {self.premises.inputs[at]} = {x[row, at]:.6g}, outside the trained range "
                f"{low:.6g} to {high:.6g} of the fuzzy model; ask within it, or allow extrapolation"
            )
        if (outside := self.outside(x)).any():
            row = int(np.argmax(outside))
            where = listed(
                f"{n} = {v:.6g}" for n, v in zip(self.premises.inputs, x[row].tolist(), strict=True)
            )
            raise BeamstiffError(
                f"row {row}: found {where}, where no rule of the fuzzy model was trained; ask closer to the "
                "readings, or allow extrapolation"
            )


LEAST_SUPPORT = 0.05  # firing strength below which readings hardly touch a rule


def out_of_range(premises: Partition, x: Array) -> NDArray[np.bool_]:
    """Return which inputs (N, n) leave their trained range, (N, n)."""
    low, high = premises.trained.T
    slack = SLACK * (np.abs(low) + np.abs(high) + (high - low))
    result: NDArray[np.bool_] = (x < low - slack) | (x > high + slack)
    return result


def equal_parts(inputs: Sequence[str], trained: Array, sets: Sequence[int]) -> Partition:
    """Return the partition of ranges (n, 2) into equal parts; one set where an input plays no part."""
    modal = [
        np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])
        for (low, high), count in zip(trained.tolist(), sets, strict=True)
    ]
    return Partition(tuple(inputs), tuple(modal), trained)
