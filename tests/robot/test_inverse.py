"""Inverse geometry, judged by the forward geometry: targets that were reached, and those that cannot be."""

import numpy as np
import pytest
from numpy.typing import NDArray

from beamstiff import BeamstiffError, Frame, Robot
from beamstiff.robot.inverse import InverseResult, inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import vector_from_rotation
from tests.robot.machines import (
    coupled_arm,
    ir663,
    kr240,
    machine,
    prismatic,
    revolute,
    screw_driven_ir663,
    slider_crank,
)

Array = NDArray[np.float64]
TOLERANCE = 1e-9


def poses(robot: Robot, q: Array, node: str = "tool") -> Array:
    """Return where a node is, (P, 4, 4)."""
    kinematics = compile_kinematics(robot)
    return pose_of(kinematics, posture(kinematics, q), node)


def errors(robot: Robot, result: InverseResult, targets: Array, node: str = "tool") -> tuple[Array, Array]:
    """Return position and rotation errors of what was found, by forward geometry."""
    at = poses(robot, result.q, node)
    turn = targets[:, :3, :3] @ np.swapaxes(at[:, :3, :3], 1, 2)
    return np.linalg.norm(at[:, :3, 3] - targets[:, :3, 3], axis=1), np.linalg.norm(
        vector_from_rotation(turn), axis=1
    )


def test_a_six_axis_robot_reaches_where_it_can_go() -> None:
    limit = np.radians(170)
    robot = kr240((-limit, limit))
    targets = poses(robot, np.random.default_rng(0).uniform(-limit, limit, (300, 6)))
    result = inverse_geometry(compile_kinematics(robot), targets)
    assert result.reached.all()
    position, rotation = errors(robot, result, targets)
    assert position.max() < TOLERANCE
    assert rotation.max() < TOLERANCE
    assert np.abs(position - result.position_error).max() < 1e-12
    assert np.abs(rotation - result.rotation_error).max() < 1e-12
    assert (np.abs(result.q) <= limit).all()


def test_the_solution_near_the_start_is_found() -> None:
    robot = kr240()
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 6))
    q[:, 4] = np.where(np.abs(q[:, 4]) < 0.3, 0.5, q[:, 4])  # away from the wrist's singularity
    q[:, 2] = np.where(np.abs(q[:, 2] + np.pi / 2) < 0.3, 0.0, q[:, 2])  # and from the stretched arm
    near = q + np.random.default_rng(2).uniform(-0.01, 0.01, q.shape)
    result = inverse_geometry(compile_kinematics(robot), poses(robot, q), start=near)
    assert result.reached.all()
    assert np.median(np.abs(result.q - q).max(axis=1)) < 1e-8


def test_positions_alone_leave_the_rest_free() -> None:
    robot = kr240((-3.0, 3.0))
    targets = poses(robot, np.random.default_rng(3).uniform(-3, 3, (300, 6)))[:, :3, 3]
    result = inverse_geometry(compile_kinematics(robot), targets)
    assert result.reached.all()
    assert np.linalg.norm(poses(robot, result.q)[:, :3, 3] - targets, axis=1).max() < TOLERANCE
    assert (result.rotation_error == 0).all()


def test_a_redundant_robot_reaches_within_its_limits() -> None:
    arm = kr240((-2.0, 2.0))
    robot = machine(
        [prismatic("rail", limits=(-1.0, 1.0)), *arm.variables],
        [
            Frame(name="carriage", alpha="90 deg", r="rail"),
            *(
                frame.model_copy(update={"parent": "carriage"}) if frame.name == "f1" else frame
                for frame in arm.frames
            ),
        ],
        tool=("f6", (0, 0, 0.1)),
    )
    low, high = np.array([-1.0] + [-2.0] * 6), np.array([1.0] + [2.0] * 6)
    targets = poses(robot, np.random.default_rng(4).uniform(low, high, (200, 7)))
    result = inverse_geometry(compile_kinematics(robot), targets)
    assert result.reached.all()
    assert max(map(np.max, errors(robot, result, targets))) < TOLERANCE
    assert ((low <= result.q) & (result.q <= high)).all()


@pytest.mark.parametrize(
    ("robot", "low", "high"),
    [
        (ir663(), [-2.0, -0.6, 0.4], [2.0, 0.8, 1.2]),
        (screw_driven_ir663(), [0.75, 0.76], [1.05, 0.94]),
        (slider_crank(), [0.62], [1.18]),
        (coupled_arm(), [-1.0, -1.0, -1.0, -0.2], [1.0, 1.0, 1.0, 0.2]),
    ],
    ids=["four-bar", "three loops", "slider-crank", "coupled"],
)
def test_robots_with_loops_and_couplings_reach(robot: Robot, low: list[float], high: list[float]) -> None:
    targets = poses(robot, np.random.default_rng(5).uniform(low, high, (100, len(low))))
    result = inverse_geometry(compile_kinematics(robot), targets)
    assert result.reached.all()
    assert max(map(np.max, errors(robot, result, targets))) < TOLERANCE


def test_out_of_reach_is_told_with_the_distance_that_remains() -> None:
    """A planar arm of two links of 1 m: it falls short by the distance less 2 m."""
    robot = machine(
        [revolute("q1"), revolute("q2")],
        [Frame(name="f1", theta="q1"), Frame(name="f2", parent="f1", d=1.0, theta="q2")],
        tool=("f2", (1, 0, 0)),
    )
    targets = np.array([[1.2, 0.5, 0.0], [3.0, 0.0, 0.0], [0.0, -2.5, 0.0], [1.0, 0.0, 0.3]])
    result = inverse_geometry(compile_kinematics(robot), targets, restarts=12)
    assert result.reached.tolist() == [True, False, False, False]
    assert result.position_error == pytest.approx([0.0, 1.0, 0.5, 0.3], abs=1e-6)


def test_limits_can_put_a_target_out_of_reach() -> None:
    robot = machine(
        [revolute("q1", limits=(-0.5, 0.5))], [Frame(name="f1", theta="q1")], tool=("f1", (2, 0, 0))
    )
    result = inverse_geometry(
        compile_kinematics(robot), 2 * np.array([[np.cos(0.4), np.sin(0.4), 0], [0, 1, 0]])
    )
    assert result.reached.tolist() == [True, False]
    assert result.q[:, 0] == pytest.approx([0.4, 0.5], abs=1e-9)
    assert result.position_error[1] == pytest.approx(4 * np.sin((np.pi / 2 - 0.5) / 2), rel=1e-9)


def test_a_rotation_that_cannot_be_had_is_told() -> None:
    # a planar arm asked to lean out of its plane
    robot = machine([revolute("q1")], [Frame(name="f1", theta="q1")], tool=("f1", (2, 0, 0)))
    target = np.eye(4)
    target[:3, :3] = [[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]]
    target[0, 3] = 2.0
    result = inverse_geometry(compile_kinematics(robot), target, restarts=12)
    assert result.reached.tolist() == [False]
    assert result.rotation_error == pytest.approx([0.2], abs=1e-6)


def test_the_same_seed_gives_the_same_answer_alone_or_in_company() -> None:
    robot = kr240((-3.0, 3.0))
    kinematics = compile_kinematics(robot)
    targets = poses(robot, np.random.default_rng(7).uniform(-3, 3, (10, 6)))
    together = inverse_geometry(kinematics, targets, seed=3).q
    assert (together == inverse_geometry(kinematics, targets, seed=3).q).all()
    for pose in range(10):
        alone = inverse_geometry(kinematics, targets[pose], seed=3)
        assert np.abs(alone.q[0] - together[pose]).max() < 1e-6


def test_other_nodes_can_be_brought_to_targets() -> None:
    robot = ir663()
    targets = poses(robot, np.array([[0.3, 0.2, 0.8]]), node="p10")
    result = inverse_geometry(compile_kinematics(robot), targets, node="p10")
    assert result.reached.all()
    assert max(map(np.max, errors(robot, result, targets, node="p10"))) < TOLERANCE


@pytest.mark.parametrize(
    ("targets", "message"),
    [
        ([[1.0, 2.0]], r"found shape \(1, 2\), expected \(P, 4, 4\) transforms or \(P, 3\) positions"),
        ([[np.nan, 0.0, 0.0]], "found values that are not finite"),
        ("home", "found 'home', expected numbers"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "pose 0 is no rigid transform"),
        (np.diag([2.0, 1.0, 1.0, 1.0]), "pose 0 is no rigid transform"),
        (np.stack([np.eye(4), np.ones((4, 4))]), "pose 1 is no rigid transform"),
    ],
)
def test_targets_that_are_none(targets: object, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        inverse_geometry(compile_kinematics(kr240()), targets)


def test_starts_that_do_not_fit_the_targets() -> None:
    with pytest.raises(BeamstiffError, match="found 2 starts for 3 targets, expected one or as many"):
        inverse_geometry(compile_kinematics(kr240()), np.ones((3, 3)), start=np.zeros((2, 6)))


def test_no_targets_no_answers() -> None:
    result = inverse_geometry(compile_kinematics(kr240()), np.zeros((0, 3)))
    assert result.q.shape == (0, 6)
    assert result.reached.shape == (0,)


def test_a_robot_that_cannot_move_reaches_where_it_is() -> None:
    robot = machine([], [], tool=("base", (1, 2, 3)))
    result = inverse_geometry(compile_kinematics(robot), [[1, 2, 3], [1, 2, 4]])
    assert result.reached.tolist() == [True, False]
    assert result.position_error.tolist() == [0.0, 1.0]
