"""Every method behind one call: the best values found, how many evaluations they took, and why it stopped."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import SPAN, Parameters
from beamstiff.identification.problem import balanced_stiffness
from beamstiff.parallel import parallel_map
from beamstiff.se3 import Array

Progress = Callable[[int, float], None]

LEAST = 5  # candidates in a population: fewer do not mix

# where each method lives: imported when it is used
METHODS = {
    "trust-region": "trust_region",
    "levenberg-marquardt": "trust_region",
    "linear": "linear",
    "slsqp": "nlopt_methods",
    "mma": "nlopt_methods",
    "lbfgs": "nlopt_methods",
    "bobyqa": "nlopt_methods",
    "isres": "nlopt_methods",
    "crs2": "nlopt_methods",
    "esch": "nlopt_methods",
    "mlsl": "nlopt_methods",
    "genetic": "genetic",
}
GLOBAL = ("isres", "crs2", "esch", "mlsl", "genetic")
POLISHED = (*GLOBAL, "mma", "bobyqa")  # by the trust region: without curvature they do not get to the bottom
AT_END = 0.05  # share of the span between the bounds, in logarithms, within which a value is at its end
SAME = 1e-9  # share of the cost that makes no difference
ALIKE = 1e-6  # share of the cost within which two searches have ended at the same values
FACTOR = 1e3  # the global methods search this far from the start, either way, where no bound is given


@dataclass(frozen=True)
class Minimum:
    """Where a search ended."""

    theta: Array  # (t,)
    cost: float
    evaluations: int  # of all residuals; one with derivatives counts as one
    message: str  # why it stopped
    interrupted: bool = False  # stopped by Ctrl-C: the best values so far


@dataclass
class Search:
    """Counts the evaluations of an objective and keeps the best, so that a search may stop at any time."""

    objective: Objective
    progress: Progress | None = None
    evaluations: int = 0
    best: Array = field(default_factory=lambda: np.zeros(0))
    best_cost: float = np.inf

    def note(self, theta: Array, cost: float) -> None:
        """Take note of an evaluation."""
        self.evaluations += 1
        if cost < self.best_cost:
            self.best, self.best_cost = np.array(theta, dtype=np.float64), cost
        if self.progress is not None:
            self.progress(self.evaluations, self.best_cost)

    def cost(self, theta: Array) -> float:
        """Return the cost."""
        cost = self.objective.cost(theta)
        self.note(theta, cost)
        return cost

    def costs(self, thetas: Array) -> Array:
        """Return the costs (K,) of several candidates (K, t)."""
        costs = self.objective.costs(thetas)
        at = int(np.argmin(costs))
        self.evaluations += len(thetas) - 1
        self.note(thetas[at], float(costs[at]))
        return costs

    def gradient(self, theta: Array) -> tuple[float, Array]:
        """Return the cost and its derivatives."""
        cost, gradient = self.objective.gradient(theta)
        self.note(theta, cost)
        return cost, gradient


@dataclass(frozen=True)
class Effort:
    """How hard a method may try, and where."""

    # at most; the trust region that polishes, or tries again, may take as many each time
    evaluations: int = 20_000
    seed: int = 0  # of the global methods
    population: int | None = None  # of the global methods; default theirs
    # of the global methods: so many, with `seed` and those that follow it; the best of them counts
    searches: int = 1
    processes: int = 1  # that do the searches
    # of dask, ``tcp://host:port``, whose workers do them; see `beamstiff.parallel`
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Refuse what is no effort."""
        for name, value, least in (
            ("evaluations", self.evaluations, 1),
            ("seed", self.seed, 0),
            ("population", LEAST if self.population is None else self.population, LEAST),
            ("searches", self.searches, 1),
            ("processes", self.processes, 1),
        ):
            if int(value) != value or value < least:
                raise BeamstiffError(
                    f"effort: found {name} = {value}, expected a whole number from {least} on"
                )


# works on the search's objective from a start, leaves the best values in the search, says why it stopped
Method = Callable[[str, Search, Array, Effort], str]


def minimise(
    objective: Objective,
    method: str = "trust-region",
    begin: Array | None = None,
    effort: Effort | None = None,
    progress: Progress | None = None,
    polish: bool = True,
) -> Minimum:
    """Minimise an objective by one of `METHODS`.

    `begin` (t,): where to start, logarithms; default the start values. `progress`: called with the number of
    evaluations and the least cost after each. `polish`: let the trust region finish what a method of
    `POLISHED` found, and, where no `begin` is given, try again from balanced values if some value ended as
    good as rigid or free: that may be another minimum.

    Ctrl-C ends the search with the best values so far; before the first evaluation it is passed on. Global
    methods search `searched`; what is polished is so within the bounds proper.
    """
    if method not in METHODS:
        raise BeamstiffError(
            f"there is no method {method!r}{suggest(method, METHODS)}; known: {listed(METHODS)}"
        )
    search = Search(objective, progress)
    start = objective.parameters.begin if begin is None else np.asarray(begin, dtype=np.float64)
    if start.shape != objective.parameters.first.shape or not np.isfinite(start).all():
        raise BeamstiffError(
            f"begin: found {start.tolist()!s:.60}, expected {objective.parameters.first.size} finite "
            "logarithms of stiffness values"
        )
    effort = Effort() if effort is None else effort
    message, interrupted = "", False
    try:
        if method in GLOBAL and effort.searches > 1:
            message = _searches(method, search, start, effort, polish)
        else:
            message = _polished(method, search, start, effort, polish)
    except KeyboardInterrupt:
        if not np.isfinite(search.best_cost):
            raise
        message, interrupted = "stopped by hand: the best so far", True
    low, high = objective.parameters.lower, objective.parameters.upper
    at_end = np.minimum(search.best - low, high - search.best) < AT_END * (high - low)
    if begin is None and polish and not interrupted and at_end.any():
        message, interrupted = _again(search, effort, message)
    if not np.isfinite(search.best_cost):
        raise BeamstiffError(f"the identification did not converge: {message}")
    return Minimum(search.best, search.best_cost, search.evaluations, message, interrupted)


def _polished(method: str, search: Search, start: Array, effort: Effort, polish: bool) -> str:
    message = _run(method, search, start, effort)
    if method in POLISHED and np.isfinite(search.best_cost) and start.size:
        if method in GLOBAL:
            message += _at_edge(search.objective.parameters, start, search.best)
        if polish:
            message += "; polished: " + _run("trust-region", search, search.best, effort)
    return message


def _searches(method: str, search: Search, start: Array, effort: Effort, polish: bool) -> str:
    """Search with one seed after the other; what is best does not depend on which search ends first."""
    efforts = [replace(effort, seed=effort.seed + number) for number in range(effort.searches)]
    one = partial(_one_search, search.objective, method, start, polish)
    found: dict[int, Minimum] = {}
    for number, minimum in parallel_map(one, efforts, processes=effort.processes, scheduler=effort.scheduler):
        found[number] = minimum
        best = min(found.items(), key=lambda item: (item[1].cost, item[0]))[1]
        search.best, search.best_cost = best.theta, best.cost
        search.evaluations += minimum.evaluations
        if search.progress is not None:
            search.progress(search.evaluations, search.best_cost)
    count = sum(minimum.cost <= best.cost * (1 + ALIKE) for minimum in found.values())
    return f"{best.message}; {count} of {len(found)} searches ended there"


def _one_search(objective: Objective, method: str, start: Array, polish: bool, effort: Effort) -> Minimum:
    search = Search(objective)
    message = _polished(method, search, start, effort, polish)
    return Minimum(search.best, search.best_cost, search.evaluations, message)


def searched(parameters: Parameters, begin: Array) -> tuple[Array, Array]:
    """Return the span of theta, two (t,) arrays, that global methods search.

    The user's bounds where there are any, else a factor of 1e3 from `begin` either way: within the factor of
    1e8 that bounds a descent most candidates are as good as rigid, or fall apart.
    """
    log_start, reach = np.log(parameters.start)[parameters.first], np.log(SPAN) * (1 - 1e-9)
    lower, upper = parameters.lower, parameters.upper
    low = np.where(lower < log_start - reach, np.maximum(lower, begin - np.log(FACTOR)), lower)
    high = np.where(upper > log_start + reach, np.minimum(upper, begin + np.log(FACTOR)), upper)
    return low, high


def _at_edge(parameters: Parameters, begin: Array, theta: Array) -> str:
    """Return a remark where the best found lies at the edge of what was searched."""
    low, high = searched(parameters, begin)
    edge = np.minimum(theta - low, high - theta) < 1e-3 * (high - low)
    names = [parameters.names[at] for at in parameters.first[edge]]
    return f"; at the edge of the values searched: {listed(names)}" if names else ""


def _again(search: Search, effort: Effort, message: str) -> tuple[str, bool]:
    """Try again from balanced values; the search keeps what is better by more than rounding."""
    parameters = search.objective.parameters
    share = parameters.sums / parameters.sums.sum(axis=0)
    ratio = np.log(balanced_stiffness(search.objective.problem.model) / parameters.start)
    begin = np.log(parameters.start)[parameters.first] + ratio @ share  # tied values: in the mean
    second, interrupted = replace(search, best=np.zeros(0), best_cost=np.inf), False
    try:
        _run("trust-region", second, np.clip(begin, parameters.lower, parameters.upper), effort)
    except KeyboardInterrupt:
        interrupted = True
    except BeamstiffError:
        pass  # a mechanism, say: what was found first holds
    search.evaluations = second.evaluations
    if second.best_cost < search.best_cost - SAME * abs(search.best_cost):
        search.best, search.best_cost = second.best, second.best_cost
        message += "; better from balanced values"
    return ("stopped by hand: the best so far" if interrupted else message), interrupted


def _run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    if begin.size == 0:
        search.cost(begin)
        return "nothing to seek"
    run: Method = import_module(f"beamstiff.identification.methods.{METHODS[method]}").run
    return run(method, search, begin, effort)
