"""NLopt's methods: local with derivatives, local without, and global ones.

Johnson, "The NLopt nonlinear-optimization package"; SLSQP: Kraft (1994); MMA: Svanberg (2002); L-BFGS:
Nocedal (1980), Luksan's code; BOBYQA: Powell (2009); ISRES: Runarsson & Yao (2005); CRS2: Kaelo & Ali (2006);
ESCH: Santos, Goncalves & Hernandez-Figueroa (2010); MLSL: Kucherenko & Sytsko (2005), here with SLSQP.
"""

from __future__ import annotations

from typing import Any

import nlopt
import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identify.minimise import GLOBAL, Effort, Search, searched
from beamstiff.se3 import Array

ALGORITHMS = {
    "slsqp": nlopt.LD_SLSQP,
    "mma": nlopt.LD_MMA,
    "lbfgs": nlopt.LD_LBFGS,
    "bobyqa": nlopt.LN_BOBYQA,
    "isres": nlopt.GN_ISRES,
    "crs2": nlopt.GN_CRS2_LM,
    "esch": nlopt.GN_ESCH,
    "mlsl": nlopt.GD_MLSL_LDS,
}
REASONS = {
    nlopt.SUCCESS: "converged",
    nlopt.FTOL_REACHED: "converged: the cost no longer changes",
    nlopt.XTOL_REACHED: "converged: the values no longer change",
    nlopt.STOPVAL_REACHED: "converged: nothing is left to explain",
    nlopt.MAXEVAL_REACHED: "stopped: the evaluations allowed are used up",
}
TOLERANCE = 1e-12  # of log k
FIRST_STEP = 0.3  # BOBYQA's, in log k


class _UsedUpError(Exception):
    """The evaluations allowed are used up: NLopt does not count those of local searches alike."""


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise from `begin` within the bounds; global methods within `minimise.searched`."""
    parameters = search.objective.parameters
    raised: list[BaseException] = []

    def evaluate(theta: Array, slopes: Array) -> float:
        # NLopt does not pass on what is raised in every algorithm and language: kept, and raised below
        if raised:
            raise nlopt.ForcedStop
        try:
            if search.evaluations >= last:
                raise _UsedUpError
            if not slopes.size:
                return search.cost(theta)
            cost, slopes[:] = search.gradient(theta)
            return cost
        except BaseException as error:
            raised.append(error)
            raise nlopt.ForcedStop from None

    last = search.evaluations + effort.evaluations
    optimiser = _optimiser(method, begin.size, effort)
    low, high = searched(parameters, begin) if method in GLOBAL else (parameters.lower, parameters.upper)
    optimiser.set_lower_bounds(low)
    optimiser.set_upper_bounds(high)
    optimiser.set_min_objective(evaluate)
    if method == "bobyqa":
        optimiser.set_initial_step(np.minimum(FIRST_STEP, 0.4 * (high - low)))
    nlopt.srand(effort.seed)
    try:
        optimiser.optimize(np.clip(begin, low, high))
        message = REASONS.get(optimiser.last_optimize_result(), "stopped")
    except nlopt.RoundoffLimited:
        message = "converged as far as rounding lets it"
    except nlopt.ForcedStop:
        message = REASONS[nlopt.MAXEVAL_REACHED]
    except (RuntimeError, ValueError, MemoryError) as error:
        # the line searches of L-BFGS and SLSQP fail so where no step goes down any more: the best is kept
        message = f"stopped by NLopt ({error}): the best so far"
        if not np.isfinite(search.best_cost) and not raised:
            raise BeamstiffError(f"{method}: NLopt refused the problem ({error})") from error
    for cause in raised:
        if not isinstance(cause, _UsedUpError):
            raise cause
        message = REASONS[nlopt.MAXEVAL_REACHED]
    return message


def _optimiser(method: str, count: int, effort: Effort) -> Any:
    optimiser = nlopt.opt(ALGORITHMS[method], count)
    optimiser.set_maxeval(effort.evaluations)
    if method == "mlsl":
        local = nlopt.opt(nlopt.LD_MMA, count)
        local.set_xtol_abs(1e-10)
        optimiser.set_local_optimizer(local)
    else:
        optimiser.set_xtol_abs(TOLERANCE)
    if effort.population is not None and method in GLOBAL:
        optimiser.set_population(effort.population)
    return optimiser
