"""Absolute positions of a rigid model: what the dead weight shows is found, what is hidden is said."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

UR10 = Path(__file__).resolve().parents[2] / "examples" / "data" / "ur10.yaml"
COMPLIANCE = 8e-6  # rad/(N m)
NOISE = 3e-5


def measured(robot: Robot, joint: int | None) -> Measurements:
    """Return 80 positions of the tool; a joint gives way under the weight behind it, by plain statics."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.5, 2.5, (80, 6))
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((80, 3)))
    position = nominal_pose(robot, rows)[0]
    if joint is not None:
        position = position + COMPLIANCE * moved(robot, q, joint, position)
    position = position + NOISE * rng.standard_normal(position.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=NOISE)


def moved(robot: Robot, q: Array, joint: int, tool: Array) -> Array:
    """Return what the tool moves by per unit compliance about a joint's axis, (N, 3)."""
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, q)
    frames = where.transforms[:, [kinematics.frame_index[f"f{k}"] for k in range(1, 7)]]
    axis, origin = frames[:, joint - 1, :3, 2], frames[:, joint - 1, :3, 3]
    torque = np.zeros(len(q))
    for mass in robot.masses:
        node = next(item for item in robot.nodes if item.name == mass.node)
        at = frames[:, int(node.frame[1]) - 1]
        if int(node.frame[1]) >= joint:
            centre = at[:, :3, 3] + at[:, :3, :3] @ (np.array(node.at) + np.array(mass.at))
            weight = mass.mass * np.array(robot.gravity)
            torque += np.einsum("ni,ni->n", axis, np.cross(centre - origin, weight))
    return torque[:, None] * np.cross(axis, tool - origin)


@pytest.fixture(scope="module")
def told() -> dict[int | None, Diagnosis]:
    robot = load_robot(UR10)
    return {joint: diagnose(robot, measured(robot, joint)) for joint in (None, 2, 3)}


def test_a_rigid_robot_that_does_not_give_way_is_in_order(told: dict[int | None, Diagnosis]) -> None:
    assert told[None].verdict.effect == "none"


@pytest.mark.parametrize("joint", [2, 3])
def test_a_joint_that_gives_way_under_its_own_weight_is_named(
    told: dict[int | None, Diagnosis], joint: int
) -> None:
    found = told[joint]
    assert found.verdict.key == f"joint-compliance:q{joint}"
    [compliance] = found.verdict.estimates
    assert compliance.value == pytest.approx(COMPLIANCE, rel=0.05)
    assert found.verdict.shrink is not None
    assert found.verdict.shrink.shrink > 0.95


def test_what_rigid_joints_without_loads_cannot_show_is_said(told: dict[int | None, Diagnosis]) -> None:
    hidden = {one.effect: one.why for one in told[2].untestable}
    for effect in ("backlash", "hardening", "hysteresis", "actuator-lever", "gravity-compensator"):
        assert hidden[effect] == "all joints are rigid about their axes: add a stiffness to the robot file"
    assert hidden["load-error"] == "no row carries a load: measure with one"
    assert "no row carries a load: only compliance under the dead weight can show" in told[2].notes


def test_a_robot_without_masses_is_told_that_its_sag_looks_like_something_else() -> None:
    robot = load_robot(UR10)
    bare = robot.model_copy(update={"masses": (), "payload": None})
    found = diagnose(bare, measured(robot, 2))
    assert found.verdict.effect != "joint-compliance"
    assert sum("give it `masses`" in note for note in found.notes) == 1
