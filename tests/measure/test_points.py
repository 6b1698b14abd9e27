"""Displacement of the TCP from points on the tool (seed 000, eqs 27 to 30): known rigid motions come back."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.points import displacement_from_points, frame_from_points, subtract_sensor_deflection
from beamstiff.se3 import Array

# P10, P11, P12 on a tool of 0.3 m, two metres from the base
TRIANGLE = np.array([[2.0, 0.1, 1.2], [2.3, 0.05, 1.25], [2.1, -0.2, 1.4]])
TCP = np.array([2.15, 0.0, 1.0])


def moved(points: Array, tcp: Array, d: Array, r: Array) -> Array:
    """Return points after the motion that displaces the TCP by d and turns about it by r."""
    result: Array = Rotation.from_rotvec(r).apply(points - tcp) + tcp + d
    return result


@given(
    st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=3),
    st.lists(st.floats(-1.5, 1.5), min_size=3, max_size=3),
    st.integers(3, 8),
    st.integers(0, 10_000),
)
def test_a_rigid_motion_comes_back(d: list[float], r: list[float], count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    points = np.vstack([TRIANGLE, random.uniform(-0.3, 0.3, (count - 3, 3)) + TRIANGLE[0]])
    after = moved(points, TCP, np.array(d), np.array(r))
    found = displacement_from_points(points, after, tcp=TCP)
    np.testing.assert_allclose(found.displacement, [*d, *r], atol=1e-13)
    assert found.residual < 1e-14
    assert found.covariance is None


def test_a_small_motion_is_exact_to_a_picometre_far_from_the_origin() -> None:
    far = np.array([30.0, -20.0, 5.0])
    d, r = np.array([1e-6, -2e-6, 3e-6]), np.array([2e-6, 1e-6, -1e-6])
    found = displacement_from_points(TRIANGLE + far, moved(TRIANGLE + far, TCP + far, d, r), tcp=TCP + far)
    np.testing.assert_allclose(found.displacement[:3], d, atol=1e-13)
    np.testing.assert_allclose(found.displacement[3:], r, atol=1e-13)


def test_it_is_the_motion_from_F7_to_F7_prime() -> None:
    after = moved(TRIANGLE, TCP, np.array([1e-3, 2e-3, -3e-3]), np.array([0.1, -0.2, 0.05]))
    frame, frame_after = frame_from_points(TRIANGLE), frame_from_points(after)
    found = displacement_from_points(TRIANGLE, after, tcp=TRIANGLE[0])
    # eq. 29 for the origin of F7, eq. 30
    np.testing.assert_allclose(found.displacement[:3], frame_after[:3, 3] - frame[:3, 3], atol=1e-15)
    np.testing.assert_allclose(found.rotation, frame_after[:3, :3] @ frame[:3, :3].T, atol=1e-14)


def test_F7_has_its_origin_in_P10_and_P11_on_x() -> None:
    frame = frame_from_points(TRIANGLE)
    np.testing.assert_allclose(frame[:3, 3], TRIANGLE[0])
    p11, p12 = (np.linalg.solve(frame, [*p, 1.0])[:3] for p in TRIANGLE[1:])
    np.testing.assert_allclose(p11, [np.linalg.norm(TRIANGLE[1] - TRIANGLE[0]), 0, 0], atol=1e-15)
    assert p12[1] > 0
    assert abs(p12[2]) < 1e-15
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)


def test_the_tcp_may_be_given_in_F7() -> None:
    after = moved(TRIANGLE, TCP, np.array([1e-3, 0, 0]), np.array([0, 0.01, 0]))
    offset = np.linalg.solve(frame_from_points(TRIANGLE), [*TCP, 1.0])[:3]
    by_offset = displacement_from_points(TRIANGLE, after, offset=offset)
    np.testing.assert_allclose(by_offset.displacement, [1e-3, 0, 0, 0, 0.01, 0], atol=1e-14)


def test_many_poses_at_once_are_each_pose_alone() -> None:
    random = np.random.default_rng(3)
    d, r = random.normal(0, 1e-3, (40, 3)), random.normal(0, 1e-3, (40, 3))
    before = TRIANGLE + random.normal(0, 1, (40, 1, 3))
    tcp = before[:, 0] + [0.1, 0.2, 0.0]
    after = np.stack([moved(*each) for each in zip(before, tcp, d, r, strict=True)])
    found = displacement_from_points(before, after, tcp=tcp, sigma=1e-5)
    np.testing.assert_allclose(found.displacement, np.hstack([d, r]), atol=1e-13)
    alone = displacement_from_points(before[7], after[7], tcp=tcp[7], sigma=1e-5)
    np.testing.assert_allclose(found.covariance[7], alone.covariance, rtol=1e-9)


def test_one_unloaded_reading_serves_all_loads() -> None:
    after = np.stack([TRIANGLE + np.array([0, 0, z]) for z in (1e-3, 2e-3)])
    found = displacement_from_points(TRIANGLE, after, tcp=TCP)
    np.testing.assert_allclose(found.displacement[:, 2], [1e-3, 2e-3], atol=1e-15)


def test_the_covariance_is_the_spread_of_noisy_readings() -> None:
    random = np.random.default_rng(5)
    sigma, n = 3e-5, 40_000
    after = moved(TRIANGLE, TCP, np.array([1e-3, 0, 0]), np.array([0, 1e-3, 0]))
    noise = random.normal(0, sigma, (2, n, 3, 3))
    noisy = displacement_from_points(TRIANGLE + noise[0], after + noise[1], tcp=TCP)
    claimed = displacement_from_points(TRIANGLE, after, tcp=TCP, sigma=sigma)
    spread = np.cov(noisy.displacement.T)
    size = np.sqrt(np.diag(claimed.covariance))
    # correlations have a standard error of 1 / sqrt(n) = 0.005, variances of sqrt(2 / n)
    np.testing.assert_allclose(
        spread / np.outer(size, size), claimed.covariance / np.outer(size, size), atol=0.03
    )
    assert claimed.sigma_position == pytest.approx(np.sqrt(np.mean(np.diag(spread)[:3])), rel=0.02)
    assert claimed.sigma_rotation == pytest.approx(np.sqrt(np.mean(np.diag(spread)[3:])), rel=0.02)
    # three points have nine coordinates, six of them spent
    mean_square = np.mean(noisy.residual**2) * 3
    assert mean_square == pytest.approx(3 * 2 * sigma**2, rel=0.03)


LINE = np.linspace([0.0, 0, 0], [1.0, 2, 3], 4)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ({"before": LINE, "after": LINE, "tcp": TCP}, "points before: found points on one line"),
        ({"before": LINE[:2], "after": LINE[:2], "tcp": TCP}, "found 2 points, expected at least three"),
        (
            {"before": np.ones((3, 3)), "after": TRIANGLE, "tcp": TCP},
            "points before: found points at one place",
        ),
        ({"before": [TRIANGLE, LINE[:3]], "after": [TRIANGLE] * 2, "tcp": TCP}, "on one line in pose 1"),
        ({"before": TRIANGLE, "after": LINE[:3], "tcp": TCP}, "points after: found points on one line"),
        ({"before": TRIANGLE, "after": TRIANGLE * np.nan, "tcp": TCP}, "points after: found nan"),
        ({"before": TRIANGLE, "after": TRIANGLE[:, :2], "tcp": TCP}, r"points after: .*shape \(3, 2\)"),
        (
            {"before": TRIANGLE, "after": np.vstack([TRIANGLE, TCP]), "tcp": TCP},
            "3 points before and 4 after",
        ),
        ({"before": [TRIANGLE] * 2, "after": [TRIANGLE] * 3, "tcp": TCP}, "same number of poses"),
        ({"before": TRIANGLE, "after": TRIANGLE}, "either tcp"),
        ({"before": TRIANGLE, "after": TRIANGLE, "tcp": TCP, "offset": TCP}, "either tcp"),
        (
            {"before": TRIANGLE, "after": TRIANGLE[[1, 0, 2]], "tcp": TCP},
            "against one another.*exchanged points",
        ),
        ({"before": TRIANGLE, "after": TRIANGLE * 1e3, "tcp": TCP}, "against one another.*other units"),
        ({"before": TRIANGLE, "after": TRIANGLE, "tcp": TCP, "sigma": 0.0}, "sigma: found 0.0"),
    ],
)
def test_points_that_tell_no_motion_are_refused(arguments: dict[str, Any], part: str) -> None:
    before, after = arguments.pop("before"), arguments.pop("after")
    with pytest.raises(BeamstiffError, match=part):
        displacement_from_points(before, after, **arguments)


# --- the sensor's own deflection

SOFT = np.diag([1e-8, 1e-8, 5e-9, 2e-6, 2e-6, 1e-6])


def test_two_springs_in_series_less_the_sensor_leave_the_robot() -> None:
    random = np.random.default_rng(8)
    rotation = Rotation.random(5, rng=random).as_matrix()
    arm = random.normal(0, 0.2, (5, 3))
    wrench = random.normal(0, 500, (5, 6))
    robot = random.normal(0, 1e-3, (5, 6))
    sensor = []
    for turn, lever, load in zip(rotation, arm, wrench, strict=True):
        # by hand: the load at the sensor in its axes, its deflection, carried back to the TCP
        f, m = turn.T @ load[:3], turn.T @ (load[3:] + np.cross(lever, load[:3]))
        u = SOFT @ [*f, *m]
        d, r = turn @ u[:3], turn @ u[3:]
        sensor.append([*(d + np.cross(r, lever)), *r])
    found = subtract_sensor_deflection(robot + np.array(sensor), wrench, SOFT, rotation, arm)
    np.testing.assert_allclose(found, robot, atol=1e-15)


@pytest.mark.parametrize(
    ("compliance", "rotation", "part"),
    [
        (-SOFT, np.eye(3), "negative eigenvalue"),
        (SOFT + np.eye(6, k=1) * 1e-8, np.eye(3), "not symmetric"),
        (SOFT[:3, :3], np.eye(3), "sensor compliance: .*shape"),
        ([SOFT, SOFT], np.eye(3), r"expected \(6, 6\)"),
        (SOFT * np.nan, np.eye(3), "found nan"),
        (SOFT, 2 * np.eye(3), "not orthonormal"),
        (SOFT, np.diag([1.0, 1, -1]), "reflection"),
    ],
)
def test_a_compliance_that_is_none_is_refused(compliance: Any, rotation: Any, part: str) -> None:
    with pytest.raises(BeamstiffError, match=part):
        subtract_sensor_deflection(np.zeros(6), np.zeros(6), compliance, rotation)
