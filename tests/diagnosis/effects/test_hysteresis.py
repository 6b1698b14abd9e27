from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.hysteresis import LIMITS, held_torque
from beamstiff.diagnosis.effects.torque_laws import axis_at
from beamstiff.se3 import Array
from tests.diagnosis.machines import ELBOW, FORE, elbow, nominal, rows_of, shape_of

CYCLE = np.array([0.25, 0.5, 1.0, 0.5, 0.25, 0.0, -0.5, -1.0, -0.5, 0.0, 1.0])


def stepped(torque: Array, limit: float, start: float = 0.0, **more: Any) -> Array:
    n = len(torque)
    return held_torque(torque, np.full(n, start), np.arange(n) == 0, np.arange(n), limit, **more)


def test_friction_holds_all_until_it_slips_and_twice_as_much_on_the_way_back() -> None:
    # Masing: a branch after a reversal is the first one, doubled
    r = 0.3
    first = np.minimum(CYCLE[:3], r)
    down = first[-1] - 2 * np.minimum((1.0 - CYCLE[3:8]) / 2, r)
    up = down[-1] + 2 * np.minimum((CYCLE[8:] + 1.0) / 2, r)
    assert stepped(CYCLE, r) == pytest.approx(np.concatenate([first, down, up]))


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=12), st.floats(0.01, 3))
def test_friction_holds_no_more_and_fine_steps_change_nothing(torque: list[float], limit: float) -> None:
    coarse = np.array(torque)
    found = stepped(coarse, limit)
    assert (np.abs(found) <= limit).all()
    knots = np.concatenate([[0.0], coarse])
    fine = np.concatenate([np.linspace(a, b, 6)[1:] for a, b in pairwise(knots)])
    np.testing.assert_allclose(stepped(fine, limit)[4::5], found, atol=1e-9)


def test_a_closed_cycle_loses_the_work_of_the_friction() -> None:
    # the loop of an elastic and frictional element: 2 r times the torque travelled beyond slipping, both ways
    r, top = 0.25, 1.0
    ends = ((0, top, 2001), (top, -top, 4001), (-top, top, 4001))
    way = np.concatenate([np.linspace(*one) for one in ends])
    held = stepped(way, r)
    loop = slice(2001, None)
    work = np.abs(np.trapezoid(held[loop], way[loop]))
    assert work == pytest.approx(2 * r * (2 * top - 2 * r), rel=2e-3)


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_friction_that_grows_with_the_torque_holds_a_share_of_it_one_way_and_the_other(share: float) -> None:
    # up: it slips all the way at mu T. Down: first it sticks, then it slips at -mu T
    up, down = np.linspace(0.01, 2.0, 200), np.linspace(1.99, 0.0, 200)
    found = stepped(np.concatenate([up, down]), 0.0, grows=share)
    assert found[:200] == pytest.approx(share * up)
    stuck = share * 2.0 - (2.0 - down)
    assert found[200:] == pytest.approx(np.maximum(stuck, -share * down), abs=1e-9)
    assert (found[200:][down < 2.0 * (1 - share) / (1 + share)] < 0).any()
    both = stepped(np.concatenate([up, down]), 0.2, grows=share)
    assert np.abs(both) == pytest.approx(np.minimum(np.abs(both), 0.2 + share * np.concatenate([up, down])))
    assert both[199] == pytest.approx(0.2 + 2.0 * share)


def test_what_the_move_has_left_is_friction_without_torque_where_the_weight_acts_after_it() -> None:
    found = stepped(np.full(3, 0.5), 0.1, start=0.5, grows=0.4, arrived=-1.0, wound=True, whole=True)
    assert found == pytest.approx(np.full(3, 0.3))  # -0.1 and 0.5 more, held by 0.1 + 0.4 * 0.5 at most


def test_the_elbow_lags_by_what_friction_holds() -> None:
    largest = 1000.0
    wrench = CYCLE[:, None] * largest / FORE * np.eye(6)[1]
    rows = rows_of(elbow(), [0, 0], wrench, pose=np.zeros(11, int), step=np.arange(11))
    there = nominal(elbow(), rows)
    for limit in LIMITS:
        shape = shape_of(there, "hysteresis", "q2", f"friction {limit:g}")
        assert shape.columns[:, 5, 0] == pytest.approx(-stepped(CYCLE, limit), abs=1e-9)
        assert shape.parameters[0].size == pytest.approx(largest / ELBOW)


def test_rows_are_taken_in_the_order_they_were_measured_in() -> None:
    order = np.random.default_rng(0).permutation(11)
    wrench = CYCLE[:, None] * 1000 * np.eye(6)[1]
    sorted_rows = rows_of(elbow(), [0, 0], wrench, pose=np.zeros(11, int), step=np.arange(11))
    mixed = rows_of(elbow(), [0, 0], wrench[order], pose=np.zeros(11, int), step=np.arange(11)[order])
    one, other = (
        shape_of(nominal(elbow(), rows), "hysteresis", "q2", "distributed friction").columns
        for rows in (sorted_rows, mixed)
    )
    np.testing.assert_allclose(other, one[order], atol=1e-12)


def test_every_pose_begins_anew_unless_the_history_runs_on() -> None:
    wrench = np.tile(CYCLE[:4], 2)[:, None] * 1000 * np.eye(6)[1]
    pose, step = np.repeat([0, 1], 4), np.tile(np.arange(4), 2)
    timed = {"pose": pose, "step": step, "time": np.arange(8.0)}
    tables = (rows_of(elbow(), [0, 0], wrench, continuous=on, **timed) for on in (False, True))
    shapes = (shape_of(nominal(elbow(), rows), "hysteresis", "q2", "friction 0.4") for rows in tables)
    anew, running = (shape.columns[:, 5, 0] for shape in shapes)
    assert anew[4:] == pytest.approx(anew[:4])
    assert running == pytest.approx(-stepped(np.tile(CYCLE[:4], 2), 0.4))
    assert running[4:] != pytest.approx(anew[4:])


def test_wound_up_by_the_weight_a_further_load_slips_at_once_and_a_lifting_one_late() -> None:
    held = stepped(np.array([5.0 + 1.0]), 0.5, start=5.0, wound=True)
    assert held == pytest.approx([0.0])  # the friction is spent already
    held = stepped(np.array([5.0 - 2.0]), 0.5, start=5.0, wound=True)
    assert held == pytest.approx([-1.0])  # from one side to the other


def test_friction_left_from_the_move_is_given_back_before_it_holds_the_other_way() -> None:
    n = len(CYCLE)
    found = held_torque(CYCLE, np.zeros(n), np.arange(n) == 0, np.arange(n), 0.3, arrived=1.0)
    # nothing more is held on the way up; the whole range comes back on the way down
    assert found[:3] == pytest.approx([0.0, 0.0, 0.0])
    assert found[3:8] == pytest.approx([-0.5, -0.6, -0.6, -0.6, -0.6])
    other = held_torque(-CYCLE, np.zeros(n), np.arange(n) == 0, np.arange(n), 0.3, arrived=-1.0)
    assert other == pytest.approx(-found)


def test_absolute_positions_show_what_was_held_before_the_first_load_as_well() -> None:
    loads = np.array([5.0, 6.0, 3.0])
    assert stepped(loads, 0.5, start=5.0, wound=True, whole=True) == pytest.approx([0.5, 0.5, -0.5])
    assert stepped(loads, 0.5, start=5.0, arrived=-1.0, whole=True) == pytest.approx([-0.5, 0.5, -0.5])
    # a displacement is the difference of two of them
    for arrived in (-1.0, -0.5, 0.0, 0.5, 1.0):
        there = stepped(loads, 0.5, start=5.0, wound=True, arrived=arrived, whole=True)
        apart = stepped(loads, 0.5, start=5.0, wound=True, arrived=arrived)
        assert apart == pytest.approx(there - there[0])


@pytest.mark.parametrize("name", ["friction 0.2, wound up by the weight", "friction 0.2, left from the move"])
def test_the_columns_of_absolute_rows_differ_by_what_was_held_at_first(name: str) -> None:
    wrench = CYCLE[:, None] * 1000 * np.eye(6)[1]
    one = {"pose": np.zeros(11, int), "step": np.arange(11)}
    moved, still = (
        shape_of(
            nominal(elbow(), rows_of(elbow(), [0.3, 0.2], wrench, **one, **more)), "hysteresis", "q2", name
        )
        for more in ({}, {"position": np.zeros((11, 3)), "rotation": np.zeros((11, 3))})
    )
    apart = still.columns - moved.columns
    np.testing.assert_allclose(apart, np.broadcast_to(apart[:1], apart.shape), atol=1e-12)
    if "move" in name:  # without dead weight nothing else is held before the first load
        assert np.abs(apart).max() > 1e-3 * np.abs(moved.columns).max()


def test_what_friction_holds_is_let_go_with_the_time() -> None:
    # a load that stays: of what is held a share exp(-t / tau) is left; tau is as long as a pose takes
    time = np.array([0.0, 10, 30, 70, 90])
    load = np.array([1.0, 1, 1, 1, 1])[:, None] * np.eye(6)[1]
    there = nominal(elbow(), rows_of(elbow(), [0, 0], load, time=time))
    shape = shape_of(there, "hysteresis", "q1", "friction that grows with the torque, let go with the time")
    names = [item.name for item in shape.parameters]
    still = shape.columns[:, 5, names.index("held_windup_0_and_0.8")]
    gone = shape.columns[:, 5, names.index("held_windup_0_and_0.8_let_go")]
    assert still == pytest.approx(-0.8)  # of the largest torque, held to the end
    assert gone == pytest.approx(-0.8 * np.exp(-time / 90.0))
    # a robot that states it keeps the time of the campaign it was found in
    assert EFFECTS["hysteresis"].scales(there, "q1")["lasts"] == 90.0
    stated = replace(there, stated={"torque": 1.3, "lasts": 45.0})
    shape = shape_of(stated, "hysteresis", "q1", "friction that grows with the torque, let go with the time")
    gone = shape.columns[:, 5, names.index("held_windup_0_and_0.8_let_go")]
    assert gone[4] / gone[0] == pytest.approx(np.exp(-2.0))


def test_without_times_nothing_is_let_go() -> None:
    rows = rows_of(elbow(), [0, 0], np.eye(6)[[1, 1, 1]])
    shapes = EFFECTS["hysteresis"].shapes(nominal(elbow(), rows), "q1")
    assert not any("let go" in one.name for one in shapes)


def test_a_machine_that_lets_go_is_known_where_nobody_looked_at_the_clock() -> None:
    rows = rows_of(elbow(), [0, 0], np.eye(6)[[1, 1, 1]], time=np.array([0.0, 10, 20]))
    there = nominal(elbow(), rows)
    name = "friction that grows with the torque, let go with the time"
    found = shape_of(there, "hysteresis", "q1", name)
    untimed = nominal(elbow(), rows_of(elbow(), [0, 0], np.eye(6)[[1, 1, 1]]))
    for other in (replace(untimed, fit_rows=there), replace(untimed, stated={"torque": 1.3, "lasts": 20.0})):
        shape = shape_of(other, "hysteresis", "q1", name)
        assert [item.name for item in shape.parameters] == [item.name for item in found.parameters]
        half = len(shape.parameters) // 2  # as long as it takes to read one, nothing is let go
        np.testing.assert_array_equal(shape.columns[..., half:], shape.columns[..., :half])


def test_single_readings_say_nothing_of_how_long_a_history_takes() -> None:
    q = np.array([[0.0, 0.0]] * 3 + [[0.1, 0.0], [0.2, 0.0], [0.3, 0.0], [0.4, 0.0]])
    pose = np.array([0, 0, 0, 1, 2, 3, 4])
    rows = rows_of(elbow(), q, np.eye(6)[[1] * 7], time=np.arange(7.0) * 15, pose=pose)
    assert EFFECTS["hysteresis"].scales(nominal(elbow(), rows), "q1")["lasts"] == 30.0


def test_the_friction_of_the_last_motion_lags_behind_it_until_a_load_has_turned_it() -> None:
    # each pose twice: as the joint arrives, and under a load that would push it on, or back, by more than 2 r
    q = np.array([[0.3, 0.0], [0.3, 0.6], [0.3, 0.2], [0.3, 0.9], [0.3, 0.4]])
    came = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0], 2)
    push = np.repeat([1.0, 1.0, 1.0, -1.0, -1.0], 2) * np.tile([0.0, 1000.0], 5)
    order = {"pose": np.repeat(np.arange(5), 2), "step": np.tile([0, 1], 5)}
    order |= {"position": np.zeros((10, 3)), "rotation": np.zeros((10, 3))}
    rows = rows_of(elbow(), np.repeat(q, 2, axis=0), push[:, None] * np.eye(6)[1], **order)
    base = nominal(elbow(), rows)
    moved = shape_of(base, "hysteresis", "q2", "friction 0.1, left from the last motion").columns[:, :, 0]
    axis = axis_at(base, "q2")
    held = 0.1 * np.where(axis.load == 0.0, came, np.sign(axis.load))
    np.testing.assert_allclose(moved, -held[:, None] * axis.shift, atol=1e-12)
    direction = shape_of(base, "approach-direction", "q2", "direction of the last motion").columns[:, :, 0]
    still = axis.load == 0.0
    # of readings without load the two are one, against the motion
    np.testing.assert_allclose(moved[still], -0.1 * direction[still], atol=1e-12)
