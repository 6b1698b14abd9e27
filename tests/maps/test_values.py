"""The numbers of a map are those of closed forms and of the other commands."""

import itertools
import re

import numpy as np
import pytest

from beamstiff import Robot, compile_structure, load_robot, map_workspace, posture, tcp_compliance
from beamstiff.errors import BeamstiffError
from beamstiff.fem import condensation
from beamstiff.maps.quantities import Reason
from beamstiff.planning.dexterity import inverse_condition, normalised_jacobian
from beamstiff.robot.kinematics import posture_at
from beamstiff.se3 import Array
from tests.maps.robots import K1, K2, L1, L2, planar_angles, planar_arm, planar_compliance, planar_jacobian

Q1, Q2 = np.linspace(-3, 3, 7), np.linspace(0.2, 2.9, 41)


def test_stiffness_of_a_planar_arm_is_its_closed_form() -> None:
    found = map_workspace(
        planar_arm(),
        {"q1": Q1, "q2": Q2},
        quantities=["stiffness", "stiffness_along", "compliance_trace", "rotational_stiffness"],
        direction=[3.0, 4.0, 0.0],
    )
    compliance = planar_compliance(*np.meshgrid(Q1, Q2, indexing="ij"))
    softest = np.linalg.eigvalsh(compliance)[..., -1]
    np.testing.assert_allclose(found.stiffness, 1 / softest, rtol=1e-11)
    along = np.array([0.6, 0.8])
    np.testing.assert_allclose(found.stiffness_along, 1 / ((compliance @ along) @ along), rtol=1e-8)
    np.testing.assert_allclose(found.compliance_trace, np.trace(compliance, axis1=2, axis2=3), rtol=1e-11)
    np.testing.assert_allclose(found.rotational_stiffness, 1 / (1 / K1 + 1 / K2), rtol=1e-11)
    assert (found.reason == Reason.COMPUTED).all()


def test_deflection_under_a_wrench_is_the_closed_form() -> None:
    found = map_workspace(
        planar_arm(),
        {"q1": Q1, "q2": Q2},
        quantities=["deflection", "displacement"],
        wrench=[300.0, -500.0, 1e4, 0.0, 0.0, 20.0],
    )
    q1, q2 = np.meshgrid(Q1, Q2, indexing="ij")
    jacobian = planar_jacobian(q1, q2)
    torque = jacobian.swapaxes(-1, -2) @ [300.0, -500.0] + 20.0
    turn = torque / [K1, K2]
    moved = (jacobian @ turn[..., None])[..., 0]
    expected = np.zeros((*q1.shape, 6))
    expected[..., :2], expected[..., 5] = moved, turn.sum(axis=-1)
    np.testing.assert_allclose(found.displacement, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(found.deflection, np.linalg.norm(moved, axis=-1), rtol=1e-10)
    assert found.displacement.dims == ("q1", "q2", "motion")
    assert found.displacement.sel(motion="rz").shape == q1.shape


def test_kappa_and_manipulability_are_those_of_the_jacobian() -> None:
    length = 0.3
    found = map_workspace(
        planar_arm(), {"q1": Q1, "q2": Q2}, quantities=["kappa", "dexterity", "manipulability"], length=length
    )
    jacobian = planar_jacobian(*np.meshgrid(Q1, Q2, indexing="ij"))
    whole = np.concatenate([jacobian / length, np.ones((*jacobian.shape[:2], 1, 2))], axis=2)
    gram = whole.swapaxes(-1, -2) @ whole
    kappa = np.sqrt(np.trace(gram, axis1=2, axis2=3) * np.trace(np.linalg.inv(gram), axis1=2, axis2=3)) / 2
    np.testing.assert_allclose(found.kappa, kappa, rtol=1e-10)
    np.testing.assert_allclose(found.dexterity, 1 / kappa, rtol=1e-10)
    np.testing.assert_allclose(found.manipulability, np.sqrt(np.linalg.det(gram)), rtol=1e-10)


def test_a_turn_about_the_first_axis_changes_no_least_stiffness() -> None:
    over = {"q1": Q1, "q2": [0.4, 1.0], "q3": [-1.5, -0.6]}
    values = map_workspace(load_robot("kr240-2"), over, held={"q5": 1.0}).stiffness.values
    np.testing.assert_allclose(values, np.broadcast_to(values[:1], values.shape), rtol=1e-12)
    assert values.std() > 1e4


@pytest.mark.parametrize(
    ("name", "over", "held"),
    [
        ("kr240-2", {"q2": np.linspace(0.1, 1.4, 31), "q3": np.linspace(-2, 0, 29)}, {"q5": 0.8}),
        ("ir663", {"q2": np.linspace(-0.6, 0.8, 31), "q8": np.linspace(0.4, 1.2, 29)}, {}),
        ("gantry", {"qx": np.linspace(0.7, 2.3, 31), "qz": np.linspace(0.3, 1.1, 29)}, {"qy": 0.2}),
        ("tripod", {"r1": np.linspace(1.15, 1.35, 4), "r3": np.linspace(1.15, 1.35, 3)}, {"r2": 1.2}),
    ],
)
def test_a_map_is_what_stiffness_gives_pose_by_pose(
    name: str, over: dict[str, Array], held: dict[str, float]
) -> None:
    """Many poses go by the recorded elimination, one alone by matrices: two ways to one answer.

    To 1e-12; but IR-663 to 1e-11, where the last digit of the joint values alone makes more than 1e-12.
    """
    robot = load_robot(name)
    found = map_workspace(
        robot, over, held=held, quantities=["compliance", "stiffness_matrix", "kappa"], length=0.7
    )
    assert (found.reason == Reason.COMPUTED).all()
    structure = compile_structure(robot)
    (a, first), (b, second) = over.items()
    offs, digits = [], []
    for i, j in itertools.product(range(0, len(first), 5), range(0, len(second), 5)):
        one = posture(structure.kinematics, {**held, a: first[i], b: second[j]})
        compliance = tcp_compliance(structure, one)[0]
        next_one = posture_at(structure.kinematics, np.nextafter(one.values, np.inf))
        offs.append(apart(found.compliance.values[i, j], compliance))
        digits.append(apart(tcp_compliance(structure, next_one)[0], compliance))
        assert apart(found.stiffness_matrix.values[i, j], condensation.tcp_stiffness(compliance)) < 1e-9
        kappa = 1 / inverse_condition(normalised_jacobian(structure.kinematics, one, 0.7))[0]
        assert found.kappa.values[i, j] == pytest.approx(kappa, rel=1e-9)
    assert max(offs) < (1e-11 if max(digits) > 1e-12 else 1e-12)


def apart(found: Array, expected: Array) -> float:
    """Return the largest difference of two symmetric matrices beside their diagonals."""
    size = np.sqrt(np.diagonal(expected))
    return float(np.abs((found - expected) / size / size[:, None]).max())


def test_sag_is_the_displacement_by_dead_weight() -> None:
    """A load of 30 kg on the planar arm, gravity along -y: m g J^T in both joints."""
    weight = 30 * 9.81
    arm = planar_arm()
    arm = Robot(**{**arm.model_dump(), "gravity": (0, -9.81, 0), "masses": [{"node": "tip", "mass": 30.0}]})
    found = map_workspace(
        arm,
        {"q1": Q1, "q2": Q2},
        quantities=["sag", "deflection"],
        wrench=[0, 100.0, 0, 0, 0, 0],
        gravity=True,
    )
    compliance = planar_compliance(*np.meshgrid(Q1, Q2, indexing="ij"))
    np.testing.assert_allclose(found.sag, weight * np.linalg.norm(compliance[..., 1], axis=-1), rtol=1e-9)
    np.testing.assert_allclose(found.deflection, found.sag * (weight - 100) / weight, rtol=1e-9)


def test_over_positions_the_arm_is_where_its_closed_form_puts_it() -> None:
    x, y = np.linspace(0.3, 0.9, 9), np.linspace(-0.6, 0.6, 8)
    found = map_workspace(planar_arm(), {"x": x, "y": y}, held={"q2": 1.0})
    xs, ys = np.meshgrid(x, y, indexing="ij")
    q1, q2 = planar_angles(xs, ys)
    np.testing.assert_allclose(found.q, np.stack([q1, q2], axis=-1), atol=1e-7)
    softest = np.linalg.eigvalsh(planar_compliance(q1, q2))[..., -1]
    np.testing.assert_allclose(found.stiffness, 1 / softest, rtol=1e-6)
    assert found.q.sel(joint="q2").min() > 0


def test_the_posture_held_decides_which_way_the_elbow_points() -> None:
    over = {"x": [0.5, 0.8], "y": [-0.3, 0.0, 0.4]}
    left, right = (map_workspace(planar_arm(), over, held={"q2": sign}) for sign in (-1.0, 1.0))
    assert (left.q[..., 1] < 0).all()
    assert (right.q[..., 1] > 0).all()
    np.testing.assert_allclose(left.q[..., 1], -right.q[..., 1], atol=1e-7)


def test_a_full_turn_away_is_brought_back() -> None:
    """6R robots reach a pose with wrist axes a turn on; the nearer turn is given."""
    robot = load_robot("kr240-2")
    held = {"q2": np.radians(60), "q3": np.radians(-200), "q5": np.radians(50)}
    over = {"x": [1.6, 2.0], "y": np.linspace(-0.6, 0.6, 5), "z": [0.9, 1.4]}
    rotation = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    found = map_workspace(robot, over, held=held, orientation=rotation)
    assert (found.reason == Reason.COMPUTED).all()
    assert np.abs(found.q.sel(joint=["q4", "q6"])).max() < np.pi
    where = posture(compile_structure(robot).kinematics, found.q.values.reshape(-1, 6))
    points = np.stack(np.meshgrid(*over.values(), indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(
        where.node_positions[:, where.kinematics.node_index[robot.tcp]], points, atol=1e-8
    )


def test_poses_that_cannot_be_taken_are_nan_with_their_reason() -> None:
    arm = planar_arm(limits=(-2.0, 2.0))
    far = map_workspace(arm, {"x": [0.8, 1.0, 1.3], "y": [0.0, 0.1]}, held={"q2": 1.0})
    assert far.reason.values.tolist() == [
        [Reason.COMPUTED] * 2,
        [Reason.COMPUTED] * 2,
        [Reason.OUT_OF_REACH] * 2,
    ]
    assert np.isnan(far.stiffness.values).tolist() == [[False] * 2, [False] * 2, [True] * 2]
    assert np.isnan(far.q.values[2]).all()
    behind = map_workspace(arm, {"x": [-1.15, 0.8], "y": [0.0, 0.1]}, held={"q2": 1.0})
    assert behind.reason.values.tolist() == [[Reason.LIMITS] * 2, [Reason.COMPUTED] * 2]
    beyond = map_workspace(arm, {"q1": [-2.1, -2.0, 0.0, 2.0, 2.1], "q2": [1.0, 2.5]})
    reasons = np.full((5, 2), Reason.LIMITS)
    reasons[1:4, 0] = Reason.COMPUTED
    assert beyond.reason.values.tolist() == reasons.tolist()
    assert (np.isnan(beyond.stiffness.values) == (reasons != Reason.COMPUTED)).all()
    assert L1 + L2 < 1.3


def test_a_pose_that_only_the_other_elbow_reaches_names_that_posture() -> None:
    """q1 at most 0: to reach up on the left, the elbow has to stand on the right."""
    arm = planar_arm()
    first = arm.variables[0].model_copy(update={"limits": (-3.0, 0.0)})
    arm = arm.model_copy(update={"variables": (first, arm.variables[1])})
    over = {"x": [0.5, 0.8], "y": [-0.8, 0.1]}
    found = map_workspace(arm, over, held={"q1": -0.5, "q2": -1.0})
    q1, q2 = planar_angles(*np.meshgrid(*over.values(), indexing="ij"))
    mirrored = 2 * np.arctan2(over["y"], np.array(over["x"])[:, None]) - q1  # the elbow asked for
    assert (mirrored > 0).tolist() == [[False, True]] * 2
    assert found.reason.values.tolist() == [[0, Reason.OTHER_CONFIGURATION]] * 2
    named = re.search(r"q1=(.*)deg,q2=(.*)deg", found.reason.attrs["example_other_configuration"])
    off = np.radians([float(named[1]), float(named[2])]) - [q1[0, 1], q2[0, 1]]
    assert np.abs(np.angle(np.exp(1j * off))).max() < 1e-3


def test_a_loop_that_does_not_close_is_said_so() -> None:
    found = map_workspace(load_robot("tripod"), {"r1": [1.2, 1.35, 3.5], "r2": [1.2, 1.3]}, held={"r3": 1.25})
    assert found.reason.values[:2].tolist() == [[0, 0], [0, 0]]
    assert set(found.reason.values[2].tolist()) <= {Reason.LOOP_OPEN, Reason.LIMITS}


def test_numbers_out_of_range_are_refused() -> None:
    with pytest.raises(BeamstiffError, match="numbers out of range"):
        map_workspace(planar_arm(), {"q1": Q1, "q2": Q2}, quantities=["deflection"], wrench=[1e308] * 6)


def test_a_mechanism_at_single_poses_is_marked_and_the_rest_goes_on() -> None:
    """A free elbow under a tie from foot to tip: stretched out, nothing holds it across."""
    arm = Robot(
        **free_elbow().model_dump()
        | {"struts": [{"name": "tie", "nodes": ["foot", "tip"], "stiffness": 1e7}]}
    )
    found = map_workspace(arm, {"q1": [-np.pi, 0.0], "q2": [-1.0, 0.0, 1.0]})
    assert found.reason.values[1].tolist() == [0, Reason.MECHANISM, 0]
    assert np.isnan(found.stiffness.values[1]).tolist() == [False, True, False]
    assert "is a mechanism: node 'tip' turns" in found.reason.attrs["example_mechanism"]


def test_a_robot_that_is_a_mechanism_everywhere_is_refused_at_once() -> None:
    with pytest.raises(BeamstiffError, match="is a mechanism"):
        map_workspace(free_elbow(), {"q1": Q1, "q2": Q2})


def free_elbow() -> Robot:
    """Return the planar arm with nothing that holds its elbow."""
    arm = planar_arm()
    stiffness = arm.joints[1].stiffness.model_copy(update={"torsional": 0.0})
    return arm.model_copy(
        update={"joints": (arm.joints[0], arm.joints[1].model_copy(update={"stiffness": stiffness}))}
    )


def test_infinite_stiffness_is_no_number() -> None:
    """Out of its plane the arm does not give way, and along itself when stretched."""
    found = map_workspace(
        planar_arm(),
        {"q1": [0.0, 0.5], "q2": [0.0, 1.0]},
        quantities=["stiffness_along", "stiffness"],
        direction=[1, 0, 0],
    )
    assert found.reason.values.tolist() == [[Reason.RIGID, 0], [0, 0]]
    assert np.isnan(found.stiffness_along.values[0, 0])
    assert np.isfinite(found.stiffness.values).all()
    with pytest.raises(BeamstiffError, match="infinite stiffness"):
        map_workspace(
            planar_arm(), {"q1": [0, 1], "q2": [0, 1]}, quantities=["stiffness_along"], direction=[0, 0, 1]
        )


def test_kappa_of_a_singular_pose_is_infinite_not_missing() -> None:
    found = map_workspace(
        planar_arm(), {"q1": [0.0, 1.0], "q2": [0.0, 1.0]}, quantities=["kappa"], length=0.5
    )
    assert np.isfinite(found.kappa.values).all()  # the orientation still tells the two joints apart
    wrist = map_workspace(
        load_robot("kr240-2"), {"q5": [0.0, 0.5], "q2": [0.5, 1.0]}, quantities=["kappa"], held={"q3": -1.0}
    )
    assert (wrist.kappa.values[0] > 1e12).all()
    assert (wrist.reason == 0).all()
