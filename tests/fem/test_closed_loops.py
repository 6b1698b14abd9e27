"""Closed-loop machines by two other ways: the Jacobian with passive joints eliminated, and multipliers.

With rigid links and springs in the drives alone, C = J diag(1/k) J^T, where J is found by differentiating
the loop equations (Gosselin, Stiffness mapping for parallel manipulators, IEEE Trans. Robotics Autom. 6
(1990) 377).
"""

import numpy as np
import pytest

from beamstiff import Robot, compile_structure, robot_names
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.constraints import has_constraints
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import Posture, twist_jacobian
from beamstiff.robot.parts import JOINT_DIRECTIONS, STIFFNESS_KINDS, Rigid
from beamstiff.robot.reader import load_robot
from beamstiff.robot.sections import section_properties
from tests.fem.builders import relative_error
from tests.fem.reference_frame import ReferenceFrame, properties_of
from tests.fem.test_batches import some_poses


def with_rigid_links(robot: Robot, drives: dict[str, float]) -> Robot:
    """Return the robot with rigid links and joints but for its drives; what is free stays free."""
    links = [Rigid(name=beam.name, nodes=beam.nodes) for beam in robot.beams]
    springs = {
        f"{joint.name}.{kind}": RIGID
        for joint in robot.joints
        for kind in STIFFNESS_KINDS
        if getattr(joint.stiffness, kind) != FREE
    }
    bare = robot.model_copy(update={"beams": (), "rigids": (*robot.rigids, *links)})
    return bare.with_parameters(springs | drives)


@pytest.mark.parametrize(
    ("name", "drives"),
    [
        ("ir663", {"J12.torsional": 1.7e6, "J18.torsional": 0.9e6}),
        ("ir663-screws", {"screw2": 3.9e7, "screw8": 2.8e7}),
        ("tripod", {"screw1": 1.2e8, "screw2": 0.7e8, "screw3": 2.0e8}),
    ],
)
def test_rigid_links_and_sprung_drives(name: str, drives: dict[str, float]) -> None:
    """A four-bar with two cranks on one axis; with slider-cranks on both; three struts and a gimbal."""
    robot = with_rigid_links(load_robot(name), drives)
    _, poses = some_poses(name, 5)
    structure = compile_structure(robot)
    assert has_constraints(structure) == (name != "tripod")
    J = twist_jacobian(structure.kinematics, poses, robot.tcp)
    expected = J @ np.diag([1 / k for k in drives.values()]) @ J.swapaxes(-1, -2)
    assert relative_error(tcp_compliance(structure, poses), expected) <= 1e-10


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
