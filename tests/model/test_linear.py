"""Displacements of rows of loads: with gravity and K_C against pendulums and an exact planar arm."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import compliance_of_rows, predict_displacements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Frame, Joint, Mass, Node, Rigid, Strut, Variable
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array
from tests import arms

LENGTH, STIFFNESS, MASS, G = 1.5, 2e4, 100.0, 9.81


def pendulum(mass: float = MASS, stiffness: float = STIFFNESS) -> Robot:
    """Return a rigid arm on a torsional spring about y that stands upright at q = 0 and turns over to +x."""
    return Robot(
        name="pendulum",
        variables=[Variable(name="q", type="revolute")],
        # z of the frame along y of the base
        frames=[Frame(name="axis", alpha=-np.pi / 2), Frame(name="arm", parent="axis", theta="q")],
        nodes=[
            Node(name="foot", frame="axis"),
            Node(name="hub", frame="arm"),
            Node(name="tip", frame="arm", at=(0, -LENGTH, 0)),
        ],
        rigids=[Rigid(name="rod", nodes=("hub", "tip"))],
        joints=[
            Joint(
                name="J",
                nodes=("foot", "hub"),
                frame="axis",
                variable="q",
                stiffness={"torsional": stiffness},
            )
        ],
        masses=[Mass(node="tip", mass=mass)],
        fixed=["foot"],
        tcp="tip",
    )


def rows(robot: Robot, q: list[list[float]], wrench: list[list[float]], **more: list[str]) -> Measurements:
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, wrench=wrench, **more)


@pytest.mark.parametrize("sign", [1, -1], ids=["upright", "hanging"])
def test_an_inverted_pendulum_is_softer_by_the_moment_of_its_weight(sign: int) -> None:
    robot, H, P = pendulum(), 50.0, 700.0
    q = [[0.0 if sign > 0 else np.pi]]
    sideways = rows(robot, q * 3, [[H, 0, 0, 0, 0, 0], [H, 0, -P, 0, 0, 0], [0, 0, 0, 0, 0, 0]])
    found = predict_displacements(robot, sideways, preload=True)
    turns = [H * LENGTH / (STIFFNESS - sign * load * LENGTH) for load in (MASS * G, MASS * G + P)]
    np.testing.assert_allclose(found[:2, 0], np.sin(turns) * LENGTH, rtol=1e-12)
    np.testing.assert_allclose(found[:2, 4], sign * np.array(turns), rtol=1e-12)
    assert np.abs(found[2]).max() < 1e-15
    plain = predict_displacements(robot, sideways)
    np.testing.assert_allclose(plain[:2, 0], H * LENGTH**2 / STIFFNESS, rtol=1e-12)


def test_a_load_along_an_arm_that_its_weight_has_turned_moves_it() -> None:
    """Gravity across the arm turns it, and a pull along it turns it back: nothing without preload."""
    robot, P = pendulum(), 500.0
    along = rows(robot, [[np.pi / 2]], [[P, 0, 0, 0, 0, 0]])
    weight = MASS * G * LENGTH
    loaded, hanging = weight / (STIFFNESS + P * LENGTH), weight / STIFFNESS
    found = predict_displacements(robot, along, preload=True)[0]
    np.testing.assert_allclose(found[4], loaded - hanging, rtol=1e-12)
    np.testing.assert_allclose(found[2], -(np.sin(loaded) - np.sin(hanging)) * LENGTH, rtol=1e-12)
    np.testing.assert_allclose(found[0], (np.cos(loaded) - np.cos(hanging)) * LENGTH, rtol=1e-9)
    assert np.abs(predict_displacements(robot, along)).max() < 1e-15


LINKS, SPRINGS, MASSES = np.array([0.8, 0.6, 0.5]), np.array([3e5, 2e5, 1e5]), np.array([40.0, 30.0, 60.0])


def planar_arm() -> Robot:
    """Return three rigid links in the plane x, y, weight along -y, masses at their ends."""
    masses = [Mass(node=f"t{at}", mass=MASSES[at - 1]) for at in (1, 2, 3)]
    nodes, links = "h0 h1 t1 h2 t2 h3 t3", ("l1", "l2", "l3")
    return arms.planar_arm("planar", LINKS, SPRINGS, nodes, links, gravity=(0, -G, 0), masses=masses)


def exact_turn(q: Array, wrench: Array, weight: float) -> float:
    """Return how far the last link turns in the true equilibrium under its weight and a wrench at the tip."""

    def unbalanced(turned: Array) -> Array:
        angle = np.cumsum(q + turned)
        moments = -SPRINGS * turned + wrench[5]
        ends = np.cumsum(LINKS * np.stack([np.cos(angle), np.sin(angle)]), axis=1)
        starts = np.concatenate([np.zeros((2, 1)), ends[:, :2]], axis=1)
        forces = np.zeros((2, 3))
        forces[1] = -weight * MASSES * G
        forces[:, 2] += wrench[:2]
        for joint in range(3):
            arm = ends - starts[:, joint : joint + 1]
            turning = arm[0] * forces[1] - arm[1] * forces[0]
            moments[joint] += turning[joint:].sum()
        return moments

    found = root(unbalanced, np.zeros(3), tol=1e-14)
    assert np.abs(unbalanced(found.x)).max() < 1e-7
    return float(found.x.sum())


def test_the_prediction_is_the_exact_equilibrium_to_second_order_in_the_loads() -> None:
    """The last link's turn is the sum of the joints', so nothing but equilibrium makes it nonlinear."""
    q, wrench = np.array([1.2, 0.3, -0.4]), np.array([900.0, -1500.0, 0, 0, 0, 200.0])
    missed: dict[bool, list[float]] = {False: [], True: []}
    for share in (1.0, 0.5, 0.25):
        robot = planar_arm()
        light = robot.model_copy(update={"gravity": (0, -share * G, 0)})
        exact = exact_turn(q, share * wrench, share) - exact_turn(q, 0 * wrench, share)
        table = rows(light, [q.tolist()], [(share * wrench).tolist()])
        for preload, errors in missed.items():
            errors.append(abs(predict_displacements(light, table, preload)[0, 5] - exact))
    plain, loaded = np.array(missed[False]), np.array(missed[True])
    np.testing.assert_allclose(plain[:-1] / plain[1:], 4, rtol=0.05)
    np.testing.assert_allclose(loaded[:-1] / loaded[1:], 8, rtol=0.1)
    assert (loaded < 0.05 * plain).all()


def test_point_and_load_point_count_with_preload_too() -> None:
    robot, H = pendulum(), 50.0
    table = rows(
        robot, [[0.0]] * 2, [[H, 0, 0, 0, 0, 0]] * 2, point=["hub", "tip"], load_point=["tip", "hub"]
    )
    found = predict_displacements(robot, table, preload=True)
    turn = H * LENGTH / (STIFFNESS - MASS * G * LENGTH)
    np.testing.assert_allclose(found[0], [0, 0, 0, 0, turn, 0], atol=1e-15)
    np.testing.assert_allclose(found[1], 0, atol=1e-15)


def test_a_small_load_without_weight_gives_the_plain_displacement() -> None:
    robot = load_robot("ir663").model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    table = rows(robot, [[0.1, 0.9], [0.2, 0.7]], [[0.9, 0, -0.3, 0, 0.1, 0]] * 2)
    plain, loaded = (predict_displacements(robot, table, preload) for preload in (False, True))
    np.testing.assert_allclose(loaded, plain, rtol=1e-4, atol=1e-14)
    assert not np.array_equal(loaded, plain)


def test_a_pendulum_too_heavy_for_its_spring_is_refused_and_named() -> None:
    robot = pendulum(stiffness=0.99 * MASS * G * LENGTH)
    table = rows(robot, [[0.0]], [[1.0, 0, 0, 0, 0, 0]])
    with pytest.raises(BeamstiffError, match=r"'pendulum' buckles under its load.*J\.torsional"):
        predict_displacements(robot, table, preload=True)
    heavy = rows(robot, [[3.0], [0.0]], [[1.0, 0, 0, 0, 0, 0]] * 2)  # hanging, then standing
    with pytest.raises(BeamstiffError, match=rf"^{heavy.place(1)}: robot 'pendulum' buckles under its load"):
        predict_displacements(robot, heavy, preload=True)
    for load, meant in ((-2e4, ""), (-3e5, r" \(300 N meant\?\)")):  # the second as if 300 were read in kN
        pushed = rows(pendulum(), [[0.0]] * 3, [[0, 0, one, 0, 0, 0] for one in (0, 1e4, load)])
        said = rf"{pushed.place(2)}: .* buckles under its load: .* this row is {-load:.0f} N{meant}: check"
        with pytest.raises(BeamstiffError, match=said):
            predict_displacements(pendulum(), pushed, preload=True)
    assert predict_displacements(robot, table)[0, 0] > 0


@pytest.mark.parametrize("preload", [False, True])
def test_a_moment_on_a_node_of_struts_is_refused_by_its_row(preload: bool) -> None:
    corners = {"a": (1, 0, 0), "b": (-1, 1, 0), "c": (-1, -1, 0)}
    robot = Robot(
        name="tripod",
        nodes=[Node(name="top", at=(0, 0, 1)), *(Node(name=name, at=at) for name, at in corners.items())],
        struts=[Strut(name=f"s{name}", nodes=(name, "top"), stiffness=1e6) for name in corners],
        fixed=list(corners),
        tcp="top",
    )
    table = rows(robot, [[], []], [[0, 0, 1, 0, 0, 0], [0, 0, 1, 5, 0, 0]])
    with pytest.raises(BeamstiffError, match=r"<arrays>:2: a moment acts on node 'top', which struts alone"):
        predict_displacements(robot, table, preload)


def test_the_compliance_of_rows_is_what_unit_wrenches_displace() -> None:
    robot = load_robot("kr240-2")
    names = [variable.name for variable in robot.actuated]
    q = np.random.default_rng(3).uniform(-0.5, 0.5, (4, len(names)))
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=np.zeros((4, 6)))
    found = compliance_of_rows(robot, rows)
    for at, wrench in enumerate(np.eye(6)):
        moved = predict_displacements(robot, replace(rows, wrench=np.tile(wrench, (4, 1))))
        np.testing.assert_allclose(found[:, :, at], moved, rtol=0, atol=1e-13 * np.abs(found).max())
