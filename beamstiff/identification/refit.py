"""Fit again, close to where a fit is known: for resampled rows, other readings, rows left out.

Gauss-Newton steps in the compliances within their bounds, as in `methods/linear`; here each row may count
several times or not at all, and a robust loss weighs residuals and steps by its derivatives (Triggs et al.,
"Bundle adjustment: a modern synthesis", 2000, section 4.3). A few evaluations each, where a search from afar
takes dozens.
"""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.methods.linear import nonnegative_step
from beamstiff.identification.objective import Objective
from beamstiff.se3 import Array

STEPS = 200
CLOSE = 1e-12  # share of the cost that a step is expected to gain: below, it is done
SHORTEST = 1e-6  # share of a step
LEAST_CURVED = 0.1  # of its weight: beyond, a robust loss bends down, and a step would know no end


def refit(objective: Objective, begin: Array, counts: Array | None = None) -> Array:
    """Return the optimum theta (t,) of an objective, from a start that is close.

    `counts` (n,): how often each whitened residual counts; default once.
    """
    if begin.size == 0:
        return begin
    parameters, n = objective.parameters, objective.problem.count
    low, high = np.exp(-parameters.upper), np.exp(-parameters.lower)
    often = np.ones(n + len(parameters.names))
    if counts is not None:
        often[:n] = counts

    def evaluate(compliance: Array) -> tuple[float, Array, Array]:
        residuals, by_log = objective.jacobian(-np.log(compliance))
        z = (residuals / objective.scale) ** 2
        rho = objective.rho(z)
        cost = 0.5 * objective.scale**2 * float(often @ rho[0])
        weight = rho[1]
        root = np.sqrt(often * np.maximum(weight + 2 * z * rho[2], LEAST_CURVED * weight))
        scaled = np.divide(often * weight * residuals, root, out=np.zeros_like(root), where=root > 0)
        return cost, scaled, root[:, None] * (-by_log / compliance)

    compliance = np.clip(np.exp(-begin), low, high)
    cost, residuals, slopes = evaluate(compliance)
    for _ in range(STEPS):
        target = _step(compliance, residuals, slopes, low, high)
        moved = slopes @ (target - compliance)
        gain = -float(moved @ (residuals + 0.5 * moved))
        if gain <= CLOSE * cost:
            break
        share = 1.0
        while True:
            there = compliance + share * (target - compliance)
            new, *rest = evaluate(there)
            if new < cost:
                break
            share /= 2
            if share < SHORTEST:
                break
        if new >= cost:  # as far as rounding lets it
            break
        compliance, cost, (residuals, slopes) = there, new, rest
    else:
        raise BeamstiffError(f"{objective.problem.source}: a fit did not converge in {STEPS} steps")
    result: Array = -np.log(compliance)
    return result


def _step(compliance: Array, residuals: Array, slopes: Array, low: Array, high: Array) -> Array:
    """Return the compliances within bounds that minimise ``|r + A (x - c)|``."""
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    change, _, rank, _ = np.linalg.lstsq(slopes / size, -residuals)
    target: Array = compliance + change / size
    if rank == len(compliance) and ((target >= low) & (target <= high)).all():
        return target
    return nonnegative_step(compliance, residuals, slopes, low, high)
