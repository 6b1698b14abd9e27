"""What tells mishaps from what a shape misses: counts of boxes and balls, ranks, and runs."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.gross_errors import _chance_of_few, _chance_of_large, mishaps
from beamstiff.se3 import Array
from tests.diagnosis.machines import kr240, nominal
from tests.diagnosis.planted import campaign, plan

PLAN = plan(6)
RUN = [13, 14, 15]  # of the posture of rows 12 to 17
SHIFT = np.array([12.0, -9.0, 4.0, 0.0, 0.0, 0.0])  # sigma


def off_by(values: dict[int, Array]) -> Baseline:
    """Return a baseline of which rows are off by vectors (6,) of so many sigma."""
    there = nominal(kr240(), campaign(PLAN, seed=1))
    gap = np.zeros_like(there.gap)
    for row, value in values.items():
        gap[row] = value * there.sigma[row]
    return replace(there, measured=there.predicted + gap)


def under(there: Baseline, steps: list[float]) -> Baseline:
    """Return the same with the loads of the run in one direction, times the steps."""
    predicted = there.predicted.copy()
    predicted[RUN] = np.outer(steps, np.full(6, 1e-3))
    return replace(there, measured=there.gap + predicted, predicted=predicted)


def test_rows_one_after_another_that_are_off_by_the_same_are_one_mishap() -> None:
    rng = np.random.default_rng(2)
    there = off_by({row: SHIFT + rng.standard_normal(6) for row in RUN})
    for steps in ([0.5, 0.0, -0.5], [1.0, 0.5, 0.0]):
        assert mishaps(under(there, steps), RUN) == [RUN]
    assert mishaps(under(there, [0.5, 0.0, -0.5]), [RUN[0], RUN[2]]) == [[RUN[0]], [RUN[2]]]  # one is sound


def test_a_knock_of_the_tracker_strikes_whichever_reflector_is_read() -> None:
    there = under(off_by(dict.fromkeys(RUN, SHIFT)), [0.5, 0.0, -0.5])
    points = np.where(np.arange(len(there.rows)) % 2 == 0, "left", "right")
    of_two = replace(there, rows=replace(there.rows, point=points))
    assert mishaps(of_two, RUN) == [RUN]
    gap = there.gap.copy()
    gap[RUN[1]] *= -1  # the other reflector is off by something else
    apart = replace(of_two, measured=there.predicted + gap)
    assert sorted(mishaps(apart, RUN)) == [[RUN[0], RUN[2]], [RUN[1]]]


def test_what_gives_way_and_stays_so_is_no_mishap() -> None:
    there = off_by(dict.fromkeys(RUN, SHIFT))
    assert mishaps(under(there, [0.6, 1.0, 0.5]), RUN) == [[row] for row in RUN]
    turned = off_by({row: sign * SHIFT for row, sign in zip(RUN, (1, 1, -1), strict=True)})
    assert RUN not in mishaps(under(turned, [0.6, 1.0, -1.0]), RUN)


def test_rows_that_are_off_by_something_else_are_another_mishap() -> None:
    long = list(range(12, 30))
    there = off_by(dict.fromkeys(long, SHIFT) | {30: np.roll(SHIFT, 1)})
    predicted = there.predicted.copy()
    predicted[long] = np.outer(np.cos(np.arange(18.0)), np.full(6, 1e-3))
    there = replace(there, measured=there.gap + predicted, predicted=predicted)
    assert mishaps(there, [*long, 30]) == [long, [30]]


def test_the_chance_of_few_postures_is_that_of_boxes_and_balls() -> None:
    # three balls in three boxes: all in one, in at most two, in any
    assert _chance_of_few(3, [0, 0, 0]) == pytest.approx(1 / 9)
    assert _chance_of_few(3, [0, 0, 1]) == pytest.approx(7 / 9)
    assert _chance_of_few(3, [0, 1, 2]) == pytest.approx(1.0)


def test_the_chance_of_large_moves_is_that_of_uniform_ranks() -> None:
    rng = np.random.default_rng(3)
    moved = rng.permutation(60).astype(np.float64)
    drawn = [_chance_of_large(moved, rng.permutation(60)[:6].tolist()) for _ in range(2000)]
    for share in (0.05, 0.25, 0.5, 0.9):
        assert np.mean(np.array(drawn) < share) == pytest.approx(share, abs=0.04)
