"""The robots that come along, those with closed loops among them, by Lagrange multipliers."""

import numpy as np
import pytest

from beamstiff import Robot, compile_structure, robot_names
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.robot.reader import load_robot
from beamstiff.robot.sections import section_properties
from tests.fem.builders import relative_error
from tests.fem.reference_frame import ReferenceFrame, properties_of
from tests.fem.test_batches import some_poses


def reference(robot: Robot, poses: Posture, at: int) -> ReferenceFrame:
    """Return a robot at one of its poses as plain numbers in the base frame."""
    kinematics = compile_structure(robot).kinematics
    node, frame = kinematics.node_index, kinematics.frame_index
    turns = poses.transforms[at, :, :3, :3]
    beams = []
    for beam in robot.beams:
        section, material = section_properties(robot.sections[beam.section]), robot.materials[beam.material]
        i, j = (node[end] for end in beam.nodes)
        axis = poses.node_positions[at, j] - poses.node_positions[at, i]
        up = np.roll(axis, 1) + np.array([0.0, 0.0, 0.1])  # where any perpendicular will do
        if beam.up is not None:
            up = turns[kinematics.node_frame[i]] @ beam.up
        beams.append((i, j, properties_of(section, material), up))
    joints = [
        (
            *(node[end] for end in joint.nodes),
            turns[frame[joint.frame]] @ joint.axis,
            np.array([getattr(joint.stiffness, kind) for kind in JOINT_DIRECTIONS]),
        )
        for joint in robot.joints
    ]
    return ReferenceFrame(
        poses.node_positions[at],
        [node[name] for name in robot.fixed],
        beams,
        [tuple(node[end] for end in rigid.nodes) for rigid in robot.rigids],
        joints,
        [(*(node[end] for end in strut.nodes), strut.stiffness) for strut in robot.struts],
    )


@pytest.mark.parametrize("name", robot_names())
def test_shipped_robots_by_multipliers(name: str) -> None:
    robot = load_robot(name)
    structure, poses = some_poses(name, 3)
    C = tcp_compliance(structure, poses)
    tcp = structure.kinematics.node_index[robot.tcp]
    for at in range(3):
        other = reference(robot, poses, at)
        for load in range(6):
            loads = np.zeros((len(robot.nodes), 6))
            loads[tcp, load] = 1.0
            assert relative_error(C[at, :, load], other.displacement(loads)[tcp]) <= 1e-9
