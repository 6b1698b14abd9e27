"""Springs and stops beside the tool against two springs side by side."""

from dataclasses import replace

import numpy as np
import pytest

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


def spring_of(there: Baseline, share: float) -> Array:
    """Return a spring (3, 3) in N/m of a share of the robot's own stiffness."""
    half = np.random.default_rng(1).standard_normal((3, 3))
    result: Array = share / np.abs(there.response).max() * half @ half.T
    return result


def held_by(there: Baseline, spring: Array) -> Array:
    """Return what the spring takes from the displacements, (N, 6), both springs carrying the load."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = spring
    moved = np.linalg.solve(np.eye(6) + there.response @ whole, there.predicted[:, :, None])
    result: Array = moved[:, :, 0] - there.predicted
    return result


def with_gap(there: Baseline, gap: Array) -> tuple[Baseline, Whitened]:
    held = replace(there, measured=there.predicted + gap)
    return held, whiten(held)


@pytest.fixture(scope="module")
def there() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 20, seed=4))


@pytest.mark.parametrize("share", [1e-3, 0.3, 3.0])
def test_a_spring_to_the_floor_carries_its_part(there: Baseline, share: float) -> None:
    spring = spring_of(there, share)
    np.testing.assert_allclose(
        _taken(held_tool(there), spring), held_by(there, spring), rtol=1e-7, atol=1e-15
    )


def test_what_a_spring_takes_more_is_the_derivative(there: Baseline) -> None:
    spring, step = spring_of(there, 0.3), 1e-4 / np.abs(there.response).max()
    for at, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
        by = np.zeros((3, 3))
        by[i, j] = by[j, i] = step
        slope = (held_by(there, spring + by) - held_by(there, spring - by)) / (2 * step)
        np.testing.assert_allclose(
            _more(held_tool(there), spring)[:, :, at], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max()
        )


@pytest.mark.parametrize(("share", "left"), [(1e-3, 0.01), (0.1, 0.15)])
def test_springs_weak_and_strong_lie_within_the_law(there: Baseline, share: float, left: float) -> None:
    moved = held_by(there, spring_of(there, share))
    found, white = with_gap(there, moved)
    columns = tethered(found, held_tool(found), white)[0].reshape(moved.size, 7)
    columns = columns / np.linalg.norm(columns, axis=0)
    rest = moved.ravel() - columns @ np.linalg.lstsq(columns, moved.ravel())[0]
    assert np.linalg.norm(rest) < left * np.linalg.norm(moved)


def test_the_gap_suggests_springs_that_pull_back_only(there: Baseline) -> None:
    moved = held_by(there, spring_of(there, 1e-3))
    found, white = with_gap(there, moved)
    suggested = suggested_spring(held_tool(found), white)
    assert np.linalg.eigvalsh(suggested).min() > -1e-12 * np.abs(suggested).max()
    assert suggested.any()
    found, white = with_gap(there, -moved)
    assert not suggested_spring(held_tool(found), white).any()


def test_a_stop_beside_the_tool_has_no_name() -> None:
    there = nominal(kr240(), at_random(kr240(), 20, seed=4))
    moved = there.predicted[:, 1]
    stop = 1e-3 / np.abs(there.response).max()  # N/m, a thousandth of the robot's own; it takes what it holds
    begins = 0.3 * moved.max()
    force = -stop * np.maximum(moved - begins, 0.0)
    taken = there.response[:, :, 1] * force[:, None]
    y, forward = 1, 0
    found = stopped(held_tool(there))[:, :, (2 * y + forward) * len(STOPS) + STOPS.index(0.3)]
    np.testing.assert_allclose(stop * found, taken, rtol=1e-9, atol=1e-15)
    assert 0 < np.count_nonzero(force) < len(force)  # some come up against it, some do not


def test_a_spring_holds_the_tool_whatever_points_are_read_or_loaded() -> None:
    machine = elbow()
    wrench = np.random.default_rng(3).standard_normal((12, 6)) * [500, 500, 0, 0, 0, 0]
    q = at_random(machine, 12, seed=1).q
    there = nominal(machine, rows_of(machine, q, wrench, point=["end"] * 12, load_point=["end"] * 12))
    spring = np.diag([2e5, 1e5, 0.0])
    tip = np.array(["tip"] * 12)
    at_tip = tool_response(machine, replace(there.rows, point=tip, load_point=tip))[:, :3, :3]
    at_end = tool_response(machine, replace(there.rows, load_point=tip))[:, :, :3]
    free = predict(machine, replace(there.rows, point=tip))[:, :3, None]
    held = np.linalg.solve(np.eye(3) + at_tip @ spring, free)
    np.testing.assert_allclose(
        _taken(held_tool(there), spring), -(at_end @ spring @ held)[:, :, 0], rtol=1e-9
    )
    assert np.abs(at_end - at_tip[:, :1]).max() > 0
