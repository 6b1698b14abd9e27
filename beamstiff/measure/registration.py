"""The rigid motion that carries points onto points, by least squares; a tracker's frame in the base frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import finite, positive
from beamstiff.se3 import Array, rotate_screw, skew

# a triangle this flat turns a micrometre of noise along its height into a rotation a thousand times larger
FLATTEST = 1e-3
DISTINCT = 1e-6  # singular value, of the largest, below which a reflector's place cannot be told
# sides from which a reflector's place is sought: along the axes and the diagonals
SIDES = np.array([one for one in np.ndindex(3, 3, 3) if one != (1, 1, 1)], dtype=np.float64) - 1.0
SIDES = SIDES[np.abs(SIDES).sum(axis=1) != 2]
NEARER = 0.5  # of what the places near where they are described leave, that others must leave


@dataclass(frozen=True, eq=False)
class Registration:
    """The frame of a tracker in the base frame: ``base = scale * rotation @ tracker + translation``."""

    rotation: Array  # (3, 3)
    translation: Array  # (3,), m
    scale: float  # 1 unless it was fitted
    residuals: Array  # (M, 3), m: base point minus carried tracker point
    sigma: float  # standard deviation of one coordinate, m: as given, else from the residuals
    # (6, 6): of ``[translation, rotation vector]``, the rotation a small one about the base axes; m and rad
    covariance: Array
    # apparent_scale, apparent_scale_std: scale that fits best, applied or not, and its standard deviation.
    # Far from 1 it warns of a scale error
    apparent_scale: float
    apparent_scale_std: float

    @property
    def rms(self) -> float:
        """Root mean square of the residuals' norm, m."""
        return float(np.sqrt(np.mean(np.sum(self.residuals**2, axis=-1))))

    @property
    def scale_doubtful(self) -> bool:
        """Whether the apparent scale is off by more than 1e-6 and three standard deviations."""
        return abs(self.apparent_scale - 1.0) > max(1e-6, 3.0 * self.apparent_scale_std)

    def points(self, points: ArrayLike) -> Array:
        """Return points (..., 3), given in the tracker's frame, in the base frame; m."""
        return self.vectors(points) + self.translation

    def vectors(self, vectors: ArrayLike) -> Array:
        """Return displacement vectors (..., 3), given in the tracker's frame, in the base frame; m."""
        return np.asarray(self.scale * finite(vectors, "vectors", 3, missing=True) @ self.rotation.T)

    def displacements(self, displacements: ArrayLike) -> Array:
        """Return displacements ``[d, r]`` (..., 6), given in the tracker's axes, in base axes; m and rad."""
        turned = finite(displacements, "displacements", 6, missing=True) @ rotate_screw(self.rotation).T
        return np.asarray(turned * np.repeat([self.scale, 1.0], 3))

    def rotations(self, rotations: ArrayLike) -> Array:
        """Return orientations (..., 3, 3) of a body in the tracker's frame as those in the base frame."""
        return np.asarray(self.rotation @ finite(rotations, "rotations", 3, 3))


def register(
    tracker: ArrayLike, base: ArrayLike, *, with_scale: bool = False, sigma: float | None = None
) -> Registration:
    """Return the frame of a tracker in the base frame, by least squares over corresponding points.

    `tracker, base` (M, 3), m: the same points in both frames, at least three, not on a line. `with_scale`:
    fit a scale too. Off by default: it would hide a length error of the robot. `sigma`, m: standard deviation
    of one coordinate's difference; estimated from the residuals where not given.

    >>> tracker = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> register(tracker, tracker + [1.0, 2.0, 3.0]).translation.round(12)
    array([1., 2., 3.])
    """
    p, b = finite(tracker, "tracker points", -1, 3), finite(base, "base points", -1, 3)
    if p.shape != b.shape or p.ndim != 2:
        raise BeamstiffError(
            f"found tracker points of shape {p.shape} and base points of shape {b.shape}, expected (M, "
            "3) in both"
        )
    check_spread(p, "tracker points")
    check_spread(b, "base points")
    motion = fit_rigid_motion(p, b, with_scale=with_scale)
    size = np.linalg.norm(b - b.mean(axis=0)) / np.linalg.norm(p - p.mean(axis=0))
    if not 0.5 < size < 2.0:
        raise BeamstiffError(
            f"found base points {size:.4g} times as far apart as the tracker points, expected the same "
            "units (m)"
        )
    if motion.mirrored:
        raise BeamstiffError(
            "found base points that are the mirror image of the tracker points, expected a rotation: a "
            "left-handed axis or exchanged points?"
        )
    scale = float(motion.best_scale) if with_scale else 1.0
    freedom = 3 * len(p) - (7 if with_scale else 6)
    noise = (
        float(np.sqrt(np.sum(motion.residuals**2) / freedom)) if sigma is None else positive(sigma, "sigma")
    )
    carried = b - motion.residuals - motion.translation
    jacobian = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(p), 3, 3)), -skew(carried), carried[..., None]], axis=-1
    ).reshape(-1, 7)
    with_all = np.linalg.inv(jacobian.T @ jacobian) * noise**2
    without = np.linalg.inv(jacobian[:, :6].T @ jacobian[:, :6]) * noise**2
    return Registration(
        rotation=motion.rotation,
        translation=motion.translation,
        scale=scale,
        residuals=motion.residuals,
        sigma=noise,
        covariance=with_all[:6, :6] if with_scale else without,
        apparent_scale=float(motion.best_scale),
        apparent_scale_std=float(_scale_std(p, b, motion.best_scale, motion.rotation, sigma)),
    )


def _scale_std(tracker: Array, base: Array, scale: Array, rotation: Array, sigma: float | None) -> float:
    """Return the standard deviation of the best-fitting scale, from the noise beside that scale."""
    a, b = tracker - tracker.mean(axis=0), base - base.mean(axis=0)
    if sigma is None:
        rest = b - scale * (a @ rotation.T)
        sigma = float(np.sqrt(np.sum(rest**2) / (3 * len(a) - 7)))
    return sigma / float(np.linalg.norm(a))


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
        return np.asarray(np.sqrt(np.mean(np.sum(self.residuals**2, axis=-1), axis=-1)))


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


def lay_over(described: Array, columns: Array, measured: Array, rounds: int) -> tuple[RigidMotion, Array]:
    """Return the motion that lays points (M, 3) over measured ones, and the c places that fit beside it.

    Motion and places in turn, `rounds` times, from several starts: none moved, and all as far to every side
    as the measured points scatter. Where reflectors sit is set up for the measurement, and may be described
    far off; the motion that fits them there would then be any.

    `columns` (M, 3, c): of each place, what a unit of it adds to the points, before the motion.
    """
    count = columns.shape[2]
    if not count:
        return fit_rigid_motion(described, measured), np.zeros(0)
    # places that move as the motion does cannot be told from it: they stay
    moved = np.concatenate([np.broadcast_to(np.eye(3), (len(measured), 3, 3)), columns], axis=2)
    inverse = np.linalg.pinv(moved.reshape(-1, 3 + count), rcond=DISTINCT)[3:]
    far = float(np.sqrt(measured.var(axis=0).sum())) * SIDES
    start = np.concatenate([np.zeros((1, count)), np.tile(far, (1, count // 3 + 1))[:, :count]])
    at = described + np.einsum("mkc,sc->smk", columns, start)
    for _ in range(rounds):
        motion = fit_rigid_motion(at, measured)
        back = (measured - motion.translation[:, None]) @ motion.rotation - described
        places = back.reshape(len(start), -1) @ inverse.T
        at = described + np.einsum("mkc,sc->smk", columns, places)
    left = fit_rigid_motion(at, measured).rms
    left[0] *= NEARER  # of two that fit about as well, the one near where they are described
    best = int(left.argmin())
    return fit_rigid_motion(at[best], measured), places[best]


def rotation_precision(centred: Array) -> Array:
    """Return ``sum |c|^2 I - c c^T`` (..., 3, 3): sigma^2 times its inverse is a rotation's covariance."""
    s = skew(centred)
    return np.asarray(np.sum(np.swapaxes(s, -1, -2) @ s, axis=-3))
