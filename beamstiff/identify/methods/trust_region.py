"""Trust region and Levenberg-Marquardt, by scipy, on the residuals with exact derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from beamstiff.errors import BeamstiffError
from beamstiff.identify.minimise import Effort, Search
from beamstiff.se3 import Array

TOLERANCE = 1e-12
WALL = 1e3  # times the residuals at the start: what Levenberg-Marquardt finds far outside the bounds


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise from `begin`; "levenberg-marquardt" knows neither bounds nor robust losses."""
    objective = search.objective
    parameters = objective.parameters
    known: dict[bytes, tuple[Array, Array]] = {}

    def evaluate(theta: Array) -> tuple[Array, Array]:
        key = theta.tobytes()
        if key not in known:
            known.clear()
            residuals, jacobian = objective.jacobian(theta)
            search.note(theta, objective.cost_of(residuals))
            known[key] = residuals, jacobian
        return known[key]

    def residuals(theta: Array) -> Array:
        return evaluate(theta)[0]

    def jacobian(theta: Array) -> Array:
        return evaluate(theta)[1]

    def walled(theta: Array) -> Array:
        """Return residuals that turn back a step so long that its values are none any more."""
        span = parameters.upper - parameters.lower
        inside = (theta >= parameters.lower - span) & (theta <= parameters.upper + span)
        return residuals(theta) if inside.all() else np.full(size, wall)

    options: dict[str, Any] = {"x_scale": "jac", "xtol": TOLERANCE, "ftol": TOLERANCE, "gtol": TOLERANCE}
    if method == "levenberg-marquardt":
        if objective.loss != "linear":
            raise BeamstiffError("levenberg-marquardt: knows no robust loss; use trust-region")
        options["method"] = "lm"
        at_start = residuals(begin)
        size, wall = at_start.size, WALL * (1.0 + float(np.linalg.norm(at_start)))
    else:
        options["bounds"] = (parameters.lower, parameters.upper)
        options["loss"] = "linear" if objective.loss == "linear" else objective.rho
        options["f_scale"] = objective.scale
        begin = np.clip(begin, parameters.lower + 1e-9, parameters.upper - 1e-9)
    fun = walled if method == "levenberg-marquardt" else residuals
    solution = least_squares(fun, begin, jac=jacobian, max_nfev=effort.evaluations, **options)
    if ((solution.x < parameters.lower) | (solution.x > parameters.upper)).any():
        raise BeamstiffError("levenberg-marquardt: left the bounds, which it does not know; use trust-region")
    return str(solution.message)
