"""benchmarks/compensation_study.py, small: what it must show, it shows."""

import numpy as np
import pytest

from benchmarks.compensation_study import (
    ENDS,
    SAMPLES,
    changed_elsewhere,
    elastica_error,
    forming,
    round_trip,
)


def test_the_beam_is_the_elastica() -> None:
    assert elastica_error() < 1e-6


def test_a_robot_computed_apart_lands_within_a_hundredth_of_the_error() -> None:
    trip = round_trip(5)
    before, after = (np.linalg.norm(rows[:, :3], axis=1) for rows in (trip.before, trip.after))
    assert before.min() > 2e-3
    assert after.max() < 0.01 * before.max()
    turned = [np.linalg.norm(rows[:, 3:], axis=1).max() for rows in (trip.before, trip.after)]
    assert turned[1] < 0.01 * turned[0]
    # beamstiff foresaw the error that the other computation has
    np.testing.assert_allclose(trip.expected, trip.before, atol=0.005 * before.max())


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_programs_change_in_their_targets_only(name: str, end: str) -> None:
    assert changed_elsewhere(name, end) == 0


@pytest.mark.slow
def test_forming_by_the_constant_springs_of_the_paper() -> None:
    formed = forming(("parametric",), along=8)
    rows = {row.name: row for row in formed.rows}
    assert formed.gap == pytest.approx(0.2, abs=0.05)  # Euler-Bernoulli against incremental, near the clamp
    incremental = rows["parametric, incremental"]
    assert 60 < rows["parametric, Euler-Bernoulli"].improvement < incremental.improvement < 90  # paper: 80
    assert rows["parametric, incremental, friction"].improvement > incremental.improvement
    assert rows["the machine's own, incremental, friction"].improvement > 99
