"""Trust region and Levenberg-Marquardt, by scipy, on the residuals with exact derivatives."""

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from beamstiff.errors import BeamstiffError
from beamstiff.identification.minimise import Effort, Search
from beamstiff.se3 import Array

TOLERANCE = 1e-12
PATIENCE = 50  # evaluations
LITTLE = 1e-4  # of half a chi square: what PATIENCE evaluations have to gain; 0.014 standard deviations
FLAT = 1e-8  # of the largest singular value, below which a direction is rounding
WALL = 1e3  # times the residuals at the start: what Levenberg-Marquardt finds outside the bounds


class _CrawlingError(Exception):
    """The search goes on and on without a gain that matters, as along a valley that the data leave flat."""


def _falls(residuals: Array, jacobian: Array) -> float:
    """Return by how much a full step would lower the cost, to first order; 0 at the bottom."""
    basis, sizes, _ = np.linalg.svd(jacobian, full_matrices=False)
    told = basis[:, sizes > FLAT * sizes.max(initial=0.0)]
    return 0.5 * float(((told.T @ residuals) ** 2).sum())


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise from `begin`; "levenberg-marquardt" knows neither bounds nor robust losses."""
    objective = search.objective
    parameters = objective.parameters
    known: dict[bytes, tuple[Array, Array]] = {}
    costs: list[float] = []

    def evaluate(theta: Array) -> tuple[Array, Array]:
        key = theta.tobytes()
        if key not in known:
            known.clear()
            residuals, jacobian = objective.jacobian(theta)
            search.note(theta, objective.cost_of(residuals))
            costs.append(search.best_cost)
            if len(costs) > 2 * PATIENCE and costs[-PATIENCE] - costs[-1] < LITTLE * noise(costs[-1]):
                raise _CrawlingError
            known[key] = residuals, jacobian
        return known[key]

    def noise(cost: float) -> float:
        """Return chi square over the rows, where it is more than the stated noise or none is stated."""
        found = 2 * cost / objective.problem.count
        return max(found, 1.0) if objective.problem.sigma_known else found

    def residuals(theta: Array) -> Array:
        return evaluate(theta)[0]

    def jacobian(theta: Array) -> Array:
        return evaluate(theta)[1]

    def walled(theta: Array) -> Array:
        """Return residuals that turn back a step beyond the bounds, as along a valley that is flat."""
        inside = (theta >= parameters.lower) & (theta <= parameters.upper)
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
    try:
        solution = least_squares(fun, begin, jac=jacobian, max_nfev=effort.evaluations, **options)
    except _CrawlingError:
        return f"the last {PATIENCE} steps gained nothing beside the noise: some values hardly matter"
    if fun is walled and _falls(*evaluate(solution.x)) > LITTLE * noise(search.best_cost):
        raise BeamstiffError("levenberg-marquardt: met bounds, which it does not know; use trust-region")
    return str(solution.message)
