"""Least squares with compliances that a machine can have: none gives back more work than was done on it.

The matrix C of a compliance is positive semidefinite, and other parameters are not negative, matrices of one
row. Where half of ``|R theta - p|^2`` is least, each is held by a force Z that is semidefinite as well, with
``C Z = 0``. Newton's method for ``C Z = mu 1``, mu falling, keeps both definite (interior points: Helmberg,
Rendl, Vanderbei & Wolkowicz, SIAM J. Optim. 6 (1996) 342). The sum of the products is how much more is left
than the least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dposv

from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

BROKEN = 1e-8  # of the largest compliance of a matrix, below zero: rounding
GAP = 1e-10  # of |p|^2, above the least: a hundredth of the noise where it is 1e-4 of what is fitted
UNHELD = 1e-8  # of the forces that lack at the start
CENTRE = 0.1  # of the products as they are that a step aims at: for less it has to turn off earlier
BOUNDARY = 0.98  # of the way to where a compliance or a force is 0 that a step goes
STEPS = 100  # 16 are usual


@dataclass(frozen=True, eq=False)
class Matrix:
    """A compliance among parameters: the sum of each times what a unit of it is, without a unit.

    `parameters`: (k,) int array. `units`: (k, d, d) array.
    """

    parameters: Integers
    units: Array

    def moved(self, start: int) -> Matrix:
        """Return the same where its parameters begin with number `start`."""
        return Matrix(self.parameters + start, self.units)

    def of(self, theta: Array) -> Array:
        """Return the matrix (d, d) of some parameters (c,)."""
        return np.asarray(np.einsum("k,kij->ij", theta[self.parameters], self.units))

    def gives_work_away(self, theta: Array) -> bool:
        """Return whether some load gets back more work than it did."""
        values = np.linalg.eigvalsh(self.of(theta))
        return bool(values[0] < -BROKEN * np.abs(values).max())

    def without_small(self, theta: Array, small: NDArray[np.bool_]) -> Array:
        """Return the parameters (c,) without rows of the matrix that are but `small` (c,)."""
        large = ~small[self.parameters]
        kept = (self.units[large] != 0.0).any(axis=(0, 1))
        result = theta.copy()
        result[self.parameters[(self.units[:, ~kept] != 0.0).any(axis=(1, 2))]] = 0.0
        return result


def matrix_of(couplings: Integers, size: Array, units: Array) -> Matrix:
    """Return the matrix of couplings (k, 3), each of two others.

    `size`: (c,) array; realistic sizes of the parameters, SI. `units`: (c,) array; SI of their units.
    """
    own = np.unique(couplings[:, 1:])
    first, second = np.searchsorted(own, couplings[:, 1:]).T
    parameters = np.concatenate([own, couplings[:, 0]])
    rows = np.concatenate([np.arange(own.size), first])
    columns = np.concatenate([np.arange(own.size), second])
    made = np.zeros((parameters.size, own.size, own.size))
    at = np.arange(parameters.size)
    made[at, rows, columns] = units[parameters] / np.sqrt(size[own][rows] * size[own][columns])
    made[at, columns, rows] = made[at, rows, columns]
    return Matrix(parameters, made)


@dataclass(frozen=True, eq=False)
class _Cone:
    """Matrices (m) of one size that have to be semidefinite: as `Matrix`, leading axis m."""

    parameters: Integers
    units: Array

    def of(self, theta: Array) -> Array:
        """Return the matrices (m, d, d) of some parameters (c,)."""
        return np.asarray(np.einsum("mk,mkij->mij", theta[self.parameters], self.units))

    def along(self, matrices: Array) -> Array:
        """Return the products (m, k) of matrices (m, d, d) with what units of the parameters are."""
        return np.asarray(np.einsum("mkij,mij->mk", self.units, matrices))

    def curvature(self, inverse: Array, force: Array) -> Array:
        """Return the traces (m, k, k) of ``E_k C^-1 E_l Z``, E what units are."""
        turned = inverse[:, None] @ self.units @ force[:, None]
        shape = (*self.parameters.shape, -1)
        return np.asarray(self.units.reshape(shape) @ turned.reshape(shape).swapaxes(1, 2))


def _stacked(matrices: Sequence[Matrix]) -> list[_Cone]:
    alike: dict[tuple[int, ...], list[Matrix]] = {}
    for one in matrices:
        alike.setdefault(one.units.shape, []).append(one)
    return [
        _Cone(np.stack([one.parameters for one in some]), np.stack([one.units for one in some]))
        for some in alike.values()
    ]


def passive(triangle: Array, pull: Array, positive: NDArray[np.bool_], matrices: Sequence[Matrix]) -> Array:
    """Return parameters (c,) with the least ``|R theta - p|``, no compliance of which gives work away.

    `triangle`: R (c, c), upper. `pull`: p (c,). `positive`: (c,) bool array; those that cannot be negative,
    the diagonals of the matrices among them.
    """
    gram, right = triangle.T @ triangle, triangle.T @ pull
    unit, size = np.linalg.norm(triangle, axis=0), float(pull @ pull) or 1.0
    coupled = np.zeros(len(pull), dtype=bool)
    for one in matrices:
        coupled[one.parameters] = True
    alone = np.flatnonzero(positive & ~coupled)
    cones = _stacked([*matrices, *(Matrix(np.array([at]), np.ones((1, 1, 1))) for at in alone.tolist())])
    rows = alone.size + sum(len(one.units[0]) for one in matrices)

    mu, unheld = CENTRE * size / rows, 1.0
    theta = np.asarray(solve_triangular(triangle, pull, check_finite=False))
    theta[coupled & ~positive] = 0.0
    theta[positive] = np.maximum(np.abs(theta), np.sqrt(mu) / unit)[positive]
    made = [cone.of(theta) for cone in cones]
    forces = [mu * root.swapaxes(1, 2) @ root for root in map(_root, made)]
    for _ in range(STEPS):
        gap = sum(float((one * force).sum()) for one, force in zip(made, forces, strict=True))
        if gap <= GAP * size and unheld <= UNHELD:
            break
        mu = CENTRE * gap / rows
        try:
            roots = [_root(one) for one in (*made, *forces)]
            step, pulled = _newton(gram, right - gram @ theta, cones, roots, forces, mu)
        except np.linalg.LinAlgError:  # as near as rounding lets it come
            break
        moved = [cone.of(step) for cone in cones]
        least = min(_least(root, change) for root, change in zip(roots, [*moved, *pulled], strict=True))
        part = 1.0 if least >= -BOUNDARY else -BOUNDARY / least
        theta = theta + part * step
        made = [one + part * change for one, change in zip(made, moved, strict=True)]
        forces = [force + part * change for force, change in zip(forces, pulled, strict=True)]
        unheld *= 1.0 - part
    small = np.abs(theta) * unit < np.sqrt(mu)  # what is not 0 is far larger, and what is far less
    theta[alone[small[alone]]] = 0.0
    for one in matrices:
        theta = one.without_small(theta, small)
    return theta


def _newton(
    gram: Array,
    left: Array,
    cones: Sequence[_Cone],
    roots: Sequence[Array],
    forces: Sequence[Array],
    mu: float,
) -> tuple[Array, list[Array]]:
    """Return the steps of the parameters (c,) and of the forces (m, d, d) towards ``C Z = mu 1``.

    `gram`: ``R^T R``. `left`: ``R^T (p - R theta)``. `roots`: see `_root`, of C first.
    """
    inverses = [root.swapaxes(1, 2) @ root for root in roots[: len(cones)]]
    downhill, curvature = left.copy(), gram.copy()
    for cone, inverse, force in zip(cones, inverses, forces, strict=True):
        at = cone.parameters
        downhill[at] += mu * cone.along(inverse)
        curvature[at[:, :, None], at[:, None, :]] += cone.curvature(inverse, force)
    scale = 1.0 / np.sqrt(np.diag(curvature))
    _, solved, fault = dposv(scale[:, None] * curvature * scale, scale * downhill)
    if fault:
        raise np.linalg.LinAlgError("the curvature is not definite")
    step: Array = scale * solved
    pulled: list[Array] = []
    for cone, inverse, force in zip(cones, inverses, forces, strict=True):
        turned = inverse @ cone.of(step) @ force
        pulled.append(mu * inverse - force - 0.5 * (turned + turned.swapaxes(1, 2)))
    return step, pulled


def _root(matrices: Array) -> Array:
    """Return L^-1 of each matrix ``L L^T``, (m, d, d)."""
    if matrices.shape[1] > 1:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(matrices)), dtype=np.float64)
    if not (matrices > 0.0).all():
        raise np.linalg.LinAlgError("a parameter is not positive")
    return np.asarray(1.0 / np.sqrt(matrices))


def _least(root: Array, change: Array) -> float:
    """Return the least value of changes (m, d, d) beside the matrices of these roots."""
    beside = root @ change @ root.swapaxes(1, 2)
    return float(beside.min() if beside.shape[1] == 1 else np.linalg.eigvalsh(beside).min())
