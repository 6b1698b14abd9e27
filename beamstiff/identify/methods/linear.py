"""Linear least squares in the compliances with positivity (seed 000, eqs 18 to 26).

With rigid links a displacement is linear in the compliances c = 1/k, and one step is exact. Where beams or
closed loops carry load past the springs it is nearly so: the steps are repeated, each from the last.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from beamstiff.errors import BeamstiffError
from beamstiff.identify.minimise import Effort, Search
from beamstiff.se3 import Array

STEPS = 60
CLOSE = 1e-11  # relative change of the cost at which it is done


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:  # noqa: ARG001
    """Minimise in the compliances ``exp(-theta)``, by damped Gauss-Newton steps within the bounds."""
    objective = search.objective
    if objective.loss != "linear":
        raise BeamstiffError("linear: knows no robust loss; use trust-region")
    low, high = np.exp(-objective.parameters.upper), np.exp(-objective.parameters.lower)
    compliance = before = np.exp(-begin)
    cost = np.inf
    for step in range(min(STEPS, effort.evaluations)):
        theta = np.clip(-np.log(compliance), objective.parameters.lower, objective.parameters.upper)
        residuals, by_log = objective.jacobian(theta)
        new = objective.cost_of(residuals)
        search.note(theta, new)
        if step and new > cost * (1 - CLOSE):
            if new <= cost:
                return f"converged in {step} steps"
            # too far: half the way back
            compliance = 0.5 * (compliance + before)
            if np.abs(compliance / before - 1).max() < 1e-14:
                return f"converged in {step} steps"
            continue
        cost, before = new, compliance
        by_compliance = -by_log / compliance  # d/dc = -(1/c) d/dlog k
        size = np.linalg.norm(by_compliance, axis=0)
        size = np.where(size > 0, size, 1.0)
        target = by_compliance @ compliance - residuals
        solution = lsq_linear(by_compliance / size, target, bounds=(low * size, high * size), method="bvls")
        compliance = np.clip(solution.x / size, low, high)
    return f"stopped after {STEPS} steps"
