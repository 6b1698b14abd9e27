"""NLopt's methods: local with derivatives, local without, and global ones.

Johnson, "The NLopt nonlinear-optimization package"; SLSQP: Kraft (1994); MMA: Svanberg (2002); L-BFGS:
Nocedal (1980), Luksan's code; BOBYQA: Powell (2009); ISRES: Runarsson & Yao (2005); CRS2: Kaelo & Ali (2006);
ESCH: Santos, Goncalves & Hernandez-Figueroa (2010); MLSL: Kucherenko & Sytsko (2005), here with L-BFGS.

SLSQP, L-BFGS and BOBYQA search in compliances, in units of their standard deviations: the cost is close to a
parabola there, also where a spring is as good as rigid and its logarithm says nothing. MMA, whose own model
of the cost is convex in the values and in their inverses, and the global methods search in logarithms.
"""

from typing import Any

import nlopt
import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.minimise import GLOBAL, Effort, Search, searched
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
IN_COMPLIANCES = ("slsqp", "lbfgs", "bobyqa")
TOLERANCE = 1e-12  # of log k, or of compliances in standard deviations
# share of the cost at which to leave the rest to the trust region: MMA knows no curvature and would crawl on,
# and a descent within MLSL is one of many
COARSE = 1e-6
ROUGH = 1e-3  # standard deviations, BOBYQA's end: closer by, rounding of the cost hides which way is down
FIRST_STEP = 0.3  # BOBYQA's, share of a compliance; at least one standard deviation


class _UsedUpError(Exception):
    """The evaluations allowed are used up: NLopt does not count those of local searches alike."""


def run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    """Minimise from `begin` within the bounds; global methods within `minimise.searched`."""
    parameters = search.objective.parameters
    raised: list[BaseException] = []

    def evaluate(x: Array, slopes: Array) -> float:
        # not every algorithm passes on what is raised, and some call once more: kept, and raised below
        if raised:
            return np.inf
        try:
            if search.evaluations >= last:
                raise _UsedUpError
            theta = x if unit is None else np.clip(-np.log(x * unit), parameters.lower, parameters.upper)
            if not slopes.size:
                return search.cost(theta)
            cost, by_theta = search.gradient(theta)
            slopes[:] = by_theta if unit is None else -by_theta / x
            return cost
        except BaseException as error:
            raised.append(error)
            optimiser.force_stop()
            return np.inf

    last = search.evaluations + effort.evaluations
    optimiser = _optimiser(method, begin.size, effort)
    begin = np.clip(begin, parameters.lower, parameters.upper)
    unit = None
    if method in IN_COMPLIANCES:
        told = np.linalg.norm(search.objective.jacobian(begin)[1], axis=0)
        unit = np.exp(-begin) / np.where(told > 0, told, 1.0)
        low, high = np.exp(-parameters.upper) / unit, np.exp(-parameters.lower) / unit
        start = np.exp(-begin) / unit
    else:
        low, high = searched(parameters, begin) if method in GLOBAL else (parameters.lower, parameters.upper)
        start = begin
    optimiser.set_lower_bounds(low)
    optimiser.set_upper_bounds(high)
    optimiser.set_min_objective(evaluate)
    if method == "bobyqa":
        optimiser.set_initial_step(np.minimum(np.maximum(FIRST_STEP * start, 1.0), 0.4 * (high - low)))
    nlopt.srand(effort.seed)
    try:
        optimiser.optimize(np.clip(start, low, high))
        message = REASONS.get(optimiser.last_optimize_result(), "stopped")
    except nlopt.RoundoffLimited:
        message = "converged as far as rounding lets it"
    except nlopt.ForcedStop:
        message = REASONS[nlopt.MAXEVAL_REACHED]
    except (nlopt.nlopt.exception, RuntimeError, ValueError, MemoryError) as error:
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
        local = nlopt.opt(nlopt.LD_LBFGS, count)  # where SLSQP's line search fails it ends MLSL as a whole
        local.set_ftol_rel(COARSE)
        optimiser.set_local_optimizer(local)
    elif method == "mma":
        optimiser.set_ftol_rel(COARSE)
    elif method == "bobyqa":
        optimiser.set_xtol_abs(ROUGH)
    else:
        optimiser.set_xtol_abs(TOLERANCE)
    if effort.population is not None and method in GLOBAL:
        optimiser.set_population(effort.population)
    return optimiser
