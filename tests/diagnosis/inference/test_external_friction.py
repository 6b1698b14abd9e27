"""Friction outside the drives: stop operators against closed forms, and campaigns stepped through by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.diagnosis.effects.hysteresis import LIMITS, held_torque, history
from beamstiff.diagnosis.inference.external_friction import held_back, lagging, slipping
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array
from tests.diagnosis.machines import kr240, nominal
from tests.diagnosis.planted import campaign, plan

PLAN = plan(8)
LIMIT = LIMITS[2]


@pytest.fixture(scope="module")
def there() -> Baseline:
    return nominal(kr240(), campaign(PLAN, seed=1))


def explained(columns: Array, moved: Array) -> float:
    """Return the share of displacements (N, 6) that lies in the span of columns (N, 6, c)."""
    flat = columns.reshape(-1, columns.shape[2])
    left = moved.ravel() - flat @ np.linalg.lstsq(flat, moved.ravel())[0]
    return 1.0 - float((left**2).sum() / (moved**2).sum())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 2.0))
def test_along_one_direction_what_is_held_is_the_scalar_stop(seed: int, limit: float) -> None:
    way = np.random.default_rng(seed).standard_normal(12)
    fresh = np.arange(12) % 4 == 0
    vector = np.zeros((12, 1, 3))
    vector[:, 0, 1] = way
    held = held_back(vector, 0 * vector, np.arange(12), fresh, np.array([limit]))
    np.testing.assert_allclose(
        held[:, 0, 1], held_torque(way, np.zeros(12), fresh, np.arange(12), limit), atol=1e-12
    )
    assert not held[:, 0, [0, 2]].any()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_turning_what_is_followed_turns_what_is_held(seed: int) -> None:
    rng = np.random.default_rng(seed)
    way, (turn, _) = rng.standard_normal((10, 2, 3)), np.linalg.qr(rng.standard_normal((3, 3)))
    fresh = np.arange(10) % 5 == 0

    def held(vectors: Array) -> Array:
        carried = np.array([False, True])
        return held_back(vectors, 0 * vectors, np.arange(10), fresh, np.array([0.5, 0.8]), carried=carried)

    np.testing.assert_allclose(held(way @ turn.T), held(way) @ turn.T, atol=1e-12)


@pytest.mark.parametrize(
    ("way", "fresh", "limit", "more", "expected"),
    [
        ([0.3, 0.6, 0.9, 0.2], [0], 0.5, {"released": True}, [0.3, 0.0, 0.3, -0.4]),
        ([1.0, 0.0, 1.0, 0.0], [0, 2], 0.4, {"carried": False}, [0.4, -0.4, 0.4, -0.4]),
        # since the start of the second, where it is -0.4
        ([1.0, 0.0, 1.0, 0.0], [0, 2], 0.4, {"carried": True}, [0.4, -0.4, 0.8, 0.0]),
        ([1.0, 0.0, 1.0, 0.0], [0, 2], 0.4, {"carried": True, "whole": True}, [0.4, -0.4, 0.4, -0.4]),
    ],
    ids=[
        "what sticks lets go of all",
        "a history ends it",
        "outlasts a history",
        "where positions are absolute",
    ],
)
def test_what_is_held_of_a_way(
    way: list[float], fresh: list[int], limit: float, more: dict[str, bool], expected: list[float]
) -> None:
    moved, rows = np.zeros((4, 1, 3)), np.arange(4)
    moved[:, 0, 0] = way
    held = held_back(moved, 0 * moved, rows, np.isin(rows, fresh), np.array([limit]), **more)
    np.testing.assert_allclose(held[:, 0, 0], expected)


def test_a_gauge_that_drags_lies_among_what_readings_do_and_not_in_the_linear_model(there: Baseline) -> None:
    moved = there.predicted[:, :3]
    width = LIMIT * np.linalg.norm(moved, axis=1).max()
    read = np.zeros_like(moved)
    for pose in np.unique(there.rows.pose):
        pointer = np.zeros(3)
        for row in np.flatnonzero(there.rows.pose == pose):
            pointer = np.clip(pointer, moved[row] - width, moved[row] + width)
            read[row] = pointer
    lag = np.concatenate([read - moved, 0 * moved], axis=1)
    assert explained(lagging(there), lag) > 1 - 1e-9
    assert explained(there.tangent, lag) < 0.9


def test_reflectors_have_a_gauge_each(there: Baseline) -> None:
    other = next(node.name for node in there.nominal.nodes if node.name != there.rows.point[0])
    point = there.rows.point.astype(object)
    point[1::2] = other
    two = replace(there, rows=replace(there.rows, point=point))
    some = np.asarray(point != other)
    order, fresh = history(two, some)
    assert set(order.tolist()) == set(np.flatnonzero(some).tolist())
    assert fresh.sum() == np.unique(there.rows.pose).size
    assert not np.allclose(lagging(two), lagging(there))


def test_a_seat_that_slips_about_one_axis_lies_among_what_friction_can_do(there: Baseline) -> None:
    place = there.places.flange
    load, dead = place.load + place.dead, place.dead
    largest = np.linalg.norm(load[:, 3:], axis=1).max()
    held = held_torque(load[:, 4], dead[:, 4], history(there)[1], history(there)[0], LIMIT * largest)
    assert explained(slipping(there, place), place.shift[:, :, 4] * held[:, None]) > 1 - 1e-9
