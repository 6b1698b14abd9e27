"""Poses of a tag as a camera reads them: one of the two is on the robot, the other stands still.

With x, R the tag's pose in the camera's frame, a camera on the robot stands at ``-R^T x``, turned by ``R^T``,
in the frame of the tag; a tag on the robot stands at x, turned by R, in the frame of a fixed camera. So such
rows are absolute poses of the robot in an unknown frame, as those of a tracker are.

What a camera reads well is where it sees the tag, not where it stands: turned by r, it sees the tag move by
r times the distance. So its rows are read along axes of their own (`Measurements.along`), the optical one
first, and a camera on the robot reads of a small motion [d, r] of its own ``d + r x sight``, sight the way
from the camera to the tag.

A wrong focal length or size of the tag makes all distances longer: ``camera.scale``.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamstiff.measure.rows import without_displacement
from beamstiff.measure.table import ON_ROBOT, Measurements
from beamstiff.se3 import Array, rotation_from_vector

SCALE = "camera.scale"
CORNERS = 0.5 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])  # of a tag of size 1


def corner_noise(position: Array, rotation: Array, noise: float, focal: float, size: float) -> Array:
    """Return standard deviations (N, 6) of tags' poses, m and rad, along and about the camera's axes.

    To first order in the noise of the four corners, which grows with range and angle (Hartley & Zisserman
    2004, eq. 5.10: covariance ``s^2 (J^T J)^-1`` of a pose by its projections).

    `position`, `rotation`: (N, 3) arrays, m and rad; in the camera's frame, z forward; rotation vectors.
    `noise`, `focal`: of a corner's coordinates; focal length.
    `size`: m; edge of the tag.
    """
    arm = np.einsum("nij,kj->nki", rotation_from_vector(rotation), size * CORNERS)
    x, y, z = np.moveaxis(position[:, None] + arm, -1, 0)
    zero = np.zeros_like(x)
    slope = np.stack([1 / z, zero, -x / z**2, zero, 1 / z, -y / z**2], -1).reshape(*z.shape, 2, 3)
    moved = np.concatenate([slope, np.cross(arm[:, :, None], slope)], -1).reshape(len(position), 8, 6)
    covariance = (noise / focal) ** 2 * np.linalg.inv(moved.swapaxes(1, 2) @ moved)
    return np.asarray(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))


def robot_poses(position: Array, rotation: Array, sigma: Array, camera: str) -> dict[str, Array]:
    """Return columns of `Measurements` for tags' poses (N, 3), (N, 3) and sigma (N, 6) in a camera's frame.

    Position, rotation, direction (the optical axis) and sight in the frame of what stands still; sigma along
    the axes that the row is read in, of rotations about those of the frame.
    """
    turn = rotation_from_vector(rotation)  # of the tag in the camera's frame
    lateral = np.sqrt((sigma[:, :2] ** 2).mean(axis=1))
    along = np.stack([sigma[:, 2], lateral, lateral], axis=1)
    if camera != ON_ROBOT:
        axis = np.broadcast_to([0.0, 0.0, 1.0], position.shape).copy()
        own = {"position": position, "rotation": rotation, "direction": axis, "sight": -position}
        return own | {"sigma": np.concatenate([along, sigma[:, 3:]], axis=1)}
    back = turn.swapaxes(1, 2)
    sight = (back @ position[:, :, None])[:, :, 0]
    about = np.sqrt((back**2 @ sigma[:, 3:, None] ** 2)[:, :, 0])
    return {
        "position": -sight,
        "rotation": -rotation,
        "direction": back[:, :, 2],
        "sight": sight,
        "sigma": np.concatenate([along, about], axis=1),
    }


def unscaled(rows: Measurements, values: Mapping[str, float]) -> Measurements:
    """Return rows as a camera would read them without its error of scale, one of `values`."""
    scale = values.get(SCALE, 0.0)
    if not scale:
        return rows
    longer = rows.sight * scale / (1.0 + scale)
    return replace(rows, position=rows.position + longer, sight=rows.sight - longer)


def without_motion(rows: Measurements, moved: Array) -> Measurements:
    """Return absolute rows as they would be had causes not moved the points by (N, 6), as rows are read."""
    if not rows.camera or rows.axes is None:
        return without_displacement(rows, moved)
    shift = (rows.axes.swapaxes(1, 2) @ moved[:, :3, None])[:, :, 0]
    if rows.camera == ON_ROBOT:
        shift = shift - np.cross(moved[:, 3:], rows.sight)
    return without_displacement(rows, np.concatenate([shift, moved[:, 3:]], axis=1))


def gap_of_camera(rows: Measurements, values: Mapping[str, float], placed: tuple[Array, Array]) -> Array:
    """Return read less predicted positions (N, 3) along the axes of the rows, as the camera sees them.

    `placed`: position (N, 3) and rotation (N, 3, 3) that are predicted, in the frame of the rows.
    """
    rows, (position, rotation) = unscaled(rows, values), placed
    off = rows.position - position
    if rows.camera == ON_ROBOT:  # the tag less where it would be seen from there
        seen = rotation @ rotation_from_vector(rows.rotation).swapaxes(1, 2) @ rows.sight[:, :, None]
        off = off + rows.sight - seen[:, :, 0]
    return rows.along(np.concatenate([off, np.zeros_like(off)], axis=1))[:, :3]


def scale_column(rows: Measurements) -> Array:
    """Return what a unit of the error of scale adds to what is read, base axes, (N, 6)."""
    return np.concatenate([-rows.sight, np.zeros_like(rows.sight)], axis=1)
