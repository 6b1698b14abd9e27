"""Joint values along paths: one branch, jumps told, out of reach told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.compensation.follow import JUMP, between, follow
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array

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
