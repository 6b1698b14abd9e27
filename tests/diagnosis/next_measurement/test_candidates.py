"""Loads that are proposed are loads that were applied: the table's directions, and no reversal it lacks."""

import numpy as np
import pytest

from beamstiff.diagnosis.next_measurement.candidates import ABSOLUTE, ONE_WAY, STEPS, _ways
from beamstiff.measure.table import Measurements, make_measurements


def loaded(*forces: tuple[float, float, float]) -> Measurements:
    wrench = np.hstack([np.array(forces), np.zeros((len(forces), 3))])
    return make_measurements(
        ["q1"],
        np.zeros((len(forces), 1)),
        tcp="tool",
        wrench=wrench,
        displacement=np.zeros((len(forces), 6)),
        source="table",
    )


def test_weights_that_hang_down_are_proposed_as_such() -> None:
    ways = _ways(loaded((0, 0, 0), (0, 0, -150), (1, 0, -300)), absolute=True)
    assert len(ways) == 1
    np.testing.assert_allclose(ways[0][0], [0, 0, -1], atol=0.02)
    assert ways[0][1] == ONE_WAY[ABSOLUTE]
    assert min(ways[0][1]) == 0.0


def test_what_was_pulled_both_ways_is_reversed() -> None:
    ways = _ways(loaded((100, 0, 0), (-100, 0, 0), (0, 50, 0)), absolute=False)
    assert [(along.tolist(), shares) for along, shares in ways] == [
        ([1.0, 0.0, 0.0], STEPS),
        ([0.0, 1.0, 0.0], ONE_WAY[STEPS]),
    ]


@pytest.mark.parametrize("forces", [[(0.0, 0.0, 0.0)], np.random.default_rng(1).normal(size=(40, 3))])
def test_without_forces_or_under_any_the_axes_of_the_base_are_taken(
    forces: list[tuple[float, float, float]],
) -> None:
    ways = _ways(loaded(*forces), absolute=False)
    np.testing.assert_array_equal([along for along, _ in ways], np.eye(3))
    assert {shares for _, shares in ways} == {STEPS}
