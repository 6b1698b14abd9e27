"""Ports that move only together: shares from lever arms known by hand."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, Rigid, Robot, compile_structure, posture
from beamstiff.fem.condensation import Port
from beamstiff.fem.dependent_ports import independent_ports
from beamstiff.robot.reader import load_robot
from tests.fem.builders import RIGID, frame, stiffness

# a lever about z at the origin, struts across it at 1 m and 3 m, one more hinge on the same axis
POINTS = [(0, 0, 0), (0, 0, 0), (1, 0, 0), (3, 0, 0), (1, 1, 0), (3, 2, 0), (0, 0, 1), (0, 0, 1)]
HINGE = (RIGID, RIGID, 1e5, RIGID)


def test_shares_are_the_lever_arms() -> None:
    robot = frame(
        POINTS,
        rigids=[(1, 2), (2, 3), (1, 7)],
        joints=[(0, 1, (0, 0, 1), HINGE), (6, 7, (0, 0, 1), HINGE)],
        struts=[(2, 4, 1e6), (3, 5, 1e6)],
        fixed=(0, 4, 5, 6),
        tcp=3,
    )
    structure = compile_structure(robot)
    ports = [Port(f"j{at}.torsional", "joint", at, 3) for at in (0, 1)]
    ports += [Port(f"t{at}", "strut", at) for at in (0, 1)]
    independent, share = independent_ports(structure, posture(structure.kinematics, np.zeros((1, 0))), ports)
    assert independent.size == 1
    assert np.abs(share / share[0]).ravel() == pytest.approx([1, 1, 1, 3], rel=1e-9)


def test_ports_that_move_by_themselves_are_all_kept() -> None:
    structure = compile_structure(load_robot("ir663"))
    where = posture(structure.kinematics, {"q2": 0.1, "q8": np.array([0.7, 0.9])})
    ports = [Port(f"J{at}.radial", "joint", at, 1) for at in range(5)]
    independent, share = independent_ports(structure, where, ports)
    assert independent.tolist() == list(range(5))
    assert (share == np.eye(5)).all()


def test_a_port_held_by_others_at_unlike_arms_follows_them_both() -> None:
    """A bar on two struts: one between them, at a quarter, moves by 3/4 of the one and 1/4 of the other."""
    points = [(0, 0, 0), (4, 0, 0), (1, 0, 0), (0, 1, 0), (4, 1, 0), (1, 1, 0), (0, 0, 0)]
    # the bar moves in y and turns about z, no more
    robot = frame(
        points,
        rigids=[(0, 1), (0, 2)],
        joints=[(6, 0, (0, 1, 0), (1e3, RIGID, RIGID, 1e3))],
        struts=[(0, 3, 1e6), (1, 4, 1e6), (2, 5, 1e6)],
        fixed=(3, 4, 5, 6),
        tcp=2,
    )
    structure = compile_structure(robot)
    ports = [Port(f"t{at}", "strut", at) for at in range(3)]
    independent, share = independent_ports(structure, posture(structure.kinematics, np.zeros((1, 0))), ports)
    assert independent.size == 2
    moved = np.array([0.7, -0.2])  # of the two ends, by any motion of the bar
    of_ends = np.linalg.lstsq(share[:2], moved)[0]
    assert share[2] @ of_ends == pytest.approx(0.75 * 0.7 + 0.25 * -0.2, rel=1e-9)


def test_shares_that_change_from_pose_to_pose_are_refused_by_name() -> None:
    """A rigid four-bar: the ratio of its joints' turns is its transmission, another in every pose."""
    robot = _four_bar()
    structure = compile_structure(robot)
    where = posture(structure.kinematics, {"q2": 0.1, "q8": np.array([0.7, 0.9])})
    ports = [Port(f"{joint.name}.torsional", "joint", at, 3) for at, joint in enumerate(robot.joints)]
    with pytest.raises(BeamstiffError, match=r"(J\d+\.torsional,? ){3}.* by shares that change"):
        independent_ports(structure, where, ports)


def _four_bar() -> Robot:
    """Return the IR-663 with rigid links and joints that only turn, all of them with springs."""
    robot = load_robot("ir663")
    turning = stiffness(RIGID, RIGID, 1e6, RIGID)
    joints = [{**dict(joint), "stiffness": turning} for joint in robot.joints]
    rigids = [Rigid(name=beam.name, nodes=beam.nodes) for beam in robot.beams]
    return Robot(**(dict(robot) | {"joints": joints, "beams": [], "rigids": rigids, "identify": []}))
