"""Joint values, assemblies, units and axes that cannot be those of the positions."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, diagnose
from beamstiff.errors import UnusableError
from beamstiff.measure.plausibility import doubts
from beamstiff.measure.position_plausibility import require_joints, require_scale
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import JointStiffness
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array, rotation_from_vector
from tests.arms import planar_arm

FRAME, PLACE = np.array([0.3, -0.2, 1.1]), np.array([2.0, -1.0, 0.4])  # rad, m: a tracker stands somewhere


def read(name: str, assembly: str | None = None, noise: float = 1e-4, poses: int = 12) -> Measurements:
    """Return positions of the TCP of a robot, its loops put together in one of their ways."""
    robot = load_robot(name).model_copy(update={"assembly": assembly})
    kinematics, rng = compile_kinematics(robot), np.random.default_rng(2)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * (high - low) * rng.uniform(-1.0, 1.0, (poses, len(low)))
    at = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    seen = at @ rotation_from_vector(FRAME).T + PLACE + noise * rng.standard_normal(at.shape)
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, position=seen, source="tracker.csv")


@pytest.mark.parametrize("factor", [1e3, 1e-3, 10.0])
def test_positions_in_a_wrong_unit_are_refused(factor: float) -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    require_scale(table, robot)
    wrong = replace(table, position=factor * table.position)
    with pytest.raises(
        BeamstiffError, match=r"tracker.csv: x y z: .* m apart .*: check the units; .* x \[mm\]"
    ):
        require_scale(wrong, robot)
    with pytest.raises(BeamstiffError, match="check the units"):
        diagnose(robot, wrong)


def test_joints_read_wrongly_and_rows_of_one_posture_are_no_wrong_unit() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    for column in range(6):
        q = table.q.copy()
        q[:, column] = np.pi - q[:, column]
        require_scale(replace(table, q=q), robot)
    require_scale(replace(table, position=0.0 * table.position), robot)  # to be predicted
    require_scale(replace(table, q=0.0 * table.q, position=table.position[:1] + 1e-3 * table.position), robot)


@pytest.fixture(scope="module")
def names() -> list[str]:
    return [one.name for one in every_assembly(compile_kinematics(load_robot("five-bar")))]


def test_another_assembly_that_fits_the_positions_is_named(names: list[str]) -> None:
    taken, other = names[:2]
    (note,) = (
        one for one in doubts(read("five-bar", other), load_robot("five-bar")) if "fit the loops" in one
    )
    assert note.startswith("tracker.csv: ")
    assert f"put together as {other!r}" in note
    assert f"not as {taken!r}" in note
    assert f"--assembly={other}" in note


def test_of_the_assembly_that_is_taken_nothing_is_said(names: list[str]) -> None:
    robot = load_robot("five-bar")
    assert not [one for one in doubts(read("five-bar", names[0]), robot) if "fit the loops" in one]
    meant = robot.model_copy(update={"assembly": names[1]})
    assert not [one for one in doubts(read("five-bar", names[1]), meant) if "fit the loops" in one]


def said(table: Measurements) -> list[str]:
    """Return what is said of the joint values."""
    return [one for one in doubts(table, load_robot("kr240-2")) if "the positions fit robot" in one]


@pytest.mark.parametrize(
    ("column", "wrong", "told"),
    [
        (2, lambda q: -q, "q3 reversed"),
        (1, lambda q: q + np.pi / 2, "q2 -90 deg"),
        (4, lambda q: q + np.pi, "q5 +180 deg"),
    ],
)
def test_a_joint_that_was_read_with_a_wrong_sign_or_zero_is_named(
    column: int, wrong: Callable[[Array], Array], told: str
) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, column] = wrong(q[:, column])
    (note,) = said(replace(table, q=q))
    assert note.startswith("tracker.csv: the positions fit robot 'kr240-2' with ")
    assert told in note


def test_swapped_columns_are_named() -> None:
    table = read("kr240-2")
    (note,) = said(replace(table, q=table.q[:, [0, 2, 1, 3, 4, 5]]))
    assert "q2 and q3 swapped" in note


def test_of_joints_that_were_read_right_and_of_few_postures_nothing_is_said() -> None:
    assert not said(read("kr240-2"))
    assert not said(read("kr240-2", noise=5e-3))  # a robot that wants calibration
    few = read("kr240-2", poses=5)
    assert not said(replace(few, q=few.q * [1, 1, -1, 1, 1, 1]))


def test_of_points_on_one_line_nothing_is_said() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    q = np.repeat(table.q[:1], len(table), axis=0)
    q[:, 5] = np.linspace(-2.0, 2.0, len(q))  # the tool turns where it stands
    kinematics = compile_kinematics(robot)
    at = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    assert not said(replace(table, q=q, position=at))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda q: q * [1, 1, -1, 1, 1, 1],
        lambda q: q + np.pi / 2 * np.eye(6)[1],
        lambda q: q[:, [0, 2, 1, 3, 4, 5]],
        np.degrees,
    ],
    ids=["sign", "zero", "swapped", "degrees"],
)
def test_joints_that_are_surely_read_wrongly_are_refused(wrong: Callable[[Array], Array]) -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    require_joints(table, robot)
    with pytest.raises(UnusableError, match="correct the column, or the robot file"):
        require_joints(replace(table, q=wrong(table.q)), robot)


def aside(table: Measurements, robot: Robot, place: Array) -> Measurements:
    """Return what a reflector at `place` beside the TCP, along the tool's axes, would have read; no noise."""
    kinematics = compile_kinematics(robot)
    at = pose_of(kinematics, posture(kinematics, table.q), robot.tcp)
    seen = at[:, :3, 3] + at[:, :3, :3] @ place
    return replace(table, position=seen @ rotation_from_vector(FRAME).T + PLACE)


def test_columns_are_told_where_the_place_of_the_reflector_was_guessed() -> None:
    robot = load_robot("kr240-2")
    table = aside(read("kr240-2", poses=30), robot, np.array([0.05, -0.08, 0.1]))
    require_joints(table, robot)
    with pytest.raises(UnusableError, match="with q2 and q3 swapped"):
        require_joints(replace(table, q=table.q[:, [0, 2, 1, 3, 4, 5]]), robot)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda at: at[:, [1, 0, 2]], "x y z mirrored (a left-handed frame: x and y swapped)"),
        (
            lambda at: at * [1, 1, -1],
            "(a left-handed frame: z reversed, or two of x y z swapped)",
        ),
    ],
)
def test_mirrored_positions_are_refused(wrong: Callable[[Array], Array], told: str) -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    base = (table.position - PLACE) @ rotation_from_vector(FRAME)
    require_joints(replace(table, position=base[:, [1, 2, 0]]), robot)  # axes turned are no mirror
    with pytest.raises(UnusableError, match=re.escape(told)):
        require_joints(replace(table, position=wrong(base)), robot)
    which = r"x y z mirrored \(a left-handed frame, or two of x y z swapped\)"  # in a tracker's frame, which?
    with pytest.raises(UnusableError, match=which):
        require_joints(replace(table, position=wrong(table.position)), robot)


@pytest.mark.parametrize(
    ("factor", "told"),
    [(1 / 25.4, "in inch, read in mm"), (1e-3, "in m, read in mm"), (25.4, "in mm, read in inch")],
)
@pytest.mark.parametrize("axis", [0, 2])
def test_one_axis_in_another_unit_is_named(axis: int, factor: float, told: str) -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    column = np.where(np.eye(3)[axis], factor, 1.0)
    with pytest.raises(UnusableError, match=f"with {'xyz'[axis]} {told} "):
        require_joints(replace(table, position=column * table.position), robot)


def test_one_joint_in_another_unit_is_named() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    for values, told in ((np.radians, "in radians, read in degrees"), (np.degrees, "in degrees, read in")):
        q = table.q.copy()
        q[:, 2] = values(q[:, 2])
        with pytest.raises(UnusableError, match=f"q3 {told}"):
            require_joints(replace(table, q=q), robot)


def test_joints_that_all_turn_the_other_way_are_named() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    with pytest.raises(UnusableError, match="q1, q4, q6 reversed"):
        require_joints(replace(table, q=table.q * [-1, 1, 1, -1, 1, -1]), robot)


def test_joints_of_a_robot_far_from_its_model_are_told_and_not_refused() -> None:
    rough, robot = read("kr240-2", noise=0.08), load_robot("kr240-2")
    turned = replace(rough, q=rough.q * [1, 1, -1, 1, 1, 1])
    assert said(turned)
    require_joints(turned, robot)


@pytest.mark.parametrize(("off", "asked"), [(2 * np.pi, True), (4.0, False)])
def test_a_joint_outside_its_limits_by_a_full_turn_is_asked_about(off: float, asked: bool) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, 1] += off
    (note,) = (one for one in doubts(replace(table, q=q), load_robot("kr240-2")) if "q2: " in one)
    assert note.endswith(": is it off by a full turn?") == asked


def test_a_robot_file_in_millimetres_is_blamed_itself() -> None:
    hips = (2e6, JointStiffness(torsional=5e5))
    robots = [
        planar_arm("planar", lengths, hips, "foot hub end pin tip", ("upper", "fore"))
        for lengths in ((1.2, 0.8), (1200.0, 800.0))
    ]
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 2))
    kinematics = compile_kinematics(robots[0])
    at = posture(kinematics, q).node_positions[:, kinematics.node_index["tip"]]
    table = make_measurements([one.name for one in robots[0].actuated], q, tcp="tip", position=at)
    require_scale(table, robots[0])
    with pytest.raises(UnusableError, match="check the lengths in the robot file; in a URDF they are in m"):
        require_scale(table, robots[1])
