"""What changed between two campaigns of one machine, beyond the uncertainty of both.

Both campaigns are linearised about one robot, fitted to both. Each then has estimates x_A, x_B of the same
parameters with covariances V_A, V_B, and Wald's statistic tests that none of them changed (Wald, "Tests of
statistical hypotheses concerning several parameters", Trans. Amer. Math. Soc. 54, 1943)::

    d = x_B - x_A,    d^T (V_A + V_B)^-1 d  ~  chi^2 with as many degrees of freedom as parameters

In a linear model that is the likelihood ratio of one set of parameters against two. Where the stated noise is
not believed, or none is stated, the scatter of the fit stands for it, and the statistic over its degrees of
freedom follows F. Which of the parameters changed is told by Holm's step-down procedure (Holm, "A simple
sequentially rejective multiple test procedure", Scand. J. Statistics 6, 1979), and only where the test of all
says that something did: so the chance of naming anything in a machine without change is the level at most.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from beamstiff.diagnosis.apply import bare_baseline, effects_displacement
from beamstiff.errors import BeamstiffError
from beamstiff.identification.information import CHANCE, invert
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.shown import Shown

DEPENDENT = 1e-10  # eigenvalue of a correlation of estimates, below which only rounding is left
SAYS_NOTHING = 100.0  # realistic deviations: a parameter known no better is not compared


@dataclass(frozen=True)
class CampaignFit:
    """Parameters of one campaign, t of them."""

    values: Array  # (t,)
    covariance: Array  # (t, t): infinite variance where the rows say nothing
    noise: float  # residual over the noise as stated; over a usual one where none is
    freedom: int | None  # degrees of freedom of the scatter where it stands for the noise


@dataclass(frozen=True)
class Change:
    """A parameter in both campaigns, SI.

    `p` is the p-value of its change by itself, `p_holm` the one adjusted to all parameters.
    """

    name: str
    unit: str
    a: float
    b: float
    change: float
    std: float
    p: float
    p_holm: float
    changed: bool


@dataclass(frozen=True, repr=False)
class RunComparison(Shown):
    """What changed between two campaigns A and B.

    Attributes
    ----------
    changes : tuple of Change
        One for each parameter that both campaigns determine.
    statistic : float
        Wald's, of the hypothesis that none of them changed.
    freedom : tuple of int
        Its degrees of freedom: of chi-square, or the two of F (the statistic then is divided by the first).
    p : float
        Chance of so large a statistic without any change.
    level : float
    changed : bool
        Whether `p` is below the level.
    noise : tuple of float
        Residual of A and of B over the noise as stated; over a usual one where none is.
    not_compared : tuple of str
        Parameters that one of the campaigns does not determine.
    notes : tuple of str
        What limits the comparison.
    """

    changes: tuple[Change, ...]
    statistic: float
    freedom: tuple[int, ...]
    p: float
    level: float
    changed: bool
    noise: tuple[float, float]
    not_compared: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, SI (``beamstiff compare-runs --json``)."""
        numbers = ("unit", "a", "b", "change", "std", "p", "p_holm", "changed")
        return {
            "changed": self.changed,
            "p": self.p,
            "level": self.level,
            "test": "wald-chi-square" if len(self.freedom) == 1 else "wald-f",
            "statistic": self.statistic,
            "freedom": list(self.freedom),
            "parameters": {one.name: {key: getattr(one, key) for key in numbers} for one in self.changes},
            "not_compared": list(self.not_compared),
            "noise_factor": list(self.noise),
            "notes": list(self.notes),
        }


def campaign_fit(residual: Array, columns: Array, values: Array, count: int, stated: bool) -> CampaignFit:
    """Return the first `count` of t parameters, the others being nuisance, by linear least squares.

    `residual` (n,), `columns` (n, t): whitened, and its fall for a unit of each parameter. `values` (count,):
    about which these are. `stated`: whether the noise is. No parameter is bounded, so that the estimates are
    normal: a compliance may come out negative.
    """
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    step, _, rank, _ = np.linalg.lstsq(columns / size, residual, rcond=1e-7)
    left = residual - columns @ (step / size)
    freedom = len(residual) - int(rank)
    if freedom < 1:
        raise BeamstiffError("as many parameters as readings: nothing is left to judge the noise by")
    square = float(left @ left)
    believed = stated and stats.chi2.sf(square, freedom) > CHANCE
    covariance = invert(columns.T @ columns)[:count, :count] * (1.0 if believed else square / freedom)
    fitted = values + (step / size)[:count]
    return CampaignFit(fitted, covariance, float(np.sqrt(square / freedom)), None if believed else freedom)


def compare_fits(
    names: Sequence[str], units: Sequence[str], sizes: Array, a: CampaignFit, b: CampaignFit, level: float
) -> RunComparison:
    """Return what changed; `sizes` (t,): realistic deviations, infinite where none is known."""
    covariance = a.covariance + b.covariance
    std = np.sqrt(np.diagonal(covariance))
    known = np.isfinite(std) & (std > 0) & (std <= SAYS_NOTHING * sizes)
    if not known.any():
        raise BeamstiffError("no parameter is determined by both campaigns: nothing can be compared")
    at = np.flatnonzero(known).tolist()
    change, std = (b.values - a.values)[at], std[at]
    axes, vectors = np.linalg.eigh(covariance[np.ix_(at, at)] / np.outer(std, std))
    sound = axes > DEPENDENT * axes.max()
    statistic = float((((change / std) @ vectors[:, sound]) ** 2 / axes[sound]).sum())
    rank = int(sound.sum())
    scatter = [one.freedom for one in (a, b) if one.freedom is not None]
    if scatter:  # the smaller one: rather too few degrees of freedom than too many
        statistic /= rank
        freedom: tuple[int, ...] = (rank, min(scatter))
        chance = float(stats.f.sf(statistic, *freedom))
        each = 2.0 * stats.t.sf(np.abs(change) / std, min(scatter))
    else:
        freedom = (rank,)
        chance = float(stats.chi2.sf(statistic, rank))
        each = 2.0 * stats.norm.sf(np.abs(change) / std)
    adjusted = holm(each)
    return RunComparison(
        changes=tuple(
            Change(
                names[number],
                units[number],
                float(a.values[number]),
                float(b.values[number]),
                float(change[k]),
                float(std[k]),
                float(each[k]),
                float(adjusted[k]),
                bool(chance < level and adjusted[k] < level),
            )
            for k, number in enumerate(at)
        ),
        statistic=statistic,
        freedom=freedom,
        p=chance,
        level=level,
        changed=chance < level,
        noise=(a.noise, b.noise),
        not_compared=tuple(name for name, one in zip(names, known, strict=True) if not one),
    )


def holm(p: Array) -> Array:
    """Return p-values adjusted to their number, (t,), after Holm (1979).

    >>> holm(np.array([0.01, 0.04, 0.03])).round(3).tolist()
    [0.03, 0.06, 0.06]
    """
    order = np.argsort(p)
    result = np.empty(len(p))
    result[order] = np.minimum(np.maximum.accumulate(np.sort(p) * np.arange(len(p), 0, -1)), 1.0)
    return result


def causes_displacement(robot: Robot, rows: Measurements) -> dict[str, Array]:
    """Return what each cause among a robot's effects adds to the rows, (N, 6), base frame, by its key."""
    keys = [f"{one.effect}:{one.component or 'null'}" for one in robot.effects]
    found, bare = {}, bare_baseline(robot, rows) if keys else None
    for key in dict.fromkeys(keys):  # all shapes of a cause at once: only their sum is meant
        own = tuple(one for one, of in zip(robot.effects, keys, strict=True) if of == key)
        found[key] = effects_displacement(robot.model_copy(update={"effects": own}), rows, bare)
    return found
