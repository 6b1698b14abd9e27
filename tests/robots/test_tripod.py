"""The tripod against geometry written down afresh: lengths from the platform's pose, stiffness from rates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.se3 import Array
from tests.robots.machine import at, compliance, corners, inside, limits, nothing_gives_but, point, values

ROBOT = load_robot("tripod")
AROUND = np.radians([90.0, 210.0, 330.0])
CIRCLE = np.stack([np.cos(AROUND), np.sin(AROUND), np.zeros(3)], axis=1)
SCREW = 1.2e8


def lengths(a: Array, b: Array, depth: Array) -> Array:
    """Return the struts' lengths (P, 3) for tilts of the tube and the platform's depth under the gimbal."""
    turn = Rotation.from_euler("XY", np.stack([a, b], axis=1))
    below = 0.250 * CIRCLE[None] - depth[:, None, None] * np.array([0.0, 0.0, 1.0])
    joints = np.einsum("pij,pkj->pki", turn.as_matrix(), below)
    return np.linalg.norm(joints - 0.550 * CIRCLE, axis=2)


def test_the_platforms_pose_is_that_from_which_the_lengths_were_taken() -> None:
    random = np.random.default_rng(0)
    pose = np.stack(
        [random.uniform(-0.2, 0.2, 500), random.uniform(-0.2, 0.2, 500), random.uniform(1.15, 1.3, 500)]
    )
    found = at(ROBOT, lengths(*pose))
    for name, expected in zip(("tilt_x", "tilt_y", "depth"), pose, strict=True):
        assert np.abs(values(found, name) - expected).max() < 1e-12


def test_the_tool_leans_up_to_22_degrees_in_the_corners() -> None:
    structure, posture = at(ROBOT, corners(ROBOT))
    tube = posture.transforms[:, structure.kinematics.frame_index["platform"], :3, 2]
    assert np.degrees(np.arccos(tube[:, 2])).max() == pytest.approx(22.4, abs=0.1)


def test_inverse_geometry_finds_the_lengths() -> None:
    r = inside(ROBOT, 40, seed=3)
    posed = at(ROBOT, r)
    found = inverse_geometry(posed[0].kinematics, point(posed, "tool"), seed=0)
    assert found.reached.all()
    assert found.q == pytest.approx(r, abs=1e-8)


def test_struts_alone_answer_by_the_rates_of_their_lengths() -> None:
    # C = sum_i t_i t_i^T / k, t_i how the tool moves as strut i grows: by differences of the closed geometry
    r = inside(ROBOT, 10)
    found = compliance(nothing_gives_but(ROBOT, dict.fromkeys(("screw1", "screw2", "screw3"), SCREW)), r)
    step = 1e-5
    expected = np.zeros((10, 3, 3))
    for strut in range(3):
        change = step * np.eye(3)[strut]
        moved = (point(at(ROBOT, r + change), "tool") - point(at(ROBOT, r - change), "tool")) / (2 * step)
        expected += moved[:, :, None] * moved[:, None, :] / SCREW
    assert np.abs(found[:, :3, :3] - expected).max() < 1e-8 * np.abs(expected).max()


def test_straight_down_three_leaning_struts_share_a_vertical_load() -> None:
    depth = np.array([1.15, 1.25])
    r = lengths(np.zeros(2), np.zeros(2), depth)
    found = compliance(nothing_gives_but(ROBOT, dict.fromkeys(("screw1", "screw2", "screw3"), SCREW)), r)
    cosine = depth / np.hypot(depth, 0.550 - 0.250)
    assert found[:, 2, 2] == pytest.approx(1 / (3 * SCREW * cosine**2), rel=1e-10)


def test_from_the_middle_the_machine_looks_the_same_from_three_sides() -> None:
    # but for the gimbal, which tells x from y
    kinds = [f"{joint}.{kind}" for joint in ("G1", "G2") for kind in ("axial", "radial", "tilting")]
    C = compliance(ROBOT.with_parameters(dict.fromkeys(kinds, np.inf)), limits(ROBOT).mean(axis=1))[0]
    third = np.kron(np.eye(2), Rotation.from_euler("z", 120, degrees=True).as_matrix())
    assert np.abs(third @ C @ third.T - C).max() < 1e-10 * np.abs(C).max()


def test_it_does_not_turn_about_its_tube_without_bending_something() -> None:
    C = compliance(ROBOT, inside(ROBOT, 50))
    assert (C[:, 5, 5] > 0.0).all()
    assert (C[:, 5, 5] < 1e-5).all()
