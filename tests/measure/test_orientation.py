"""Conventions of orientation against scipy and against what controllers print."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.orientation import (
    KUKA,
    EulerAngles,
    Orientation,
    Quaternion,
    RotationVector,
    ToolAxis,
    named_orientation,
)

ANGLE = st.floats(-6.0, 6.0)
ORDERS = ["ZYX", "XYZ", "ZYZ", "ZXZ", "xyz", "zyx", "zyz", "YXZ"]


@given(st.tuples(ANGLE, ANGLE, ANGLE), st.sampled_from(ORDERS))
def test_angles_are_those_of_scipy(angles: tuple[float, float, float], order: str) -> None:
    expected = Rotation.from_euler(order, angles).as_matrix()
    np.testing.assert_allclose(EulerAngles(order).rotations(np.array([angles]))[0], expected, atol=1e-14)


CONVENTIONS: list[Orientation] = [*map(EulerAngles, ORDERS), RotationVector()]


@given(st.tuples(ANGLE, ANGLE, ANGLE), st.sampled_from(CONVENTIONS), st.floats(-1e-4, 1e-4))
def test_a_small_turn_changes_the_rotation_written_by_as_much(
    numbers: tuple[float, float, float], convention: Orientation, by: float
) -> None:
    like = np.array([numbers])
    turned = Rotation.from_rotvec([by, -by, by]).as_matrix() @ convention.rotations(like)
    again = convention.rotations(convention.numbers(turned, like))
    np.testing.assert_allclose(again, turned, atol=2e-7)  # a fiftieth of the last decimal written


@given(st.tuples(ANGLE, ANGLE, ANGLE), st.sampled_from(ORDERS))
def test_away_from_the_poles_numbers_come_back(angles: tuple[float, float, float], order: str) -> None:
    pole = np.sin(angles[1]) if order[0] == order[2] else np.cos(angles[1])
    if abs(pole) < 1e-3:
        return
    like = np.array([angles])
    convention = EulerAngles(order)
    np.testing.assert_allclose(convention.numbers(convention.rotations(like), like), like, atol=1e-8)


@given(ANGLE, ANGLE, st.sampled_from([np.pi / 2, -np.pi / 2]))
def test_at_the_pole_the_first_angle_stays(a: float, c: float, b: float) -> None:
    like = np.array([[a, b, c]])
    numbers = KUKA.numbers(KUKA.rotations(like), like)
    np.testing.assert_allclose(numbers, like, atol=1e-7)


def test_rapid_puts_the_scalar_first() -> None:
    # [0, 0, 1, 0]: half a turn about y, the tool looks down
    half = Quaternion().rotations(np.array([[0.0, 0.0, 1.0, 0.0]]))[0]
    np.testing.assert_allclose(half, np.diag([-1.0, 1.0, -1.0]), atol=1e-15)


def test_of_both_signs_the_quaternion_keeps_its_own() -> None:
    like = np.array([[-0.7071068, 0.0, -0.7071068, 0.0]])
    np.testing.assert_allclose(Quaternion().numbers(Quaternion().rotations(like), like), like, atol=1e-7)


def test_the_axis_of_apt_points_from_tip_to_holder() -> None:
    rotation = ToolAxis().rotations(np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(rotation[:, :, 2], [[0, 0, -1], [-0.6, 0, -0.8], [-1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)


@pytest.mark.parametrize(
    ("convention", "numbers"),
    [(Quaternion(), [1.0, 0.2, 0, 0]), (ToolAxis(), [0, 0, 0.9]), (ToolAxis(), [0, 0, 0])],
)
def test_numbers_that_are_no_orientation_are_refused(convention: Orientation, numbers: list[float]) -> None:
    with pytest.raises(BeamstiffError, match="length"):
        convention.rotations(np.array([numbers]))


@pytest.mark.parametrize("name", ["Euler", "Euler XXY", "ZYX", "roll pitch yaw", "", "Euler ZZZ"])
def test_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(BeamstiffError, match="expected rotation vector, KUKA ABC"):
        named_orientation(name)


def test_named_conventions() -> None:
    assert named_orientation("KUKA ABC") == KUKA
    assert named_orientation("kuka_abc") == KUKA
    assert named_orientation("intrinsic zyx") == EulerAngles("ZYX")
    assert named_orientation("extrinsic XYZ") == EulerAngles("xyz")
    assert named_orientation("Rotation vector") == RotationVector()
