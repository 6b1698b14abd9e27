from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.cycles import cycle_of
from beamstiff.diagnosis.effects.drift_basis import LAGS
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.effects.thermal_drift import WARM
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array
from tests.diagnosis.machines import FORE, UPPER, at_random, close, elbow, kr240, nominal, rows_of, shape_of

TIME = np.array([0.0, 100, 200, 300, 350, 400])


def test_a_steady_drift_grows_with_the_time_whatever_the_load() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "linear")
    for axis in range(3):
        drift = shape.columns[:, axis, axis]
        assert np.diff(drift) == pytest.approx(np.diff(TIME) / 400)  # the parameter is the drift of all of it
        assert not np.delete(shape.columns[..., axis], axis, axis=1).any()


@pytest.mark.parametrize(("name", "decay"), [("warming up within 0.3", 0.3), ("warming up within 0.1", 0.1)])
def test_a_machine_warms_up_as_newton_says(name: str, decay: float) -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    found = shape_of(nominal(elbow(), rows), "thermal-drift", None, name).columns[:, 0, 0]
    # the rate is proportional to what is still missing
    assert 1 - found == pytest.approx(np.exp(-TIME / (decay * 400)))


@pytest.mark.parametrize("name", ["linear", "warming up within 0.3", "any course"])
def test_outside_the_campaign_a_drift_stays_as_it_was_at_its_ends(name: str) -> None:
    there = nominal(elbow(), at_random(elbow(), 6, seed=1, time=TIME))
    within = shape_of(there, "thermal-drift", None, name).columns
    other = at_random(elbow(), 6, seed=1, time=np.array([-900.0, -1.0, 0.0, 400.0, 401.0, 4000.0]))
    found = shape_of(replace(nominal(elbow(), other), fit_rows=there), "thermal-drift", None, name).columns
    assert found[:3] == pytest.approx(np.broadcast_to(within[:1], found[:3].shape))
    assert found[3:] == pytest.approx(np.broadcast_to(within[-1:], found[3:].shape))


def test_without_times_and_temperatures_nothing_is_said_to_drift() -> None:
    assert EFFECTS["thermal-drift"].components(nominal(elbow(), at_random(elbow(), 5, seed=1))) == []
    timed = at_random(elbow(), 6, seed=1, time=TIME)
    assert EFFECTS["thermal-drift"].components(nominal(elbow(), timed)) == [None]


def test_a_shared_unloaded_reading_takes_the_drift_of_its_moment_out() -> None:
    once, pose = at_random(elbow(), 2, seed=2), np.repeat([0, 1], 3)
    rows = rows_of(elbow(), once.q[pose], once.wrench[pose], pose=pose, time=TIME, shared_unloaded=True)
    shapes = EFFECTS["thermal-drift"].shapes(nominal(elbow(), rows), None)
    found = next(one for one in shapes if one.name == "linear, since the unloaded reading").columns[:, 0, 0]
    assert found == pytest.approx((TIME - [0, 0, 0, 300, 300, 300]) / 400)


def test_a_thermometer_is_believed_where_there_is_one() -> None:
    warmth = np.array([20.0, 21, 23, 22, 25, 21])
    rows = at_random(elbow(), 6, seed=3, temperature=warmth)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "temperature")
    assert shape.columns[:, 2, 2] == pytest.approx(warmth - 22)
    still = at_random(elbow(), 6, seed=3, temperature=np.full(6, 20.0))
    names = {one.name for one in EFFECTS["thermal-drift"].shapes(nominal(elbow(), still), None)}
    assert "temperature" not in names


def test_a_machine_follows_its_temperature_with_a_lag() -> None:
    time = np.linspace(0.0, 400.0, 401)
    rows = at_random(elbow(), 401, seed=3, time=time, temperature=np.where(time < 100, 20.0, 25.0))
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "temperature, lagging by 0.05")
    found = shape.columns[:, 0, 0]
    after = time >= 100
    rise = (found[after] - found[0]) / 5.0
    assert rise == pytest.approx(
        1 - np.exp(-(time[after] - 99.0) / 20.0)
    )  # a step, answered as of first order


def test_a_turning_frame_moves_points_by_their_distance() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "any course, turning")
    names = [item.name for item in shape.parameters]
    turn = shape.columns[..., [names.index(f"turn_mode_1_{axis}") for axis in "xyz"]]
    course = shape.columns[:, 0, names.index("drift_mode_1_x")]
    first, both = rows.q[:, 0], rows.q.sum(axis=1)
    tip = UPPER * np.stack([np.cos(first), np.sin(first), 0 * first], -1)
    tip = tip + FORE * np.stack([np.cos(both), np.sin(both), 0 * both], -1)
    for axis in range(3):
        assert turn[:, 3 + axis, axis] == pytest.approx(course)
        moved = course[:, None] * np.cross(np.eye(3)[axis], tip)
        np.testing.assert_allclose(turn[:, :3, axis], moved, atol=1e-12)


COURSES = [
    pytest.param(lambda t: t, id="linear"),
    pytest.param(lambda t: 1 - np.exp(-t / 0.2), id="warming up"),
    pytest.param(lambda t: np.sin(2 * np.pi * t), id="a hall over a day"),
    pytest.param(lambda t: (t - 0.4) ** 2, id="there and back"),
]


def missed(modes: Array, wanted: Array) -> float:
    """Return the share of a course (N,) that is no mixture of modes (N, m)."""
    found = modes @ np.linalg.lstsq(modes, wanted, rcond=None)[0]
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


@pytest.mark.parametrize("course", COURSES)
def test_any_smooth_course_of_the_time_is_a_mixture_of_the_modes(course: Callable[[Array], Array]) -> None:
    time = np.linspace(0.0, 400.0, 41)
    rows = at_random(elbow(), 41, seed=1, time=time)
    along_x = shape_of(nominal(elbow(), rows), "thermal-drift", None, "any course").columns[:, 0]
    wanted = course(time / 400)
    # a constant is the unloaded reading's, or the frame's
    assert missed(along_x - along_x.mean(axis=0), wanted - wanted.mean()) < 0.05


@pytest.mark.parametrize("course", COURSES)
def test_and_so_is_what_came_since_the_first_reading_of_a_pose(course: Callable[[Array], Array]) -> None:
    time = np.linspace(0.0, 400.0, 72)
    q = np.repeat(at_random(elbow(), 12, seed=2).q, 6, axis=0)
    wrench = np.tile([[0.0, 500.0, 0, 0, 0, 0]], (72, 1))
    rows = rows_of(elbow(), q, wrench, time=time, shared_unloaded=True)
    name = "any course, since the unloaded reading"
    along_x = shape_of(nominal(elbow(), rows), "thermal-drift", None, name).columns[:, 0]
    wanted = course(time / 400)
    since = wanted - np.repeat(wanted[::6], 6)
    assert missed(along_x, since) < 0.2


def test_with_any_lag_is_every_lag_of_the_temperature_together() -> None:
    warmth = np.array([20.0, 21, 23, 22, 25, 21])
    there = nominal(elbow(), at_random(elbow(), 6, seed=3, temperature=warmth))
    every = shape_of(there, "thermal-drift", None, "temperature, with any lag")
    for lag in LAGS:
        name = "temperature" if lag == 0 else f"temperature, lagging by {lag:g}"
        one = shape_of(there, "thermal-drift", None, name).columns[:, 0, 0]
        own = every.columns[:, 0, [f"lagging_by_{lag:g}_x" in item.name for item in every.parameters]]
        found = own[:, 0] if lag else every.columns[:, 0, 0]
        assert found == pytest.approx(one / WARM)


def test_each_zero_length_and_tilt_follows_a_course_of_its_own() -> None:
    there = nominal(elbow(), at_random(elbow(), 6, seed=1, time=TIME))
    shape = shape_of(there, "thermal-drift", None, "every zero and length and tilt, any course")
    course = shape_of(there, "thermal-drift", None, "any course").columns[:, 0, 0]
    course = course - course[0]  # what it was at the start is no drift of a part
    names = [item.name for item in shape.parameters]
    for what, part in (("zero", "q2"), ("length", "f2.d"), ("tilt", "f2.alpha")):
        column = shape.columns[..., names.index(f"{what}_{part}_mode_1")]
        close(column, course[:, None] * pose_change(there, part))


def test_a_machine_that_grows_moves_every_point_away_from_its_base_by_its_distance() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    rows = replace(rows, point=np.array(["tip", "end"] * 3))
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "growing, any course")
    course = shape_of(nominal(elbow(), rows), "thermal-drift", None, "any course").columns[:, 0, 0]
    first, both = rows.q[:, 0], rows.q.sum(axis=1)
    tip = np.where(np.arange(6) % 2 == 0, 1.0, 0.0)[:, None]
    away = UPPER * np.stack([np.cos(first), np.sin(first), 0 * first], -1)
    away = away + tip * FORE * np.stack([np.cos(both), np.sin(both), 0 * both], -1)
    np.testing.assert_allclose(shape.columns[:, :3, 0], course[:, None] * away, atol=1e-12)
    assert not shape.columns[:, 3:].any()


def test_a_machine_that_grows_with_its_temperature_does_so_by_the_kelvin() -> None:
    warmth = np.array([20.0, 21, 23, 22, 25, 21])
    rows = at_random(elbow(), 6, seed=3, temperature=warmth)
    there = nominal(elbow(), rows)
    found = shape_of(there, "thermal-drift", None, "growing with temperature").columns[:, :3, 0]
    first, both = rows.q[:, 0], rows.q.sum(axis=1)
    away = UPPER * np.cos(first) + FORE * np.cos(both)
    assert found[:, 0] == pytest.approx((warmth - 22) * away)


@pytest.mark.parametrize("shared", [False, True])
def test_a_cooler_that_switches_on_and_off_is_found_with_its_period(shared: bool) -> None:
    rng = np.random.default_rng(4)
    rows = at_random(kr240(), 96, seed=2, time=np.cumsum(rng.uniform(20, 40, 96)))
    pose = np.repeat(np.arange(12), 8)
    rows = replace(rows, pose=pose, q=rows.q[8 * pose], shared_unloaded=shared)
    period = 290.0
    saw = 1e-4 * np.abs((rows.time / period) % 1.0 - 0.5)  # a room that warms and cools by the clock
    if shared:
        saw = saw - saw[8 * pose]
    moved = predict_displacements(kr240(), rows) + saw[:, None] * [1.0, -0.5, 2.0, 0, 0, 0]
    there = fit_baseline(kr240(), replace(rows, displacement=moved + rng.normal(0, 5e-6, moved.shape)))
    cycle = cycle_of(there, shared)
    assert np.ptp(rows.time) / cycle.count == pytest.approx(period, rel=0.01)
    assert cycle.choices > 1
    name = "cycle, since the unloaded reading" if shared else "cycle"
    columns = shape_of(there, "thermal-drift", None, name).columns[:, 0]
    left = saw - columns @ np.linalg.lstsq(columns, saw)[0]
    assert np.linalg.norm(left) < 0.15 * np.linalg.norm(saw - saw.mean())


def test_hours_without_readings_do_not_change_the_period() -> None:
    """Rows that were not read are no readings of zero."""
    rng = np.random.default_rng(2)
    time = 30.0 * np.arange(80)
    rows = at_random(elbow(), 80, seed=5, time=time)
    cycles = 10.6
    wave = 6e-5 * np.sin(2 * np.pi * cycles * time / time[-1])[:, None] * [1.0, 0.5, 0.5]
    read = predict_displacements(elbow(), rows) + rng.normal(0, 2e-5, (80, 6))
    read[:, :3] += wave + np.array([2e-4, -1e-4, 1.4e-4])
    read[24:60] = np.nan
    there = fit_baseline(elbow(), replace(rows, displacement=read))
    assert cycle_of(there, False).count == pytest.approx(cycles, abs=0.1)


def test_a_drift_has_begun_before_the_first_row_and_a_machine_may_grow_before_it_is_measured() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    there = nominal(elbow(), rows)
    seen = nominal(elbow(), rows_of(elbow(), rows.q, rows.wrench, position=np.ones((6, 3)), time=TIME))
    for baseline, name in ((there, "drift_begun_x"), (seen, "drift_before_x")):
        for stated in (None, {"temperature": 20.0}):  # a robot that states a drift has it under the same name
            shape = shape_of(replace(baseline, stated=stated), "thermal-drift", None, "any course")
            names = [item.name for item in shape.parameters]
            assert (shape.columns[:, 0, names.index(name)] == 1.0).all()
    shape = shape_of(replace(seen, stated={"temperature": 20.0}), "thermal-drift", None, "any course")
    assert not shape.columns[..., [item.name for item in shape.parameters].index("drift_begun_x")].any()


def test_lengths_drift_whatever_unit_they_are_written_in() -> None:
    there = nominal(kr240(), at_random(kr240(), 6, seed=1, time=TIME))
    shape = shape_of(there, "thermal-drift", None, "every length, linear and warming up within 0.3")
    found = {item.name.removesuffix("_linear") for item in shape.parameters if item.name.endswith("_linear")}
    assert found == {f"length_{name}" for name in ("f1.r", "f2.d", "f3.d", "f4.d", "f4.r", "f6.r")}


def test_a_spindle_grows_along_its_own_axis_wherever_the_arm_holds_it() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    there = nominal(elbow(), rows)
    shape = shape_of(there, "thermal-drift", None, "tool, any course")
    course = shape_of(there, "thermal-drift", None, "any course").columns[:, 0, 0]
    course = course - course[0]
    turned = rows.q.sum(axis=1)
    along = np.stack([np.cos(turned), np.sin(turned), 0 * turned], -1)
    np.testing.assert_allclose(shape.columns[:, :3, 0], course[:, None] * along, atol=1e-12)
    assert not shape.columns[:, 3:].any()


def test_a_target_that_turns_on_its_holder_moves_no_point() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "any course, target turning")
    turns = shape.columns[..., [item.name.startswith("target_turn") for item in shape.parameters]]
    assert not turns[:, :3].any()
    assert turns[:, 3:].any()
    # where no rotation is read there is nothing to see of it
    lone = at_random(elbow(), 6, seed=1, time=TIME, displacement=np.zeros((6, 3)))
    read = np.isfinite(lone.displacement)
    lone = replace(lone, displacement=np.where(read, predict_displacements(elbow(), lone), np.nan))
    shapes = EFFECTS["thermal-drift"].shapes(fit_baseline(elbow(), lone), None)
    assert not any("target" in one.name for one in shapes)


def test_a_machine_without_anything_to_fit_may_drift_as_well() -> None:
    robot = elbow(torsional="rigid")
    there = fit_baseline(robot, at_random(robot, 60, seed=1, time=np.arange(60.0)), keep=())
    assert cycle_of(there, False).count >= 2.0
    assert shape_of(there, "thermal-drift", None, "cycle").data_selected


def test_few_readings_are_no_reason_to_believe_in_a_cycle() -> None:
    for count in (4, 8, 9, 12):
        there = nominal(elbow(), at_random(elbow(), count, seed=1, time=np.arange(float(count))))
        cycle = cycle_of(there, False)
        assert cycle.choices >= 1.0
        assert cycle.count == 0.0 or cycle.count >= 2.0


@pytest.mark.parametrize("absolute", [False, True])
def test_what_a_length_drifts_by_counts_from_the_start_of_the_campaign(absolute: bool) -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    if absolute:
        rows = rows_of(elbow(), rows.q, rows.wrench, position=np.ones((6, 3)), time=TIME)
    there = nominal(elbow(), rows)
    shape = shape_of(there, "thermal-drift", None, "every length, linear and warming up within 0.3")
    names = [item.name for item in shape.parameters]
    found = shape.columns[..., names.index("length_f2.d_linear")]
    close(found, (TIME / 400)[:, None] * pose_change(there, "f2.d"))


def test_a_length_of_nothing_does_not_grow_whatever_unit_it_is_written_in() -> None:
    robot = elbow()
    first = robot.frames[0].model_copy(update={"r": "0 mm"})
    robot = robot.model_copy(update={"frames": (first, *robot.frames[1:])})
    shapes = EFFECTS["thermal-drift"].shapes(nominal(robot, at_random(robot, 6, seed=1, time=TIME)), None)
    names = {item.name for shape in shapes for item in shape.parameters}
    assert any(name.startswith("length_f2.d") for name in names)
    assert not any(name.startswith("length_f1.r") for name in names)
