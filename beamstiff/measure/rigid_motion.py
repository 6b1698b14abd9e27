"""The rigid motion that carries points onto points, by least squares, batched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array, skew

# a triangle this flat turns a micrometre of noise along its height into a rotation a thousand times larger
FLATTEST = 1e-3


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Motions ``to = scale * rotation @ from + translation``."""

    rotation: Array  # (..., 3, 3)
    translation: Array  # (..., 3), m
    residuals: Array  # (..., M, 3), m: what remains at each point, to minus moved from
    best_scale: Array  # (...): scale that would fit best, whether applied or not
    # (...): a reflection would fit the points far better than any rotation
    mirrored: NDArray[np.bool_]

    @property
    def rms(self) -> Array:
        """Root mean square of the residuals' norm (...), m."""
        result: Array = np.sqrt(np.mean(np.sum(self.residuals**2, axis=-1), axis=-1))
        return result


def check_spread(points: Array, name: str) -> None:
    """Refuse sets of points (..., M, 3) that do not fix a rotation."""
    count = points.shape[-2]
    if count < 3:
        raise BeamstiffError(f"{name}: found {count} points, expected at least three that are not on a line")
    spread = np.linalg.svd(points - points.mean(axis=-2, keepdims=True), compute_uv=False).reshape(-1, 3)
    flat = spread[:, 1] <= FLATTEST * spread[:, 0]
    if flat.any():
        worst = int(flat.argmax())
        place = f" in pose {worst}" if points.ndim > 2 else ""
        kind = "on one line" if spread[worst, 0] > 0 else "at one place"
        raise BeamstiffError(
            f"{name}: found points {kind}{place}, expected at least three that are not on a line"
        )


def fit_rigid_motion(start: Array, end: Array, *, with_scale: bool = False) -> RigidMotion:
    """Return the motions that carry points `start` onto `end` with the least squared distance.

    Kabsch 1976 (Acta Cryst. A32, 922) with the scale of Umeyama 1991 (IEEE PAMI 13, 376), by singular values.

    `start, end` (..., M, 3), m: corresponding points, M >= 3, not collinear (`check_spread`). `with_scale`:
    fit a scale too.
    """
    start, end = np.broadcast_arrays(start, end)
    from_centre, to_centre = start.mean(axis=-2), end.mean(axis=-2)
    a, b = start - from_centre[..., None, :], end - to_centre[..., None, :]
    u, values, vt = np.linalg.svd(np.swapaxes(b, -1, -2) @ a)
    hand = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    signs = np.ones_like(values)
    signs[..., 2] = hand
    rotation = (u * signs[..., None, :]) @ vt
    size = np.sum(a**2, axis=(-2, -1))
    fitted = np.sum(values * signs, axis=-1)
    best_scale = fitted / size
    scale = best_scale if with_scale else np.ones_like(best_scale)
    translation = to_centre - scale[..., None] * np.einsum("...ij,...j->...i", rotation, from_centre)
    moved = np.einsum("...ij,...mj->...mi", rotation, a) * scale[..., None, None]
    residuals = b - moved
    # squared residuals of the best rotation and of the best reflection, each with its own scale
    left = np.sum(b**2, axis=(-2, -1))
    proper, improper = left - fitted**2 / size, left - np.sum(values, axis=-1) ** 2 / size
    mirrored = (proper > 100 * np.maximum(improper, 0.0)) & (proper > 1e-6 * left)
    return RigidMotion(rotation, translation, residuals, best_scale, mirrored)


def rotation_precision(centred: Array) -> Array:
    """Return ``sum |c|^2 I - c c^T`` (..., 3, 3): sigma^2 times its inverse is a rotation's covariance."""
    s = skew(centred)
    return np.asarray(np.sum(np.swapaxes(s, -1, -2) @ s, axis=-3))
