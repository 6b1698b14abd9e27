"""Bodies of a machine: its nodes where the kinematics puts them, its springs those of the elements."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.fem.beam_element import beam_stiffness
from beamstiff.robot.description import Robot
from beamstiff.robot.library import robot_names
from beamstiff.robot.sections import section_properties
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.se3 import Array, displacement_transport
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.bodies import BodyTree, placed_bodies
from beamstiff.simulators.paths import machine_of
from tests.robot.machines import coupled_arm


def farthest_site(robot: Robot, tree: BodyTree) -> float:
    """Return how far a site is from its node at most, m, in several postures without any load."""
    machine = machine_of(robot)
    index = machine.kinematics.node_index
    gaps = []
    for values, nodes in zip(machine.where.values, machine.where.node_positions, strict=True):
        named = dict(zip(machine.kinematics.coupling.names, values.tolist(), strict=True))
        for body, pose in zip(tree.bodies, placed_bodies(tree.bodies, named), strict=True):
            gaps += [
                np.abs((pose @ at)[:3, 3] - nodes[index[name]]).max()
                for name, at in body.sites
                if name in index
            ]
    return float(max(gaps))


@pytest.mark.parametrize("name", robot_names())
def test_sites_are_where_the_kinematics_puts_the_nodes(name: str) -> None:
    robot = load_robot(name)
    tree = assemble(robot)
    assert {node.name for node in robot.nodes} <= {site for body in tree.bodies for site, _ in body.sites}
    assert farthest_site(robot, tree) < 1e-9


def test_coupled_variables_lead_followers() -> None:
    robot = coupled_arm()
    tree = assemble(robot)
    joints = [joint for body in tree.bodies for joint in body.joints]
    assert {joint.name for joint in joints if joint.role == "drive"} == {v.name for v in robot.actuated}
    assert any(joint.factor == 0.5 for joint in joints if joint.role == "follower")
    assert farthest_site(robot, tree) < 1e-9


def test_springs_at_the_middle_of_a_beam_are_the_beam() -> None:
    robot = load_robot("cantilever")
    (joints,) = (body.joints for body in assemble(robot).bodies if body.joints)
    K: Array = np.zeros((6, 6))
    tip = np.array(next(node.at for node in robot.nodes if node.name == robot.tcp))
    compliance = np.zeros((6, 6))
    for joint in joints:  # what a unit of each moves at the tip, times its compliance
        turn = np.zeros(6)
        turn[3 * (joint.kind == "hinge") :][:3] = joint.axis
        moved = displacement_transport(tip - joint.at) @ turn
        compliance += np.outer(moved, moved) / joint.stiffness
    (beam,) = robot.beams
    s, m = section_properties(robot.sections[beam.section]), robot.materials[beam.material]
    shear = [area or np.inf for area in (s.Ay, s.Az)]
    K = beam_stiffness(np.float64(np.linalg.norm(tip)), m.E, m.G, s.A, s.Iy, s.Iz, s.J, *shear)[6:, 6:]
    np.testing.assert_allclose(compliance @ K, np.eye(6), atol=1e-9)


def test_what_varies_with_the_posture_is_told() -> None:
    tree = assemble(load_robot("gantry"))
    assert tree.varies
    assert any("beam ram has its compliance at 0.7 m in every posture" in line for line in tree.lost)
    assert assemble(load_robot("kr240-2")).lost == ()


def test_a_start_value_that_no_load_touched_is_told_or_carried() -> None:
    robot = load_robot("kr240-2").model_copy(update={"unmeasured": ("J6.torsional",)})
    assert any("J6.torsional: their stiffness is a start value" in line for line in assemble(robot).lost)
    assert parse_urdf(robot_to_urdf(robot), "kr240.urdf").unmeasured == robot.unmeasured
