"""The loaded machine: K_C of seed 000 (eqs 8 to 10) against the Jacobian's derivatives and a second model."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError, Robot, Section, Variable, compile_structure
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.geometric_stiffness import loaded_compliance, loaded_stiffness
from beamstiff.fem.static_response import nodal_loads
from beamstiff.robot.kinematics import posture, twist_jacobian
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array
from tests.fem.builders import (
    FREE,
    RIGID,
    SECTION,
    SHEAR_SECTION,
    at_rest,
    frame,
    relative_error,
    screw,
    some_rotation,
    turned,
)
from tests.fem.complementary_stiffness import complementary_stiffness
from tests.fem.rigid_bodies import RigidBodies
from tests.fem.test_serial_robots import serial_robot

KR240 = load_robot("kr240-2")


def serial(kinds: str, seed: int) -> Robot:
    """Return a serial robot of revolute (R) and prismatic (P) joints with random frames and stiff springs."""
    rng, slides = np.random.default_rng(seed), np.array([kind == "P" for kind in kinds])
    values = np.full((len(kinds), 4), RIGID)
    values[range(len(kinds)), np.where(slides, 0, 2)] = 10 ** rng.uniform(5, 6, len(kinds))
    return serial_robot(rng.uniform(0, 2, (len(kinds), 4)), slides, values, rng.normal(size=3))


def stiffness_about_axes(robot: Robot) -> Array:
    return np.array([min(joint.stiffness.torsional, joint.stiffness.axial) for joint in robot.joints])


def loaded_at_tcp(robot: Robot, q: Array, wrench: Array) -> Array:
    structure = compile_structure(robot)
    return loaded_compliance(
        structure, posture(structure.kinematics, q), nodal_loads(structure, len(q), {robot.tcp: wrench})
    )


def derivative_of_jacobian_transpose(robot: Robot, q: Array, wrench: Array) -> Array:
    """Return ``[dJ^T/dq_1 w ... ]`` by central differences of the geometric Jacobian."""
    kinematics = compile_structure(robot).kinematics
    step = 1e-5
    columns = []
    for at in range(q.shape[1]):
        shift = np.eye(q.shape[1])[at] * step
        after, before = (
            twist_jacobian(kinematics, posture(kinematics, q + s), robot.tcp) for s in (shift, -shift)
        )
        columns.append(np.einsum("paj,pa->pj", (after - before) / (2 * step), wrench))
    return np.stack(columns, axis=-1)


SIZES = np.repeat([1e3, 300.0], 3)


def with_coupled_wrist() -> Robot:
    robot = serial("RRRRRR", 3)
    coupled = Variable(name="q6", equals="-q5 + 0.5*q4", type="revolute")
    return robot.model_copy(update={"variables": (*robot.variables[:5], coupled)})


@pytest.mark.parametrize(
    "robot",
    [KR240, serial("RRPRRR", 0), serial("PRRPRR", 1), with_coupled_wrist()],
    ids=["KR240", "1P", "2P", "coupled"],
)
def test_complementary_stiffness_is_what_differences_of_the_jacobian_give(robot: Robot) -> None:
    rng = np.random.default_rng(5)
    q, wrench = rng.uniform(-3, 3, (50, len(robot.actuated))), rng.normal(size=(50, 6)) * SIZES
    structure = compile_structure(robot)
    found = complementary_stiffness(structure, posture(structure.kinematics, q), wrench)
    expected = derivative_of_jacobian_transpose(robot, q, wrench)
    assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()
    assert (
        np.abs(found - found.swapaxes(1, 2)).max() > 0.01 * np.abs(found).max()
    )  # moments act: not symmetric


@given(seed=st.integers(0, 10**6), kinds=st.text("RP", min_size=6, max_size=6))
@settings(max_examples=25)
def test_seed_000_equations_8_and_10(seed: int, kinds: str) -> None:
    """K_theta = K_C + J^T K_X J and K_X = J^-T (K_theta - K_C) J^-1, also with moments and sliders."""
    robot = KR240 if seed % 2 else serial(kinds, seed)
    rng = np.random.default_rng(seed)
    q, wrench = rng.uniform(-3, 3, (5, 6)), rng.normal(size=(5, 6)) * SIZES
    structure = compile_structure(robot)
    pose = posture(structure.kinematics, q)
    jacobian = twist_jacobian(structure.kinematics, pose, robot.tcp)
    k_theta = np.diag(stiffness_about_axes(robot))
    k_c = complementary_stiffness(structure, pose, wrench)
    compliance = loaded_at_tcp(robot, q, wrench)
    expected = jacobian @ np.linalg.inv(k_theta - k_c) @ jacobian.swapaxes(1, 2)
    assert relative_error(compliance, expected) < 1e-10
    well = np.linalg.cond(jacobian) < 1e3
    if well.any():
        k_x = loaded_stiffness(compliance[well])
        back = k_c[well] + jacobian[well].swapaxes(1, 2) @ k_x @ jacobian[well]
        assert relative_error(back, np.broadcast_to(k_theta, back.shape)) < 1e-8


def test_without_load_the_compliance_is_the_plain_one() -> None:
    structure = compile_structure(KR240)
    pose = posture(structure.kinematics, np.random.default_rng(0).uniform(-3, 3, (20, 6)))
    found = loaded_compliance(structure, pose, np.zeros((20, len(KR240.nodes), 6)))
    assert relative_error(found, tcp_compliance(structure, pose)) < 1e-13


# joints and loops of rigid bodies: points, node at the TCP, parts as `builders.frame` takes them
ARM = [(0, 0, 0), (0, 0, 0), (1, 0.2, 0.3), (1, 0.2, 0.3), (1.5, 1, 0.2)]
FOUR_BAR = [at for at in ((0, 0, 0), (0.2, 0, 1), (1.3, 0, 1.2), (1.2, 0, 0)) for _ in (0, 1)]
FOUR_BAR = [*FOUR_BAR, (2, 0, 1.1)]
TILTED, Y = (0.1, 0.2, 1.0), (0, 1, 0)
ALL_SIX, HINGE, FREE_HINGE = (1e5, 2e5, 1e4, 3e4), (RIGID, RIGID, 2e4, RIGID), (RIGID, RIGID, FREE, RIGID)
SOFT_HINGE = (1e6, RIGID, 2e4, 5e4)
FIRM, SLIDE, SKEW = (1e5, RIGID, 1e4, 3e4), (1e5, RIGID, RIGID, 3e4), (1, 0.2, 1)
SHUT = (1e5, 3e5, FREE, RIGID)  # of the joint that closes a loop
ELASTIC, HINGED = (RIGID, RIGID, 3e3, RIGID), (RIGID, RIGID, 3e3, 1e5)
LINKS, BARS = [(1, 2), (3, 4)], [(1, 2), (3, 4), (5, 6), (4, 8)]


def made(points: Any, tcp: int, joints: Any, rigids: Any, **more: Any) -> tuple[Any, int, dict[str, Any]]:
    return points, tcp, {"joints": joints, "rigids": rigids, **more}


CHAIN = [(0, 1, TILTED, ALL_SIX), (2, 3, SKEW, ALL_SIX)]
BACKWARD = [(1, 0, TILTED, FIRM), (3, 2, SKEW, SLIDE)]  # from the ground, their second nodes are met first
SLIDES = [(0, 1, TILTED, SLIDE), (2, 3, SKEW, (1e5, RIGID, 2e4, RIGID))]
CLOSING = [(0, 1, TILTED, FIRM), (2, 3, SKEW, ALL_SIX), (4, 3, (1, 0.2, 0.4), SHUT)]
HINGES = [(0, 1, Y, HINGE), (2, 3, Y, FREE_HINGE), (4, 5, Y, ELASTIC), (7, 6, Y, HINGE)]
SOFT = [(0, 1, Y, SOFT_HINGE), (2, 3, Y, (RIGID, 1e6, FREE, RIGID)), (5, 4, Y, HINGED), (7, 6, Y, SOFT_HINGE)]
STRUTS = {"struts": [(2, 3, 2e5), (4, 2, RIGID)], "fixed": (0, 3, 4)}
TRIANGLE = [(0, 1, TILTED, ALL_SIX), (3, 5, (0, 1, 1), (RIGID, 2e6, 3e4, RIGID))]
CORNERS = [*ARM[:3], (1, 1, 0.3), (1.5, 1, 0.2), (1, 1, 0.3)]
MACHINES = {
    "chain": made(ARM, 4, CHAIN, LINKS),
    "backward": made(ARM, 4, BACKWARD, LINKS),
    "slides": made(ARM, 4, SLIDES, LINKS),
    "joint that closes a loop": made([*ARM[:4], ARM[3]], 2, CLOSING, [(1, 2)], fixed=(0, 4)),
    "struts": made([*ARM[:3], (1, -1, -0.3), (0, 1, 1)], 2, [(0, 1, TILTED, FIRM)], [(1, 2)], **STRUTS),
    "four-bar": made(FOUR_BAR, 8, HINGES, BARS, fixed=(0, 7)),
    "soft four-bar": made(FOUR_BAR, 8, SOFT, BARS, fixed=(0, 7)),
    "triangle of rigids": made(CORNERS, 4, TRIANGLE, [(1, 2), (2, 3), (3, 1), (5, 4)]),
}


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("kind", ["forces", "moments too", "payload", "none"])
def test_rigid_bodies_against_differences_of_an_exact_equilibrium(name: str, kind: str) -> None:
    points, tcp, parts = MACHINES[name]
    rng = np.random.default_rng(len(name))
    loads = np.zeros((len(points), 6))
    if kind in ("forces", "moments too"):
        loads[1:, :3] = rng.normal(size=(len(points) - 1, 3)) * 200
    if kind == "moments too":
        loads[1:, 3:] = rng.normal(size=(len(points) - 1, 3)) * 100
    weight = {"masses": [(tcp, 30.0, (0.3, 0.2, -0.4))]} if kind == "payload" else {}
    loads[list(parts.get("fixed", (0,)))] = 0.0
    structure = compile_structure(frame(points, tcp=tcp, **parts, **weight))
    found = loaded_compliance(structure, at_rest(structure), loads[None], gravity=kind == "payload")[0]
    expected = RigidBodies(points, **parts, **weight).compliance(tcp, loads, gravity=kind == "payload")
    assert relative_error(found, expected) < 1e-9
    if kind != "none":
        assert relative_error(found, tcp_compliance(structure, at_rest(structure))[0]) > 1e-4


def beam_machine(rng: np.random.Generator) -> tuple[Robot, Array]:
    """Return a bent frame of beams with an elastic joint, a strut, a rigid and a mass, and its loads."""
    points = rng.normal(size=(6, 3)) + np.arange(6)[:, None] * [0.7, 0.4, 0.5]
    points = np.concatenate([points, points[3:4], rng.normal(size=(1, 3)) * 3])
    robot = frame(
        points,
        beams=[(0, 1), (1, 2), (2, 3), (6, 4), (0, 4)],
        joints=[(3, 6, rng.normal(size=3), (1e7, 2e7, 1e6, 2e6))],
        rigids=[(4, 5)],
        struts=[(7, 2, 1e7)],
        masses=[(5, 300.0, rng.normal(size=3))],
        fixed=(0, 7),
        tcp=5,
        up=rng.normal(size=3),
    )
    return robot, np.concatenate([rng.normal(size=(8, 3)) * 2e3, rng.normal(size=(8, 3)) * 500], axis=1)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15)
def test_under_forces_alone_the_stiffness_is_symmetric(seed: int) -> None:
    """Forces and weight have a potential; only moments of constant direction have none."""
    robot, loads = beam_machine(np.random.default_rng(seed))
    structure = compile_structure(robot)
    forces = loads * ([1] * 3 + [0] * 3)
    found = loaded_compliance(structure, at_rest(structure), forces[None], gravity=True)[0]
    plain = tcp_compliance(structure, at_rest(structure))[0]
    assert (np.abs(found - found.T) <= 1e-9 * np.abs(found - plain).max() + 1e-12 * np.abs(found)).all()
    found = loaded_compliance(structure, at_rest(structure), loads[None], gravity=True)[0]
    assert np.abs(found - found.T).max() > 1e-6 * np.abs(found - plain).max()


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15)
def test_turning_the_whole_machine_with_its_loads_turns_the_compliance(seed: int) -> None:
    robot, loads = beam_machine(np.random.default_rng(seed))
    rotation = Rotation.random(rng=seed).as_matrix()
    structure, elsewhere = compile_structure(robot), compile_structure(turned(robot, rotation, (3, 1, 2)))
    here = loaded_compliance(structure, at_rest(structure), loads[None], gravity=True)[0]
    there = loaded_compliance(elsewhere, at_rest(elsewhere), loads[None] @ screw(rotation).T, gravity=True)[0]
    assert relative_error(there, screw(rotation) @ here @ screw(rotation).T) < 1e-9


def first_order_effect(elements: int, section: Section, gravity: bool) -> Array:
    """Return the change of a bent cantilever's compliance per load, by differences small in the load."""
    rotation, factor = some_rotation(4), 1e-2
    wrench = np.concatenate([rotation @ [300, -800, 500], rotation @ [400, -300, 200]])
    points = np.linspace(0, 2, elements + 1)[:, None] * rotation[:, 0]
    beams = [(at, at + 1) for at in range(elements)]
    found = []
    for sign in (factor, -factor):
        weight = (0, 0, -98.1 * sign if gravity else 0.0)
        robot = frame(points, beams=beams, up=rotation[:, 2], section=section, gravity=weight)
        structure = compile_structure(robot)
        load = nodal_loads(structure, 1, {robot.tcp: sign * wrench})
        found.append(loaded_compliance(structure, at_rest(structure), load, gravity=True)[0])
    return (found[0] - found[1]) / (2 * factor)


@pytest.mark.parametrize("gravity", [False, True])
@pytest.mark.parametrize("section", [SECTION, SHEAR_SECTION], ids=["Euler-Bernoulli", "Timoshenko"])
def test_one_beam_element_is_exact_to_first_order_in_the_load(section: Section, gravity: bool) -> None:
    """Its shapes are the exact ones of the unloaded beam, which is all that a first order asks for."""
    one, many = first_order_effect(1, section, gravity), first_order_effect(6, section, gravity)
    assert relative_error(one, many) < 1e-7


def hung(guide: float, rotation: Array) -> Robot:
    """Return a plate that hangs on a strut 1.6 m long, held across by a soft guide."""
    end = 1.6 * rotation[:, 0]
    joint = (2, 1, rotation[:, 0], (FREE, guide, RIGID, RIGID))
    return frame([(0, 0, 0), end, end], struts=[(0, 1, 3e7)], joints=[joint], fixed=(0, 2), tcp=1)


@pytest.mark.parametrize("pull", [0.0, 5e3, 80e3, -7e3])
def test_a_taut_cable_resists_across_with_tension_over_length(pull: float) -> None:
    rotation = some_rotation(8)
    structure = compile_structure(hung(5e3, rotation))
    load = nodal_loads(structure, 1, {"n1": np.array([*(pull * rotation[:, 0]), 0, 0, 0])})
    found = loaded_compliance(structure, at_rest(structure), load)[0, :3, :3]
    across = 1 / (5e3 + pull / 1.6)
    assert np.abs(rotation.T @ found @ rotation - np.diag([1 / 3e7, across, across])).max() < 1e-12 * across


def test_a_pushed_strut_tips_over_when_its_guide_is_too_soft() -> None:
    structure = compile_structure(hung(5e3, np.eye(3)))
    load = nodal_loads(structure, 1, {"n1": np.array([-8001.0, 0, 0, 0, 0, 0])})
    with pytest.raises(
        BeamstiffError, match=r"'frame' buckles under its load: node 'n1' moves along .*j0\.radial"
    ):
        loaded_compliance(structure, at_rest(structure), load)


def test_many_poses_at_once_are_the_poses_one_by_one() -> None:
    rng = np.random.default_rng(2)
    q, wrench = rng.uniform(-3, 3, (9, 6)), rng.normal(size=(9, 6)) * 500
    together = loaded_at_tcp(KR240, q, wrench)
    alone = np.concatenate([loaded_at_tcp(KR240, q[at : at + 1], wrench[at : at + 1]) for at in range(9)])
    assert relative_error(together, alone) < 1e-14
    structure = compile_structure(KR240)
    loads = nodal_loads(structure, 9, {KR240.tcp: wrench})
    in_pieces = loaded_compliance(structure, posture(structure.kinematics, q), loads, chunk=2)
    assert relative_error(together, in_pieces) < 1e-14


def test_buckling_names_the_pose() -> None:
    structure = compile_structure(KR240)
    pose = posture(structure.kinematics, np.zeros((3, 6)))
    loads = np.zeros((3, len(KR240.nodes), 6))
    loads[2, structure.kinematics.node_index["n6b"], :3] = [-1e8, 0, 0]
    with pytest.raises(BeamstiffError, match="'kr240-2' buckles under its load at pose 2: "):
        loaded_compliance(structure, pose, loads, chunk=2)


@pytest.mark.parametrize("bad", [np.zeros((2, 13, 6)), np.zeros((1, 3, 6)), np.full((1, 13, 6), np.nan)])
def test_loads_that_do_not_fit_are_refused(bad: Array) -> None:
    structure = compile_structure(KR240)
    with pytest.raises(
        BeamstiffError, match=r"found loads of shape .*, expected finite numbers of shape \(1, 13, 6\)"
    ):
        loaded_compliance(structure, posture(structure.kinematics, np.zeros((1, 6))), bad)


def test_a_moment_on_a_node_of_struts_is_refused() -> None:
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.3, 0.3, 0.3)]
    struts = [(at, 4, 1e6) for at in (1, 2, 3)]
    robot = frame(points, beams=[(0, 1)], struts=struts, fixed=(0, 2, 3), tcp=1)
    structure = compile_structure(robot)
    load = nodal_loads(structure, 1, {"n4": np.array([0, 0, 0, 1.0, 0, 0])})
    with pytest.raises(BeamstiffError, match="a moment acts on node 'n4', which struts alone hold"):
        loaded_compliance(structure, at_rest(structure), load)


def test_the_stiffness_of_a_singular_compliance_is_refused() -> None:
    with pytest.raises(BeamstiffError, match="arm: singular compliance at pose 1"):
        loaded_stiffness(np.stack([np.eye(6), np.diag([1, 1, 1, 1, 1, 0.0])]), "arm")
