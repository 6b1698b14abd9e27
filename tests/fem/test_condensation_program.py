"""The program of a structure gives the compliance that condensation gives, or says that it is not sure."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.expression_graph.graph import MANY
from beamstiff.fem.condensation import (
    CHUNK,
    ROUNDING,
    Condensed,
    Port,
    condense,
    condense_by_matrices,
    tcp_compliance,
)
from beamstiff.fem.condensation_program import (
    CondensationProgram,
    condensation_program,
    eliminate,
    elimination_order,
)
from beamstiff.fem.constraints import has_constraints
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.fem.unknowns import joint_unknowns
from beamstiff.robot.closure import GRID
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Posture, posture
from beamstiff.robot.library import robot_names
from beamstiff.robot.parts import Beam, Frame, Joint, Mass, Material, Node, Rigid, Strut, Variable
from beamstiff.robot.reader import load_robot
from beamstiff.robot.sections import Section
from tests.expression_graph.test_program import WAYS
from tests.fem.builders import FREE, RIGID, at_rest, stiffness
from tests.fem.random_frames import machine_frame

AGREED = 1e-9


def program_of(structure: Structure) -> CondensationProgram | None:
    """Return the program of the compliance at the TCP."""
    tcp = structure.kinematics.node_index[structure.robot.tcp]
    return condensation_program(structure, (tcp,), (), False)


def generally(
    structure: Structure, poses: Posture, observed: list[str] | None = None, ports: Sequence[Port] = ()
) -> Condensed:
    number = np.arange(len(poses.values))
    seen = [structure.robot.tcp] if observed is None else observed
    return condense_by_matrices(structure, poses, seen, ports, CHUNK, number)


def disagreement(found: np.ndarray, expected: np.ndarray) -> float:
    return float((np.abs(found - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))).max())


def within_limits(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    limits = [variable.limits or (-1.0, 1.0) for variable in robot.actuated]
    low, high = np.array(limits, dtype=float).reshape(-1, 2).T
    middle, reach = 0.5 * (low + high), 0.45 * (high - low)
    return middle + reach * np.random.default_rng(seed).uniform(-1, 1, (count, len(low)))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", robot_names())
def test_shipped_robots(name: str, way: bool) -> None:
    structure = compile_structure(load_robot(name))
    poses = posture(structure.kinematics, within_limits(structure.robot, 40))
    (_, _, found, _, _), sure = program_of(structure).run(poses.values, way)
    assert sure.all()
    assert disagreement(found, generally(structure, poses).clamped) <= AGREED
    assert (found == found.swapaxes(-1, -2)).all()


@pytest.mark.skipif(len(WAYS) == 1, reason="numba is not installed (extra `fast`)")
@pytest.mark.parametrize("name", robot_names())
def test_compiled_and_interpreted_differ_as_the_last_digit_of_the_joint_values_does(name: str) -> None:
    structure = compile_structure(load_robot(name))
    poses = posture(structure.kinematics, within_limits(structure.robot, 200))
    program = program_of(structure)
    one, other = (program.run(poses.values, way)[0][2] for way in (True, False))
    # what last digits do is the worst of many draws: one alone is off by a factor of two from the next
    ways = np.random.default_rng(0).choice([-np.inf, np.inf], (64, *poses.values.shape))
    beside = np.nextafter(poses.values, ways).reshape(64 * 200, poses.values.shape[1])
    last_digit = disagreement(program.run(beside, False)[0][2], np.tile(other, (64, 1, 1)))
    assert disagreement(one, other) <= max(last_digit, 1e-14)
    assert last_digit <= 1e-11


@given(
    seed=st.integers(0, 2**32 - 1),
    more=st.integers(1, 6),
    loops=st.integers(0, 3),
    rigid=st.sampled_from([0.0, 0.4]),
)
def test_random_machines(seed: int, more: int, loops: int, rigid: float) -> None:
    """All kinds of parts, loops of beams and struts among them; mechanisms and rigid loops are left alone."""
    structure = compile_structure(machine_frame(seed, more, loops, rigid=rigid).robot())
    program = program_of(structure)
    rest = at_rest(structure)
    if program is None:
        event("constraints" if has_constraints(structure) else "nothing to say")
        return
    (_, _, found, _, _), sure = program.run(rest.values)
    assert sure.all()  # a machine without variables: what is not sure has no program
    expected = generally(structure, rest).clamped
    size = max(np.abs(expected).max(), 1e-20)
    assert np.abs(found - expected).max() <= AGREED * size


def moving_machine(seed: int, links: int) -> Robot:
    """Return an arm of revolute and prismatic joints with beams, rigid links, a strut and a second branch."""
    rng = np.random.default_rng(seed)
    variables, frames, nodes, beams, rigids, joints, struts = [], [], [Node(name="g")], [], [], [], []
    above, parent = "g", "base"
    for link in range(links):
        slides = rng.random() < 0.25
        gamma, alpha, beta = rng.uniform(-1, 1, 3) if rng.random() < 0.6 else (0.0, np.pi / 2, 0.0)
        b, d = rng.uniform(0.2, 0.6, 2)
        variables.append(
            Variable(name=f"q{link}", type="prismatic" if slides else "revolute", limits=(0.3, 1.5))
        )
        drive = {"r": f"q{link}"} if slides else {"theta": f"q{link}", "beta": float(beta)}
        frames.append(Frame(name=f"f{link}", parent=parent, gamma=gamma, b=b, alpha=alpha, d=d, **drive))
        at = (d * np.cos(gamma), d * np.sin(gamma), b)  # where the frame turns, seen from its parent
        nodes += [
            Node(name=f"a{link}", frame=parent, at=at),
            Node(name=f"b{link}", frame=f"f{link}"),
            Node(name=f"c{link}", frame=f"f{link}", at=tuple(rng.uniform(0.1, 0.5, 3))),
        ]
        properties = {"section": "s", "material": "m", "up": tuple(rng.normal(size=3))}
        beams.append(Beam(name=f"w{link}", nodes=(above, f"a{link}"), **properties))
        kinds = 10.0 ** rng.uniform(5, 8, 4)
        kinds[rng.random(4) < 0.3] = RIGID
        if slides:  # its far node runs along the rail: a beam that grows
            across = np.eye(3)[rng.integers(2)] @ _turn(gamma, alpha).T
            beams.append(
                Beam(
                    name=f"rail{link}",
                    nodes=(f"a{link}", f"b{link}"),
                    section="s",
                    material="m",
                    up=tuple(across),
                )
            )
        else:
            joints.append(
                Joint(
                    name=f"J{link}",
                    nodes=(f"a{link}", f"b{link}"),
                    frame=f"f{link}",
                    axis="z",
                    stiffness=stiffness(*kinds),
                )
            )
        above, parent = f"b{link}", f"f{link}"
        if rng.random() < 0.5:
            rigids.append(Rigid(name=f"r{link}", nodes=(f"b{link}", f"c{link}")))
        else:
            beams.append(Beam(name=f"v{link}", nodes=(f"b{link}", f"c{link}"), **properties))
    struts.append(Strut(name="stay", nodes=("g", f"c{links - 1}"), stiffness=1e6))
    return Robot(
        name="arm",
        variables=variables,
        frames=frames,
        nodes=nodes,
        beams=beams,
        rigids=rigids,
        joints=joints,
        struts=struts,
        materials={"m": Material(E=2e11, G=8e10, density=7850.0)},
        sections={"s": Section(A=2e-3, Iy=3e-6, Iz=1e-6, J=2e-6, Ay=1e-3, Az=1.5e-3)},
        fixed=["g"],
        tcp=f"c{links - 1}",
    )


def _turn(gamma: float, alpha: float) -> np.ndarray:
    c, s, k, t = np.cos(gamma), np.sin(gamma), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * k, s * t], [s, c * k, -c * t], [0.0, t, k]])


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), links=st.integers(1, 4))
def test_random_arms_in_random_postures(seed: int, links: int) -> None:
    structure = compile_structure(moving_machine(seed, links))
    q = np.random.default_rng(seed).uniform(0.3, 1.5, (5, links))
    poses = posture(structure.kinematics, q)
    program = program_of(structure)
    assume(program is not None)  # nearly all: `up` of a beam that was drawn may be all but along it
    (_, _, found, _, _), sure = program.run(poses.values)
    assert sure.all()
    assert disagreement(found, generally(structure, poses).clamped) <= AGREED


def stayed(q: np.ndarray) -> tuple[Structure, np.ndarray]:
    """Return an arm that hinges freely, held by a strut: at q = 0 the strut points through the hinge."""
    robot = Robot(
        name="stayed",
        variables=[Variable(name="q", type="revolute")],
        frames=[Frame(name="f", theta="q")],
        nodes=[
            Node(name="g"),
            Node(name="foot", at=(2.0, 0.0, 0.0)),
            Node(name="hub", frame="f"),
            Node(name="tip", frame="f", at=(1.0, 0.0, 0.0)),
        ],
        beams=[Beam(name="b", nodes=("hub", "tip"), section="s", material="m", up=(0, 0, 1))],
        joints=[
            Joint(name="J", nodes=("g", "hub"), frame="f", axis="z", stiffness=stiffness(1e8, 1e8, FREE, 1e7))
        ],
        struts=[Strut(name="stay", nodes=("foot", "tip"), stiffness=1e7)],
        materials={"m": Material(E=2e11, G=8e10, density=7850.0)},
        sections={"s": Section(A=2e-3, Iy=3e-6, Iz=1e-6, J=2e-6)},
        fixed=["g", "foot"],
        tcp="tip",
    )
    return compile_structure(robot), q[:, None]


def test_a_mechanism_among_many_poses_is_named_with_its_number() -> None:
    structure, values = stayed(np.linspace(0.2, 1.2, MANY))
    poses = posture(structure.kinematics, values)
    assert disagreement(tcp_compliance(structure, poses), generally(structure, poses).clamped) <= AGREED
    values[MANY - 7] = 0.0
    with pytest.raises(BeamstiffError, match=rf"mechanism at pose {MANY - 7}: .* through J\.torsional"):
        tcp_compliance(structure, posture(structure.kinematics, values))


def test_near_a_mechanism_the_general_way_decides() -> None:
    """The strut all but points through the hinge: the program is not sure of its answer."""
    structure, values = stayed(np.linspace(0.2, 1.2, MANY))
    values[3] = 2e-4
    poses = posture(structure.kinematics, values)
    assert np.flatnonzero(~program_of(structure).run(poses.values)[1]).tolist() == [3]
    one = posture(structure.kinematics, values[3:4])
    assert (tcp_compliance(structure, poses)[3] == generally(structure, one).clamped[0]).all()


def test_loops_that_do_not_close_are_refused_in_many_poses_as_in_few() -> None:
    structure = compile_structure(load_robot("ir663"))
    poses = posture(structure.kinematics, within_limits(structure.robot, MANY))
    broken = poses.values.copy()
    broken[11, 2] = np.nan
    of = type(poses).of
    for some in (slice(None), slice(11, 12)):
        with pytest.raises(BeamstiffError, match="is not a number; does the pose close its loops"):
            tcp_compliance(structure, of(structure.kinematics, broken[some]))
    broken[11] = poses.values[11] + [0.0, 0.0, 1e-4, 0.0]
    with pytest.raises(BeamstiffError, match=r"joint 'J.*' and .* mm apart at pose 11"):
        tcp_compliance(structure, of(structure.kinematics, broken))


def test_a_posture_changed_by_hand_is_taken_as_it_is() -> None:
    structure = compile_structure(load_robot("kr240-2"))
    poses = posture(structure.kinematics, within_limits(structure.robot, MANY))
    moved = dataclasses.replace(poses, node_positions=1.1 * poses.node_positions)
    expected = generally(structure, moved).clamped
    assert (tcp_compliance(structure, moved) == expected).all()
    assert disagreement(tcp_compliance(structure, poses), expected) > 0.01


def test_another_robot_at_the_same_values_is_not_taken_for_this_one() -> None:
    robot = load_robot("kr240-2")
    stiffer = robot.with_parameters({robot.identify[0]: 1e9})
    structure, same = compile_structure(robot), compile_structure(stiffer)
    poses = posture(same.kinematics, within_limits(robot, MANY))
    assert disagreement(tcp_compliance(structure, poses), generally(structure, poses).clamped) <= AGREED
    structure, values = stayed(np.linspace(0.2, 1.2, MANY))
    tip = structure.robot.nodes[-1].model_copy(update={"at": (1.1, 0.0, 0.0)})
    longer = structure.robot.model_copy(update={"nodes": (*structure.robot.nodes[:-1], tip)})
    other = posture(compile_structure(longer).kinematics, values)
    expected = generally(structure, other).clamped
    assert (tcp_compliance(structure, other) == expected).all()
    assert disagreement(tcp_compliance(structure, posture(structure.kinematics, values)), expected) > 0.01


def test_what_a_pose_gets_does_not_depend_on_the_others() -> None:
    structure = compile_structure(load_robot("ir663"))
    q = within_limits(structure.robot, 3 * GRID)
    whole = tcp_compliance(structure, posture(structure.kinematics, q))
    for some in (slice(5, 5 + GRID), slice(GRID - 1, 3 * GRID)):
        assert (tcp_compliance(structure, posture(structure.kinematics, q[some])) == whole[some]).all()


def alike(one: Condensed, other: Condensed, met: float) -> None:
    """Check all parts, pose by pose against the largest entry.

    S is a difference of stiffness that met: below 1e-11 of that both ways take it for rounding.
    """
    floors = {"port_stiffness": 0.1 * ROUNDING / AGREED * met, "port_dead": 1e-6, "clamped_dead": 1e-6}
    for item in dataclasses.fields(Condensed):
        found, expected = (getattr(each, item.name).reshape(len(one.clamped), -1) for each in (one, other))
        size = np.abs(expected).max(axis=1, initial=0.0)
        off = np.abs(found - expected).max(axis=1, initial=0.0)
        assert (off <= AGREED * np.maximum(size, floors.get(item.name, 0.0))).all(), item.name


@pytest.mark.parametrize("name", ["ir663", "ir663-screws-beams", "gantry", "kr240-2", "tripod"])
def test_ports_and_dead_weight_of_shipped_robots(name: str) -> None:
    robot = load_robot(name)
    structure = compile_structure(robot)
    poses = posture(structure.kinematics, within_limits(robot, MANY))
    rng = np.random.default_rng(1)
    known = joint_unknowns(structure.unknowns)
    own = sorted(known)
    ports = [Port(robot.joints[at].name, "joint", at, direction) for at, direction in own]
    ports = [ports[at] for at in np.sort(rng.choice(len(ports), min(4, len(ports)), replace=False))]
    observed = [robot.tcp, next(node.name for node in robot.nodes if node.name not in robot.fixed)]
    numbers = tuple(known[port.index, port.direction] for port in ports)
    nodes = tuple(structure.kinematics.node_index[node] for node in observed)
    program = condensation_program(structure, nodes, numbers, True)
    assert program.run(poses.values)[1].all()
    met = float(program.port_size.max())
    alike(condense(structure, poses, observed, ports), generally(structure, poses, observed, ports), met)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), links=st.integers(1, 3))
def test_ports_and_dead_weight_of_random_arms(seed: int, links: int) -> None:
    made = moving_machine(seed, links)
    masses = [Mass(node=f"c{links - 1}", mass=40.0, at=(0.1, 0.2, -0.3)), Mass(node="a0", mass=10.0)]
    robot = made.model_copy(update={"masses": tuple(masses), "gravity": (1.0, -2.0, -9.0)})
    structure = compile_structure(robot)
    known = joint_unknowns(structure.unknowns)
    rng = np.random.default_rng(seed)
    ports = [Port("", "joint", at, direction) for at, direction in sorted(known) if rng.random() < 0.3]
    poses = posture(structure.kinematics, rng.uniform(0.3, 1.5, (5, links)))
    observed = [f"c{links - 1}", "b0"]
    nodes = tuple(structure.kinematics.node_index[node] for node in observed)
    numbers = tuple(known[port.index, port.direction] for port in ports)
    program = condensation_program(structure, nodes, numbers, True)
    assume(program is not None)  # nearly all: `up` of a beam that was drawn may be all but along it
    parts, sure = program.run(poses.values)
    assert sure.all()
    general = generally(structure, poses, observed, ports)
    parts[0] = np.where(general.port_stiffness == 0.0, 0.0, parts[0])  # rounding
    alike(Condensed(*parts), general, float(program.port_size.max(initial=0.0)))


def test_elimination_is_a_schur_complement() -> None:
    rng = np.random.default_rng(4)
    full = rng.normal(size=(9, 9)) * (rng.random((9, 9)) < 0.4)
    full = full @ full.T + np.eye(9)
    matrix = {(i, j): float(full[i, j]) for i in range(9) for j in range(i, 9) if full[i, j] != 0.0}
    order, _ = elimination_order(matrix, range(6))
    left, pivots = eliminate(matrix, order)
    expected = full[6:, 6:] - full[6:, :6] @ np.linalg.solve(full[:6, :6], full[:6, 6:])
    found = np.array([[left.get((min(i, j), max(i, j)), 0.0) for j in range(6, 9)] for i in range(6, 9)])
    assert np.abs(found - expected).max() <= 1e-12
    assert np.prod(list(pivots.values())) == pytest.approx(np.linalg.det(full[:6, :6]), rel=1e-10)


@pytest.mark.parametrize("own", ["6e7 N/m", "rigid"])
def test_struts_that_stretch_over_their_free_length_are_in_series_with_their_own_stiffness(own: str) -> None:
    platform = load_robot("stewart")
    struts = [
        Strut(name=one.name, nodes=one.nodes, stiffness=own, EA=f"{at + 2}e7 N", fixed_length="200 mm")
        for at, one in enumerate(platform.struts)
    ]
    robot = platform.model_copy(update={"struts": tuple(struts)})
    structure = compile_structure(robot)
    poses = posture(structure.kinematics, within_limits(robot, 8))
    (_, _, found, _, _), sure = program_of(structure).run(poses.values)
    assert sure.all()
    assert disagreement(found, generally(structure, poses).clamped) <= AGREED
    beside = tcp_compliance(compile_structure(platform), poses) if own == "6e7 N/m" else 0.0
    assert (np.trace(found - beside, axis1=-2, axis2=-1) > 0.0).all()  # a rod in series only softens
