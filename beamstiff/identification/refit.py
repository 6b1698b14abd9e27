"""Fit again, close to where a fit is known: for resampled rows, other readings, rows left out.

Gauss-Newton steps in the compliances within their bounds; here each row may count several times or not at
all, and a robust loss weighs residuals and steps by its derivatives (Triggs et al., "Bundle adjustment: a
modern synthesis", 2000, section 4.3). A few evaluations each, where a search from afar takes dozens.
"""

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.methods.linear import gauss_newton
from beamstiff.identification.objective import Objective
from beamstiff.se3 import Array

CLOSE = 1e-12  # share of the cost that a step is expected to gain: below, it is done
SHORTEST = 1e-6  # share of a step
LEAST_CURVED = 0.1  # of its weight: beyond, a robust loss bends down, and a step would know no end


def refit(objective: Objective, begin: Array, counts: Array | None = None) -> Array:
    """Return the optimum theta (t,), from one close by; `counts` (n,): how often each residual counts."""
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

    start = np.clip(np.exp(-begin), low, high)
    compliance, converged, message = gauss_newton(evaluate, start, low, high, CLOSE, SHORTEST)
    if not converged:
        raise BeamstiffError(f"{objective.problem.source}: a fit did not converge: {message}")
    return np.asarray(-np.log(compliance))
