"""The estimate: Levenberg-Marquardt with adaptive damping (seed 001, eqs 3 and 4), and Gauss-Newton.

Steps are taken in realistic deviations, so that one damping holds for lengths, angles and compliances::

    dx = (J^T J + lambda 1)^-1 J^T r

The damping falls tenfold with every step that lowers the cost, and rises tenfold with one that does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from beamstiff.calibration.elastic import LEAST
from beamstiff.calibration.problem import Problem
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.se3 import Array

METHODS = ("levenberg-marquardt", "gauss-newton")
ITERATIONS = 60
SMALL = 1e-10  # step, in realistic deviations, and relative gain, below which all is done
DAMPING = 1e-3  # to begin with, of the mean square of a column
LARGEST = 1e12


@dataclass(frozen=True, eq=False)
class Estimate:
    """Where a search ended."""

    theta: Array  # (t,)
    costs: Array  # (iterations + 1,): half the sum of squared weighed residuals, from the start on
    converged: bool


def estimate(
    problem: Problem, begin: Array, identified: Sequence[str], method: str = "levenberg-marquardt"
) -> Estimate:
    """Return the parameters that explain the readings best from `begin` (t,); those not `identified` stay."""
    if method not in METHODS:
        raise BeamstiffError(
            f"there is no method {method!r}{suggest(method, METHODS)}; known: {listed(METHODS)}"
        )
    size = problem.size
    free = np.array([item.name in set(identified) for item in problem.parameters])
    positive = np.array([item.group == "compliance" for item in problem.parameters])
    floor = np.where(positive, LEAST * size, -np.inf)
    theta = np.maximum(begin, floor)
    residual, jacobian = problem.linearised(theta)
    cost = 0.5 * float(residual @ residual)
    columns = jacobian[:, free] * size[free]
    undamped = method == "gauss-newton"
    damping = 0.0 if undamped else DAMPING * float((columns**2).sum(axis=0).mean())
    costs, converged = [cost], False
    for _ in range(ITERATIONS):
        step = np.zeros(len(theta))
        lowest = ((floor - theta) / size)[free]
        step[free] = size[free] * damped_step(jacobian[:, free] * size[free], residual, damping, lowest)
        trial = np.maximum(theta + step, floor)
        moved = float(np.abs((trial - theta) / size).max(initial=0.0))
        try:
            tried = problem.residuals(trial)
            new_cost = 0.5 * float(tried @ tried)
        except BeamstiffError:  # a loop does not close any more: the step was too long
            if undamped:
                raise
            new_cost = np.inf
        gain = (cost - new_cost) / cost if cost > 0 else 0.0
        if new_cost <= cost or undamped:
            theta, cost = trial, new_cost
            residual, jacobian = problem.linearised(theta)
            damping *= 0.1
            costs.append(cost)
            if moved < SMALL or 0.0 <= gain < SMALL:
                converged = True
                break
        elif moved < SMALL or gain > -SMALL:  # no way down but rounding
            converged = True
            break
        else:
            damping *= 10.0
            if damping > LARGEST * float((columns**2).sum(axis=0).max(initial=1.0)):
                break
    return Estimate(theta, np.array(costs), converged)


def damped_step(columns: Array, residual: Array, damping: float, lowest: Array) -> Array:
    """Return the step (f,) by least squares of ``[columns; sqrt(damping) 1]``, from `lowest` (f,) up."""
    count = columns.shape[1]
    matrix, right = columns, residual
    if damping > 0.0:
        matrix = np.concatenate([matrix, np.sqrt(damping) * np.eye(count)])
        right = np.concatenate([right, np.zeros(count)])
    step = np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)
    if (step >= lowest).all():
        return step
    # compliances that would turn negative: the same least squares within bounds, on the small triangle
    turned, triangle = np.linalg.qr(matrix)
    low = np.minimum(lowest, 0.0)
    bounded = lsq_linear(triangle, turned.T @ right, (low, np.full(count, np.inf)), method="bvls")
    return np.maximum(bounded.x, low)


def covariance_of(problem: Problem, theta: Array, identified: Sequence[str]) -> Array:
    """Return the covariance (t, t) of the identified parameters at the noise as stated, 0 for the others."""
    free = np.array([item.name in set(identified) for item in problem.parameters])
    _, jacobian = problem.linearised(theta)
    scaled = jacobian[:, free] * problem.size[free]
    _, values, axes = np.linalg.svd(scaled, full_matrices=False)
    root = (axes.T / values) * problem.size[free][:, None]
    result = np.zeros((len(theta), len(theta)))
    result[np.ix_(free, free)] = root @ root.T
    return result
