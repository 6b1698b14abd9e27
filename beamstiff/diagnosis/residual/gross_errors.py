"""Whether rows that nothing explains stand apart as mishaps do, or are what the shapes of an effect miss.

A mishap strikes whatever the posture and the load are: a mistyped row, or several one after another that
are off by the same, as after a reflector was bumped. What a shape misses is large at some postures or under
some loads, and next to large.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array

BY_CHANCE = 0.01  # probability that wrong rows come from as few postures, or from as large moves
SAME = 0.15  # of the squares of what two are off by, within which they are off by the same
VARIES = 0.25  # of the square of what the model predicts, from which a run's loads turn, or come to nothing


def by_chance(baseline: Baseline, outliers: Sequence[int]) -> bool:
    """Return whether rows come from as many postures and from as small moves as mishaps would."""
    each = mishaps(baseline, outliers)
    moved = np.linalg.norm(baseline.predicted[:, :3], axis=1)
    struck = [rows[0] for rows in each]
    few = _chance_of_few(np.unique(baseline.rows.pose).size, baseline.rows.pose[struck].tolist())
    return few > BY_CHANCE and _chance_of_large(moved, struck) > BY_CHANCE


def mishaps(baseline: Baseline, outliers: Sequence[int]) -> list[list[int]]:
    """Return rows by mishap: one by one, but together where one follows another and all are off by the same.

    Returns list of list of int; rows of one reflector, or of all of them, one after another, under loads that
    turn or come to nothing: what yields and stays so is off by the same under all loads to one side.
    """
    wrong = set(outliers)
    order, point = history_order(baseline.rows), baseline.rows.point
    of_one = [run for one in np.unique(point) for run in _runs(baseline, order[point[order] == one], wrong)]
    of_all = _runs(baseline, order, wrong)
    return of_all if len(of_all) < len(of_one) else of_one


def _runs(baseline: Baseline, order: NDArray[np.intp], wrong: set[int]) -> list[list[int]]:
    """Return the wrong rows of some that were read one after another, by mishap."""
    off = np.where(baseline.used, baseline.gap / baseline.sigma, 0.0)
    result: list[list[int]] = []
    run: list[int] = []
    for row in order.tolist():
        if row in wrong and run and _same(off[row], off[run].mean(axis=0)):
            run.append(row)
            continue
        result += _as_mishaps(baseline, run)
        run = [row] if row in wrong else []
    return result + _as_mishaps(baseline, run)


def _same(one: Array, other: Array) -> bool:
    """Return whether vectors (6,) are about the same."""
    return bool(((one - other) ** 2).sum() <= SAME * ((one**2).sum() + (other**2).sum()))


def _as_mishaps(baseline: Baseline, run: list[int]) -> list[list[int]]:
    """Return a run as one mishap where its loads differ enough, else row by row."""
    moved = baseline.predicted[run] / baseline.sigma[run]
    if len(run) > 1 and ((moved - moved.mean(axis=0)) ** 2).sum() >= VARIES * (moved**2).sum():
        return [run]
    return [[row] for row in run]


def _chance_of_few(postures: int, found: Sequence[int]) -> float:
    """Return the probability that as many mishaps, at random, strike as few postures as were found."""
    chance = np.zeros(postures + 1)  # of a number of postures, mishap by mishap
    chance[0] = 1.0
    new = 1.0 - np.arange(postures + 1) / postures
    for _ in found:
        chance = chance * (1.0 - new) + np.concatenate([[0.0], (chance * new)[:-1]])
    return float(chance[: np.unique(found).size + 1].sum())


def _chance_of_large(moved: Array, rows: Sequence[int]) -> float:
    """Return the probability that as many rows, taken at random, stand as high in the order of what moves."""
    rank = (rankdata(moved)[list(rows)] - 0.5) / moved.size
    return float(norm.sf((rank.mean() - 0.5) * np.sqrt(12.0 * rank.size)))
