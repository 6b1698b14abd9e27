"""A tracker's frame from common points, against scipy's align_vectors and known frames."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.registration import register
from beamstiff.se3 import Array

TURN = Rotation.from_rotvec([0.4, -1.1, 2.0])
SHIFT = np.array([3.0, -2.0, 0.5])
POINTS = np.random.default_rng(0).uniform(-1, 1, (12, 3)) + np.array([2.0, 0.0, 1.0])


def base(points: Array, scale: float = 1.0) -> Array:
    result: Array = scale * TURN.apply(points) + SHIFT
    return result


@given(st.integers(3, 20), st.integers(0, 10_000))
def test_a_known_frame_comes_back(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    points = np.vstack([np.eye(3), random.uniform(-1, 1, (count - 3, 3))]) + random.uniform(-5, 5, 3)
    turn, shift = Rotation.random(rng=random), random.uniform(-5, 5, 3)
    found = register(points, turn.apply(points) + shift)
    np.testing.assert_allclose(found.rotation, turn.as_matrix(), atol=1e-13)
    np.testing.assert_allclose(found.translation, shift, atol=1e-12)
    assert found.rms < 1e-13
    assert found.scale == 1.0
    assert found.apparent_scale == pytest.approx(1.0, abs=1e-12)


def test_noisy_points_give_the_rotation_of_align_vectors() -> None:
    random = np.random.default_rng(4)
    noisy = base(POINTS) + random.normal(0, 1e-3, POINTS.shape)
    found = register(POINTS, noisy)
    expected, _ = Rotation.align_vectors(noisy - noisy.mean(axis=0), POINTS - POINTS.mean(axis=0))
    np.testing.assert_allclose(found.rotation, expected.as_matrix(), atol=1e-13)
    np.testing.assert_allclose(found.residuals, noisy - found.points(POINTS), atol=1e-14)
    assert found.residuals.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-13)


def test_points_vectors_displacements_and_orientations_are_carried() -> None:
    found = register(POINTS, base(POINTS))
    here = np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
    np.testing.assert_allclose(found.points(here), base(here), atol=1e-13)
    np.testing.assert_allclose(found.vectors(here), TURN.apply(here), atol=1e-13)
    twist = np.arange(6.0)
    expected = [*TURN.apply(twist[:3]), *TURN.apply(twist[3:])]
    np.testing.assert_allclose(found.displacements(twist), expected, atol=1e-12)
    tool = Rotation.from_rotvec([1, 2, 3]).as_matrix()
    np.testing.assert_allclose(found.rotations(tool), TURN.as_matrix() @ tool, atol=1e-13)


def test_unmeasured_displacements_stay_unmeasured() -> None:
    found = register(POINTS, base(POINTS))
    assert np.isnan(found.vectors([[np.nan, 0, 0], [1, 0, 0]])).all(axis=1).tolist() == [True, False]


def test_a_scale_is_found_when_asked_for_and_told_when_not() -> None:
    random = np.random.default_rng(7)
    scaled = base(POINTS, 1.0003) + random.normal(0, 1e-6, POINTS.shape)
    fitted, plain = register(POINTS, scaled, with_scale=True), register(POINTS, scaled)
    assert fitted.scale == pytest.approx(1.0003, abs=5 * fitted.apparent_scale_std)
    assert fitted.rms < 1e-5
    np.testing.assert_allclose(fitted.vectors([1, 0, 0]), 1.0003 * TURN.apply([1, 0, 0]), atol=1e-5)
    twist = fitted.displacements([0, 0, 0, 1, 0, 0])
    np.testing.assert_allclose(np.linalg.norm(twist), 1.0)  # a rotation has no length to be scaled
    assert plain.scale == 1.0
    assert plain.apparent_scale == pytest.approx(fitted.scale)
    assert plain.scale_doubtful
    assert not register(POINTS, base(POINTS) + random.normal(0, 1e-4, POINTS.shape)).scale_doubtful


@pytest.mark.parametrize("with_scale", [False, True])
def test_the_covariance_is_the_spread_over_noisy_readings(with_scale: bool) -> None:
    random = np.random.default_rng(9)
    sigma, n = 1e-4, 1500
    claimed = register(POINTS, base(POINTS), sigma=sigma, with_scale=with_scale)
    errors, estimates, scales = [], [], []
    for _ in range(n):
        found = register(POINTS, base(POINTS) + random.normal(0, sigma, POINTS.shape), with_scale=with_scale)
        turn = Rotation.from_matrix(found.rotation @ TURN.as_matrix().T).as_rotvec()
        errors.append([*(found.translation - SHIFT), *turn])
        estimates.append(found.sigma**2)
        scales.append(found.apparent_scale)
    size = np.sqrt(np.diag(claimed.covariance))
    spread = np.cov(np.array(errors).T) / np.outer(size, size)
    np.testing.assert_allclose(spread, claimed.covariance / np.outer(size, size), atol=0.1)
    # the mean estimated variance is unbiased: relative standard error sqrt(2 / (30 n))
    assert np.mean(estimates) == pytest.approx(sigma**2, rel=0.02)
    assert np.std(scales) == pytest.approx(claimed.apparent_scale_std, rel=0.06)


MIRROR = np.diag([1.0, 1.0, -1.0])
LINE = np.linspace([0.0, 0, 0], [1.0, 1, 1], 5)


@pytest.mark.parametrize(
    ("tracker", "base_points", "arguments", "part"),
    [
        (POINTS[:2], base(POINTS[:2]), {}, "tracker points: found 2 points"),
        (LINE, base(LINE), {}, "tracker points: found points on one line"),
        (POINTS, LINE[[0, 1, 2, 3] * 3], {}, "base points: found points on one line"),
        (POINTS, base(POINTS)[:-1], {}, r"shape \(12, 3\) and base points of shape \(11, 3\)"),
        (POINTS * np.nan, base(POINTS), {}, "tracker points: found nan"),
        (POINTS * 1e3, base(POINTS), {}, r"found base points 0.001 times as far apart.*same units"),
        (POINTS @ MIRROR, base(POINTS), {}, "mirror image"),
        (POINTS, base(POINTS), {"sigma": -1.0}, "sigma: found -1.0"),
        ([POINTS] * 2, [POINTS] * 2, {}, r"expected \(M, 3\) in both"),
    ],
)
def test_points_that_give_no_frame_are_refused(
    tracker: Any, base_points: Any, arguments: dict[str, Any], part: str
) -> None:
    with pytest.raises(BeamstiffError, match=part):
        register(tracker, base_points, **arguments)


def test_points_in_a_plane_are_no_mirror_image_of_themselves() -> None:
    flat = POINTS * [1.0, 1.0, 0.0]
    found = register(flat, base(flat))
    np.testing.assert_allclose(found.rotation, TURN.as_matrix(), atol=1e-12)
