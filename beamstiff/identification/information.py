"""Uncertainty from the Fisher information: covariance of log k, and intervals that hold in the compliances.

With rigid links a displacement is linear in the compliances, so a compliance has a symmetric interval
``c (1 +- t s)``, s its relative standard deviation; the interval of the stiffness is its image, open above
where it reaches zero. It is the same at first order for log k and stays right where s is large.

Near the bound that compliances have at zero the interval is that of the profile likelihood. Around the
optimum the likelihood of the compliances x (over those found) is normal, cut off at the bounds. A value phi
belongs to its interval as long as the best fit with it is hardly worse than the best of all::

    min { Q(x) : x within bounds, a x = phi } - min { Q(x) : x within bounds } <= quantile^2

Away from the bounds this is ``phi +- quantile s``. Where a spring next to it is as good as rigid, whose
compliance the fit stops at zero, ``+- quantile s`` would hold the truth too often: in up to 97.5 % of the
cases instead of 95 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import brentq, lsq_linear

from beamstiff.identification.objective import Objective
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

LEVEL = 0.95
CHANCE = 0.05  # of so large a residual, below which the stated noise is not believed

RIDGE = 1e-12  # where the data say nothing, beside unit sensitivities
FIRM = 1e4  # how much more than a residual the distance from phi counts
STILL = 1e-3  # gradient, in standard deviations, that counts as none


@dataclass(frozen=True)
class Uncertainty:
    """Of the free values theta at an optimum."""

    covariance: Array  # (t, t): infinite variance where the data say nothing
    chi_square: float  # sum of squared whitened residuals over the degrees of freedom
    freedom: int
    quantile: float  # by how many standard deviations the 95 % interval reaches
    profile: Profile  # the likelihood around the optimum, from which intervals come

    def stiffness_interval(self, value: float, direction: Array, std: float) -> tuple[float, float]:
        """Return the 95 % interval of a stiffness; slopes by theta (t,) and std are of its logarithm."""
        down, up = self.profile.interval(direction, std)
        return value / (1 + up), value / (1 + down) if down > -1 else np.inf

    def compliance_interval(self, value: float, direction: Array, std: float) -> tuple[float, float]:
        """Return the 95 % interval of a sum of compliances: minus infinity where only a bound ends it.

        `value`: at the optimum. `direction` (t,): its derivatives by theta.
        """
        down, up = self.profile.interval(-direction, std)
        return value + down, value + up


def uncertainty(objective: Objective, theta: Array) -> Uncertainty:
    """Return the uncertainty of theta (t,) at the optimum of an objective: covariance ``(J^T W J)^-1``.

    J are the slopes of the residuals by theta, the logarithms of compliances, with a row a prior; W the
    weights of the readings, over what they scatter.

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
    return np.asarray(first + 2 * z[: objective.problem.count] * second)


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


@dataclass(frozen=True)
class Profile:
    """Twice the negative logarithm of the likelihood around an optimum, in compliances over those there."""

    information: Array  # (t, t): second derivatives of half of it
    # (t,): first derivatives of half of it, where x = 1: not zero for compliances that a bound holds
    gradient: Array
    # low, high, (t,): bounds of x
    low: Array
    high: Array
    quantile: float  # standard deviations that an interval reaches

    def interval(self, direction: Array, std: float) -> tuple[float, float]:
        """Return how far ``a x`` reaches below and above its value at the optimum.

        `direction` (t,): a. `std`: standard deviation of ``a x`` without bounds. Infinite where only a bound
        ends it.
        """
        reach = self.quantile * std
        if self._inside or not np.isfinite(std):
            return -reach, reach
        a = direction / self._size
        felt, at = a != 0, float(a @ self._size)
        ends = a[felt] * np.stack([self._low[felt], self._high[felt]])
        least, most = ends.min(axis=0).sum() - at, ends.max(axis=0).sum() - at
        return self._end(a, -reach, float(least), -np.inf), self._end(a, reach, float(most), np.inf)

    def _end(self, a: Array, reach: float, wall: float, beyond: float) -> float:
        """Return where the profile crosses the quantile, between 0 and `reach`, which it cannot pass."""
        far = reach if abs(reach) < abs(wall) else wall
        # data without noise: the optimum is off its place by more than the standard deviation, by rounding
        if far == 0.0 or self._excess(a, far) <= 0.0 or self._excess(a, 0.0) >= 0.0:
            return beyond if far == wall else far
        return float(brentq(lambda shift: self._excess(a, shift), 0.0, far, xtol=1e-6 * abs(reach)))

    def _excess(self, a: Array, shift: float) -> float:
        """Return by how much the best fit with a shift of ``a x`` exceeds what the interval allows."""
        firm = FIRM / float(np.linalg.norm(a))
        matrix = np.concatenate([self._root, firm * a[None]])
        target = np.append(self._root @ self._free, firm * (a @ self._size + shift))
        found = lsq_linear(matrix, target, bounds=(self._low, self._high), method="bvls", tol=1e-12)
        return self._distance(found.x) - self._least - self.quantile**2

    def _distance(self, y: Array) -> float:
        return float(((self._root @ (y - self._free)) ** 2).sum())

    @cached_property
    def _size(self) -> Array:
        """Sensitivity to each compliance; y = size x are the unknowns here."""
        size = np.sqrt(np.maximum(np.diagonal(self.information), 0.0))
        return np.where(size > 0, size, 1.0)

    @property
    def _low(self) -> Array:
        return self.low * self._size

    @property
    def _high(self) -> Array:
        return self.high * self._size

    @cached_property
    def _root(self) -> Array:
        unit = self.information / np.outer(self._size, self._size)
        return cholesky(unit + RIDGE * np.eye(len(unit)), lower=False)

    @cached_property
    def _free(self) -> Array:
        """The optimum if there were no bounds, y."""
        half = solve_triangular(self._root, self.gradient / self._size, trans="T")
        return self._size - solve_triangular(self._root, half)

    @cached_property
    def _least(self) -> float:
        found = lsq_linear(
            self._root, self._root @ self._free, bounds=(self._low, self._high), method="bvls", tol=1e-12
        )
        return min(self._distance(found.x), self._distance(self._size))

    @cached_property
    def _inside(self) -> bool:
        """Whether no bound is within reach of any compliance."""
        half = solve_triangular(self._root, np.eye(len(self._size)), trans="T")
        reach = self.quantile * np.linalg.norm(half, axis=0) / self._size
        still = np.abs(self.gradient / self._size) < STILL
        return bool((still & (reach < 1 - self.low) & (reach < self.high - 1)).all())
