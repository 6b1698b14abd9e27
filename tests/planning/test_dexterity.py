"""Dexterity against the published numbers of the KR240-2 (seed 000, section 3.1), and closed forms."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from beamstiff.errors import BeamstiffError
from beamstiff.planning.dexterity import (
    characteristic_length,
    dexterity_map,
    inverse_condition,
    normalised_jacobian,
    workspace_map,
)
from beamstiff.planning.poses import joint_grid
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Kinematics, compile_kinematics, posture
from beamstiff.robot.parts import Frame, Node, Rigid, Variable
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array

KR240 = load_robot("kr240-2")
KINEMATICS = compile_kinematics(KR240)
WRIST = {"q4": np.pi / 4, "q5": np.pi / 4, "q6": np.pi / 4}
ZONES = {
    "Z1c": (0, 110, -245, -170),
    "Z2c": (0, 25, 0, 29),
    "Z3c": (100, 146, 0, 29),
}  # seed 000, Table 1, deg


def with_lengths(**lengths: float) -> Kinematics:
    """Return the KR240-2 with other frame parameters, such as ``f4__r=-1.1``."""
    changed = {tuple(name.split("__")): value for name, value in lengths.items()}
    frames = tuple(
        frame.model_copy(update={key: value for (name, key), value in changed.items() if name == frame.name})
        for frame in KR240.frames
    )
    return compile_kinematics(KR240.model_copy(update={"frames": frames}))


def test_characteristic_length_of_the_kr240() -> None:
    found = characteristic_length(KINEMATICS)
    assert found.length == pytest.approx(0.682, abs=0.001)  # seed 000, section 3.1
    assert found.condition == pytest.approx(1.2515, abs=5e-5)
    # the pose that is said to have it has it, and no length near it does better there
    jacobian = [
        normalised_jacobian(KINEMATICS, posture(KINEMATICS, found.q), length)
        for length in found.length * np.array([0.98, 1.0, 1.02])
    ]
    conditions = 1 / inverse_condition(np.concatenate(jacobian))
    assert conditions[1] == pytest.approx(found.condition, rel=1e-9)
    assert conditions[1] < min(conditions[[0, 2]])


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)])
def test_it_does_not_depend_on_the_signs_that_the_paper_leaves_open(signs: tuple[int, int, int]) -> None:
    d4, rl4, rl6 = np.multiply(signs, (-0.055, 1.1, 0.23))
    found = characteristic_length(with_lengths(f4__d=d4, f4__r=rl4, f6__r=rl6))
    assert found.length == pytest.approx(0.682, abs=0.001)
    assert found.condition == pytest.approx(1.2515, abs=5e-5)


def test_no_pose_does_better_than_the_characteristic_length_says() -> None:
    found = characteristic_length(KINEMATICS)
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (20_000, 6))
    for length in (0.4, 0.682, 1.0):
        values = inverse_condition(normalised_jacobian(KINEMATICS, posture(KINEMATICS, q), length))
        assert values.max() <= 1 / found.condition


@pytest.mark.parametrize("zone", ZONES)
def test_the_published_zones_have_good_dexterity_everywhere(zone: str) -> None:
    """Table 1: 1/kappa_F of at least 0.36 at theta4 = theta5 = theta6 = 45 deg."""
    low2, high2, low3, high3 = np.radians(ZONES[zone])
    over = {"q2": np.linspace(low2, high2, 45), "q3": np.linspace(low3, high3, 45)}
    values = dexterity_map(KINEMATICS, joint_grid(KR240, over, WRIST), 0.682).inverse_condition
    assert values.min() >= 0.36


def test_with_the_other_sign_of_rl4_the_zones_run_into_singular_poses() -> None:
    kinematics = with_lengths(f4__r=-1.1)
    low2, high2, low3, high3 = np.radians(ZONES["Z1c"])
    over = {"q2": np.linspace(low2, high2, 89), "q3": np.linspace(low3, high3, 61)}
    found = dexterity_map(kinematics, joint_grid(KR240, over, WRIST), 0.682)
    assert found.inverse_condition.min() < 0.02
    assert found.determinant.min() < 0 < found.determinant.max()


def test_the_first_axis_does_not_count() -> None:
    """Seed 000: "the first revolute joint does not affect the robot dexterity"."""
    q = np.random.default_rng(3).uniform(-3, 3, (50, 6))
    turned = q + 0.8 * np.eye(6)[0]
    values = [
        inverse_condition(normalised_jacobian(KINEMATICS, posture(KINEMATICS, p), 0.682)) for p in (q, turned)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-9)


@given(arrays.arrays(float, (6, 6), elements=st.floats(-5, 5)))
def test_the_condition_number_is_equation_11(matrix: Array) -> None:
    found = inverse_condition(matrix)
    assert 0 <= found <= 1 + 1e-12
    if np.linalg.cond(matrix) < 1e6:
        gram = matrix.T @ matrix
        expected = np.sqrt(np.trace(gram) * np.trace(np.linalg.inv(gram))) / 6
        assert 1 / found == pytest.approx(expected, rel=1e-6)


def test_isotropic_and_singular_matrices() -> None:
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    assert inverse_condition(3.7 * rotation) == pytest.approx(1.0)
    assert inverse_condition(np.diag([1.0, 1, 1, 1, 1, 0])) == 0.0
    assert inverse_condition(np.zeros((6, 6))) == 0.0
    assert inverse_condition(rotation[:, :2]) == pytest.approx(1.0)  # two actuated variables


def planar(reach: tuple[float, ...], kinds: str) -> Robot:
    """Return a robot in the plane: revolute joints (R) with links of given lengths, or slides (P) along x."""
    variables, frames, parent = [], [], "base"
    for at, (length, kind) in enumerate(zip(reach, kinds, strict=True), start=1):
        if kind == "R":
            variables.append(Variable(name=f"q{at}", type="revolute"))
            frames.append(Frame(name=f"a{at}", parent=parent, theta=f"q{at}"))
            frames.append(Frame(name=f"f{at}", parent=f"a{at}", d=length))
        else:
            variables.append(Variable(name=f"q{at}", type="prismatic", limits=(0.1, 1.0)))
            frames.append(Frame(name=f"f{at}", parent=parent, d=f"q{at}"))
        parent = f"f{at}"
    nodes = [Node(name="n0"), Node(name="tip", frame=parent)]
    link = Rigid(name="link", nodes=("n0", "tip"))
    return Robot(
        name="planar", variables=variables, frames=frames, nodes=nodes, rigids=[link], fixed=["n0"], tcp="tip"
    )


def test_a_planar_arm_of_two_links_by_hand() -> None:
    """Gram matrix [[|r1|^2/L^2 + 1, r1.r2/L^2 + 1], [., |r2|^2/L^2 + 1]] with r_i from joint i to the tip."""
    kinematics = compile_kinematics(planar((0.8, 0.5), "RR"))
    angle, length = 1.1, 0.4
    second = 0.5 * np.array([np.cos(angle), np.sin(angle)])
    first = second + 0.8 * np.eye(2)[0]
    gram = np.array([[first @ first, first @ second], [first @ second, second @ second]]) / length**2 + 1
    expected = np.sqrt(np.trace(gram) * np.trace(np.linalg.inv(gram))) / 2
    found = inverse_condition(normalised_jacobian(kinematics, posture(kinematics, [[0.3, angle]]), length))
    assert 1 / found[0] == pytest.approx(expected, rel=1e-12)


def test_a_slide_is_counted_in_characteristic_lengths() -> None:
    """The condition number does not change when the machine and L are scaled, slides included."""
    conditions = []
    for scale in (1.0, 7.0):
        kinematics = compile_kinematics(planar((0.8 * scale, 0.0, 0.5 * scale), "RPR"))
        q = [[0.3, 0.4 * scale, 1.1]]
        jacobian = normalised_jacobian(kinematics, posture(kinematics, q), 0.3 * scale)
        conditions.append(float(inverse_condition(jacobian)[0]))
    assert conditions[0] == pytest.approx(conditions[1], rel=1e-12)


def test_the_workspace_map_has_the_best_pose_of_each_cell() -> None:
    angles = np.radians(np.arange(-180, 180, 5))
    found = dexterity_map(KINEMATICS, joint_grid(KR240, {"q2": angles, "q3": angles}, WRIST), 0.682)
    work = workspace_map(found, 0.2)
    value, position = found.inverse_condition.reshape(-1), found.position.reshape(-1, 3)
    i = np.digitize(position[:, 0], work.x) - 1
    k = np.digitize(position[:, 2], work.z) - 1
    for a, b in ((10, 10), (15, 8), (12, 20)):
        inside = (i == a) & (k == b)
        assert inside.any()
        assert work.value[a, b] == value[inside].max()
        assert work.value[a, b] == value[work.pose[a, b]]
    assert np.isnan(work.value[0, 0])
    assert work.pose[0, 0] == -1
    assert np.nanmax(work.value) == value.max()


def test_a_map_of_a_machine_with_loops_leaves_out_what_does_not_close() -> None:
    robot = load_robot("ir663")
    kinematics = compile_kinematics(robot)
    over = {"q2": np.radians(np.arange(-120, 121, 20)), "q8": np.radians(np.arange(-120, 121, 20))}
    found = dexterity_map(kinematics, joint_grid(robot, over), 0.682)
    reached = ~np.isnan(found.inverse_condition)
    assert 0.05 < reached.mean() < 0.95
    assert (np.isnan(found.position).any(axis=2) == ~reached).all()
    assert found.determinant is None
    assert (found.inverse_condition[reached] > 0).all()


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_length_that_is_none_is_refused(length: float) -> None:
    with pytest.raises(BeamstiffError, match=r"characteristic length: found .*, expected a positive number"):
        normalised_jacobian(KINEMATICS, posture(KINEMATICS, np.zeros((1, 6))), length)


def refused_grid() -> Any:
    return joint_grid(load_robot("ir663"), {"q2": np.radians([0, 2]), "q8": np.radians([-92, -90])})


def test_what_cannot_be_mapped_is_refused() -> None:
    kinematics = compile_kinematics(load_robot("ir663"))
    with pytest.raises(BeamstiffError, match="'ir663': no pose of the grid closes its loops"):
        dexterity_map(kinematics, refused_grid(), 0.682)
    grid = joint_grid(KR240, {"q2": [0, 1], "q3": [0, 1]}, WRIST)
    with pytest.raises(BeamstiffError, match="found the size 0, expected a positive one"):
        workspace_map(dexterity_map(KINEMATICS, grid, 0.682), 0)
    with pytest.raises(BeamstiffError, match="'frame' has no actuated variable"):
        characteristic_length(
            compile_kinematics(Robot(name="frame", nodes=[Node(name="a")], fixed=["a"], tcp="a"))
        )


def test_the_zones_stand_out_from_the_joint_space() -> None:
    """The zones have more than 0.36; half of the joint space has less."""
    angles = np.radians(np.arange(-180, 180, 4))
    grid = joint_grid(KR240, {"q2": angles, "q3": angles}, WRIST)
    values = dexterity_map(KINEMATICS, grid, 0.682).inverse_condition
    assert 0.33 < np.median(values) < 0.36
    q2, q3 = np.degrees(grid.first).round(6)[:, None], np.degrees(grid.second).round(6)
    for low_2, high_2, low_3, high_3 in ZONES.values():
        inside = ((q2 - low_2) % 360 <= high_2 - low_2) & ((q3 - low_3) % 360 <= high_3 - low_3)
        assert values[inside].min() >= 0.36
