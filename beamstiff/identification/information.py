"""Uncertainty from the Fisher information: covariance of log k, and intervals that hold in the compliances.

With rigid links a displacement is linear in the compliances, so a compliance has a symmetric interval
``c (1 +- t s)``, s its relative standard deviation; the interval of the stiffness is its image, open above
where it reaches zero. It is the same at first order for log k and stays right where s is large. Near the
bound that compliances have at zero it is shorter (see `profile`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from beamstiff.identification.objective import Objective
from beamstiff.identification.profile import Profile
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

LEVEL = 0.95
CHANCE = 0.05  # of so large a residual, below which the stated noise is not believed


@dataclass(frozen=True)
class Uncertainty:
    """Of the free values theta at an optimum."""

    covariance: Array  # (t, t): infinite variance where the data say nothing
    chi_square: float  # sum of squared whitened residuals over the degrees of freedom
    freedom: int
    quantile: float  # by how many standard deviations the 95 % interval reaches
    profile: Profile  # the likelihood around the optimum, from which intervals come

    def stiffness_interval(self, value: float, direction: Array, std: float) -> tuple[float, float]:
        """Return the 95 % interval of a stiffness.

        `value`: at the optimum. `direction` (t,): derivatives of its logarithm by theta. `std`: standard
        deviation of its logarithm.
        """
        down, up = self.profile.interval(direction, std)
        return value / (1 + up), value / (1 + down) if down > -1 else np.inf

    def compliance_interval(self, value: float, direction: Array, std: float) -> tuple[float, float]:
        """Return the 95 % interval of a sum of compliances: minus infinity where only a bound ends it.

        `value`: at the optimum. `direction` (t,): its derivatives by theta.
        """
        down, up = self.profile.interval(-direction, std)
        return value + down, value + up


def uncertainty(objective: Objective, theta: Array) -> Uncertainty:
    """Return the uncertainty of theta (t,) at the optimum of an objective.

    The noise is as stated; where the residual exceeds it, or none is stated, the residual tells it. Where it
    exceeds it by more than chance would, the stated noise is not believed and the quantile is Student's.
    Under a robust loss the spread is that of Huber's M-estimates (see `huber_factor`).
    """
    residuals, jacobian = objective.jacobian(theta)
    n = objective.problem.count
    own = residuals[:n]
    freedom = max(n - theta.size, 1)
    chi_square = float(objective.weights(residuals)[:n] @ own**2) / freedom
    factor = chi_square if objective.loss == "linear" else huber_factor(objective, residuals, theta.size)
    factor = max(factor, 1.0) if objective.problem.sigma_known else factor
    scale = np.ones(len(residuals))
    scale[:n] = 1.0 / max(factor, np.finfo(float).tiny)  # the priors' own spread is what it is
    information = jacobian.T @ (scale[:, None] * jacobian)
    score = objective.weights(residuals) * residuals
    if objective.loss != "linear":
        score[:n] /= max(float(_slopes(objective, residuals).mean()), np.finfo(float).tiny)
    parameters, compliance = objective.parameters, np.exp(-theta)
    by_chance = stats.chi2.sf(chi_square * freedom, freedom) > CHANCE
    known = objective.problem.sigma_known and by_chance
    tail = 0.5 * (1 + LEVEL)
    quantile = float(stats.norm.ppf(tail) if known else stats.t.ppf(tail, freedom))
    profile = Profile(
        information=information,
        gradient=-jacobian.T @ (scale * score),
        low=np.exp(-parameters.upper) / compliance,
        high=np.exp(-parameters.lower) / compliance,
        quantile=quantile,
    )
    return Uncertainty(invert(information), chi_square, freedom, quantile, profile)


def huber_factor(objective: Objective, residuals: Array, count: int) -> float:
    """Return by what the variance of an M-estimate exceeds that of least squares with unit noise.

    ``K^2 [sum psi^2 / (n - t)] / [mean psi']^2`` with ``K = 1 + t/n var psi' / [mean psi']^2`` (Huber,
    "Robust regression", Annals of Statistics 1, 1973; "Robust Statistics", 1981, section 7.6).

    `residuals` (n + m,); `count`: number t of free values.
    """
    n = objective.problem.count
    psi = (objective.weights(residuals) * residuals)[:n]
    slope = _slopes(objective, residuals)
    mean = float(slope.mean())
    if mean <= 0.0:
        return np.inf  # most residuals lie where the loss is flat: nothing holds the values
    correction = 1 + count / n * float(slope.var()) / mean**2
    return correction**2 * float(psi @ psi) / max(n - count, 1) / mean**2


def _slopes(objective: Objective, residuals: Array) -> Array:
    """Return psi', the derivative of what each measured residual weighs by the residual itself, (n,)."""
    z = (residuals / objective.scale) ** 2
    _, first, second = objective.rho(z)[:, : objective.problem.count]
    result: Array = first + 2 * z[: objective.problem.count] * second
    return result


def invert(information: Array) -> Array:
    """Return the inverse of an information matrix (t, t), with infinite variances where it is singular.

    >>> invert(np.diag([4.0, 0.0])).tolist()
    [[0.25, 0.0], [0.0, inf]]
    """
    size = np.sqrt(np.maximum(np.diagonal(information), 0.0))
    unit = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(unit, unit))
    sound = values > 1e-13 * max(float(values.max(initial=0.0)), 1.0)
    inverse: Array = (vectors[:, sound] / values[sound]) @ vectors[:, sound].T / np.outer(unit, unit)
    lost = (np.abs(vectors[:, ~sound]) > 1e-6).any(axis=1)
    inverse[lost, lost] = np.inf
    return inverse


def spread_over(covariance: Array, tied: Integers) -> Array:
    """Return the covariance (m, m) of values of which the free one `tied[j]` moves the j-th, -1 none.

    >>> spread_over(np.diag([4.0, np.inf]), np.array([0, 0, -1, 1])).tolist()[0]
    [4.0, 4.0, 0.0, 0.0]
    """
    free = len(covariance)
    padded = np.zeros((free + 1, free + 1))
    padded[:free, :free] = covariance
    return padded[np.ix_(tied, tied)]  # -1 is the last
