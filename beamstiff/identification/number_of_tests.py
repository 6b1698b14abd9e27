"""Identified values against the number of tests they come from (seed 000, section 5.1, Figure 7).

Tests are taken one by one in a random order, none twice, and the model is fitted to the first n of them; many
orders show what is chance. Values that no longer move come from enough tests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.bootstrap import blocks_of, determines, sums_of, values_of
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import Statement
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

MOST = 30  # numbers of tests looked at, where the caller names none


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
    progress: Callable[[int], None] | None = None,
) -> NumberOfTests:
    """Fit a stated identification to growing numbers of its tests.

    `theta` (t,): its optimum. `counts`: numbers of tests, growing; default all, or thirty of them. `orders`:
    random orders of the tests. `by`: what a test is: a pose with all its loads, or a row. `progress`: called
    with the number of each order.
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
        if progress is not None:
            progress(order)
    return NumberOfTests(
        names=statement.parameters.names,
        relations=tuple(sum_.text() for sum_ in statement.plan.sums),
        counts=numbers,
        stiffness=stiffness,
        sums=sums,
        final=final,
    )
