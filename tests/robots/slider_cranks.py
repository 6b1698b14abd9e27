"""Closed forms of a triangle's angle and side, for machines that ball screws drive."""

import numpy as np

from beamstiff.se3 import Array


def marie_theta(screw: Array, kappa: float, lam: float, l1: float, l3: float, branch: int) -> Array:
    """Return the angle that a screw of this length holds (Marie et al., eq. A.3).

    With the slip of the paper set right: `screw` is squared in Z, and the two signs before the root differ.
    """
    xb, yb = l3 * np.cos(np.pi / 2 - lam), l3 * np.sin(np.pi / 2 - lam)
    z = screw**2 - xb**2 - yb**2 - l1**2
    return wrapped(kappa - arctangent(2 * yb * l1, 2 * xb * l1, z, branch) + np.pi / 2)


def arctangent(b1: Array | float, b2: Array | float, b3: Array, branch: int) -> Array:
    """Return the angle with b1 sin + b2 cos = b3."""
    square = b1**2 + b2**2
    root = np.sqrt(square - b3**2)
    result: Array = np.arctan2(
        (b1 * b3 + branch * b2 * root) / square, (b2 * b3 - branch * b1 * root) / square
    )
    return result


def third_side(one: float, other: float, between: Array) -> Array:
    """Return the side of a triangle opposite to an angle: law of cosines."""
    return np.sqrt(one**2 + other**2 - 2 * one * other * np.cos(between))


def lever_arm(one: float, other: float, between: Array) -> Array:
    """Return the height of that triangle over its third side: twice the area by the side."""
    return np.abs(one * other * np.sin(between)) / third_side(one, other, between)


def wrapped(angle: Array) -> Array:
    """Return an angle within half a turn of zero."""
    result: Array = np.arctan2(np.sin(angle), np.cos(angle))
    return result
