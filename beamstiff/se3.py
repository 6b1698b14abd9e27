"""Batched rotations, homogeneous transforms, wrench and twist transport.

All functions work on arrays with any leading (pose) axes. A transform ``T`` (..., 4, 4) maps coordinates
of the moving frame to the fixed one. A twist or displacement is ``[d, r]``, a wrench ``[f, m]``.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def skew(vector: Array) -> Array:
    """Return the cross-product matrix of vectors: ``skew(a) @ b == cross(a, b)``.

    `vector` (..., 3). Returns (..., 3, 3) array.
    """
    vector = np.asarray(vector, dtype=np.float64)
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


def rotation_about(axis: int, angle: Array) -> Array:
    """Return rotations about a coordinate axis (0 x, 1 y, 2 z).

    `angle` (...), rad. Returns (..., 3, 3) array.

    >>> rotation_about(2, np.pi / 2).round(12) @ [1.0, 0.0, 0.0]
    array([0., 1., 0.])
    """
    angle = np.asarray(angle, dtype=np.float64)
    c, s = np.cos(angle), np.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.zeros((*angle.shape, 3, 3))
    rotation[..., axis, axis] = 1.0
    rotation[..., j, j], rotation[..., j, k] = c, -s
    rotation[..., k, j], rotation[..., k, k] = s, c
    return rotation


def rotation_from_vector(vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector (Rodrigues).

    `vector` (..., 3), rad. Returns (..., 3, 3) array.
    """
    vector = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    s = skew(vector)
    # sinc-like coefficients stay exact at zero
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    result: Array = np.eye(3) + first * s + second * (s @ s)
    return result


def vector_from_rotation(rotation: Array) -> Array:
    """Return the rotation vector of rotation matrices, angle in [0, pi].

    `rotation` (..., 3, 3). Returns (..., 3) array, rad.
    """
    from scipy.spatial.transform import Rotation

    rotation = np.asarray(rotation, dtype=np.float64)
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return flat.reshape(*rotation.shape[:-2], 3)


def transform(rotation: Array, position: Array) -> Array:
    """Return homogeneous transforms from rotations (..., 3, 3) and positions (..., 3)."""
    shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1])
    result = np.zeros((*shape, 4, 4))
    result[..., :3, :3] = rotation
    result[..., :3, 3] = position
    result[..., 3, 3] = 1.0
    return result


def displacement_transport(arm: Array) -> Array:
    """Return X with ``u_b = X u_a`` for two points of one rigid body, ``arm = p_b - p_a``.

    ``d_b = d_a + r x arm``, ``r_b = r_a``; the same matrix transposed carries a wrench from b to a:
    ``w_a = X^T w_b``.

    `arm` (..., 3), m, base frame. Returns (..., 6, 6) array.
    """
    arm = np.asarray(arm, dtype=np.float64)
    result = np.zeros((*arm.shape[:-1], 6, 6))
    result[..., range(6), range(6)] = 1.0
    result[..., :3, 3:] = -skew(arm)
    return result


def rotate_screw(rotation: Array) -> Array:
    """Return blockdiag(R, R): turns the components of a twist or wrench from one frame to another."""
    rotation = np.asarray(rotation, dtype=np.float64)
    result = np.zeros((*rotation.shape[:-2], 6, 6))
    result[..., :3, :3] = rotation
    result[..., 3:, 3:] = rotation
    return result
