"""Finite rotations of the simulated bodies, batched over any leading axes."""

import numpy as np

from beamstiff.exam.campaign import Array

PAIRS = ((2, 1), (0, 2), (1, 0))  # row and column of the components of a skew matrix


def cross_matrix(v: Array) -> Array:
    """Return the matrices (..., 3, 3) that take the cross product with vectors (..., 3) from the left."""
    result = np.zeros((*v.shape, 3))
    for at, (j, k) in enumerate(PAIRS):
        result[..., j, k], result[..., k, j] = v[..., at], -v[..., at]
    return result


def cross(v: Array, w: Array) -> Array:
    """Return the cross products (..., 3) of vectors; of few of them in a fraction of numpy's time."""
    result = np.empty(np.broadcast_shapes(v.shape, w.shape))
    for at, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        result[..., at] = v[..., j] * w[..., k] - v[..., k] * w[..., j]
    return result


def apply(matrices: Array, vectors: Array) -> Array:
    """Return the products (..., 3) of matrices (..., 3, 3) with vectors (..., 3)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def turn(vector: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of rotation vectors (..., 3), by unit quaternions.

    >>> turn(np.array([0.0, 0.0, np.pi / 2])).round(12) @ [1.0, 0.0, 0.0]
    array([0., 1., 0.])
    """
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    w = np.cos(half)[..., None]
    v = 0.5 * np.sinc(half / np.pi) * vector
    s = cross_matrix(v)
    return np.asarray(np.eye(3) + 2.0 * w * s + 2.0 * s @ s)


def turned_by(rotation: Array) -> Array:
    """Return the rotation vectors (..., 3) of rotation matrices (..., 3, 3), angle below pi.

    >>> turned_by(turn(np.array([0.1, -0.2, 0.3])))
    array([ 0.1, -0.2,  0.3])
    """
    skew = 0.5 * np.stack([rotation[..., j, k] - rotation[..., k, j] for j, k in PAIRS], axis=-1)
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1.0))
    factor = np.where(sine > 1e-8, angle / np.where(sine > 1e-8, sine, 1.0), 1.0)
    near = angle > 3.1
    result: Array = factor[..., None] * skew
    if near.any():  # the odd part fades near half a turn; the even one tells the axis
        even = 0.5 * (rotation[near] + np.swapaxes(rotation[near], -1, -2))
        axis = np.linalg.eigh(even)[1][..., -1]
        sign = np.where(np.einsum("ki,ki->k", axis, skew[near]) < 0.0, -1.0, 1.0)
        result[near] = (sign * angle[near])[:, None] * axis
    return result


def vector_rate(vector: Array) -> Array:
    """Return what turns spin into the rate of a rotation vector: ``I - [v]/2 + (1/12 + |v|^2/720) [v]^2``."""
    s = cross_matrix(vector)
    square = np.sum(vector**2, axis=-1)[..., None, None]
    return np.asarray(np.eye(3) - 0.5 * s + (1.0 / 12.0 + square / 720.0) * (s @ s))
