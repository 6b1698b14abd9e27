"""Names of reflectors on one body. Truth: a rigid triangle whose names are exchanged by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.measure.swapped_labels import label_doubts
from beamstiff.measure.table import Measurements, make_measurements

STATES = 12
TRIANGLE = np.array([[0.1, 0.0, 0.0], [0.0, 0.16, 0.0], [0.0, 0.0, 0.25]])


def table(seed: int = 0) -> Measurements:
    rng = np.random.default_rng(seed)
    turned = Rotation.random(STATES, random_state=rng).as_matrix()
    at = np.einsum("sij,pj->spi", turned, TRIANGLE) + rng.uniform(-1, 1, (STATES, 1, 3))
    at += 2e-5 * rng.standard_normal(at.shape)
    return make_measurements(
        ["q1"],
        np.repeat(rng.uniform(-1, 1, (STATES, 1)), 3, axis=0),
        tcp="tool",
        position=at.reshape(-1, 3),
        point=["m1", "m2", "m3"] * STATES,
        pose=np.repeat(np.arange(STATES), 3),
        source="t.csv",
    )


def test_right_names_raise_no_doubt() -> None:
    assert list(label_doubts(table())) == []


@pytest.mark.parametrize("states", [(2, 7), (0, 1, 2, 3, 4)])
def test_exchanged_names_are_found_by_the_distances(states: tuple[int, ...]) -> None:
    right = table()
    point = right.point.copy()
    for state in states:
        point[3 * state : 3 * state + 3] = ["m2", "m1", "m3"]
    (said,) = label_doubts(replace(right, point=point))
    assert f"exchanged in {len(states)} of {STATES} states" in said
    assert "m2 is m1, m1 is m2" in said
    assert right.place(3 * states[0] + 1) in said


def test_three_names_that_went_round_are_found() -> None:
    right = table()
    point = right.point.copy()
    point[:3] = ["m2", "m3", "m1"]
    (said,) = label_doubts(replace(right, point=point))
    assert "m2 is m1, m3 is m2, m1 is m3" in said


def test_a_reflector_that_slipped_is_named() -> None:
    right = table()
    position = right.position.copy()
    position[3 * 8 + 1 :: 3] += [0.0, 0.02, 0.01]
    (said,) = label_doubts(replace(right, position=position))
    assert said.startswith(f"reflector m2 seems to have slipped in {STATES - 8} of {STATES} states")


def test_reflectors_on_several_bodies_raise_no_doubt() -> None:
    right = table()
    rng = np.random.default_rng(1)
    assert list(label_doubts(replace(right, position=rng.uniform(-1, 1, right.position.shape)))) == []
