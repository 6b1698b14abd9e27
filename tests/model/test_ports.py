"""The port-reduced evaluator against the whole structure, and its derivatives against complex step.

Sources: the derivative of an inverse, dC/dk = -w w^T (Haftka & Guerdal, Elements of Structural Optimization,
ch. 7); complex step after Squire & Trapp, SIAM Review 40 (1998) 110.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import posture
from beamstiff.robot.reader import load_robot
from tests.fem.builders import FREE, RIGID, SECTION, STEEL, frame, relative_error

ROBOTS = {
    "ir663": ([-0.3, 0.5], [0.6, 1.2]),
    "ir663-screws-beams": ([0.68, 0.72], [0.85, 0.85]),
    "kr240-2": ([-1.0] * 6, [1.0] * 6),
}
LISTED = {
    "ir663": [
        "J12.torsional",
        "J18.torsional",
        "J18.radial",
        "J33.radial",
        "J99.radial",
        "J1010.radial",
        "arm.E",
    ],
    "ir663-screws-beams": ["nut2.axial", "nut8.axial", "J1010.radial", "J12.radial", "screw2.E", "arm.E"],
    "kr240-2": [f"J{at}.torsional" for at in range(1, 7)],
}
seeds = st.integers(0, 2**32 - 1)


def rows(robot: Robot, seed: int, count: int = 6) -> Measurements:
    """Return loads at random nodes of random poses, seen at other nodes; some rows share a pose."""
    rng = np.random.default_rng(seed)
    low, high = ROBOTS[robot.name]
    q = rng.uniform(low, high, (count - 2, len(low)))
    moving = [node.name for node in robot.nodes if node.name not in robot.fixed]
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.concatenate([q, q[:2]]),
        tcp=robot.tcp,
        wrench=rng.normal(size=(count, 6)) * 1000,
        displacement=np.zeros((count, 6)),
        point=[*rng.choice(moving, count - 1), robot.tcp],
        load_point=[*rng.choice(moving, count - 1), robot.tcp],
    )


def whole(robot: Robot, table: Measurements, gravity: bool) -> np.ndarray:
    """Return the displacements (N, 6) by solving the whole structure row by row."""
    structure = compile_structure(robot)
    result = np.zeros((len(table), 6))
    for row in range(len(table)):
        pose = posture(structure.kinematics, table.q[row : row + 1])
        loads = nodal_loads(structure, 1, {str(table.load_point[row]): table.wrench[row]})
        moved = respond(structure, pose, loads, gravity).displacement[0]
        result[row] = moved[structure.kinematics.node_index[str(table.point[row])]]
    return result


def values(model: PortModel, seed: int) -> np.ndarray:
    return model.start * 10.0 ** np.random.default_rng(seed).uniform(-1, 1, len(model.start))


@pytest.mark.parametrize("gravity", [False, True])
@pytest.mark.parametrize("name", ROBOTS)
def test_predictions_are_those_of_the_whole_structure(name: str, gravity: bool) -> None:
    robot = load_robot(name)
    for seed in range(2):
        table = rows(robot, seed)
        model = reduce_to_ports(robot, table, LISTED[name], gravity)
        assert relative_error(model.predict(model.start), whole(robot, table, gravity)) <= 1e-9
        stiffness = values(model, seed)
        changed = robot.with_parameters(dict(zip(model.parameters, stiffness, strict=True)))
        assert relative_error(model.predict(stiffness), whole(changed, table, gravity)) <= 1e-9


def by_complex_step(model: PortModel, stiffness: np.ndarray) -> np.ndarray:
    """Return the derivatives (N, 6, m) of ``clamped + B^T (S + diag k)^-1 f`` to machine precision."""
    result = np.zeros((len(model.pose), 6, len(stiffness)))
    for parameter in range(len(stiffness)):
        k = stiffness.astype(complex)
        k[parameter] += 1e-30j * stiffness[parameter]
        matrix = model.port_stiffness[model.pose] + np.tensordot(k, model.springs, 1)
        opened = np.linalg.solve(matrix, model.force[..., None].astype(complex))[..., 0]
        moved = np.einsum("npa,np->na", model.motion, opened)
        result[:, :, parameter] = moved.imag / (1e-30 * stiffness[parameter])
    return result


@settings(max_examples=15)
@given(name=st.sampled_from(sorted(ROBOTS)), seed=seeds, gravity=st.booleans())
def test_derivatives_are_exact(name: str, seed: int, gravity: bool) -> None:
    robot = load_robot(name)
    model = reduce_to_ports(robot, rows(robot, seed), LISTED[name], gravity)
    stiffness = values(model, seed)
    predicted, derivatives = model.derivatives(stiffness)
    assert (predicted == model.predict(stiffness)).all()
    expected = by_complex_step(model, stiffness)
    # by the change that a change of the stiffness by itself makes
    assert relative_error(derivatives * stiffness, expected * stiffness) <= 1e-9
    # of the logarithm dk = k dx, of the compliance dk = -k^2 dx
    assert relative_error(model.derivatives(stiffness, "log")[1], expected * stiffness) <= 1e-9
    by_compliance = model.derivatives(stiffness, "compliance")[1]
    assert relative_error(by_compliance / stiffness, -expected * stiffness) <= 1e-9


@pytest.mark.parametrize("name", ROBOTS)
def test_derivatives_are_differences_of_the_whole_structure(name: str) -> None:
    robot = load_robot(name)
    table = rows(robot, 5)
    model = reduce_to_ports(robot, table, LISTED[name], gravity=True)
    _, derivatives = model.derivatives(model.start)
    for at, parameter in enumerate(model.parameters):
        step = 1e-3 * model.start[at]
        two, four = (
            (
                whole(robot.with_parameters({parameter: model.start[at] + times * step}), table, True)
                - whole(robot.with_parameters({parameter: model.start[at] - times * step}), table, True)
            )
            / (2 * times * step)
            for times in (1, 2)
        )
        expected = (4 * two - four) / 3
        size = np.abs(whole(robot, table, True)).max() / model.start[at]
        assert np.abs(derivatives[..., at] - expected).max() <= 1e-8 * size


@pytest.mark.parametrize("name", ROBOTS)
def test_candidates_at_once_are_those_one_by_one(name: str) -> None:
    model = reduce_to_ports(load_robot(name), rows(load_robot(name), 3), LISTED[name])
    for seed, count in ((0, 1), (1, 2), (2, 5)):
        some = np.stack([values(model, seed + at) for at in range(count)])
        one_by_one = np.stack([model.predict(one) for one in some])
        assert relative_error(model.predict(some), one_by_one) <= 1e-12


def test_many_rows_in_one_pose_are_those_one_by_one() -> None:
    """More loads in a pose than ports: the other way to solve."""
    table = make_measurements(
        ["q2", "q8"],
        [[0.1, 0.8]] * 7 + [[0.2, 0.9]],
        tcp="n7",
        wrench=np.random.default_rng(0).normal(size=(8, 6)),
        displacement=np.zeros((8, 6)),
    )
    model = reduce_to_ports(load_robot("ir663"), table, ["J12.torsional", "J18.torsional"])
    stiffness = values(model, 1)
    one_by_one = np.concatenate([model.rows([row]).predict(stiffness) for row in range(8)])
    assert relative_error(model.predict(stiffness), one_by_one) <= 1e-12


def telescope(struts: int = 0) -> tuple[Robot, Measurements]:
    """Return a bar along z that grows with a slide, pulled and pushed sideways at 1 m and at 2.5 m."""
    robot = Robot(
        name="telescope",
        variables=[{"name": "r", "type": "prismatic"}],
        frames=[{"name": "end", "r": "r"}],
        materials={"steel": STEEL},
        sections={"bar": SECTION},
        nodes=[{"name": "root"}, {"name": "tip", "frame": "end"}],
        beams=[
            {"name": "bar", "nodes": ["root", "tip"], "section": "bar", "material": "steel", "up": [1, 0, 0]}
        ],
        struts=[{"name": f"t{at}", "nodes": ["root", "tip"], "stiffness": 1e6} for at in range(struts)],
        fixed=["root"],
        tcp="tip",
    )
    loads = [[0, 0, 1e4, 0, 0, 0], [1e3, 0, 0, 0, 0, 0]] * 2
    table = make_measurements(
        ["r"], [[1.0], [1.0], [2.5], [2.5]], tcp="tip", wrench=loads, displacement=np.zeros((4, 6))
    )
    return robot, table


def test_the_modulus_of_a_beam_that_grows_counts_by_its_length_in_each_pose() -> None:
    """F L / (E A) and F L^3 / (3 E I)."""
    robot, table = telescope()
    model = reduce_to_ports(robot, table, ["bar.E"])
    for modulus in (70e9, 210e9):
        moved = model.predict(np.array([modulus]))
        for row, length in ((0, 1.0), (2, 2.5)):
            assert moved[row, 2] == pytest.approx(1e4 * length / (modulus * SECTION.A), rel=1e-9)
            bending = 1e3 * length**3 / (3 * modulus * SECTION.Iz)  # local y along `up`, x
            assert moved[row + 1, 0] == pytest.approx(bending, rel=1e-9)


def test_a_beam_that_grows_beside_springs_in_parallel_is_refused() -> None:
    robot, table = telescope(struts=2)
    with pytest.raises(BeamstiffError, match="springs in parallel beside the modulus of a beam that changes"):
        reduce_to_ports(robot, table, ["bar.E", "t0", "t1"])


CHAIN = frame(
    [(0, 0, 0), (1, 0, 0), (1, 0, 0), (2, 0, 0)],
    beams=[(0, 1), (2, 3)],
    joints=[(1, 2, (0, 0, 1), (1e6, RIGID, FREE, 2e4))],
    struts=[(0, 3, 1e5)],
    up=(0, 1, 0.5),
)


def pulled(node: str = "n3") -> Measurements:
    wrench = np.array([[10.0, 20, 30, 4, 5, 6], [0, 0, -50, 0, 0, 0]])
    nothing = np.zeros((2, 6))
    return make_measurements(
        [], np.zeros((2, 0)), tcp=node, wrench=wrench, displacement=nothing, load_point=[node] * 2
    )


def test_what_is_rigid_or_free_starts_at_one_and_ends_there() -> None:
    braced = CHAIN.model_copy(
        update={
            "struts": (
                *CHAIN.struts,
                CHAIN.struts[0].model_copy(update={"name": "t1", "nodes": ("n0", "n2")}),
            )
        }
    )
    names = ["j0.radial", "j0.tilting", "t0"]
    model = reduce_to_ports(braced.with_parameters({"j0.torsional": 1e4}), pulled(), names)
    assert model.start.tolist() == [1.0, 2e4, 1e5]
    assert (model.springs == [np.diag(d) for d in ([1, 1, 0, 0, 0], [0, 0, 1, 1, 0], [0, 0, 0, 0, 1])]).all()
    stiff = braced.with_parameters({"j0.torsional": 1e4})
    found = model.predict(np.array([1e30, 2e4, 1e5]))
    assert relative_error(found, whole(stiff, pulled(), False)) <= 1e-9
    released = braced.with_parameters({"j0.torsional": 1e4, "t0": FREE})
    found = model.predict(np.array([1e30, 2e4, 0.0]))
    assert relative_error(found, whole(released, pulled(), False)) <= 1e-9


@given(low=st.floats(1e-6, 1.0), high=st.floats(1.0, 1e25))
def test_softest_and_stiffest_springs_in_series_and_in_parallel(low: float, high: float) -> None:
    """Ports of joints in series lose no digits to one another, whatever their ratio: 1/a + 1/b."""
    assume(high / low < 1e300)
    spring = (RIGID, RIGID, 1.0, RIGID)
    twins = frame(
        [(0, 0, 0)] * 3, joints=[(0, 1, (0, 0, 1), spring), (1, 2, (0, 0, 1), spring)], fixed=(0,), tcp=2
    )
    table = make_measurements(
        [], np.zeros((1, 0)), tcp="n2", wrench=[[0, 0, 0, 0, 0, 1.0]], displacement=[[0.0] * 6]
    )
    model = reduce_to_ports(twins, table, ["j0.torsional", "j1.torsional"])
    for pair in ((low, high), (high, low)):
        turned = model.predict(np.array(pair))[0, 5]
        assert abs(turned / (1 / low + 1 / high) - 1) <= 1e-12


@pytest.mark.parametrize("bad", [[-1.0, 1e5], [np.nan, 1e5], [np.inf, 1e5], [1e5], [1e5] * 3])
def test_values_that_are_no_stiffness_are_refused(bad: list[float]) -> None:
    stable = CHAIN.with_parameters({"j0.torsional": 1e4})
    model = reduce_to_ports(stable, pulled(), ["j0.axial", "t0"])
    with pytest.raises(BeamstiffError, match="expected 2 finite and positive ones"):
        model.predict(np.array(bad))
    with pytest.raises(BeamstiffError, match="expected 2 finite and positive ones"):
        model.derivatives(np.array(bad))


def test_a_mechanism_of_the_ports_is_named_by_its_parameters() -> None:
    """Each port may be free as long as the other holds; both together may not."""
    points = [(0, 0, 0), (0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1)]
    hinge = (RIGID, RIGID, 1e5, 1e5)
    robot = frame(
        points,
        beams=[(1, 2), (2, 4)],
        joints=[(0, 1, (1, 0, 0), hinge), (3, 4, (0, 0, 1), (FREE, FREE, 1e5, FREE))],
        fixed=(0, 3),
        tcp=2,
        up=(0, 1, 0),
    )
    table = pulled("n2")
    model = reduce_to_ports(robot, table, ["j0.tilting", "j1.torsional"])
    assert np.isfinite(model.predict(np.array([1e5, 0.0]))).all()
    with pytest.raises(
        BeamstiffError, match=r"j0\.tilting.*: with so little stiffness the robot is a mechanism"
    ):
        model.predict(np.array([0.0, 0.0]))


def test_a_mechanism_beside_the_ports_is_found_when_they_are_reduced() -> None:
    with pytest.raises(BeamstiffError, match=r"robot 'frame' is a mechanism: .* through j0\.torsional"):
        reduce_to_ports(CHAIN, pulled(), ["j0.tilting"])


def test_unknown_and_repeated_parameters_and_none_at_all() -> None:
    table = pulled()
    with pytest.raises(
        BeamstiffError, match=r"no stiffness parameter 'j0\.tilt' \(did you mean 'j0\.tilting'\?\)"
    ):
        reduce_to_ports(CHAIN, table, ["j0.tilt"])
    with pytest.raises(BeamstiffError, match=r"'j0\.tilting' is named twice"):
        reduce_to_ports(CHAIN, table, ["j0.tilting", "j0.tilting"])
    with pytest.raises(BeamstiffError, match="names no parameters under `identify`"):
        reduce_to_ports(CHAIN, table)


def test_a_moment_where_struts_alone_hold_is_refused() -> None:
    points = [(0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 1, 1), (0.5, 0.5, 1)]
    robot = frame(
        points, beams=[(0, 1)], struts=[(0, 4, 1e6), (2, 4, 1e6), (3, 4, 1e6)], fixed=(0, 2, 3), tcp=1
    )
    with pytest.raises(
        BeamstiffError, match=r"<arrays>:\d+: a moment acts on node 'n4', which struts alone hold"
    ):
        reduce_to_ports(robot, pulled("n4"), ["t0"])
