"""The random search of Solis and Wets ("Minimization by random search techniques", 1981, algorithm 1)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamstiff.se3 import Array

WIDER, NARROWER, AFTER = 2.0, 0.5, (5, 3)  # the step after so many successes, failures
SMALLEST = 1e-4


def solis_wets(
    cost: Callable[[Array], float],
    begin: Array,
    step: float,
    evaluations: int,
    random: np.random.Generator,
) -> tuple[Array, float]:
    """Return the best point found, and its cost.

    Steps are normal about a bias that follows what went well; where one fails its opposite is tried.

    `cost`: of a point (n,); infinite where it is not allowed. `step`: standard deviation of the
    first steps. `evaluations`: at most.
    """
    at, best, bias = np.array(begin, dtype=np.float64), cost(begin), np.zeros(len(begin))
    good = bad = 0
    spent = 1
    while spent < evaluations and step > SMALLEST and len(begin):
        move = bias + step * random.standard_normal(at.size)
        for sign in (1.0, -1.0):
            value = cost(at + sign * move)
            spent += 1
            if value < best:
                at, best = at + sign * move, value
                bias = 0.2 * bias + 0.4 * move if sign > 0 else bias - 0.4 * move
                good, bad = good + 1, 0
                break
        else:
            bias *= 0.5
            good, bad = 0, bad + 1
        if good >= AFTER[0]:
            step, good = WIDER * step, 0
        elif bad >= AFTER[1]:
            step, bad = NARROWER * step, 0
    return at, best
