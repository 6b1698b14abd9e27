"""Two-node beams in space: local axes, 12x12 stiffness (Euler-Bernoulli and Timoshenko), distributed load.

Local degrees of freedom ``[u v w rx ry rz]`` at each end, x along the axis. Source: Przemieniecki, Theory of
Matrix Structural Analysis (1968), eq. 5.116; the shear parameter is ``phi = 12 E I / (G A_s L^2)``.
"""

import numpy as np

from beamstiff.se3 import Array


def beam_axes(axis: Array, up: Array) -> Array:
    """Return the rotation (..., 3, 3) of beams along `axis` (..., 3): columns x, y, z.

    Local y lies in the plane of x and `up` (..., 3), which is not parallel to the axis; NaN where any
    perpendicular will do.
    """
    x = axis / _length(axis)
    chosen = up
    if np.isnan(up).any():  # any perpendicular: the coordinate axis that is farthest from the beam's
        chosen = np.where(np.isnan(up), np.eye(3)[np.argmin(np.abs(x), axis=-1)], up)
    z = np.cross(x, chosen)
    z = z / _length(z)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _length(vector: Array) -> Array:
    # by hand, so that expressions (`expression_graph`) pass too
    return np.asarray(np.sqrt((vector * vector).sum(axis=-1, keepdims=True)))


def beam_stiffness(
    length: Array, E: Array, G: Array, A: Array, Iy: Array, Iz: Array, J: Array, Ay: Array, Az: Array
) -> Array:
    """Return the local stiffness of beams, (..., 12, 12), SI; all arguments broadcast over (...).

    ``Iz`` resists bending in the x-y plane, ``Iy`` in the x-z plane; an infinite shear area makes the beam
    Euler-Bernoulli.

    >>> beam_stiffness(*map(np.float64, (2.0, 6.0, 1.0, 1.0, 1.0, 1.0, 1.0, np.inf, np.inf)))[1, 1]
    np.float64(9.0)
    """
    length = np.asarray(length)  # numbers, or expressions (`expression_graph`)
    k = np.zeros((*length.shape, 12, 12), dtype=np.result_type(length, np.float64))
    axial, torsion = E * A / length, G * J / length
    for i, value in ((0, axial), (3, torsion)):
        k[..., i, i] = k[..., i + 6, i + 6] = value
        k[..., i, i + 6] = k[..., i + 6, i] = -value
    # bending in x-y (v, rz) and in x-z (w, ry): the same matrix but for the sign of the couples
    for second, shear, v, r, sign in ((Iz, Ay, 1, 5, 1.0), (Iy, Az, 2, 4, -1.0)):
        phi = 12 * E * second / (G * shear * length * length)
        base = E * second / (length * (1 + phi))
        force, couple = 12 * base / (length * length), sign * 6 * base / length
        near, far = (4 + phi) * base, (2 - phi) * base
        for a, b, value in (
            (v, v, force), (v + 6, v + 6, force), (v, v + 6, -force),
            (v, r, couple), (v, r + 6, couple), (v + 6, r, -couple), (v + 6, r + 6, -couple),
            (r, r, near), (r + 6, r + 6, near), (r, r + 6, far),
        ):  # fmt: skip
            k[..., a, b] = k[..., b, a] = value
    return k


def uniform_load(load: Array, length: Array) -> Array:
    """Return the consistent nodal loads (..., 12) of line loads (..., 3), N/m, on beams (...), m, local axes.

    ``q L/2`` at each end and ``q L^2/12`` couples, for Euler-Bernoulli and Timoshenko beams alike.
    """
    length = np.asarray(length, dtype=np.float64)[..., None]
    result = np.zeros((*load.shape[:-1], 12))
    result[..., 0:3] = result[..., 6:9] = load * length / 2
    couple = load * length**2 / 12
    result[..., 4], result[..., 5] = -couple[..., 2], couple[..., 1]
    result[..., 10], result[..., 11] = couple[..., 2], -couple[..., 1]
    return result
