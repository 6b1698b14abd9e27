"""Every method behind one call: the best values found, how many evaluations they took, and why it stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Protocol

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.identify.objective import Objective
from beamstiff.se3 import Array

Progress = Callable[[int, float], None]

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


@dataclass(frozen=True)
class Minimum:
    """Where a search ended.

    Attributes
    ----------
    theta : (t,) array
    cost : float
    evaluations : int
        Of all residuals; one with derivatives counts as one.
    message : str
        Why it stopped.
    interrupted : bool
        Stopped by Ctrl-C: the best values so far.
    """

    theta: Array
    cost: float
    evaluations: int
    message: str
    interrupted: bool = False


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

    def gradient(self, theta: Array) -> tuple[float, Array]:
        """Return the cost and its derivatives."""
        cost, gradient = self.objective.gradient(theta)
        self.note(theta, cost)
        return cost, gradient


@dataclass(frozen=True)
class Effort:
    """How hard a method may try.

    Attributes
    ----------
    evaluations : int
        At most.
    seed : int
        Of the global methods.
    population : int or None
        Of the global methods; default theirs.
    """

    evaluations: int = 20_000
    seed: int = 0
    population: int | None = None


class Method(Protocol):
    """A way to minimise: works on the search's objective from `begin` and says why it stopped."""

    def __call__(self, method: str, search: Search, begin: Array, effort: Effort) -> str:
        """Minimise; the best values are in the search."""


def minimise(
    objective: Objective,
    method: str = "trust-region",
    begin: Array | None = None,
    effort: Effort | None = None,
    progress: Progress | None = None,
    polish: bool = True,
) -> Minimum:
    """Minimise an objective by one of `METHODS`.

    Parameters
    ----------
    objective : Objective
    method : str
    begin : (t,) array, optional
        Default the start values.
    effort : Effort, optional
    progress : callable, optional
        Called with the number of evaluations and the least cost after each.
    polish : bool
        Let the trust region finish what a global method found.

    Raises
    ------
    BeamstiffError
        When there is no such method, or nothing was found.
    """
    if method not in METHODS:
        raise BeamstiffError(
            f"there is no method {method!r}{suggest(method, METHODS)}; known: {listed(METHODS)}"
        )
    search = Search(objective, progress)
    start = objective.parameters.begin if begin is None else begin
    effort = Effort() if effort is None else effort
    message, interrupted = "", False
    try:
        message = _run(method, search, start, effort)
        if polish and method in GLOBAL:
            message += "; " + _run("trust-region", search, search.best, effort)
    except KeyboardInterrupt:
        if not np.isfinite(search.best_cost):
            raise
        message, interrupted = "stopped by hand: the best so far", True
    if not np.isfinite(search.best_cost):
        raise BeamstiffError(f"the identification did not converge: {message}")
    return Minimum(search.best, search.best_cost, search.evaluations, message, interrupted)


def _run(method: str, search: Search, begin: Array, effort: Effort) -> str:
    run: Method = import_module(f"beamstiff.identify.methods.{METHODS[method]}").run
    return run(method, search, begin, effort)
