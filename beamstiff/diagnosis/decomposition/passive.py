"""Least squares with compliances that a machine can have: none gives back more work than was done on it.

The matrix of a compliance is positive semidefinite, that is ``v^T C v >= 0`` for every load v. Each v is a
linear constraint, and those that a fit breaks are added until none is left (cutting planes: Kelley, J. SIAM 8
(1960) 703). Those that do not hold a fit are dropped: without them it stays the best, so that the next one is
farther off (Eaves & Zangwill, SIAM J. Control 9 (1971) 529). Under linear constraints least squares is a
problem of least distance (Lawson & Hanson, Solving Least Squares Problems, ch. 23).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from beamstiff.measure.arrays import Integers
from beamstiff.non_negative import non_negative
from beamstiff.se3 import Array

CUTS = 200  # rounds of constraints; what is broken then by little is mended by smaller couplings
BROKEN = 1e-8  # of the largest compliance of a matrix, below zero: rounding


@dataclass(frozen=True, eq=False)
class Matrix:
    """A compliance among parameters: which stand where, and what each is multiplied by to have no unit.

    `at`: (k, k) int array, -1 where there is none. `scale`: (k, k) array.
    """

    at: Integers
    scale: Array

    def moved(self, start: int) -> Matrix:
        """Return the same where its parameters begin with number `start`."""
        return Matrix(np.where(self.at >= 0, self.at + start, -1), self.scale)

    def of(self, theta: Array) -> Array:
        """Return the matrix (k, k) of some parameters (c,)."""
        return np.where(self.at >= 0, theta[self.at], 0.0) * self.scale

    def cuts(self, theta: Array) -> Array:
        """Return constraints (m, c) that parameters break: by each load that gets back more than it did."""
        values, loads = np.linalg.eigh(self.of(theta))
        broken = loads[:, values < -BROKEN * max(float(np.abs(values).max()), np.finfo(float).tiny)].T
        result = np.zeros((len(theta), len(broken)))
        there = self.at >= 0
        worked = broken[:, :, None] * broken[:, None, :] * self.scale
        np.add.at(result, self.at[there], worked[:, there].T)
        return result.T

    def mended(self, theta: Array) -> Array:
        """Return the parameters with couplings as much smaller as it takes."""
        matrix = self.of(theta)
        own = np.sqrt(np.maximum(np.diag(matrix), 0.0))
        unit = np.where(own > 0, own, 1.0)
        least = float(np.linalg.eigvalsh(matrix / np.outer(unit, unit) * np.outer(own > 0, own > 0))[0])
        result = theta.copy()
        coupled = (self.at >= 0) & ~np.eye(len(self.at), dtype=bool)
        share = np.outer(own > 0, own > 0) * min(1.0, 1.0 / max(1.0 - least, 1.0))
        result[self.at[coupled]] = theta[self.at[coupled]] * share[coupled]
        return result


def matrix_of(couplings: Integers, size: Array, units: Array) -> Matrix:
    """Return the matrix of couplings (k, 3), each of two others.

    `size`: (c,) array; realistic sizes of the parameters, SI. `units`: (c,) array; SI of their units.
    """
    own = np.unique(couplings[:, 1:])
    at = np.full((own.size, own.size), -1, dtype=np.intp)
    np.fill_diagonal(at, own)
    first, second = np.searchsorted(own, couplings[:, 1:]).T
    at[first, second] = at[second, first] = couplings[:, 0]
    return Matrix(at, units[at] / np.sqrt(np.outer(size[own], size[own])))


def passive(triangle: Array, pull: Array, positive: NDArray[np.bool_], matrices: Sequence[Matrix]) -> Array:
    """Return parameters (c,) with the least ``|R theta - p|``, no compliance of which gives work away.

    `triangle`: R (c, c), upper. `pull`: p (c,). `positive`: (c,) bool array; those that cannot be negative.
    """
    size = float(np.linalg.norm(pull)) or 1.0
    signs = _along(triangle, np.eye(len(pull))[positive])
    loads = np.zeros((len(pull), 0))
    theta = np.asarray(solve_triangular(triangle, pull, check_finite=False))
    for _ in range(CUTS):
        broken = [cut for one in matrices for cut in one.cuts(theta)]
        if not broken and (theta[positive] >= 0.0).all():
            return theta
        if broken:
            loads = np.concatenate([loads, _along(triangle, np.array(broken))], axis=1)
        along = np.concatenate([signs, loads], axis=1)
        dual = np.concatenate([along, -(pull / size @ along)[None]])
        found = non_negative(dual, np.append(np.zeros(len(pull)), 1.0))[0]
        left = dual @ found
        left[-1] -= 1.0
        loads = loads[:, found[signs.shape[1] :] > 0.0]
        theta = solve_triangular(triangle, pull - size * left[:-1] / left[-1], check_finite=False)
        theta[positive & (theta < 0.0)] = 0.0  # by rounding
    theta[positive & (theta < 0.0)] = 0.0
    for one in matrices:
        theta = one.mended(theta)
    return theta


def _along(triangle: Array, rows: Array) -> Array:
    """Return constraints (m, c) as unit columns (c, m) of the problem of least distance."""
    along = np.asarray(solve_triangular(triangle, rows.T, trans="T", check_finite=False))
    return np.asarray(along / np.linalg.norm(along, axis=0))
