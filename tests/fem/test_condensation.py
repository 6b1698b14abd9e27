"""Static condensation: to the TCP as in seed 003 (eqs 24 to 27; Guyan, AIAA J. 3 (1965) 380), and to ports.

``K_eq = K_EE - K_ER K_RR^-1 K_RE`` and ``F_eq = F_E - K_ER K_RR^-1 F_R`` from the full matrix; ports
against the assembly of the whole structure with the stiffness values put in.
"""

import numpy as np
import pytest
from hypothesis import assume, event, example, given, settings
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Robot
from beamstiff.fem.assembly import dense_stiffness
from beamstiff.fem.beam_element import beam_stiffness
from beamstiff.fem.condensation import Condensed, Port, condense, tcp_compliance, tcp_stiffness
from beamstiff.fem.constraints import has_constraints
from beamstiff.fem.loads import gravity_wrenches
from beamstiff.fem.placed_structure import place
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import Structure, compile_structure
from tests.fem.builders import FREE, RIGID, at_rest, compliance, frame, relative_error
from tests.fem.random_frames import RandomFrame, beam_frame, machine_frame
from tests.fem.test_identities import FIRM, TOLERANCE, closing, machine, seeds, sizes

KINDS = ("axial", "radial", "torsional", "tilting")
DIRECTIONS = {0: (0,), 1: (1, 2), 2: (3,), 3: (4, 5)}


def condensed(robot: Robot, observed: list[str], ports: list[Port] | tuple[()] = ()) -> Condensed:
    structure = compile_structure(robot)
    return condense(structure, at_rest(structure), observed, ports)


def condensed_or_refused(robot: Robot, observed: list[str], ports: list[Port]) -> Condensed | str:
    try:
        return condensed(robot, observed, ports)
    except BeamstiffError as refused:
        return str(refused)


@given(seed=seeds, more=sizes, loops=closing)
def test_tcp_stiffness_and_equivalent_wrench_of_seed_003(seed: int, more: int, loops: int) -> None:
    made = beam_frame(seed, more, loops)
    assume(made.reference().softness() > FIRM)
    robot = made.robot()
    structure = compile_structure(robot)
    geometry = place(structure, at_rest(structure))
    # the whole stiffness by reordering: with beams alone the unknowns are the nodes' own displacements
    K, rows = made.reference().system()
    E = 6 * structure.kinematics.node_index[robot.tcp] + np.arange(6)
    R = np.setdiff1d(np.arange(len(K)), np.concatenate([E, np.arange(6)]))  # less the fixed node 0
    assert len(rows) == 6
    F = gravity_wrenches(structure, geometry)[0].reshape(-1)
    inner = np.linalg.solve(K[np.ix_(R, R)], np.column_stack([K[np.ix_(R, E)], F[R]]))
    K_eq = K[np.ix_(E, E)] - K[np.ix_(E, R)] @ inner[:, :-1]
    F_eq = F[E] - K[np.ix_(E, R)] @ inner[:, -1]
    result = condensed(robot, [robot.tcp])
    direct = np.sqrt(np.outer(np.diag(K_eq), np.diag(K_eq)))
    found = tcp_stiffness(result.clamped, robot.name)[0]
    assert (np.abs(found - K_eq) / direct).max() <= 1e-7  # inverted twice
    assert relative_error(result.clamped[0], np.linalg.inv(K_eq)) <= 1e-8
    assert relative_error(result.clamped_dead[0], np.linalg.solve(K_eq, F_eq)) <= 1e-8
    assert relative_error(tcp_compliance(structure, at_rest(structure))[0], result.clamped[0]) == 0


@given(seed=seeds, more=sizes, loops=closing)
def test_compliance_at_nodes_is_the_response_to_unit_wrenches_there(seed: int, more: int, loops: int) -> None:
    made = machine(seed, more, loops)
    structure = compile_structure(made.robot())
    observed = [f"n{at}" for at in made.turning()[-3:]]
    result = condense(structure, at_rest(structure), observed)
    at = [structure.kinematics.node_index[name] for name in observed]
    size = 6 * len(observed)
    expected = np.zeros((size, size))
    for column in range(size):
        loads = nodal_loads(structure, 1, {observed[column // 6]: np.eye(6)[column % 6]})
        expected[:, column] = respond(structure, at_rest(structure), loads).displacement[0, at].reshape(-1)
    assert relative_error(result.clamped[0], expected) <= TOLERANCE
    assert (result.clamped[0] == result.clamped[0].T).all()
    nothing = nodal_loads(structure, 1, {})
    sag = respond(structure, at_rest(structure), nothing, gravity=True).displacement[0, at].reshape(-1)
    assert sag_error(result.clamped_dead[0], sag, expected) <= TOLERANCE


def opened(
    made: RandomFrame, rng: np.random.Generator, share: float
) -> tuple[dict[str, float], list[Port], list[str]]:
    """Return new values of some stiffness parameters, their ports, and the parameter of each port."""
    values, ports, owners = {}, [], []
    for at, (_, _, _, kinds) in enumerate(made.joints):
        for kind, value in enumerate(kinds):
            if value not in (RIGID, FREE) and rng.random() < share:
                name = f"j{at}.{KINDS[kind]}"
                values[name] = 10.0 ** rng.uniform(4, 9)
                for direction in DIRECTIONS[kind]:
                    ports.append(Port(name, "joint", at, direction))
                    owners.append(name)
    for at, (_, _, value) in enumerate(made.struts):
        if value != RIGID and rng.random() < share:
            values[f"t{at}"] = 10.0 ** rng.uniform(5, 8)
            ports.append(Port(f"t{at}", "strut", at))
            owners.append(f"t{at}")
    return values, ports, owners


def sag_error(found: np.ndarray, expected: np.ndarray, C: np.ndarray) -> float:
    """Return the relative error of a sag; where the ground takes all weight, by what a newton would do."""
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), np.abs(C).max(), 1e-10))


def put_together(result: Condensed, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return C(k) and the sag of the observed nodes from what was condensed, at stiffness (p,) or (p, p)."""
    S, B = result.port_stiffness[0], result.port_map[0]
    M = S + (np.diag(stiffness) if stiffness.ndim == 1 else stiffness)
    C = result.clamped[0] + B.T @ np.linalg.solve(M, B)
    return C, result.clamped_dead[0] + B.T @ np.linalg.solve(M, result.port_dead[0])


@settings(max_examples=15)
@given(
    seed=seeds, more=sizes, loops=closing, rigid_loops=st.booleans(), rigid=st.sampled_from([0.0, 0.3, 0.6])
)
@example(seed=208, more=4, loops=3, rigid_loops=True, rigid=0.0)  # a motion that moves no node
def test_ports_give_the_whole_structure_at_any_stiffness(
    seed: int, more: int, loops: int, rigid_loops: bool, rigid: float
) -> None:
    """Coordinate ports on the tree, ports of joints that close loops, struts, with rigid loops and without.

    Rigid loops tie many ports together: mostly one parameter at a time there.
    """
    made = machine_frame(seed, more, loops, rigid=rigid, free=0.1, rigid_loops=rigid_loops)
    rng = np.random.default_rng(seed)
    values, ports, owners = opened(made, rng, 0.7)
    if rigid_loops and values and rng.random() < 0.8:
        values = dict(list(values.items())[:1])
        ports = [port for port in ports if port.name in values]
        owners = [port.name for port in ports]
    assume(ports)
    robot = made.robot()
    changed = robot.with_parameters(values)
    observed = [robot.tcp, f"n{made.turning()[0]}"]
    for at, (i, j, axis, kinds) in enumerate(made.joints):
        new = [values.get(f"j{at}.{kind}", old) for kind, old in zip(KINDS, kinds, strict=True)]
        made.joints[at] = (i, j, axis, np.array(new))
    made.struts = [(i, j, values.get(f"t{at}", old)) for at, (i, j, old) in enumerate(made.struts)]
    assume(made.reference().softness() > FIRM)
    result = condensed_or_refused(robot, observed, ports)
    if isinstance(result, str):  # rigid parts tie the ports to one another, or hold both sides of one
        assert "rigid parts of their loops hold them" in result
        event("refused")
        return
    event(f"constraints: {has_constraints(compile_structure(robot))}")
    event(f"coordinates: {all(port.kind == 'joint' for port in ports)}")
    C, sag = put_together(result, np.array([values[name] for name in owners]))
    whole = condensed(changed, observed)
    assert relative_error(C, whole.clamped[0]) <= TOLERANCE
    assert sag_error(sag, whole.clamped_dead[0], C) <= TOLERANCE
    # the present values of what is left open do not enter
    again = condensed(changed, observed, ports)
    assert relative_error(again.port_stiffness, result.port_stiffness) <= TOLERANCE
    assert relative_error(again.clamped, result.clamped) <= TOLERANCE


@given(seed=seeds, more=sizes, loops=closing)
def test_a_beam_as_six_ports(seed: int, more: int, loops: int) -> None:
    """Its far end against the near one carried along: with its stiffness put back, the structure is whole."""
    made = beam_frame(seed, more, loops)
    assume(made.reference().softness() > FIRM)
    robot = made.robot()
    structure = compile_structure(robot)
    which = seed % len(made.beams)
    ports = [Port(f"b{which}.E", "beam", which, direction) for direction in range(6)]
    properties = {name: values[which] for name, values in structure.beam_properties.items()}
    length = place(structure, at_rest(structure)).beam_length[0, which]
    own = beam_stiffness(length, **properties)[6:, 6:]
    C, _ = put_together(condensed(robot, [robot.tcp], ports), own)
    assert relative_error(C, compliance(robot)) <= TOLERANCE


def test_compliance_of_the_reduced_stiffness_is_its_inverse_at_the_tcp() -> None:
    """Where the TCP's displacement is among the unknowns, C is a block of the inverse of the reduced K."""
    robot = beam_frame(3).robot()
    structure: Structure = compile_structure(robot)
    K = dense_stiffness(structure, place(structure, at_rest(structure)))[0]
    own = [at for at, (name, _) in enumerate(structure.unknowns.labels) if name == robot.tcp]
    expected = np.linalg.inv(K)[np.ix_(own, own)]
    assert relative_error(tcp_compliance(structure, at_rest(structure))[0], expected) <= TOLERANCE


def test_an_unknown_node_is_named_with_a_suggestion() -> None:
    robot = frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)])
    with pytest.raises(BeamstiffError, match=r"robot 'frame' has no node 'n10' \(did you mean 'n1'\?\)"):
        condensed(robot, ["n10"])


def test_ports_that_rigid_parts_tie_together_are_named() -> None:
    """Two bodies joined by two parallel hinges on one axis: their torsions are one motion."""
    points = [(0, 0, 0), (0, 0, 1), (0, 0, 0), (0, 0, 1), (1, 0, 0)]
    hinge = (RIGID, RIGID, 1e5, RIGID)
    parts = {"rigids": [(2, 3), (3, 4)], "joints": [(0, 2, (0, 0, 1), hinge), (1, 3, (0, 0, 1), hinge)]}
    robot = frame(points, fixed=(0, 1), **parts)
    ports = [Port(f"j{at}.torsional", "joint", at, 3) for at in (0, 1)]
    message = (
        r"j0\.torsional, j1\.torsional cannot move without one another: rigid parts of their loops hold them"
    )
    with pytest.raises(BeamstiffError, match=message):
        condensed(robot, ["n4"], ports)
    with pytest.raises(BeamstiffError, match=r"j0\.tilting cannot move at all: rigid parts"):
        condensed(robot, ["n4"], [Port("j0.tilting", "joint", 0, 4)])
    C, _ = put_together(condensed(robot, ["n4"], ports[:1]), np.array([1e5]))
    assert C[5, 5] == pytest.approx(1 / 2e5, rel=1e-12)
