"""Parts that are none, and loads where they cannot act: each refused in one line that names the part."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError, Material, Section, compile_structure
from beamstiff.fem.condensation import condense, tcp_compliance, tcp_stiffness
from tests.fem.builders import FREE, RIGID, at_rest, compliance, displacement, frame, solve

HINGE = (RIGID, RIGID, FREE, RIGID)
Z = (0, 0, 1)


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e-6, 0.0, "1e999", True])
@pytest.mark.parametrize("name", ["A", "Iy", "Iz", "J", "Ay"])
def test_a_section_that_is_no_number_or_not_positive(name: str, value: Any) -> None:
    with pytest.raises(BeamstiffError, match=rf"^{name}: found .*, expected a .*"):
        Section(**({"A": 1e-3, "Iy": 1e-6, "Iz": 1e-6, "J": 1e-6} | {name: value}))


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 0.0])
@pytest.mark.parametrize("name", ["E", "G"])
def test_a_material_that_is_no_number_or_not_positive(name: str, value: float) -> None:
    with pytest.raises(BeamstiffError, match=rf"^{name}: found .*, expected a .*"):
        Material(**({"E": 1e11, "G": 1e10} | {name: value}))


@pytest.mark.parametrize("value", [math.nan, -1.0, -math.inf])
def test_a_spring_that_is_no_stiffness(value: float) -> None:
    with pytest.raises(BeamstiffError, match=r"stiffness.torsional: found .*, expected a .*"):
        frame([(0, 0, 0), (0, 0, 0)], joints=[(0, 1, Z, (RIGID, RIGID, value, RIGID))])


def test_numbers_that_leave_the_range_on_the_way() -> None:
    huge = frame([(0, 0, 0), (1e-3, 0, 0)], beams=[(0, 1)], material=Material(E=1e307, G=1e307))
    with (
        np.errstate(all="ignore"),
        pytest.raises(BeamstiffError, match="found a stiffness or compliance that is not a finite number"),
    ):
        compliance(huge)


def test_parts_of_no_length() -> None:
    with pytest.raises(BeamstiffError, match=r"beam 'b0' has zero length: its nodes 'n0' and 'n1' coincide"):
        frame([(1, 2, 3), (1, 2, 3)], beams=[(0, 1)])
    with pytest.raises(BeamstiffError, match=r"strut 't0' has zero length: its nodes 'n0' and 'n2' coincide"):
        frame([(0, 0, 0), (1, 0, 0), (0, 0, 0)], beams=[(0, 1)], struts=[(0, 2, 1e6)], tcp=1)


def test_disconnected_parts() -> None:
    with pytest.raises(
        BeamstiffError, match="disconnected part: nodes n2, n3 are connected to no fixed node"
    ):
        frame([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)], beams=[(0, 1), (2, 3)], tcp=1)


def test_up_along_the_beam() -> None:
    for up in ((1, 0, 0), (-3, 0, 0), (1, 1e-10, 0)):
        with pytest.raises(BeamstiffError, match="parallel to the beam 'b0', expected a direction across it"):
            frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)], up=up)


def test_joint_between_nodes_apart() -> None:
    with pytest.raises(BeamstiffError, match=r"nodes 'n0' and 'n1' of the joint 'j0' are 0\.002 m apart"):
        frame([(0, 0, 0), (0, 0, 0.002), (1, 0, 0)], beams=[(1, 2)], joints=[(0, 1, Z, HINGE)])


def test_what_only_a_pose_shows() -> None:
    """Nodes of different frames meet or part with the pose: the pose and the parts are named."""
    robot = frame(
        [(0, 0, 0), (0, 0, 0), (1, 0, 0), (0, 1, 0)],
        beams=[(1, 2)],
        struts=[(3, 2, 1e6)],
        rigids=[(2, 3)],
        joints=[(0, 1, Z, (RIGID, RIGID, 1e4, RIGID))],
        up=(0, 1, 0),
    )
    structure = compile_structure(robot)
    poses = at_rest(structure)

    def moved(node: int, to: tuple[float, float, float]) -> Any:
        many = poses.only(np.zeros(3, dtype=np.int64))
        positions = many.node_positions.copy()
        positions[2, node] = to
        return dataclasses.replace(many, node_positions=positions)

    for node, to, said in (
        (
            1,
            (0, 0, 0.01),
            r"joint 'j0': its nodes 'n0' and 'n1' are 10 mm apart at pose 2, expected to coincide",
        ),
        (2, (0, 0, 0), r"beam 'b0' has zero length at pose 2: its nodes 'n1' and 'n2' coincide"),
        (2, (0, 2, 0), r"beam 'b0': `up` is parallel to the beam at pose 2, expected a direction across it"),
        (3, (1, 0, 0), r"strut 't0' has zero length at pose 2: its nodes 'n3' and 'n2' coincide"),
        (2, (np.nan, 0, 0), r"node 'n2': its position at pose 2 is not a number"),
    ):
        for chunk in (512, 1):
            with pytest.raises(BeamstiffError, match=said):
                condense(structure, moved(node, to), ["n2"], chunk=chunk)


def test_tcp_that_struts_alone_hold() -> None:
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.3, 1)]
    robot = frame(points, struts=[(at, 3, 1e6) for at in range(3)], fixed=(0, 1, 2))
    said = "tcp: node 'n3' is held by struts alone and has no rotation; attach a rigid or beam"
    with pytest.raises(BeamstiffError, match=said):
        compile_structure(robot)


def test_moments_where_struts_alone_hold() -> None:
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.3, 1), (2, 2, 2)]
    held: dict[str, Any] = {
        "struts": [(at, 3, 1e6) for at in range(3)],
        "beams": [(0, 4)],
        "fixed": (0, 1, 2),
    }
    with pytest.raises(BeamstiffError, match="a moment acts on node 'n3', which struts alone hold"):
        solve(frame(points, **held), {"n3": [0, 0, 1, 0, 1, 0]})
    on = frame(points, masses=[(3, 5.0, (0, 0, 0))], **held)
    assert np.isfinite(displacement(on, {}, "n3", gravity=True)).all()
    off = frame(points, masses=[(3, 5.0, (0.1, 0, 0))], **held)
    with pytest.raises(BeamstiffError, match="the mass on node 'n3' is off it, but struts alone hold that"):
        solve(off, {}, gravity=True)
    with pytest.raises(BeamstiffError, match="the mass on node 'n3' is off it"):
        tcp_compliance(structure := compile_structure(off), at_rest(structure))


def test_singular_compliance_has_no_stiffness() -> None:
    """One spring: the TCP gives way in one direction only."""
    joint = (0, 1, Z, (RIGID, RIGID, 1e5, RIGID))
    robot = frame([(0, 0, 0), (0, 0, 0), (1, 0, 0)], rigids=[(1, 2)], joints=[joint])
    structure = compile_structure(robot)
    C = tcp_compliance(structure, at_rest(structure))
    assert C[0, 1, 1] == pytest.approx(1e-5)
    with pytest.raises(
        BeamstiffError, match=r"frame: singular compliance at pose 0: .* against some wrench \(mostly "
    ):
        tcp_stiffness(C, robot.name)
    with pytest.raises(BeamstiffError, match="found a stiffness or compliance that is not a finite number"):
        tcp_stiffness(np.stack([np.eye(6), np.full((6, 6), np.nan)]))


def test_loads_on_nodes_that_do_not_exist() -> None:
    robot = frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)])
    with pytest.raises(BeamstiffError, match=r"robot 'frame' has no node 'n01' \(did you mean 'n1'\?\)"):
        solve(robot, {"n01": [1, 0, 0, 0, 0, 0]})


def test_no_poses() -> None:
    structure = compile_structure(frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)]))
    with pytest.raises(BeamstiffError, match="no poses: expected at least one"):
        tcp_compliance(structure, at_rest(structure).only(slice(0)))
