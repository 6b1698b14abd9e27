"""Arms whose maps are known by hand."""

import numpy as np

from beamstiff import Robot
from beamstiff.se3 import Array
from tests import arms

L1, L2 = 0.7, 0.5
K1, K2 = 2e5, 8e4  # N m/rad


def planar_arm(limits: tuple[float, float] | None = None) -> Robot:
    """Return an arm of two rigid links in the plane x, y, elastic about its two axes alone."""
    nodes, links = "foot hub elbow fork tip", ("upper", "lower")
    return arms.planar_arm("planar arm", (L1, L2), (K1, K2), nodes, links, limits=limits)


def planar_jacobian(q1: Array, q2: Array) -> Array:
    """Return the Jacobian (..., 2, 2) of the tip's position."""
    s1, c1, s12, c12 = np.sin(q1), np.cos(q1), np.sin(q1 + q2), np.cos(q1 + q2)
    rows = [[-L1 * s1 - L2 * s12, -L2 * s12], [L1 * c1 + L2 * c12, L2 * c12]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def planar_compliance(q1: Array, q2: Array) -> Array:
    """Return the compliance (..., 2, 2) of the tip in the plane: J diag(1/k) J^T."""
    jacobian = planar_jacobian(q1, q2)
    return jacobian @ np.diag([1 / K1, 1 / K2]) @ jacobian.swapaxes(-1, -2)


def planar_angles(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the joint values of the tip at x, y with the elbow to its right (q2 > 0)."""
    q2 = np.arccos((x**2 + y**2 - L1**2 - L2**2) / (2 * L1 * L2))
    return np.arctan2(y, x) - np.arctan2(L2 * np.sin(q2), L1 + L2 * np.cos(q2)), q2
