from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.robot.parts import AddedEffect
from tests.diagnosis.machines import arm_at, at_random, close, kr240, nominal, rows_of, shape_of, unexplained

SMALL = 1e-6


@pytest.mark.parametrize("axis", range(3))
def test_displacements_seen_in_a_turned_frame(axis: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    turn = Rotation.from_rotvec(SMALL * np.eye(3)[axis])
    d, r = np.split(there.predicted, 2, axis=1)
    seen = np.concatenate([turn.apply(d), turn.apply(r)], axis=1)
    columns = shape_of(there, "frame-misalignment", None, "turned").columns[..., axis]
    close(columns, (seen - there.predicted) / SMALL, 1e-5)


def test_displacements_seen_in_another_scale() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    columns = shape_of(there, "frame-misalignment", None, "turned and scaled").columns[..., 3]
    close(columns, there.predicted * [1, 1, 1, 0, 0, 0])  # angles have none


def test_displacements_seen_along_axes_that_are_not_square() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    shape = shape_of(there, "frame-misalignment", None, "turned, scaled by axis and skewed")
    x, y, _ = there.predicted[:, :3].T
    at = [item.name for item in shape.parameters].index("skew_xy")
    close(shape.columns[..., at], np.stack([y, x, *4 * [0 * x]], axis=1))
    at = [item.name for item in shape.parameters].index("scale_y")
    close(shape.columns[..., at], np.stack([0 * y, y, *4 * [0 * y]], axis=1))


@pytest.mark.parametrize("at", range(7))
def test_absolute_poses_seen_in_a_frame_turned_shifted_or_scaled(at: int) -> None:
    q = at_random(kr240(), 8, seed=2).q
    arm = arm_at(q)
    vector = Rotation.from_matrix(arm.tool).as_rotvec()
    rows = rows_of(kr240(), q, np.zeros((8, 6)), position=arm.tip, rotation=vector)
    there = fit_baseline(kr240(), rows)
    np.testing.assert_allclose(there.measured, 0, atol=1e-12)
    turn = Rotation.from_rotvec(SMALL * np.eye(7)[at, :3])
    position = turn.apply(arm.tip) * (1 + SMALL * (at == 6)) + SMALL * np.eye(7)[at, 3:6]
    seen = replace(rows, position=position, rotation=(turn * Rotation.from_matrix(arm.tool)).as_rotvec())
    expected = fit_baseline(kr240(), seen).measured / SMALL
    shape = ("turned", "turned and shifted", "scaled")[0 if at < 3 else 1 if at < 6 else 2]
    columns = shape_of(there, "frame-misalignment", None, shape).columns[..., at if at < 6 else 0]
    close(columns, expected, 1e-5, least=1e-9)


def test_a_tracker_whose_angles_and_lengths_have_other_scales_errs_by_where_it_looks() -> None:
    there = nominal(kr240(), at_random(kr240(), 60, seed=1))
    place, moved = arm_at(there.rows.q).tip, there.predicted[:, :3]
    to = place - np.array([6.0, -4.0, 1.5])  # from a stand some metres away
    along = to / np.linalg.norm(to, axis=1, keepdims=True)
    error = np.concatenate([along * (along * moved).sum(axis=1, keepdims=True), 0 * moved], axis=1)

    def left(name: str) -> float:
        return unexplained(error, shape_of(there, "frame-misalignment", None, name).columns)

    assert left("turned, scaled by axis and skewed") > 0.1
    assert left("other scales and turns elsewhere") < 0.05
    assert left("other scales and turns elsewhere, by the square of the way") < 0.01


@pytest.mark.parametrize("degree", [3, 4])
def test_a_displacement_is_the_difference_of_two_places_that_are_read_in_a_bent_space(degree: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 60, seed=1))
    place, moved = arm_at(there.rows.q).tip, there.predicted[:, :3]
    stand = np.array([4.0, -3.0, 1.0])

    def read(at: np.ndarray) -> np.ndarray:  # a lens: what is farther from its axis is seen farther still
        x, y, z = (at - stand).T
        return stand + np.stack([x, y * (1 + 0.002 * (y**2 + z**2)), z * (1 + 0.002 * (y**2 + z**2))], -1)

    step = 1e-4 / np.abs(moved).max()
    error = (read(place + step * moved) - read(place - step * moved)) / (2 * step) - moved
    name = f"places read in a bent space, of degree {degree}"
    columns = shape_of(there, "frame-misalignment", None, name).columns
    assert not columns[:, 3:, 3:].any()
    assert unexplained(error, columns[:, :3, 3:]) < 1e-6


@pytest.mark.parametrize("axis", range(3))
def test_what_reads_rotations_beside_such_a_tracker_is_turned_by_itself(axis: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    turned = Rotation.from_rotvec(SMALL * np.eye(3)[axis]).apply(there.predicted[:, 3:])
    change = (turned - there.predicted[:, 3:]) / SMALL
    columns = shape_of(there, "frame-misalignment", None, "other scales and turns elsewhere").columns
    close(columns[..., axis], np.concatenate([0.0 * change, change], axis=1), 1e-5)


def in_steps(poses: int, kind: str = "displacement") -> Baseline:
    """Return four readings in each of some postures of the KR240-2, one posture after another."""
    q = np.repeat(at_random(kr240(), poses, seed=6).q, 4, axis=0)
    wrench = at_random(kr240(), len(q), seed=7).wrench
    pose = np.repeat(np.arange(poses), 4)
    more: dict[str, Any] = {"pose": pose}
    if kind == "absolute":
        arm = arm_at(q)
        turned = Rotation.from_matrix(arm.tool).as_rotvec()
        more |= {"position": arm.tip, "rotation": turned}
    return nominal(kr240(), rows_of(kr240(), q, wrench, **more))


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
def test_a_frame_that_was_moved_reads_otherwise_after_that(kind: str) -> None:
    there = in_steps(10, kind)
    turn = Rotation.from_rotvec([0.0, 0.0, 3e-4])
    d, r = np.split(there.predicted, 2, axis=1)
    seen = np.concatenate([turn.apply(d), turn.apply(r)], axis=1)
    if kind == "absolute":
        tip = arm_at(there.rows.q).tip
        seen = there.predicted + np.concatenate(
            [turn.apply(tip) - tip, np.tile(turn.as_rotvec(), (40, 1))], 1
        )
    first = np.arange(40) < 24
    measured = np.where(first[:, None], there.predicted, seen)
    noise = 1e-8 * np.random.default_rng(8).standard_normal(measured.shape)
    moved = replace(there, measured=measured + noise)
    name = "turned, then moved" if kind == "displacement" else "turned and shifted, then moved"
    shape = shape_of(moved, "frame-misalignment", None, name)
    at = [item.name for item in shape.parameters].index("rotation_z_later")
    close(3e-4 * shape.columns[..., at], measured - there.predicted, 1e-3, least=1e-9)
    assert shape.data_selected
    # a robot states the moment, for the same rows again
    scales = EFFECTS["frame-misalignment"].scales(moved, None)
    assert 23 / 39 < scales["moved_at"] < 24 / 39
    again = replace(there, stated=scales)
    close(shape_of(again, "frame-misalignment", None, name).columns, shape.columns)
    # what is measured another day is measured in the frame of after it
    today = replace(nominal(kr240(), subset(there.rows, np.arange(10))), stated=scales)
    found = shape_of(today, "frame-misalignment", None, name).columns
    own = len(shape.parameters) // 2
    close(found[..., own:], found[..., :own])
    # no other shape counts against it
    shapes = EFFECTS["frame-misalignment"].shapes(moved, None)
    assert [one.name for one in shapes if one.against is None] == [name]


def test_of_rows_that_were_timed_the_time_says_what_was_before_and_after() -> None:
    scales = {"moved_at": 0.5, "start": 60.0, "duration": 100.0, "rows": 40.0}
    there = in_steps(2)
    timed = replace(there.rows, time=np.array([70.0, 80, 90, 100, 115, 120, 130, 900]))
    again = replace(there, rows=timed, stated=scales)
    shape = shape_of(again, "frame-misalignment", None, "turned, then moved")
    assert shape.columns[..., 3:].any(axis=(1, 2)).tolist() == 4 * [False] + 4 * [True]


def test_a_frame_that_is_moved_between_two_tables_is_found_though_each_starts_its_clock() -> None:
    there = in_steps(8)
    run, time = np.repeat([0, 1], 16), np.tile(60.0 * np.arange(16), 2)
    rows = replace(there.rows, run=run, time=time, sources=("a.csv", "b.csv"))
    turn = Rotation.from_rotvec([0.0, 0.0, 3e-4])
    d, r = np.split(there.predicted, 2, axis=1)
    seen = np.where(
        run[:, None] == 0, there.predicted, np.concatenate([turn.apply(d), turn.apply(r)], axis=1)
    )
    noise = 1e-8 * np.random.default_rng(8).standard_normal(seen.shape)
    moved = replace(there, rows=rows, measured=seen + noise)
    shape = shape_of(moved, "frame-misalignment", None, "turned, then moved")
    assert shape.columns[..., 3:].any(axis=(1, 2)).tolist() == 16 * [False] + 16 * [True]


def test_a_moment_that_is_not_stated_is_asked_for() -> None:
    turned = {"rotation_z_later": "1 mrad"}
    added = AddedEffect(effect="frame-misalignment", shape="turned, then moved", parameters=turned)
    robot = kr240().model_copy(update={"effects": (added,)})
    with pytest.raises(BeamstiffError, match="scales: moved_at, start, duration, rows missing"):
        effects_displacement(robot, in_steps(2).rows)


def test_a_frame_is_moved_between_postures_and_not_at_the_ends() -> None:
    def names(pose: list[int]) -> list[str]:
        there = in_steps(10)
        rows = replace(there.rows, pose=np.array(pose))
        noise = np.random.default_rng(9).standard_normal(there.measured.shape)
        seen = replace(there, rows=rows, measured=there.predicted + 1e-5 * noise)
        return [one.name for one in EFFECTS["frame-misalignment"].shapes(seen, None)]

    assert "turned, then moved" in names(20 * [0] + 20 * [1])
    assert "turned, then moved" not in names(40 * [0])
    assert "turned, then moved" not in names(4 * [0] + 32 * [1] + 4 * [2])


def test_a_frame_that_is_set_up_again_is_turned_another_way_in_every_posture() -> None:
    there = in_steps(5)
    turns = Rotation.from_rotvec(np.repeat(np.random.default_rng(10).uniform(-1e-6, 1e-6, (5, 3)), 4, axis=0))
    d, r = np.split(there.predicted, 2, axis=1)
    off = np.concatenate([turns.apply(d), turns.apply(r)], axis=1) - there.predicted
    shape = shape_of(there, "frame-misalignment", None, "turned, another way in every posture")
    assert unexplained(off, shape.columns) < 1e-5
    assert [item.posture_specific for item in shape.parameters] == 3 * [False] + 15 * [True]


def test_absolute_positions_along_axes_of_other_scales_and_not_square() -> None:
    there = in_steps(6, "absolute")
    shape = shape_of(there, "frame-misalignment", None, "turned, shifted, scaled by axis and skewed")
    x, y, _ = arm_at(there.rows.q).tip.T
    at = [item.name for item in shape.parameters].index("skew_xy")
    close(shape.columns[..., at], np.stack([y, x, *4 * [0 * x]], axis=1), 1e-9, least=1e-9)
