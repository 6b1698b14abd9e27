import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.robot.placement import (
    NEARLY_PARALLEL,
    elementary,
    frame_parameters,
    from_roll_pitch_yaw,
    roll_pitch_yaw,
    turned_to,
)
from beamstiff.se3 import rotation_about, transform

angles = st.floats(-7.0, 7.0) | st.sampled_from(
    [0.0, 1e-9, 1e-6, np.pi / 2, -np.pi / 2, np.pi, 3.14159, 1.5708]
)
lengths = st.floats(-3.0, 3.0) | st.just(0.0)
triples = st.tuples(angles, angles, angles)
points = st.tuples(lengths, lengths, lengths)


@given(triples, points)
@example((np.pi, 0.0, 0.0), (0.3, 0.2, 0.1))
@example((3.14159, 0.0, 0.0), (0.3, 0.2, 0.1))
@example((1e-7, 0.0, 0.4), (0.3, 0.2, 0.1))
@example((1e-7, 0.0, 0.4), (0.0, 0.0, 0.1))
def test_frames_of_a_transform_multiply_to_it(rpy: tuple[float, ...], xyz: tuple[float, ...]) -> None:
    # truth: scipy's rotation
    placed = transform(Rotation.from_euler("xyz", rpy).as_matrix(), np.array(xyz))
    parts = frame_parameters(placed)
    product = np.linalg.multi_dot([np.eye(4), np.eye(4), *map(elementary, parts)])
    assert np.abs(product - placed).max() < 1e-12
    assert len(parts) <= 2


@given(triples, points)
def test_one_frame_is_enough_unless_axes_are_parallel(rpy: tuple[float, ...], xyz: tuple[float, ...]) -> None:
    placed = transform(Rotation.from_euler("xyz", rpy).as_matrix(), np.array(xyz))
    lean = np.hypot(*placed[:2, 2])
    if len(frame_parameters(placed)) == 2:
        assert 0 < lean <= NEARLY_PARALLEL
    # and no parameter is far larger than the offset itself
    for part in frame_parameters(placed):
        assert all(abs(part.get(key, 0.0)) < 40 * max(np.linalg.norm(xyz), 1e-9) for key in ("b", "d", "r"))


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3), points)
def test_six_parameters_come_back_where_unique(turns: tuple[float, ...], shifts: tuple[float, ...]) -> None:
    given_ones = dict(zip(("gamma", "alpha", "theta", "b", "d", "r"), (*turns, *shifts), strict=True))
    if abs(np.sin(given_ones["alpha"])) <= NEARLY_PARALLEL:
        return
    (found,) = frame_parameters(elementary(given_ones))
    for key, value in given_ones.items():
        assert found.get(key, 0.0) == pytest.approx(value, abs=1e-12)


@given(triples)
def test_roll_pitch_yaw_come_back_as_the_same_rotation(rpy: tuple[float, ...]) -> None:
    rotation = Rotation.from_euler("xyz", rpy).as_matrix()
    np.testing.assert_allclose(from_roll_pitch_yaw(np.array(rpy), np.zeros(3))[:3, :3], rotation, atol=1e-14)
    again = from_roll_pitch_yaw(roll_pitch_yaw(rotation), np.zeros(3))[:3, :3]
    np.testing.assert_allclose(again, rotation, atol=1e-14)


@given(st.tuples(*[st.floats(-1, 1)] * 3))
@example((0.0, 0.0, -1.0))
@example((1e-9, 0.0, -1.0))
def test_z_is_carried_onto_the_axis_by_a_rotation(axis: tuple[float, ...]) -> None:
    if np.linalg.norm(axis) < 1e-3:
        return
    turn = turned_to(np.array(axis))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(turn[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-14)


def test_lengths_of_a_file_stay_the_decimals_that_they_are() -> None:
    """As origin xyz="0.2 0 0.12" with an axis along -x, which b, d and r are sums and products for."""
    turned = transform(rotation_about(1, np.asarray(np.pi / 2)), np.array([0.2, 0.0, 0.12]))
    (found,) = frame_parameters(turned)
    assert {repr(abs(value)) for name, value in found.items() if name in "bdr"} == {"0.12", "0.2"}
