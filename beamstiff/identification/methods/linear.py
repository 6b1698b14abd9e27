"""Linear least squares in the compliances with positivity (seed 000, eqs 18 to 26).

With rigid links a displacement is linear in the compliances c = 1/k, and one step is exact. Where beams or
closed loops carry load past the springs it is nearly so: the steps are repeated, each from the last, shorter
where a whole one goes too far.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import lsq_linear

from beamstiff.errors import BeamstiffError
from beamstiff.identification.minimise import Effort, Search
from beamstiff.se3 import Array

STEPS = 200
CLOSE = (
    1e-14  # share of the cost that a step is expected to gain, or change of a compliance: below, it is done
)
SHORTEST = 1e-4  # share of a step


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise in the compliances ``exp(-theta)``, by Gauss-Newton steps within the bounds."""
    objective = search.objective
    if objective.loss != "linear":
        raise BeamstiffError("linear: knows no robust loss; use trust-region")
    lower, upper = objective.parameters.lower, objective.parameters.upper

    def evaluate(compliance: Array) -> tuple[float, Array, Array]:
        theta = np.clip(-np.log(compliance), lower, upper)
        residuals, by_log = objective.jacobian(theta)
        cost = objective.cost_of(residuals)
        search.note(theta, cost)
        return cost, residuals, -by_log / compliance  # d/dc = -(1/c) d/dlog k

    compliance = np.exp(-np.clip(begin, lower, upper))
    bounds = np.exp(-upper), np.exp(-lower)
    return gauss_newton(evaluate, compliance, *bounds, CLOSE, SHORTEST, effort.evaluations)[2]


def gauss_newton(
    evaluate: Callable[[Array], tuple[float, Array, Array]],
    compliance: Array,
    low: Array,
    high: Array,
    close: float,
    shortest: float,
    evaluations: float = np.inf,
) -> tuple[Array, bool, str]:
    """Return the compliances (t,) that steps within bounds end at, whether they converged, and why.

    `evaluate` gives the cost, residuals (n,) and their slopes (n, t) by the compliances. A step that goes too
    far is halved, down to `shortest` of it; no more are made where one is expected to gain less than `close`
    of the cost.
    """
    cost, residuals, slopes = evaluate(compliance)
    spent = 1
    for step in range(STEPS):
        target = bounded_step(compliance, residuals, slopes, low, high)
        moved = slopes @ (target - compliance)
        gain = -float(moved @ (residuals + 0.5 * moved))
        if gain <= close * cost or np.abs(target / compliance - 1).max() <= close:
            return compliance, True, f"converged in {step} step{'s'[: step > 1]}"
        share = 1.0
        while True:
            if spent >= evaluations:
                return compliance, False, "stopped: the evaluations allowed are used up"
            there = np.clip(compliance + share * (target - compliance), low, high)
            new, *rest = evaluate(there)
            spent += 1
            if new < cost:
                break
            share /= 2
            if share < shortest:
                return compliance, True, f"converged in {step} steps as far as rounding lets it"
        compliance, cost, (residuals, slopes) = there, new, rest
    return compliance, False, f"stopped after {STEPS} steps"


def bounded_step(compliance: Array, residuals: Array, slopes: Array, low: Array, high: Array) -> Array:
    """Return the compliances (t,) within bounds that minimise ``|r + A (x - c)|``.

    `compliance` (t,): c, where r (n,) are the residuals and A (n, t) the slopes; `low`, `high` (t,).
    """
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    change, _, rank, _ = np.linalg.lstsq(slopes / size, -residuals)
    target: Array = compliance + change / size
    if rank == len(compliance) and ((target >= low) & (target <= high)).all():
        return target
    found = lsq_linear(
        slopes / size,
        slopes @ compliance - residuals,
        bounds=(low * size, high * size),
        method="bvls",
        tol=1e-15,
        max_iter=1000,
    )
    return np.clip(found.x / size, low, high)
