"""Displacement of the tool from points on it, measured before and after loading (seed 000, eqs 27 to 30)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import finite, positive, rotation_matrix
from beamstiff.measure.registration import check_spread, fit_rigid_motion, rotation_precision
from beamstiff.se3 import Array, displacement_transport, rotate_screw, skew, transform, vector_from_rotation


@dataclass(frozen=True, eq=False)
class PointDisplacement:
    """Displacements of the TCP found from points."""

    displacement: Array  # (..., 6), m and rad: ``[d, r]`` of the TCP, in the frame of the points
    rotation: Array  # (..., 3, 3): ``dR = R' R^T`` (eq. 30); its rotation vector is r
    # (...), m: root mean square distance between the points after loading and the points before, moved
    # rigidly
    residual: Array
    # (..., 6, 6): of `displacement`, from the points' sigma; None where that was not given
    covariance: Array | None

    @property
    def sigma_position(self) -> Array | None:
        """Standard deviation of d (...), root mean square over its three components, m."""
        return None if self.covariance is None else _root_mean(self.covariance[..., :3, :3])

    @property
    def sigma_rotation(self) -> Array | None:
        """Standard deviation of r (...), root mean square over its three components, rad."""
        return None if self.covariance is None else _root_mean(self.covariance[..., 3:, 3:])


def frame_from_points(points: ArrayLike) -> Array:
    """Return the frame F7 that three points P10, P11, P12 on the tool define.

    Origin P10, x towards P11, z normal to the plane of the three, P12 on the side of positive y.

    `points` (..., 3, 3), m: rows P10, P11, P12.

    >>> frame_from_points([[0, 0, 1], [2, 0, 1], [1, 1, 1]])[:3, 3]
    array([0., 0., 1.])
    """
    p = finite(points, "points", 3, 3)
    check_spread(p, "points")
    x = p[..., 1, :] - p[..., 0, :]
    z = np.cross(x, p[..., 2, :] - p[..., 0, :])
    axes = [x, np.cross(z, x), z]
    rotation = np.stack([axis / np.linalg.norm(axis, axis=-1, keepdims=True) for axis in axes], axis=-1)
    return transform(rotation, p[..., 0, :])


def displacement_from_points(
    before: ArrayLike,
    after: ArrayLike,
    *,
    tcp: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    sigma: float | None = None,
    tolerance: float = 1e-3,
) -> PointDisplacement:
    """Return the displacement of the TCP from points on the tool before and after loading.

    ``d = p' - p`` (eq. 29) and ``dR = R' R^T`` (eq. 30) of the rigid motion that carries the points before
    onto those after with the least squared distance; for three points this is F7 to F7' of eqs 27 and 28.

    `before, after` (..., M, 3), m: M >= 3 points, in the base frame (else the result is in the frame of the
    tracker); an unloaded reading (M, 3) serves all poses. `tcp` (..., 3), m: unloaded TCP, in the frame of
    the points. `offset` (..., 3), m: instead of `tcp`: the TCP in the frame F7 of the first three points
    (`frame_from_points`). `sigma`, m: standard deviation of one coordinate of one point, before and after.
    `tolerance`, m: largest residual: points on a rigid tool keep their distances.

    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> displacement_from_points(points, points + [0, 0, -1e-3], tcp=[0, 0, 2]).displacement.round(12)
    array([ 0.   ,  0.   , -0.001,  0.   ,  0.   ,  0.   ])
    """
    p, p_after = finite(before, "points before", -1, 3), finite(after, "points after", -1, 3)
    if p.shape[-2] != p_after.shape[-2]:
        raise BeamstiffError(
            f"found {p.shape[-2]} points before and {p_after.shape[-2]} after loading, expected the same "
            "points"
        )
    try:
        p, p_after = np.broadcast_arrays(p, p_after)
    except ValueError:
        raise BeamstiffError(
            f"found points before of shape {p.shape} and after of shape {p_after.shape}, expected the "
            "same number of poses"
        ) from None
    check_spread(p, "points before")
    check_spread(p_after, "points after")
    if offset is not None and tcp is None:
        frame = frame_from_points(p[..., :3, :])
        at = np.einsum("...ij,...j->...i", frame[..., :3, :3], finite(offset, "offset", 3))
        place = frame[..., :3, 3] + at
    elif tcp is not None and offset is None:
        place = finite(tcp, "tcp", 3)
    else:
        raise BeamstiffError(
            "expected either tcp, its place beside the points, or offset, its place in their frame F7"
        )
    motion = fit_rigid_motion(p, p_after)
    residual = motion.rms
    if (np.atleast_1d(residual) > tolerance).any():
        worst = float(residual.max())
        at = f" in pose {int(residual.argmax())}" if residual.ndim else ""
        raise BeamstiffError(
            f"found points that moved {worst * 1e3:.3g} mm against one another{at}, expected at most "
            f"{tolerance * 1e3:.3g} mm on a rigid tool: exchanged points, a loose reflector, or other units?"
        )
    # centred before it is turned: the origin may be metres away, the displacement is a fraction of a
    # millimetre
    centre = p.mean(axis=-2)
    arm = place - centre
    turned = np.einsum("...ij,...j->...i", motion.rotation, arm)
    d = p_after.mean(axis=-2) - centre + (turned - arm)
    displacement = np.concatenate([d, vector_from_rotation(motion.rotation)], axis=-1)
    covariance = None if sigma is None else _covariance(p_after, turned, positive(sigma, "sigma"))
    return PointDisplacement(displacement, motion.rotation, residual, covariance)


def subtract_sensor_deflection(
    displacement: ArrayLike,
    wrench: ArrayLike,
    compliance: ArrayLike,
    rotation: ArrayLike,
    arm: ArrayLike = (0.0, 0.0, 0.0),
) -> Array:
    """Return measured TCP displacements without the deflection of a force sensor between flange and tool.

    `displacement` (..., 6), m and rad: measured ``[d, r]`` of the TCP, base frame. `wrench` (..., 6), N and N
    m: wrench on the tool at the TCP, base frame. `compliance` (6, 6): of the sensor, at its own origin and in
    its own axes, ``[d, r] = C [f, m]``, from the maker's data. `rotation` (..., 3, 3): base from sensor axes.
    `arm` (..., 3), m: from the sensor's origin to the TCP, base frame.
    """
    measured = finite(displacement, "displacement", 6)
    load = finite(wrench, "wrench", 6)
    c = finite(compliance, "sensor compliance", 6, 6)
    if c.ndim != 2:
        raise BeamstiffError(f"sensor compliance: found shape {c.shape}, expected (6, 6)")
    # translations and rotations differ in unit: compare on a scale where the diagonal is one
    size = np.sqrt(np.where(np.diag(c) > 0, np.diag(c), 1.0))
    scaled = c / np.outer(size, size)
    if np.abs(scaled - scaled.T).max() > 1e-6:
        raise BeamstiffError("sensor compliance: found a matrix that is not symmetric, expected C = C^T")
    if np.linalg.eigvalsh((scaled + scaled.T) / 2).min() < -1e-9:
        raise BeamstiffError(
            "sensor compliance: found a negative eigenvalue, expected a positive semidefinite matrix"
        )
    screw = rotate_screw(rotation_matrix(rotation, "sensor rotation"))
    carry = displacement_transport(finite(arm, "arm", 3))
    # at the sensor: w = X^T w_tcp; at the TCP: u = X C w
    at_tcp = carry @ screw @ c @ np.swapaxes(screw, -1, -2) @ np.swapaxes(carry, -1, -2)
    return np.asarray(measured - np.einsum("...ij,...j->...i", at_tcp, load))


def _covariance(points: Array, arm: Array, sigma: float) -> Array:
    """Return the covariance of ``[d, r]`` at `arm` from the centre of the points.

    A point's error counts twice, before and after. The error of the centre, ``2 sigma^2 / M``, and that of
    the rotation, ``2 sigma^2 (sum |c|^2 I - c c^T)^-1``, are independent; the arm turns the second into a
    translation.
    """
    centred = points - points.mean(axis=-2, keepdims=True)
    turning = 2.0 * sigma**2 * np.linalg.inv(rotation_precision(centred))
    lever = -skew(np.broadcast_to(arm, (*points.shape[:-2], 3)))
    crossed = lever @ turning
    shift = crossed @ np.swapaxes(lever, -1, -2) + 2.0 * sigma**2 / points.shape[-2] * np.eye(3)
    upper = np.concatenate([shift, crossed], axis=-1)
    lower = np.concatenate([np.swapaxes(crossed, -1, -2), turning], axis=-1)
    return np.concatenate([upper, lower], axis=-2)


def _root_mean(block: Array) -> Array:
    return np.asarray(np.sqrt(np.trace(block, axis1=-2, axis2=-1) / 3.0))
