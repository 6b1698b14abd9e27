"""Stewart platform, delta, five-bar and palletizer against their geometry written down afresh."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import load_robot
from beamstiff.se3 import Array
from tests.robots.machine import at, compliance, inside, limits, nothing_gives_but, point

POSES = 50


def wrenches(points: Array, ways: Array) -> Array:
    """Return the unit wrenches (P, L, 6) of legs along ways (P, L, 3) that act at points from the tool."""
    unit = ways / np.linalg.norm(ways, axis=2, keepdims=True)
    return np.concatenate([unit, np.cross(points, unit)], axis=2)


def around(degrees: Array, radius: float) -> Array:
    angle = np.radians(degrees)
    return radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


def relative(found: Array, expected: Array) -> float:
    return float((np.abs(found - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))).max())


def stewart_poses() -> tuple[Array, Array, Array, Array]:
    """Return the tool's places (P, 3), the joints of the platform from it (P, 6, 3), legs and lengths."""
    feet = around(np.array([-8, 8, 112, 128, 232, 248.0]), 0.600)
    heads = around(np.array([-52, 52, 68, 172, 188, 292.0]), 0.350) - [0.0, 0.0, 0.150]
    random = np.random.default_rng(0)
    turned = Rotation.from_rotvec(random.uniform(-0.05, 0.05, (POSES, 3))).as_matrix()
    tool = random.uniform([-0.03, -0.03, 0.91], [0.03, 0.03, 0.93], (POSES, 3))
    arms = np.einsum("pij,lj->pli", turned, heads)
    legs = tool[:, None] + arms - feet
    return tool, arms, legs, np.linalg.norm(legs, axis=2)


def test_the_stewart_platform_stands_where_its_legs_lengths_were_taken() -> None:
    tool, arms, _, lengths = stewart_poses()
    robot = load_robot("stewart")
    low, high = limits(robot).T
    assert ((lengths > low) & (lengths < high)).all()
    posed = at(robot, lengths)
    assert np.abs(point(posed, "tool") - tool).max() < 1e-11
    for leg in range(6):
        assert np.abs(point(posed, f"p{leg + 1}") - tool - arms[:, leg]).max() < 1e-11


def stewart_error() -> float:
    """Return how far compliances are from ``J k^-1 J^T`` of the legs at 50 postures, relative."""
    _, arms, legs, lengths = stewart_poses()
    to_lengths = wrenches(arms, legs)  # K = J^-T k J^-1, the rows of J^-1 being the legs' wrenches
    jacobian = np.linalg.inv(to_lengths)
    expected = jacobian @ jacobian.swapaxes(1, 2) / 6e7
    return relative(compliance(load_robot("stewart"), lengths), expected)


def test_the_stewart_platform_gives_way_as_its_legs_do() -> None:
    assert stewart_error() < 1e-10


def delta_poses() -> tuple[Array, Array, Array, Array, Array]:
    """Return q (P, 3), tool (P, 3), rods (P, 3, 3), and elbows with their rates by q (P, 3, 3) each."""
    random = np.random.default_rng(1)
    centre = random.uniform([-0.2, -0.2, -0.90], [0.2, 0.2, -0.70], (POSES, 3))
    out = around(np.array([0, 120, 240.0]), 1.0)
    # in the arm's plane: from the hip to the foot of the platform's joint on that plane
    joint = centre[:, None] + 0.045 * out
    ahead = (joint * out).sum(axis=2) - 0.200
    aside = np.cross(out, joint)[..., 2]
    down = -joint[..., 2]
    reach = np.hypot(ahead, down)
    inner = np.arccos((0.350**2 + reach**2 - (0.800**2 - aside**2)) / (2 * 0.350 * reach))
    q = np.arctan2(down, ahead) - inner  # the elbow outwards
    up = np.array([0.0, 0.0, 1.0])
    arm = np.cos(q)[..., None] * out - np.sin(q)[..., None] * up
    rate = -np.sin(q)[..., None] * out - np.cos(q)[..., None] * up
    elbow = 0.200 * out + 0.350 * arm
    return q, centre - 0.060 * up, joint - elbow, elbow, 0.350 * rate


def test_the_delta_hangs_where_its_spheres_meet() -> None:
    q, tool, rods, elbow, _ = delta_poses()
    assert np.abs(np.linalg.norm(rods, axis=2) - 0.800).max() < 1e-12
    robot = load_robot("delta")
    low, high = limits(robot).T
    assert ((q > low) & (q < high)).all()
    posed = at(robot, q)
    assert np.abs(point(posed, "tool") - tool).max() < 1e-11
    for leg in (1, 2, 3):
        middle = 0.5 * (point(posed, f"e{leg}a") + point(posed, f"e{leg}b"))
        assert np.abs(middle - elbow[:, leg - 1]).max() < 1e-12


def delta_errors() -> tuple[float, float, float]:
    """Return how far compliances are from closed forms at 50 postures, relative: elastic rods, rigid ones.

    The last is that of ``J k^-1 J^T`` with the Jacobian of the three drives alone.
    """
    q, tool, rods, elbow, rate = delta_poses()
    across = np.cross([0.0, 0.0, 1.0], around(np.array([0, 120, 240.0]), 0.050))
    ways = np.repeat(rods, 2, axis=1)
    ends = np.repeat(elbow + rods, 2, axis=1) + np.stack([across, -across], axis=1).reshape(6, 3)
    to_lengths = wrenches(ends - tool[:, None], ways)
    # a rod is shortened by what its elbow moves along it
    unit = ways / 0.800
    along = (unit * np.repeat(rate, 2, axis=1)).sum(axis=2)
    drives = along[:, :, None] * np.repeat(np.eye(3), 2, axis=0)
    robot = load_robot("delta")
    errors = []
    for rod in (4e6, np.inf):
        given = np.eye(6) / rod + drives @ drives.swapaxes(1, 2) / 8e4
        jacobian = np.linalg.inv(to_lengths)
        expected = jacobian @ given @ jacobian.swapaxes(1, 2)
        names = [f"rod{leg}{side}" for leg in (1, 2, 3) for side in "ab"]
        found = compliance(robot.with_parameters(dict.fromkeys(names, rod)), q)
        errors.append(relative(found, expected))
    three = np.linalg.solve(rods, (rods * rate).sum(axis=2)[:, :, None] * np.eye(3))
    alone = np.zeros_like(found)
    alone[:, :3, :3] = three @ three.swapaxes(1, 2) / 8e4
    return errors[0], errors[1], relative(found, alone)


def test_the_delta_gives_way_as_its_drives_and_rods_do() -> None:
    assert max(delta_errors()) < 1e-10


def test_the_five_bars_tool_is_where_circles_about_its_elbows_cut() -> None:
    robot = load_robot("five-bar")
    for name, side in (("-", 1), ("+", -1)):
        q = inside(robot, POSES, seed=4)
        left, right = (
            np.stack([foot + 0.250 * np.cos(angle), 0.250 * np.sin(angle)], axis=1)
            for foot, angle in zip((-0.100, 0.100), q.T, strict=True)
        )
        half = 0.5 * (right - left)
        apart = np.linalg.norm(half, axis=1, keepdims=True)
        normal = np.stack([-half[:, 1], half[:, 0]], axis=1) / apart
        tool = left + half + side * np.sqrt(0.300**2 - apart**2) * normal
        found = point(at(robot.model_copy(update={"assembly": name}), q), "tool")
        assert np.abs(found[:, :2] - tool).max() < 1e-12
        assert np.abs(found[:, 2]).max() == 0.0


def test_the_palletizers_flange_stays_level_and_its_forearm_does_not_follow_the_upper_arm() -> None:
    robot = load_robot("palletizer")
    q = inside(robot, POSES, seed=5)
    posed = at(robot, q)
    out = 0.300 + 1.300 * np.sin(q[:, 1]) + 1.350 * np.cos(q[:, 2]) + 0.250
    up = 0.800 + 1.300 * np.cos(q[:, 1]) - 1.350 * np.sin(q[:, 2]) - 0.250
    tool = np.stack([out * np.cos(q[:, 0]), out * np.sin(q[:, 0]), up], axis=1)
    assert np.abs(point(posed, "flange") - tool).max() < 1e-11
    structure, posture = posed
    turn = posture.transforms[:, structure.kinematics.frame_index["f4"], :3, :3]
    # z down; x leads along the arm, turned by q1 from above and by q4 from below
    assert np.abs(turn[:, :, 2] - [0.0, 0.0, -1.0]).max() < 1e-11
    heading = q[:, 0] - q[:, 3]
    assert np.abs(turn[:, :2, 0] - np.stack([np.cos(heading), np.sin(heading)], axis=1)).max() < 1e-11


def test_the_palletizers_drives_answer_by_its_jacobian() -> None:
    robot = load_robot("palletizer")
    drives = {"J1.torsional": 1.5e7, "J2.torsional": 6e6, "J3.torsional": 6e6, "J4.torsional": 3e5}
    q = inside(robot, POSES, seed=6)
    q[:, 0] = 0.0
    out = 0.300 + 1.300 * np.sin(q[:, 1]) + 1.350 * np.cos(q[:, 2]) + 0.250
    zero, one = np.zeros(POSES), np.ones(POSES)
    jacobian = np.array(
        [
            [zero, 1.300 * np.cos(q[:, 1]), -1.350 * np.sin(q[:, 2]), zero],
            [out, zero, zero, zero],
            [zero, -1.300 * np.sin(q[:, 1]), -1.350 * np.cos(q[:, 2]), zero],
            [zero, zero, zero, zero],
            [zero, zero, zero, zero],
            [one, zero, zero, -one],
        ]
    )
    jacobian = np.moveaxis(jacobian, -1, 0)
    expected = jacobian / np.array(list(drives.values())) @ jacobian.swapaxes(1, 2)
    assert relative(compliance(nothing_gives_but(robot, drives), q), expected) < 1e-10


@pytest.mark.parametrize("name", ["delta", "five-bar", "palletizer", "stewart"])
def test_other_drives_move_the_tool_otherwise(name: str) -> None:
    """No drive is idle: the columns of the Jacobian are all there."""
    robot = load_robot(name)
    q = limits(robot).mean(axis=1)
    steps = q + 0.01 * np.eye(len(q))
    posed = at(robot, np.concatenate([q[None], steps]))
    turn = posed[1].transforms[:, posed[0].kinematics.node_frame[posed[0].kinematics.node_index[robot.tcp]]]
    assert (np.abs(turn[1:] - turn[0]).max(axis=(1, 2)) > 1e-3).all()
