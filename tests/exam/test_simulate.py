"""The simulated machine without effects: against closed forms, and the library where both must agree."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import beamstiff.exam
from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.exam.effect import Reality
from beamstiff.exam.equilibrium import Load, Problem, equilibrium, rows_of
from beamstiff.exam.laws import Situation
from beamstiff.exam.layout import lay_out, topology_of
from beamstiff.exam.machine import machine_of
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.rotations import turn, turned_by
from beamstiff.exam.simulate import draw_stiffness, simulate, solve
from beamstiff.exam.strain import State, Tangent, add_stiffness, resisting, strain_of
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Beam, Frame, Joint, JointStiffness, Mass, Material, Node, Rigid, Variable
from beamstiff.robot.sections import Section
from tests.exam.campaigns import campaign_of, random_loads, random_poses, read, without_weight

ROBOTS = ["kr240-2", "kr500", "ir663", "ir663-screws", "ir663-screws-beams", "gantry", "tripod"]
ALLOWED = {
    "beamstiff.errors",
    "beamstiff.robot.description",
    "beamstiff.robot.parts",
    "beamstiff.robot.expression",  # parses frame parameters: plain data
    "beamstiff.robot.sections",  # area and second moments of a section: plain data
    "beamstiff.measure.table",
}
SIMULATOR = [
    "campaign", "rotations", "placing", "machine", "laws", "layout", "strain", "equilibrium",
    "components", "draws", "parameters", "effect", "added_parts", "simulate", "sizes", "record", "names",
]  # fmt: skip


def test_shares_no_equations_with_the_library() -> None:
    folder = Path(beamstiff.exam.__file__).parent
    forms = sorted((folder / "forms").rglob("*.py"))
    assert {file.parent.name for file in forms} == {"forms", *(f"author{n}" for n in range(1, 5))}
    for file in [folder / f"{name}.py" for name in SIMULATOR] + forms:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                assert not [alias for alias in node.names if alias.name.startswith("beamstiff")], file
            if isinstance(node, ast.ImportFrom):
                module = str(node.module)
                known = module in ALLOWED or module.startswith("beamstiff.exam.forms")
                own = module.removeprefix("beamstiff.exam.") in SIMULATOR
                assert node.level == 0, f"{file.name} imports by a relative name"
                assert known or own or not module.startswith("beamstiff"), f"{file.name} imports {module}"


@pytest.mark.parametrize("name", ROBOTS)
def test_frames_and_loops_stand_where_the_library_puts_them(name: str) -> None:
    robot = load_robot(name)
    limits = np.array([variable.limits for variable in robot.actuated])
    q = limits[:, 0] + np.random.default_rng(1).uniform(size=(60, len(limits))) * np.diff(limits).T
    placed = place(skeleton_of(robot), q)
    expected = posture(compile_kinematics(robot), q).node_positions
    found = np.stack([placed.node(node) for node in robot.nodes], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize("name", ROBOTS)
def test_differs_from_linear_theory_by_the_square_of_the_load(name: str) -> None:
    robot = without_weight(load_robot(name))
    rng = np.random.default_rng(3)
    q = random_poses(robot, rng, 10)
    loads = random_loads(rng, 10, [1.0])
    compliance = tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))
    errors = []
    for factor in (1.0, 0.1):
        linear = np.einsum("pij,pj->pi", compliance, factor * loads[:, 0])
        errors.append(np.abs(read(robot, campaign_of(robot, q, factor * loads)) - linear).max(axis=0))
        size = np.abs(linear).max(axis=0)
    assert (errors[0] < 0.02 * 10.0 * size).all()
    np.testing.assert_allclose(errors[0] / errors[1], 100.0, rtol=0.1)


def test_redundant_rigid_loops_agree_with_linear_theory() -> None:
    robot = without_weight(load_robot("ir663"))
    stiff = [
        joint.model_copy(update={"stiffness": joint.stiffness.model_copy(update={"radial": np.inf})})
        for joint in robot.joints
    ]
    links = [Rigid(name=beam.name, nodes=beam.nodes) for beam in robot.beams]
    robot = robot.model_copy(
        update={"beams": (), "rigids": tuple(links), "joints": tuple(stiff), "identify": ()}
    )
    rng = np.random.default_rng(4)
    q = random_poses(robot, rng, 6)
    loads = random_loads(rng, 6, [0.01])
    compliance = tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))
    linear = np.einsum("pij,pj->pi", compliance, loads[:, 0])
    np.testing.assert_allclose(
        read(robot, campaign_of(robot, q, loads)), linear, atol=2e-4 * np.abs(linear).max()
    )


def _pendulum(stiffness: float, mass: float) -> Robot:
    return Robot(
        name="pendulum",
        variables=[Variable(name="q1", type="revolute", limits=(-1.0, 1.0))],
        frames=[Frame(name="f1", alpha="90 deg", theta="q1")],
        nodes=[Node(name="a"), Node(name="b", frame="f1"), Node(name="tip", frame="f1", at=(2.0, 0, 0))],
        rigids=[Rigid(name="arm", nodes=["b", "tip"])],
        joints=[
            Joint(
                name="J",
                nodes=["a", "b"],
                frame="f1",
                variable="q1",
                stiffness=JointStiffness(torsional=stiffness),
            )
        ],
        masses=[Mass(node="tip", mass=mass)],
        fixed=["a"],
        tcp="tip",
    )


def test_pendulum_on_a_soft_spring_hangs_where_statics_says() -> None:
    # k x = -(m g + F) L cos(q + x): rotations of more than a radian
    robot = _pendulum(300.0, 20.0)
    q, down = np.array([[0.3], [-0.4]]), 150.0
    campaign = campaign_of(robot, q, [[0, 0, -down, 0, 0, 0]], kind="absolute")
    found = read(robot, campaign)
    for row, angle in enumerate(q[:, 0]):
        x = brentq(
            lambda x, a=angle: 300.0 * x + (20.0 * 9.81 + down) * 2.0 * np.cos(a + x), -3.0, 0.0, xtol=1e-14
        )
        np.testing.assert_allclose(
            found[row, :3], [2 * np.cos(angle + x), 0, 2 * np.sin(angle + x)], atol=1e-9
        )


def test_cantilever_follows_the_elastica() -> None:
    # Mattiasson (1981), Int. J. Num. Meth. Engng 17, 145: tip load P L^2/EI = 1, 5
    n, length, second = 16, 1.0, 1e-9
    nodes = [Node(name=f"n{i}", at=(i * length / n, 0, 0)) for i in range(n + 1)]
    robot = Robot(
        name="cantilever",
        gravity=(0, 0, 0),
        materials={"steel": Material(E=2e11, G=8e10)},
        sections={"rod": Section(A=1e-2, Iy=second, Iz=second, J=2e-9)},
        nodes=nodes,
        beams=[
            Beam(name=f"b{i}", nodes=[f"n{i}", f"n{i + 1}"], section="rod", material="steel")
            for i in range(n)
        ],
        fixed=["n0"],
        tcp=f"n{n}",
    )
    EI = 2e11 * second
    loads = [[0, 0, p * EI / length**2, 0, 0, 0] for p in (1.0, 5.0)]
    found = read(robot, campaign_of(robot, np.zeros((1, 0)), loads))
    np.testing.assert_allclose(found[:, 2], [0.30172, 0.71379], rtol=2e-3)
    np.testing.assert_allclose(-found[:, 0], [0.05643, 0.38763], rtol=4e-3)
    np.testing.assert_allclose(-found[:, 4], [0.46135, 1.21537], rtol=2e-3)


@pytest.mark.parametrize("name", ["kr240-2", "ir663", "ir663-screws", "tripod"])
def test_tangent_is_the_derivative_of_the_forces(name: str) -> None:
    robot = load_robot(name)
    rng = np.random.default_rng(5)
    q = random_poses(robot, rng, 2)
    topology = topology_of(machine_of(robot))
    layout = lay_out(topology, place(skeleton_of(robot), q))
    bodies, rows = topology.bodies, 6 * len(topology.members) + len(topology.rods)
    state = State(
        2e-3 * rng.standard_normal((2, bodies, 3)),
        turn(2e-3 * rng.standard_normal((2, bodies, 3))),
        np.zeros((2, 0)),
    )
    force = rng.standard_normal((2, rows))

    def forces(moved: np.ndarray) -> np.ndarray:
        there = State(state.moved + moved[..., :3], turn(moved[..., 3:]) @ state.turned, state.hold)
        return resisting(topology, strain_of(topology, layout, there), force)

    tangent = np.zeros((2, 6 * bodies, 6 * bodies))
    constant = Tangent(np.zeros_like(layout.stiffness), np.zeros((2, len(topology.rods))), [])
    add_stiffness(tangent, topology, layout, strain_of(topology, layout, state), force, constant)
    for column in rng.choice(6 * bodies, 12, replace=False):
        step = np.zeros((2, bodies, 6))
        step.reshape(2, -1)[:, column] = 1e-6
        slope = (forces(step) - forces(-step)) / 2e-6
        # terms of second order in the springs' relative rotation (2e-3 rad) are left out
        np.testing.assert_allclose(tangent[:, :, column], slope, atol=2e-2)


@pytest.mark.parametrize("name", ROBOTS)
def test_forces_balance_on_every_body(name: str) -> None:
    robot = load_robot(name)
    rng = np.random.default_rng(6)
    q = random_poses(robot, rng, 6)
    solved = solve(Reality(machine_of(robot)), campaign_of(robot, q, random_loads(rng, 6, [0.5, 2.0])))
    # springs of 5e13 N/m times the rounding of a metre leave some 1e-3 N; 2e-10 of the loads elsewhere
    stiffest = max([1e9, *(k for j in robot.joints for k in (j.stiffness.radial,) if np.isfinite(k))])
    assert solved.unbalanced.max() < 1e-6 + 1e-17 * stiffest


@pytest.mark.parametrize("name", ["kr240-2", "ir663", "gantry"])
def test_the_loaded_machine_is_reciprocal(name: str) -> None:
    """Forces have a potential: the answer at i to a small force more at j is that at j to the same at i."""
    robot = without_weight(load_robot(name))  # the beams' weight has couples, which have no potential
    rng = np.random.default_rng(7)
    q = random_poses(robot, rng, 1)
    force = np.concatenate([1500.0 * rng.standard_normal(3), np.zeros(3)])
    small = np.concatenate([10.0 * np.eye(3), np.zeros((3, 3))], axis=1)
    found = read(robot, campaign_of(robot, q, np.concatenate([force + small, force - small])))[:, :3]
    compliance = (found[:3] - found[3:]) / 20.0
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-9 * np.abs(compliance).max() + 1e-15)


def test_work_of_the_loads_does_not_depend_on_their_order() -> None:
    robot = load_robot("kr240-2")
    q = random_poses(robot, np.random.default_rng(8), 1)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    way = 0.5 * (nodes + 1.0)
    A, B = np.array([2e3, 0, 500, 0, 0, 0.0]), np.array([0, 1.5e3, -2e3, 0, 0, 0.0])
    works = []
    for first, second in ((A, B), (B, A)):
        # complementary work: integral of displacement over load, along two straight legs
        total = 0.0
        for start, leg in ((np.zeros(6), first), (first, second)):
            found = read(robot, campaign_of(robot, q, start + way[:, None] * leg))
            total += float(0.5 * weights @ (found @ leg))
        works.append(total)
    assert works[0] == pytest.approx(works[1], rel=1e-10)


def test_absolute_rows_are_where_the_frames_are_when_nothing_bends() -> None:
    robot = without_weight(load_robot("kr240-2"))
    q = random_poses(robot, np.random.default_rng(9), 5)
    found = read(robot, campaign_of(robot, q, np.zeros((1, 6)), kind="absolute"))
    stands = posture(compile_kinematics(robot), q)
    tcp = compile_kinematics(robot).node_index[robot.tcp]
    np.testing.assert_allclose(found[:, :3], stands.node_positions[:, tcp], atol=1e-12)
    frame = compile_kinematics(robot).frame_index["f6"]
    np.testing.assert_allclose(turn(found[:, 3:]), stands.transforms[:, frame, :3, :3], atol=1e-12)


def test_rows_of_one_state_seen_at_several_points_share_the_state() -> None:
    robot = load_robot("ir663")
    q = np.repeat(random_poses(robot, np.random.default_rng(10), 1), 2, axis=0)
    wrench = np.tile([900.0, 0, -500, 0, 0, 0], (2, 1, 1)).reshape(2, 1, 6)
    both = campaign_of(
        robot, q, wrench, pose=np.zeros(2, int), step=np.zeros(2, int), point=np.array(["n7", "n3"])
    )
    found = read(robot, both)
    for row, point in enumerate(("n7", "n3")):
        alone = campaign_of(robot, q[:1], wrench[:1], point=np.array([point]))
        np.testing.assert_allclose(found[row], read(robot, alone)[0], atol=1e-14)
    assert np.linalg.norm(found[0, :3]) > 1.2 * np.linalg.norm(found[1, :3])


def test_noise_is_as_declared_and_shared_where_the_unloaded_reading_is() -> None:
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(11)
    q = random_poses(robot, rng, 300)
    for shared in (False, True):
        campaign = campaign_of(
            robot, q, np.zeros((4, 6)), sigma_position=3e-5, sigma_rotation=5e-5, claimed_position=1e-5,
            shared_unloaded=shared,
        )  # fmt: skip
        rows = simulate(robot, [], campaign, rng)
        assert rows.sigma_position == 1e-5
        assert rows.shared_unloaded is shared
        noise = rows.displacement.reshape(300, 4, 6)
        np.testing.assert_allclose(noise.std(axis=(0, 1)), np.repeat([3e-5, 5e-5], 3), rtol=0.08)
        between = np.mean(noise[:, 0, :3] * noise[:, 1, :3]) / 3e-5**2
        assert between == pytest.approx(0.5 if shared else 0.0, abs=0.12)


def test_rotations_are_left_out_on_request() -> None:
    robot = load_robot("kr240-2")
    campaign = campaign_of(robot, np.zeros((1, 6)) + 0.3, [[0, 0, -1e3, 0, 0, 0]], rotations=False)
    rows = simulate(robot, [], campaign, np.random.default_rng(0))
    assert np.isnan(rows.displacement[:, 3:]).all()
    assert not np.isnan(rows.displacement[:, :3]).any()


def test_true_stiffness_is_spread_about_the_nominal_one() -> None:
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(12)
    drawn = np.array([list(draw_stiffness(rng, robot).values()) for _ in range(400)])
    ratio = np.log(drawn / [robot.parameter(name) for name in robot.identify])
    np.testing.assert_allclose(ratio.mean(axis=0), 0.0, atol=0.05)
    np.testing.assert_allclose(ratio.std(axis=0), 0.25, rtol=0.12)


def test_rotation_vectors_return_from_their_matrices_up_to_half_a_turn() -> None:
    axis = np.random.default_rng(13).standard_normal((200, 3))
    vector = (
        axis
        / np.linalg.norm(axis, axis=1)[:, None]
        * np.concatenate([10.0 ** -np.arange(20), np.linspace(0.1, np.pi - 1e-6, 180)])[:, None]
    )
    np.testing.assert_allclose(turned_by(turn(vector)), vector, atol=1e-8)


def test_a_machine_that_cannot_stand_is_refused() -> None:
    robot = _pendulum(300.0, 20.0)
    loose = robot.joints[0].model_copy(update={"stiffness": JointStiffness(torsional="free")})
    robot = robot.model_copy(update={"joints": (loose,), "frames": (Frame(name="f1", theta="q1"),)})
    with pytest.raises(BeamstiffError, match="pendulum"):
        read(robot, campaign_of(robot, [[0.2]], [[0, 1.0, -1.0, 0, 0, 0]]))


def test_equilibrium_does_not_depend_on_where_the_search_starts() -> None:
    robot = load_robot("ir663")
    q = random_poses(robot, np.random.default_rng(14), 3)
    topology = topology_of(machine_of(robot))
    layout = lay_out(topology, place(skeleton_of(robot), q))
    body = np.full(3, topology.body[topology.index[robot.tcp]])
    wrench = np.tile([800.0, 300, -1e3, 50, 0, 20], (3, 1))
    load = Load(body, layout.arms[:, topology.index[robot.tcp]], wrench)
    situation = Situation({}, np.zeros(3), np.zeros(3), np.zeros(3))
    problem = Problem(topology, rows_of(topology), layout, load, situation)
    start = problem.at_rest()
    shaken = dataclasses.replace(start, moved=start.moved + 1e-3 * (np.arange(topology.bodies) > 0)[:, None])
    found = [equilibrium(problem, state).state.moved[:, 1:] for state in (start, shaken)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-11)
