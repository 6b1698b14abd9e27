"""Parts unlike by many powers of ten, against the truth in 120 digits: right, or refused with a name."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError, Material, Section, compile_structure
from beamstiff.fem.condensation import condense, tcp_compliance, tcp_stiffness
from beamstiff.fem.geometric_stiffness import loaded_compliance
from beamstiff.fem.response import nodal_loads, respond
from beamstiff.model.ports import find_ports
from tests.fem.builders import FREE, RIGID, SECTION, STEEL, at_rest, compliance, displacement, frame, solve
from tests.fem.exact_frame import exact_compliance
from tests.fem.random_frames import RandomFrame
from tests.fem.reference_frame import ReferenceFrame
from tests.fem.stiffness_spreads import chain, outcome, relative_error, stretched_tie, with_loops

SOME = range(6)


def test_the_truth_knows_the_cantilever() -> None:
    properties = {name: getattr(SECTION, name) for name in ("A", "Iy", "Iz", "J")}
    properties |= {"E": STEEL.E, "G": STEEL.G, "Ay": np.inf, "Az": np.inf}
    beam = (0, 1, properties, np.array([0.0, 1.0, 0.0]))
    exact = exact_compliance(ReferenceFrame(np.array([[0.0, 0, 0], [2, 0, 0]]), [0], [beam]), 1)
    assert exact is not None
    assert exact[1, 1] == pytest.approx(8 / (3 * STEEL.E * SECTION.Iz), rel=1e-14)


@pytest.mark.parametrize("powers", [4, 8, 12, 16, 18])
def test_chains_are_right_whatever_the_spread(powers: int) -> None:
    assert {outcome(chain(1000 * powers + seed, powers))[0] for seed in SOME} == {"right"}


@pytest.mark.parametrize("powers", [4, 8, 12, 16, 20])
def test_structures_with_loops_are_right_or_refused(powers: int) -> None:
    found = [outcome(with_loops(1000 * powers + seed, powers)) for seed in range(12)]
    assert "wrong" not in {what for what, _ in found}
    assert sum(what == "right" for what, _ in found) >= 9
    for what, said in found:
        assert what == "right" or "is lost in rounding" in said or "a mechanism" in said


@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6])
def test_a_free_elbow_under_a_stretched_tie(gap: float) -> None:
    """Right where the gap is known to enough digits, else a mechanism, and the elbow is named."""
    for seed in (None, 0, 1, 2):
        what, said = outcome(stretched_tie(gap, seed))
        assert what != "wrong"
        assert what == "right" if gap > 5e-9 else "j1.torsional" in said


@pytest.mark.parametrize("powers", [0, 8, 16, 20])
def test_what_a_chain_passes_on_is_its_load_whatever_the_spread(powers: int) -> None:
    """The wrench in every part of a chain follows from equilibrium alone."""
    load = np.array([3.0, -2.0, 5.0, 0.7, 0.4, -0.9])
    for seed in SOME:
        robot = chain(1000 * powers + seed, powers).robot()
        structure = compile_structure(robot)
        loads = nodal_loads(structure, 1, {robot.tcp: load})
        response = respond(structure, at_rest(structure), loads)
        points = response.geometry.posture.node_positions[0]
        carried = [
            np.concatenate([load[:3], load[3:] + np.cross(points[-1] - at, load[:3])]) for at in points
        ]
        ends = [carried[max(pair)] if pair[1] > pair[0] else -carried[pair[1]] for pair in structure.elements]
        assert np.abs(response.element_forces[0, :, 1] - ends).max(initial=0.0) <= 1e-6 * np.abs(load).max()


@pytest.mark.parametrize("make", [chain, with_loops])
@pytest.mark.parametrize("powers", [4, 12, 16])
def test_ports_put_together_give_the_truth(make: Callable[[int, float], RandomFrame], powers: int) -> None:
    """With every joint on the tree a port: C = C_clamped + B^T (S + k)^-1 B."""
    for seed in SOME:
        made = make(1000 * powers + seed, powers)
        robot = made.robot()
        exact = exact_compliance(made.reference(), int(robot.tcp[1:]))
        structure = compile_structure(robot)
        names = [f"{robot.joints[at].name}.axial" for at in structure.unknowns.tree_joints]
        names = [name for name in names if np.isfinite(robot.parameter(name))]
        try:
            found = condense(structure, at_rest(structure), [robot.tcp], ports := find_ports(robot, names)[0])
        except BeamstiffError:
            assert make is with_loops
            continue
        own = np.diag([robot.parameter(port.name) for port in ports])
        by_ports = found.port_map[0].T @ np.linalg.inv(found.port_stiffness[0] + own) @ found.port_map[0]
        assert relative_error(found.clamped[0] + by_ports, exact) <= 1e-6


@pytest.mark.parametrize("soft", [1e-10, 1e-6, 1.0, 1e6])
def test_a_soft_mast_on_a_stiff_one_buckles_at_its_own_load(soft: float) -> None:
    """Beam-column on a beam 1e16 times stiffer: H/P (tan kL / k - L), Timoshenko and Gere art. 1.4."""
    made = [STEEL.model_copy(update={"E": k, "G": k}) for k in (1e16 * soft, soft)]
    points = [(0.1 * at, 0.0, 0.0) for at in range(9)]
    robot = frame(
        points, beams=[(at, at + 1) for at in range(8)], material=[made[0]] * 4 + [made[1]] * 4, up=(0, 1, 0)
    )
    structure, length, EI = compile_structure(robot), 0.4, soft * SECTION.Iz
    force = 0.7 * np.pi**2 * EI / (4 * length**2)
    found = loaded_compliance(
        structure, at_rest(structure), nodal_loads(structure, 1, {"n8": np.array([-force, 0, 0, 0, 0, 0])})
    )[0]
    k = np.sqrt(force / EI)
    assert found[1, 1] == pytest.approx((np.tan(k * length) / k - length) / force, rel=1e-6)


# Parts that are none, and loads where they cannot act: each refused in one line that names the part


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
    assert np.isfinite(
        displacement(frame(points, masses=[(3, 5.0, (0, 0, 0))], **held), {}, "n3", gravity=True)
    ).all()
    off = frame(points, masses=[(3, 5.0, (0.1, 0, 0))], **held)
    with pytest.raises(BeamstiffError, match="the mass on node 'n3' is off it, but struts alone hold that"):
        solve(off, {}, gravity=True)
    with pytest.raises(BeamstiffError, match="the mass on node 'n3' is off it"):
        tcp_compliance(structure := compile_structure(off), at_rest(structure))


def test_singular_compliance_has_no_stiffness() -> None:
    """One spring: the TCP gives way in one direction only."""
    robot = frame(
        [(0, 0, 0), (0, 0, 0), (1, 0, 0)], rigids=[(1, 2)], joints=[(0, 1, Z, (RIGID, RIGID, 1e5, RIGID))]
    )
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
