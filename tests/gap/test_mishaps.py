"""What tells mishaps from what a shape misses: counts of boxes and balls, ranks, and runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.mishaps import _chance_of_few, _chance_of_large, mishaps
from beamstiff.se3 import Array
from tests.gap.machines import kr240, nominal
from tests.gap.planted import campaign, plan

PLAN = plan(6)
RUN = [13, 14, 15]  # of the posture of rows 12 to 17, under loads that differ


def off_by(values: dict[int, Array]) -> Baseline:
    """Return a baseline of which rows are off by vectors (6,) of so many sigma."""
    there = nominal(kr240(), campaign(PLAN, seed=1))
    gap = np.zeros_like(there.gap)
    for row, value in values.items():
        gap[row] = value * there.sigma[row]
    return replace(there, measured=there.predicted + gap)


def test_rows_one_after_another_that_are_off_by_the_same_are_one_mishap() -> None:
    rng = np.random.default_rng(2)
    shift = np.array([12.0, -9.0, 4.0, 0.0, 0.0, 0.0])
    there = off_by({row: shift + rng.standard_normal(6) for row in RUN})
    assert mishaps(there, RUN) == [RUN]
    assert mishaps(there, [RUN[0], RUN[2]]) == [[RUN[0]], [RUN[2]]]  # a sound row lies between


def test_rows_that_are_off_by_as_much_as_they_are_loaded_are_each_one() -> None:
    shift = np.array([12.0, -9.0, 4.0, 0.0, 0.0, 0.0])
    steps = np.array([0.2, 1.0, 0.5])
    there = off_by({row: shift * step * 2 for row, step in zip(RUN, steps, strict=True)})
    assert len(mishaps(there, RUN)) > 1
    turned = off_by({row: np.roll(shift, k) for k, row in enumerate(RUN)})
    assert mishaps(turned, RUN) == [[row] for row in RUN]


def test_under_one_load_a_run_says_nothing() -> None:
    shift = np.array([12.0, -9.0, 4.0, 0.0, 0.0, 0.0])
    there = off_by(dict.fromkeys(RUN, shift))
    still = there.predicted.copy()
    still[RUN] = still[RUN[0]]
    assert mishaps(replace(there, measured=there.gap + still, predicted=still), RUN) == [[row] for row in RUN]


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
