"""Friction outside the drives: stop operators against closed forms, and campaigns stepped through by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.diagnosis.effects.hysteresis import LIMITS, held_torque, history
from beamstiff.diagnosis.inference.external_friction import held_back, lagging, slipping
from beamstiff.diagnosis.inference.tool_ground_spring import (
    STOPS,
    _more,
    _taken,
    held_tool,
    stopped,
    suggested_spring,
    tethered,
)
from beamstiff.diagnosis.residual.baseline import Baseline, predict, tool_response
from beamstiff.diagnosis.residual.whitened import Whitened, whiten
from beamstiff.se3 import Array
from tests.diagnosis.machines import at_random, elbow, kr240, nominal, rows_of
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
    scalar = held_torque(way, np.zeros(12), fresh, np.arange(12), limit)
    np.testing.assert_allclose(held[:, 0, 1], scalar, atol=1e-12)
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


# Springs and stops beside the tool against two springs side by side


def spring_of(tied: Baseline, share: float) -> Array:
    """Return a spring (3, 3) in N/m of a share of the robot's own stiffness."""
    half = np.random.default_rng(1).standard_normal((3, 3))
    return share / np.abs(tied.response).max() * half @ half.T


def held_by(tied: Baseline, spring: Array) -> Array:
    """Return what the spring takes from the displacements, (N, 6), both springs carrying the load."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = spring
    moved = np.linalg.solve(np.eye(6) + tied.response @ whole, tied.predicted[:, :, None])
    return moved[:, :, 0] - tied.predicted


def with_gap(tied: Baseline, gap: Array) -> tuple[Baseline, Whitened]:
    held = replace(tied, measured=tied.predicted + gap)
    return held, whiten(held)


@pytest.fixture(scope="module")
def tied() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 20, seed=4))


@pytest.mark.parametrize("share", [1e-3, 0.3, 3.0])
def test_a_spring_to_the_floor_carries_its_part(tied: Baseline, share: float) -> None:
    spring = spring_of(tied, share)
    np.testing.assert_allclose(_taken(held_tool(tied), spring), held_by(tied, spring), rtol=1e-7, atol=1e-15)


def test_what_a_spring_takes_more_is_the_derivative(tied: Baseline) -> None:
    spring, step = spring_of(tied, 0.3), 1e-4 / np.abs(tied.response).max()
    for at, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
        by = np.zeros((3, 3))
        by[i, j] = by[j, i] = step
        slope = (held_by(tied, spring + by) - held_by(tied, spring - by)) / (2 * step)
        np.testing.assert_allclose(
            _more(held_tool(tied), spring)[:, :, at], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max()
        )


@pytest.mark.parametrize(("share", "left"), [(1e-3, 0.01), (0.1, 0.15)])
def test_springs_weak_and_strong_lie_within_the_law(tied: Baseline, share: float, left: float) -> None:
    moved = held_by(tied, spring_of(tied, share))
    found, white = with_gap(tied, moved)
    columns = tethered(found, held_tool(found), white)[0].reshape(moved.size, 7)
    columns = columns / np.linalg.norm(columns, axis=0)
    rest = moved.ravel() - columns @ np.linalg.lstsq(columns, moved.ravel())[0]
    assert np.linalg.norm(rest) < left * np.linalg.norm(moved)


def test_the_gap_suggests_springs_that_pull_back_only(tied: Baseline) -> None:
    moved = held_by(tied, spring_of(tied, 1e-3))
    found, white = with_gap(tied, moved)
    suggested = suggested_spring(held_tool(found), white)
    assert np.linalg.eigvalsh(suggested).min() > -1e-12 * np.abs(suggested).max()
    assert suggested.any()
    found, white = with_gap(tied, -moved)
    assert not suggested_spring(held_tool(found), white).any()


def test_a_stop_beside_the_tool_has_no_name() -> None:
    tied = nominal(kr240(), at_random(kr240(), 20, seed=4))
    moved = tied.predicted[:, 1]
    stop = 1e-3 / np.abs(tied.response).max()  # N/m, a thousandth of the robot's own; it takes what it holds
    begins = 0.3 * moved.max()
    force = -stop * np.maximum(moved - begins, 0.0)
    taken = tied.response[:, :, 1] * force[:, None]
    y, forward = 1, 0
    found = stopped(held_tool(tied))[:, :, (2 * y + forward) * len(STOPS) + STOPS.index(0.3)]
    np.testing.assert_allclose(stop * found, taken, rtol=1e-9, atol=1e-15)
    assert 0 < np.count_nonzero(force) < len(force)  # some come up against it, some do not


def test_a_spring_holds_the_tool_whatever_points_are_read_or_loaded() -> None:
    machine = elbow()
    wrench = np.random.default_rng(3).standard_normal((12, 6)) * [500, 500, 0, 0, 0, 0]
    q = at_random(machine, 12, seed=1).q
    tied = nominal(machine, rows_of(machine, q, wrench, point=["end"] * 12, load_point=["end"] * 12))
    spring = np.diag([2e5, 1e5, 0.0])
    tip = np.array(["tip"] * 12)
    at_tip = tool_response(machine, replace(tied.rows, point=tip, load_point=tip))[:, :3, :3]
    at_end = tool_response(machine, replace(tied.rows, load_point=tip))[:, :, :3]
    free = predict(machine, replace(tied.rows, point=tip))[:, :3, None]
    held = np.linalg.solve(np.eye(3) + at_tip @ spring, free)
    np.testing.assert_allclose(_taken(held_tool(tied), spring), -(at_end @ spring @ held)[:, :, 0], rtol=1e-9)
    assert np.abs(at_end - at_tip[:, :1]).max() > 0
