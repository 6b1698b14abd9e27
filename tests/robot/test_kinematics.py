"""Forward geometry and twist Jacobians, against printed entries, explicit products and finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from beamstiff import BeamstiffError, Frame, Robot
from beamstiff.robot.frames import MOTIONS
from beamstiff.robot.kinematics import (
    actuated_values,
    compile_kinematics,
    forward,
    pose_of,
    posture,
    twist_jacobian,
)
from beamstiff.se3 import rotate_screw, vector_from_rotation
from tests.robot.machines import (
    bennett,
    coupled_arm,
    ir663,
    kr240,
    kr240_appendix_a,
    machine,
    revolute,
    screw_driven_ir663,
    slider_crank,
)

Array = NDArray[np.float64]
STEP = 1e-4


def test_twist_jacobian_of_kr240_is_the_printed_one() -> None:
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 6))
    kinematics = compile_kinematics(kr240())
    jacobian = twist_jacobian(kinematics, posture(kinematics, q), "tool")
    assert np.abs(jacobian - kr240_appendix_a(q)).max() < 1e-12


def differences(robot: Robot, q: Array, node: str = "tool") -> Array:
    """Return the Jacobian (P, 6, A) by central differences of fourth order."""
    kinematics = compile_kinematics(robot)

    def pose(change: Array) -> tuple[Array, Array]:
        at = pose_of(kinematics, posture(kinematics, q + change), node)
        return at[:, :3, 3], at[:, :3, :3]

    columns = []
    for direction in STEP * np.eye(q.shape[1]):
        column = 0.0
        for weight, steps in ((8 / 12, 1), (-1 / 12, 2)):
            (ahead, turn_ahead), (behind, turn_behind) = pose(steps * direction), pose(-steps * direction)
            # half the turn between the two, as a vector, in the base frame
            turned = vector_from_rotation(turn_ahead @ np.swapaxes(turn_behind, 1, 2))
            column = column + weight * np.concatenate([ahead - behind, turned], axis=1) / STEP
        columns.append(column)
    return np.stack(columns, axis=2)


@pytest.mark.parametrize(
    ("robot", "low", "high"),
    [
        (kr240(), [-3.0] * 6, [3.0] * 6),
        (coupled_arm(), [-2.0, -2.0, -2.0, -0.3], [2.0, 2.0, 2.0, 0.3]),
        (ir663(), [-3.0, -0.6, 0.4], [3.0, 0.8, 1.2]),
        (slider_crank(), [0.65], [1.15]),
        (screw_driven_ir663(), [0.75, 0.76], [1.05, 0.94]),
        (bennett([-2.0, 0.0, -3.0]), [0.3], [2.5]),
    ],
    ids=["serial", "coupled", "four-bar", "slider-crank", "three loops", "spatial loop"],
)
def test_twist_jacobian_is_the_poses_derivative(robot: Robot, low: list[float], high: list[float]) -> None:
    q = np.random.default_rng(1).uniform(low, high, (20, len(low)))
    kinematics = compile_kinematics(robot)
    jacobian = twist_jacobian(kinematics, posture(kinematics, q), "tool")
    assert np.abs(jacobian - differences(robot, q)).max() < 1e-9 * np.abs(jacobian).max()


def elementary(kind: str, axis: int, amount: float) -> Array:
    """Return one motion as a matrix, written out."""
    motion = np.eye(4)
    if kind == "shift":
        motion[axis, 3] = amount
        return motion
    c, s = np.cos(amount), np.sin(amount)
    motion[:3, :3] = {
        0: [[1, 0, 0], [0, c, -s], [0, s, c]],
        1: [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        2: [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    return motion


# rot(z,gamma) trans(z,b) rot(x,alpha) trans(x,d) rot(z,theta) rot(y,beta) trans(z,r), as the format says
KHALIL_KLEINFINGER = [
    ("gamma", "turn", 2),
    ("b", "shift", 2),
    ("alpha", "turn", 0),
    ("d", "shift", 0),
    ("theta", "turn", 2),
    ("beta", "turn", 1),
    ("r", "shift", 2),
]
parameters = st.lists(st.floats(-4.0, 4.0), min_size=7, max_size=7)


def arm_of(rows: list[list[float]], driven: dict[str, str] | None = None, base: Frame | None = None) -> Robot:
    """Return a chain of frames with these parameters, each with what `driven` adds for its motion."""
    names = [name for name, _, _ in KHALIL_KLEINFINGER]
    frames = [
        Frame(
            name=f"f{at}",
            parent=f"f{at - 1}" if at else "base" if base is None else base.name,
            **{
                name: f"{value!r} {(driven or {}).get(name, '')}" if driven else value
                for name, value in zip(names, row, strict=True)
            },
        )
        for at, row in enumerate(rows)
    ]
    return machine(
        [revolute(f"x{at}") for at in range(3)],
        [*([base] if base else []), *frames],
        tool=(frames[-1].name, (0.3, -0.2, 0.1)),
    )


@given(st.lists(parameters, min_size=1, max_size=4))
def test_forward_is_the_product_of_the_seven_motions(rows: list[list[float]]) -> None:
    kinematics = compile_kinematics(arm_of(rows))
    expected = np.eye(4)
    for row in rows:
        for (_, kind, axis), amount in zip(KHALIL_KLEINFINGER, row, strict=True):
            expected = expected @ elementary(kind, axis, amount)
    found = forward(kinematics, np.zeros((1, 3)))[0, -1]
    assert np.abs(found - expected).max() < 1e-13


# every motion driven, by three variables at once
DRIVEN = {
    "gamma": "+ 0.3*x0",
    "b": "+ 0.2 m/rad * x1",
    "alpha": "- x2 + 0.5*x0",
    "d": "+ 0.1 m/rad * x0 - 0.3 m/rad * x2",
    "theta": "+ x1 + x0",
    "beta": "+ 0.7*x2",
    "r": "- 0.4 m/rad * x1",
}
angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(st.lists(parameters, min_size=1, max_size=3), parameters, angles)
def test_every_motion_gives_its_twist_which_turns_with_the_base(
    rows: list[list[float]], moved: list[float], q: tuple[float, ...]
) -> None:
    robot, at = arm_of(rows, DRIVEN), np.array([q])
    kinematics = compile_kinematics(robot)
    jacobian = twist_jacobian(kinematics, posture(kinematics, at), "tool")
    assert np.abs(jacobian - differences(robot, at)).max() < 1e-9 * max(1.0, np.abs(jacobian).max())
    base = Frame(name="elsewhere", **dict(zip(DRIVEN, moved, strict=True)))
    there = compile_kinematics(arm_of(rows, DRIVEN, base))
    transforms = posture(there, at).transforms
    expected = rotate_screw(transforms[:, 1, :3, :3]) @ jacobian
    assert np.abs(twist_jacobian(there, posture(there, at), "tool") - expected).max() < 1e-12
    rotations = transforms[0, :, :3, :3]
    assert np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(rotations) - 1.0).max() < 1e-14
    assert (transforms[0, :, 3] == [0, 0, 0, 1]).all()


def test_the_order_of_the_motions_is_that_of_the_format() -> None:
    assert list(MOTIONS) == KHALIL_KLEINFINGER


def test_frames_may_be_declared_in_any_order() -> None:
    frames = [
        Frame(name="hand", parent="arm", d=1.0, theta="q2"),
        Frame(name="arm", parent="base", theta="q1"),
    ]
    robot = machine([revolute("q1"), revolute("q2")], frames, tool=("hand", (1.0, 0, 0)))
    kinematics = compile_kinematics(robot)
    assert kinematics.frame_names == ("base", "arm", "hand")
    tool = posture(kinematics, [np.pi / 2, -np.pi / 2]).node_positions[0, kinematics.node_index["tool"]]
    assert np.abs(tool - [1.0, 1.0, 0.0]).max() < 1e-15


@pytest.mark.parametrize(
    ("robot", "low", "high", "within"),
    [(kr240(), -3.0, 3.0, 1e-15), (ir663(), np.radians([-180, -40, 20]), np.radians([180, 50, 75]), 1e-12)],
    ids=["serial", "four-bar"],
)
def test_poses_in_one_call_are_those_one_by_one(robot: Robot, low: Array, high: Array, within: float) -> None:
    kinematics = compile_kinematics(robot)
    q = np.random.default_rng(3).uniform(low, high, (30, len(robot.actuated)))
    together = posture(kinematics, q)
    jacobian = twist_jacobian(kinematics, together, "tool")
    for pose in range(len(q)):
        alone = posture(kinematics, q[pose])
        assert np.abs(alone.values[0] - together.values[pose]).max() < within
        assert np.abs(alone.transforms[0] - together.transforms[pose]).max() < within
        assert np.abs(twist_jacobian(kinematics, alone, "tool")[0] - jacobian[pose]).max() < 10 * within


def test_a_robot_without_variables_or_without_poses() -> None:
    still = compile_kinematics(machine([], [], tool=("base", (1, 2, 3))))
    assert posture(still, {}).node_positions[0, 1].tolist() == [1, 2, 3]
    assert twist_jacobian(still, posture(still, {}), "tool").shape == (1, 6, 0)
    kinematics = compile_kinematics(ir663())
    none = posture(kinematics, np.zeros((0, 3)))
    assert none.transforms.shape == (0, 8, 4, 4)
    assert twist_jacobian(kinematics, none, "tool").shape == (0, 6, 3)


def test_values_by_name_and_by_order_are_the_same() -> None:
    robot = ir663()
    assert (actuated_values(robot, {"q8": [0.5, 0.6], "q1": 0.1}) == [[0.1, 0.0, 0.5], [0.1, 0.0, 0.6]]).all()
    assert (actuated_values(robot, [0.1, 0.0, 0.5]) == [[0.1, 0.0, 0.5]]).all()
    assert (actuated_values(robot, {}) == [[0.0, 0.0, 0.0]]).all()


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ({"q22": 0.1}, r"unknown joint variable 'q22' \(did you mean 'q2'\?\), expected q1, q2, q8"),
        (
            {"th3": 0.1},
            "'th3' is solved by loop closure: give values of the actuated variables q1, q2, q8 only",
        ),
        ({"q1": np.nan}, r"q1: found nan \(pose 0\), expected a finite number"),
        ({"q1": [0.0, np.inf]}, r"q1: found inf \(pose 1\), expected a finite number"),
        ({"q1": "90 deg"}, "q1: found '90 deg', expected numbers"),
        ({"q1": True}, "q1: found 'True', expected numbers"),
        ({"q1": 1j}, "q1: found '1j', expected numbers"),
        ({"q1": None}, "q1: found 'None', expected numbers"),
        ({"q1": [[0.0]]}, r"q1: found values of shape \(1, 1\), expected a number or a row"),
        ({"q1": [0.0, 1.0], "q2": [0.0, 1.0, 2.0]}, "found 2, 3 values for the joints of 'machine'"),
        ([0.0, 1.0], r"shape \(1, 2\), expected 3 in a row: q1, q2, q8"),
        ([[[0.0, 1.0, 2.0]]], r"shape \(1, 1, 3\), expected 3 in a row"),
        ([[0.0, 1.0, 2.0], [0.0]], "the joint values: found .*, expected numbers"),
        ([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]], r"q2: found nan \(pose 1\)"),
    ],
)
def test_values_that_are_none(q: object, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message) as error:
        actuated_values(ir663(), q)
    assert "\n" not in str(error.value)


def test_a_coupled_variable_cannot_be_given() -> None:
    with pytest.raises(BeamstiffError, match="'th6' follows -q5: give values of the actuated variables"):
        actuated_values(coupled_arm(), {"th6": 0.1})


def test_an_unknown_node_is_named() -> None:
    kinematics = compile_kinematics(kr240())
    with pytest.raises(BeamstiffError, match=r"no node 'tol' \(did you mean 'tool'\?\)"):
        pose_of(kinematics, posture(kinematics, {}), "tol")
