"""Refits of resampled poses: bootstrap intervals, and values against the number of tests they come from.

Bootstrap intervals ask the scatter of the poses themselves, not the stated noise. Poses are drawn with
replacement and the model is fitted again, many times (Efron and Tibshirani, "An introduction to the
bootstrap", 1993, chapters 6 and 13). Whatever the rows of a pose have in common (a shared unloaded reading, a
joint reading, an error of the model there) stays together. A pose drawn twice counts twice: its whitened
residuals do, since poses are independent of one another. Before they are drawn, residuals are freed of the
leverage of their pose.

For the number of tests (seed 000, section 5.1, Figure 7) they are taken one by one in a random order, none
twice, and the model is fitted to the first n of them; many orders show what is chance. Values that no longer
move come from enough tests.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from scipy import stats

from beamstiff.errors import BeamstiffError
from beamstiff.identification.information import LEVEL
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import SPAN
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import Statement
from beamstiff.measure.arrays import Integers
from beamstiff.parallel import parallel_map
from beamstiff.se3 import Array

LEAST_FREE = 1e-2  # share of a pose's noise that its residual shows, at least: below, it is not scaled up
FEWEST = 4  # poses: of fewer there are next to no different draws
LOST = 1e-7  # information, of what all rows tell of each parameter, below which nothing is known
AT_BOUND = 1e-6  # of the logarithm
BLOCK = 25  # draws in a task: some ten milliseconds at least, beside one that it costs to give it away

MOST = 30  # numbers of tests looked at, where the caller names none


@dataclass(frozen=True)
class Bootstrap:
    """Values refitted to poses drawn with replacement."""

    names: tuple[str, ...]  # (m)
    # (R, m), N/m, N m/rad or Pa: of every draw; infinite where it ended at the upper bound, as good as rigid
    stiffness: Array
    relations: tuple[str, ...]  # (s): of the sums that are known though their members are not
    sums: Array  # (R, s): their values, of every draw
    # (low, high): 95 % percentile interval of every parameter that is identifiable by itself, and of every
    # relation. Next to a spring as good as rigid, whose compliance ends at zero, it holds the truth less
    # often than that (Andrews, "Inconsistency of the bootstrap when a parameter is on the boundary of the
    # parameter space", Econometrica 68, 2000); the intervals of `identify` do not
    intervals: Mapping[str, tuple[float, float]]
    poses: int  # how many there are
    undetermined: int  # draws that left a parameter open, and are not counted

    @property
    def spread(self) -> Array:
        """Standard deviation of the compliances over their mean, (m,)."""
        compliance = 1.0 / self.stiffness
        return np.asarray(compliance.std(axis=0, ddof=1) / compliance.mean(axis=0))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: how many draws, and the intervals, SI; None for an infinite end."""
        return {
            "repetitions": len(self.stiffness),
            "poses": self.poses,
            "undetermined": self.undetermined,
            "intervals": {
                name: [limit if np.isfinite(limit) else None for limit in ends]
                for name, ends in self.intervals.items()
            },
        }


def bootstrap(
    statement: Statement,
    theta: Array,
    repetitions: int = 1000,
    seed: int = 0,
    *,
    processes: int = 1,
    scheduler: str | None = None,
) -> Bootstrap:
    """Fit a stated identification again to poses drawn with replacement.

    `theta` (t,): its optimum. `scheduler`: of dask, ``tcp://host:port``; see `beamstiff.parallel`. The draws,
    and what is found, are the same.
    """
    objective = statement.objective
    group, poses = blocks_of(objective, statement.problem.pose)
    if poses < FEWEST:
        raise BeamstiffError(
            f"{statement.problem.source}: found {poses} poses, expected {FEWEST} or more to draw from"
        )
    if repetitions < 2:
        raise BeamstiffError(f"bootstrap: found {repetitions} repetitions, expected two or more")
    slopes = objective.jacobian(theta)[1]
    if objective.loss == "linear":
        objective = without_leverage(objective, theta, group)
    refits = partial(_refits, objective, slopes, theta, group)
    drawn = _draws(poses, repetitions, seed)
    blocks = dict(parallel_map(refits, drawn, processes=processes, scheduler=scheduler))
    found = [one for at in sorted(blocks) for one in blocks[at]]
    if 2 * len(found) < repetitions:
        raise BeamstiffError(
            f"{statement.problem.source}: {repetitions - len(found)} of {repetitions} draws of {poses} poses "
            "leave a parameter open; measure more poses"
        )
    names, relations = statement.parameters.names, statement.plan.sums
    stiffness = values_of(statement, np.array(found))
    sums = sums_of(statement, np.array(found))
    ends = percentiles(poses)
    intervals = {
        name: _interval(stiffness[:, at], ends) for at, name in enumerate(names) if alone(statement, name)
    }
    intervals |= {sum_.text(): _interval(sums[:, at], ends) for at, sum_ in enumerate(relations)}
    texts, undetermined = tuple(sum_.text() for sum_ in relations), repetitions - len(found)
    return Bootstrap(names, stiffness, texts, sums, intervals, poses, undetermined)


def _draws(poses: int, repetitions: int, seed: int) -> Iterator[Integers]:
    """Yield how often each pose is drawn, (B, g), some draws at a time."""
    random = np.random.default_rng(seed)
    for first in range(0, repetitions, BLOCK):
        count = min(BLOCK, repetitions - first)
        yield random.multinomial(poses, np.full(poses, 1.0 / poses), size=count)


def _refits(
    objective: Objective, slopes: Array, theta: Array, group: Integers, draws: Integers
) -> list[Array]:
    """Return the optima of those draws that leave no parameter open."""
    often = draws[:, group].astype(np.float64)
    return [refit(objective, theta, counts) for counts in often if determines(slopes, counts)]


def without_leverage(objective: Objective, theta: Array, group: Integers) -> Objective:
    """Return an objective whose residuals scatter as the noise does, not as residuals do.

    A pose pulls the fit towards itself, and its residual is the less for it: ``cov e_g = 1 - H_gg``, H the
    hat matrix. ``(1 - H_gg)^-1/2 e_g`` has the noise's covariance (Bell and McCaffrey, "Bias reduction in
    standard errors for linear regression with multi-stage samples", Survey Methodology 28, 2002). The optimum
    stays.

    `theta` (t,): its optimum. `group` (n,): pose of each whitened residual.
    """
    problem = objective.problem
    n = problem.count
    residuals, slopes = objective.jacobian(theta)
    size = np.linalg.norm(slopes, axis=0)
    basis, singular, _ = np.linalg.svd(slopes / np.where(size > 0, size, 1.0), full_matrices=False)
    basis = basis[:, singular > LOST * singular.max(initial=0.0)]
    freed = residuals[:n].copy()
    order = np.argsort(group, kind="stable")
    for at in np.split(order, np.cumsum(np.bincount(group))[:-1]):
        value, vectors = np.linalg.eigh(basis[at] @ basis[at].T)
        root = 1.0 / np.sqrt(np.maximum(1.0 - value, LEAST_FREE))
        freed[at] = vectors @ (root * (vectors.T @ freed[at]))
    step = freed - residuals[:n]
    step -= basis[:n] @ (basis[:n].T @ step)
    measured = problem.measured.copy()
    measured[problem.used] += problem.whitening.solve(step)
    return replace(objective, problem=replace(problem, measured=measured))


def blocks_of(objective: Objective, groups: Integers) -> tuple[Integers, int]:
    """Return the group, 0..g-1, of each whitened residual (n,), and their number g."""
    number = np.unique(groups, return_inverse=True)[1].reshape(-1)
    rows = np.nonzero(objective.problem.used)[0]
    kept, group = np.unique(number[rows], return_inverse=True)
    return group.reshape(-1).astype(np.int64), len(kept)


def determines(slopes: Array, counts: Array) -> bool:
    """Return whether rows that count so often (n,) tell all that the sensitivities (n + m, t) of all tell."""
    often = np.concatenate([counts, np.ones(len(slopes) - len(counts))])
    every = slopes.T @ slopes
    size = np.sqrt(np.diagonal(every))
    size = np.where(size > 0, size, 1.0)
    both = np.outer(size, size)
    whole = np.linalg.eigvalsh(every / both)
    some = np.linalg.eigvalsh((slopes.T * often) @ slopes / both)
    return int((some > LOST).sum()) >= int((whole > LOST).sum())


def values_of(statement: Statement, thetas: Array) -> Array:
    """Return the stiffness (R, m) at optima (R, t); infinite at the upper bound that nobody set."""
    parameters = statement.parameters
    stiffness = parameters.stiffness(thetas)
    farthest = np.log(parameters.start * SPAN)[parameters.first]
    top = thetas >= farthest - AT_BOUND
    rigid = np.concatenate([top, np.zeros((len(thetas), 1), dtype=np.bool_)], axis=1)[:, parameters.tied]
    return np.where(rigid, np.inf, stiffness)


def sums_of(statement: Statement, thetas: Array) -> Array:
    """Return the values (R, s) of the sums that are known, at optima (R, t)."""
    names, sums = statement.parameters.names, statement.plan.sums
    rows = [dict(zip(names, row, strict=True)) for row in statement.parameters.stiffness(thetas).tolist()]
    return np.array([[sum_.value(row) for sum_ in sums] for row in rows]).reshape(len(rows), len(sums))


def alone(statement: Statement, name: str) -> bool:
    """Return whether a parameter can be identified by itself."""
    return name not in statement.plan.grouped and name not in statement.plan.held


def percentiles(poses: int) -> tuple[float, float]:
    """Return the percentiles, 0 to 1, that bound a 95 % interval.

    Draws of n poses scatter less than campaigns of n poses do, by ``sqrt((n - 1) / n)``, and not as Student's
    t: the percentiles are moved out by both (Hesterberg, "What teachers should know about the bootstrap", The
    American Statistician 69, 2015).

    >>> [round(end, 3) for end in percentiles(10)], [round(end, 3) for end in percentiles(100_000)]
    ([0.009, 0.991], [0.025, 0.975])
    """
    reach = np.sqrt(poses / (poses - 1)) * stats.t.ppf(0.5 * (1 + LEVEL), poses - 1)
    tail = float(stats.norm.cdf(-reach))
    return tail, 1.0 - tail


def _interval(values: Array, ends: tuple[float, float]) -> tuple[float, float]:
    low, high = np.quantile(values, ends, method="inverted_cdf")
    return float(low), float(high)


@dataclass(frozen=True)
class NumberOfTests:
    """Values identified from the first n tests of random orders."""

    names: tuple[str, ...]  # (m)
    relations: tuple[str, ...]  # (s): sums that are known though their members are not
    counts: Integers  # (c,): numbers n
    stiffness: Array  # (O, c, m): by order, NaN where the tests leave a parameter open
    sums: Array  # (O, c, s)
    final: Array  # (m,): from all tests

    def band(self, level: float = 0.9) -> Array:
        """Return low, median and high of the stiffness over its final value, (c, 3, m).

        NaN where not all orders determine the parameters.
        """
        tail = 50 * (1 - level)
        ratio = self.stiffness / self.final
        return np.percentile(ratio, [tail, 50, 100 - tail], axis=0, method="nearest").swapaxes(0, 1)

    def enough(self, tolerance: float = 0.1, level: float = 0.9) -> dict[str, int | None]:
        """Return the least number of tests from which on each value stays near the final one.

        `tolerance`: relative distance within which it stays. `level`: share of the orders for which it does.
        None where all tests but one are not enough.
        """
        band = self.band(level)
        result: dict[str, int | None] = {}
        for at, name in enumerate(self.names):
            near = (band[:, 0, at] >= 1 / (1 + tolerance)) & (band[:, 2, at] <= 1 + tolerance)
            far = np.flatnonzero(np.logical_not(near))
            last = int(far[-1]) if far.size else -1
            known = np.isfinite(self.final[at]) and last + 1 < len(self.counts) - 1
            result[name] = int(self.counts[last + 1]) if known else None
        return result


def number_of_tests(
    statement: Statement,
    theta: Array,
    counts: Sequence[int] | None = None,
    orders: int = 30,
    seed: int = 0,
    by: Literal["pose", "row"] = "pose",
) -> NumberOfTests:
    """Fit a stated identification to growing numbers of its tests.

    `theta` (t,): its optimum. `counts`: numbers of tests, growing; default all, or thirty of them. `orders`:
    random orders of the tests. `by`: what a test is: a pose with all its loads, or a row.
    """
    problem, objective = statement.problem, statement.objective
    torn = (problem.sharing >= 0).any() or (
        problem.disturbance is not None and bool(problem.disturbance.common.any())
    )
    if by not in ("pose", "row") or (by == "row" and torn):
        why = 'the rows of a pose share a reading: by="pose"' if by == "row" else 'expected "pose" or "row"'
        raise BeamstiffError(f"number of tests: found by={by!r}; {why}")
    groups = problem.pose if by == "pose" else np.arange(len(problem.measured))
    group, tests = blocks_of(objective, groups)
    if counts is None:
        counts = np.unique(np.geomspace(1, tests, MOST).round()).astype(int).tolist()
        counts = list(range(1, tests + 1)) if tests <= MOST else counts
    numbers = np.asarray(counts, dtype=np.int64)
    if not numbers.size or (np.diff(numbers) <= 0).any() or numbers[0] < 1 or numbers[-1] > tests:
        raise BeamstiffError(
            f"number of tests: found {list(counts)!s:.60}, expected growing numbers from 1 to {tests}"
        )
    if orders < 1:
        raise BeamstiffError(f"number of tests: found {orders} orders, expected one or more")
    random = np.random.default_rng(seed)
    slopes = objective.jacobian(theta)[1]
    final = values_of(statement, theta[None])[0]
    stiffness = np.full((orders, len(numbers), final.size), np.nan)
    sums = np.full((orders, len(numbers), len(statement.plan.sums)), np.nan)
    for order in range(orders):
        rank = random.permutation(tests)
        for at in range(len(numbers) - 1, -1, -1):  # from many to few: each starts near
            often = (rank < numbers[at])[group].astype(np.float64)
            if not determines(slopes, often):
                break
            found = refit(objective, theta, often)
            stiffness[order, at] = values_of(statement, found[None])[0]
            sums[order, at] = sums_of(statement, found[None])[0]
    return NumberOfTests(
        names=statement.parameters.names,
        relations=tuple(sum_.text() for sum_ in statement.plan.sums),
        counts=numbers,
        stiffness=stiffness,
        sums=sums,
        final=final,
    )
