"""Joint values along paths: one branch, jumps told, out of reach told."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.compensation.follow import JUMP, between, external_axes, follow, follow_path
from beamstiff.compensation.formats import path_csv
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.errors import BeamstiffError
from beamstiff.robot.frames import Kinematics
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array
from tests.arms import on_rail

KINEMATICS = compile_kinematics(load_robot("kr500"))
START = np.array([0.2, -1.2, 1.5, 0.3, 0.8, 0.1])


def poses_at(q: Array) -> Array:
    return pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.integers(2, 60))
def test_a_path_is_followed_in_the_branch_it_began_in(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    goal = START + random.uniform(-0.25, 0.25, 6)
    q = START + np.linspace(0, 1, count)[:, None] * (goal - START)
    found = follow(KINEMATICS, poses_at(q), START)
    assert found.reached.all()
    assert not found.switched.size
    np.testing.assert_allclose(found.q, q, atol=1e-7)


def test_targets_far_apart_are_walked_to() -> None:
    poses = poses_at(START[None] + [[0.0] * 6, [0.9, 0.1, -0.2, 0.0, 0.0, 0.0]])
    found = follow(KINEMATICS, poses, START)
    assert found.reached.all()
    assert not found.switched.size
    assert np.abs(found.q[1, 0] - 1.1) < 1e-6


def test_without_a_start_joints_begin_in_the_middle_of_their_ranges() -> None:
    found = follow(KINEMATICS, poses_at(START))
    np.testing.assert_allclose(found.q[0], START, atol=1e-7)


def test_what_is_out_of_reach_is_told_and_the_rest_goes_on() -> None:
    poses = np.repeat(poses_at(START), 5, axis=0)
    poses[1:4, 0, 3] += [3.0, 3.01, 3.02]
    found = follow(KINEMATICS, poses, START)
    assert found.reached.tolist() == [True, False, False, False, True]
    assert sorted(found.reasons) == [1, 2, 3]
    assert all(reason.startswith("out of reach by") for reason in found.reasons.values())
    np.testing.assert_allclose(found.q[4], START, atol=1e-7)


def test_a_joint_that_is_in_the_way_is_named() -> None:
    beyond = START.copy()
    beyond[1] = KINEMATICS.robot.actuated[1].limits[0] - 0.5
    found = follow(KINEMATICS, poses_at(beyond), START)
    assert not found.reached[0]
    assert found.reasons[0].endswith("q3 at the limit; with another orientation the TCP reaches this place")
    far = poses_at(START)
    far[:, :3, 3] *= 9.0
    assert "another orientation" not in follow(KINEMATICS, far, START).reasons[0]


def test_a_stretched_arm_is_no_reason_to_give_up() -> None:
    stretched = START.copy()
    stretched[2] = -np.arctan2(0.055, 1.025)
    found = follow(KINEMATICS, np.repeat(poses_at(stretched), 3, axis=0), START)
    assert found.reached.all()
    np.testing.assert_allclose(poses_at(found.q), poses_at(np.tile(stretched, (3, 1))), atol=4e-7)


def test_a_jump_to_another_configuration_is_told() -> None:
    # q1 on the other side of its gap: the only way there is a jump
    q = np.array([START, START])
    q[0, 0], q[1, 0] = np.radians(184.9), np.radians(186.0)  # the limit is 185
    found = follow(KINEMATICS, poses_at(q), q[0])
    assert found.reached.all()
    assert np.abs(np.diff(found.q, axis=0)).max() > JUMP
    assert found.switched.tolist() == [1]


def test_a_planar_robot_follows_positions() -> None:
    kinematics = compile_kinematics(load_robot("ir663"))
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, 0, 3], poses[:, 2, 3] = np.linspace(1.6, 1.9, 20), 1.0
    found = follow(kinematics, poses)
    assert found.reached.all()
    at = pose_of(kinematics, posture(kinematics, found.q), kinematics.robot.tcp)
    np.testing.assert_allclose(at[:, :3, 3], poses[:, :3, 3], atol=1e-9)


def test_between_two_poses() -> None:
    first, second = poses_at(START), poses_at(START + 0.3)
    way = between(first, second, np.array([0.0, 1.0]))
    np.testing.assert_allclose(way[0], first[0], atol=1e-15)
    np.testing.assert_allclose(way[1], second[0], atol=1e-14)


@pytest.mark.parametrize("count", [1, 3])
def test_a_path_of_nothing_but_unreachable_targets(count: int) -> None:
    poses = np.repeat(poses_at(START), count, axis=0)
    poses[:, :3, 3] *= 10
    found = follow(KINEMATICS, poses)
    assert not found.reached.any()
    assert len(found.reasons) == count


def rail_path(
    unit: str = "m", factor: float = 1.0, beyond: float = 0.0
) -> tuple[Kinematics, Array, ToolPath]:
    """Return a robot on a rail, joint values along a path, and its table with the rail's column."""
    kinematics = compile_kinematics(on_rail(KINEMATICS.robot))
    q = np.c_[np.linspace(-0.4, 0.8, 12), START + np.linspace(0.0, 0.2, 12)[:, None] * [1, -1, 1, 1, 1, 1]]
    poses = pose_of(kinematics, posture(kinematics, q), kinematics.robot.tcp)
    table = [f"e1 [{unit}],x,y,z,qw,qx,qy,qz"]
    for value, pose in zip(q[:, 0] + beyond, poses, strict=True):
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
        table.append(",".join(f"{one:.12g}" for one in (factor * value, *pose[:3, 3], *turn)))
    return kinematics, q, path_csv.read("\n".join(table), "seam.csv").path


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("mm", 1e3)])
def test_a_column_called_as_a_joint_is_an_external_axis(unit: str, factor: float) -> None:
    kinematics, q, path = rail_path(unit, factor)
    found = follow_path(Machine(kinematics.robot), path, path.poses, q[0] + 0.05)
    assert found.reached.all()
    np.testing.assert_allclose(found.q, q, atol=1e-6)


def test_without_that_column_the_rail_is_as_free_as_every_joint() -> None:
    kinematics, q, path = rail_path()
    found = follow_path(Machine(kinematics.robot), replace(path, columns={}), path.poses, q[0] + 0.05)
    assert found.reached.all()
    assert np.abs(found.q[:, 0] - q[:, 0]).max() > 0.01


def test_an_external_axis_beyond_its_range_is_refused_with_its_line() -> None:
    kinematics, _, path = rail_path(beyond=1.5)
    with pytest.raises(
        BeamstiffError, match=r"^seam\.csv:11: row 10: e1: found 2\.08182 m, expected -2 to 2 m"
    ):
        follow_path(Machine(kinematics.robot), path, path.poses)


def test_columns_of_joints_that_are_needed_hold_nothing() -> None:
    path = replace(rail_path()[2], columns={"q1": np.zeros(12)})
    assert np.isnan(external_axes(KINEMATICS, path)).all()


def test_an_axis_of_a_program_is_in_millimetres_and_degrees() -> None:
    kinematics, q, path = rail_path()
    program = replace(path, columns={}, external={"e1": 1e3 * q[:, 0], "e2": np.zeros(12)})
    np.testing.assert_array_equal(external_axes(kinematics, program)[:, 0], q[:, 0])
    turned = replace(path, columns={}, external={"q6": np.degrees(q[:, 6])})
    held = external_axes(kinematics, turned)
    np.testing.assert_allclose(held[:, 6], q[:, 6], rtol=1e-15)
    assert np.isnan(held[:, :6]).all()
