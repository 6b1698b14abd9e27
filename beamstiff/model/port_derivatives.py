"""Displacements of many rows and their derivatives by the stiffness at the ports, rows along the last axis.

With ``M = S + sum k_j Phi_j`` and ``f = B_w w + g`` of `model.ports`, the derivative by k_j is
``-B_d^T M^-1 Phi_j M^-1 f``. One elimination a row, without pivots: M is positive definite. With the rows
last every step of it runs over a stretch of numbers that stays in the processor's cache.
"""

import numpy as np
from numpy.typing import NDArray

from beamstiff.se3 import Array

CHUNK = 512  # rows at a time


def moved_with_slopes(
    own: Array, springs: Array, port_stiffness: Array, pose: NDArray[np.int64], force: Array, motion: Array
) -> tuple[Array, Array]:
    """Return ``B_d^T M^-1 f`` of every row (N, 6), and its derivatives by the values k, (N, 6, m).

    `own` (p, p) is ``sum k_j Phi_j``, `springs` (m, p, p) are Phi, none where no derivatives are wanted; S
    (P, p, p) by pose, f (N, p) and B_d (N, p, 6) by row.

    >>> one = np.ones((1, 1, 1))
    >>> moved_with_slopes(np.eye(1), one, one, np.zeros(1, int), np.ones((1, 1)), np.ones((1, 1, 6)))[1][0, 0]
    array([-0.25])
    """
    rows, ports = force.shape
    moved, slopes = np.empty((rows, 6)), np.empty((rows, 6, len(springs)))
    parts = [np.flatnonzero(spring.any(axis=1)) for spring in springs]
    for start in range(0, rows, CHUNK):
        some = slice(start, start + CHUNK)
        at = port_stiffness[pose[some]]
        left = np.empty((ports, ports + (7 if len(springs) else 1), len(at)))
        left[:, :ports] = at.transpose(1, 2, 0) + own[:, :, None]
        left[:, ports] = force[some].T
        if len(springs):
            left[:, ports + 1 :] = motion[some].transpose(1, 2, 0)
        solved = _solve(left)
        opened, carried = solved[:, 0], solved[:, 1:]
        moved[some] = np.einsum("pan,pn->na", motion[some].transpose(1, 2, 0), opened)
        for number, (spring, these) in enumerate(zip(springs, parts, strict=True)):
            pulled = np.tensordot(spring[np.ix_(these, these)], opened[these], 1)
            if len(these) == 1:
                slopes[some, :, number] = -(carried[these[0]] * pulled[0]).T
            else:
                slopes[some, :, number] = -(carried[these] * pulled[:, None]).sum(axis=0).T
    return moved, slopes


def _solve(left: Array) -> Array:
    """Return the solutions (p, c, N) of symmetric systems beside their right sides, (p, p + c, N)."""
    ports = left.shape[0]
    for at in range(ports - 1):
        shares = left[at, at + 1 : ports] / left[at, at]
        for below, share in enumerate(shares, at + 1):
            left[below, below:] -= share * left[at, below:]
    solved = left[:, ports:]
    for at in range(ports - 1, -1, -1):
        for right in range(at + 1, ports):
            solved[at] -= left[at, right] * solved[right]
        solved[at] /= left[at, at]
    return solved
