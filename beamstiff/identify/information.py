"""Uncertainty from the Fisher information: covariance of log k, and intervals that hold in the compliances.

With rigid links a displacement is linear in the compliances, so a compliance has a symmetric interval
``c (1 +- t s)``, s its relative standard deviation; the interval of the stiffness is its image, open above
where it reaches zero. It is the same at first order for log k and stays right where s is large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from beamstiff.identify.objective import Objective
from beamstiff.se3 import Array

LEVEL = 0.95


@dataclass(frozen=True)
class Uncertainty:
    """Of the free values theta at an optimum.

    Attributes
    ----------
    covariance : (t, t) array
        Infinite variance where the data say nothing.
    chi_square : float
        Sum of squared whitened residuals over the degrees of freedom.
    freedom : int
    quantile : float
        By how many standard deviations the 95 % interval reaches.
    """

    covariance: Array
    chi_square: float
    freedom: int
    quantile: float


def uncertainty(objective: Objective, theta: Array) -> Uncertainty:
    """Return the uncertainty of theta (t,) at the optimum of an objective.

    The noise is as stated; where the residual exceeds it, or none is stated, the residual tells it. Under a
    robust loss each residual counts by its weight.
    """
    residuals, jacobian = objective.jacobian(theta)
    weights = objective.weights(residuals)
    n = objective.problem.count
    own = residuals[:n]
    freedom = max(n - theta.size, 1)
    chi_square = float(weights[:n] @ own**2) / freedom
    factor = max(chi_square, 1.0) if objective.problem.sigma_known else chi_square
    scale = np.ones(len(residuals))
    scale[:n] = 1.0 / max(factor, np.finfo(float).tiny)  # the priors' own spread is what it is
    information = jacobian.T @ ((weights * scale)[:, None] * jacobian)
    known = objective.problem.sigma_known and chi_square <= 1.0
    tail = 0.5 * (1 + LEVEL)
    quantile = float(stats.norm.ppf(tail) if known else stats.t.ppf(tail, freedom))
    return Uncertainty(invert(information), chi_square, freedom, quantile)


def invert(information: Array) -> Array:
    """Return the inverse of an information matrix (t, t), with infinite variances where it is singular.

    Examples
    --------
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


def stiffness_interval(value: float, relative_std: float, quantile: float) -> tuple[float, float]:
    """Return the 95 % interval of a stiffness from the relative standard deviation of its compliance.

    Examples
    --------
    >>> low, high = stiffness_interval(100.0, 0.25, 2.0)
    >>> round(low, 6), high
    (66.666667, 200.0)
    >>> stiffness_interval(100.0, 1.0, 2.0)[1]
    inf
    """
    reach = quantile * relative_std
    return value / (1 + reach), value / (1 - reach) if reach < 1 else np.inf
