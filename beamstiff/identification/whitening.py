"""Noise of the rows, and the matrix W that turns readings into independent values of unit variance.

A row is measured under a load, and at joint values, that differ a little from those in the table. To first
order its displacement is off by ``dd/dw dw + dd/dq dq``: more for a row that moves more, correlated between
its components, and between the rows of a pose, which share one reading of the joints. The covariance of the
rows is that of the readings plus this, block by block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from beamstiff.measure.arrays import Integers, equal_rows
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Whitening:
    """The matrix ``W = blocks + left right^T`` with ``W cov W^T = 1``, for n used components.

    A reading that r of them share joins all of these; as a product that takes 2 r numbers instead of r^2.
    """

    blocks: sparse.csr_array  # (n, n): diagonal where readings are shared
    # left, right, (n, s): of s readings that are shared; none has a component in common with another
    left: sparse.csr_array
    right: sparse.csr_array

    def __matmul__(self, values: Array) -> Array:
        """Return W times values (n,) or (n, c)."""
        result: Array = self.blocks @ values
        if self.left.shape[1]:
            result = result + self.left @ (self.right.T @ values)
        return result

    def solve(self, values: Array) -> Array:
        """Return the values (n,) that W turns into these."""
        if not self.left.shape[1]:
            return splu(self.blocks.tocsc()).solve(values)
        own = np.asarray(self.blocks.diagonal())  # Sherman, Morrison and Woodbury
        shared = 1.0 + np.asarray((self.right * self.left).T @ (1.0 / own))
        alone = values / own
        return np.asarray(alone - (self.left @ ((self.right.T @ alone) / shared)) / own)

    def among(self, at: NDArray[np.intp]) -> Array:
        """Return the entries (B, m, m) of W among each of B groups of m components (B, m)."""
        if len(at) == 1:
            [own] = at
            return np.asarray((self.blocks[own][:, own] + self.left[own] @ self.right[own].T).toarray())[None]
        first, second = np.repeat(at, at.shape[1], axis=1).ravel(), np.tile(at, at.shape[1]).ravel()
        entries = np.asarray(self.blocks[first, second])
        if self.left.shape[1]:
            entries = entries + np.asarray((self.left[first] * self.right[second]).sum(axis=1))
        return entries.reshape(*at.shape, at.shape[1])

    def toarray(self) -> Array:
        """Return all of W, (n, n)."""
        return self @ np.eye(self.blocks.shape[0])


def whitening(sigma: Array, used: NDArray[np.bool_], sharing: Integers) -> Whitening:
    """Return W for the used components, n in all.

    For components that share an unloaded reading the covariance is ``D (1 + 1 1^T) D / 2``, D their standard
    deviations: its inverse root takes their mean out and puts it back with its own weight.

    `sigma`, `used` (N, 6); `sharing` (N,): number of the shared reading, -1 for none.
    """
    inverse = 1.0 / sigma[used]
    row, component = np.nonzero(used)
    shared = np.flatnonzero(sharing[row] >= 0)
    number = 6 * sharing[row[shared]] + component[shared]
    group = np.unique(number, return_inverse=True)[1].reshape(-1)
    n = np.bincount(group)
    own = np.ones(inverse.size)
    own[shared] = np.sqrt(2.0)
    of_mean = (1.0 / np.sqrt((1 + n) / 2) - np.sqrt(2.0)) / n
    places, shape = (shared, group), (inverse.size, n.size)
    return Whitening(
        sparse.diags_array(own * inverse, format="csr"),
        sparse.csr_array((of_mean[group], places), shape=shape),
        sparse.csr_array((inverse[shared], places), shape=shape),
    )


def of_blocks(matrix: sparse.csr_array) -> Whitening:
    """Return a matrix (n, n) of blocks as W."""
    nothing = sparse.csr_array((matrix.shape[0], 0))
    return Whitening(matrix, nothing, nothing)


@dataclass(frozen=True)
class Disturbance:
    """How the rows move by one standard deviation of each input's error."""

    own: Array  # (N, 6, a), m and rad: by errors that every row has for itself: of its load
    common: Array  # (N, 6, b), m and rad: by errors that the rows of one pose share: of the joint readings

    def rows(self, chosen: ArrayLike) -> Disturbance:
        """Return that of some rows: a mask or indices."""
        at = np.asarray(chosen)
        return Disturbance(self.own[at], self.common[at])


def disturbed_covariance(
    sigma: Array, used: NDArray[np.bool_], sharing: Integers, pose: Integers, disturbance: Disturbance
) -> list[tuple[Integers, Array]]:
    """Return the covariance of the used components, as blocks that are independent of one another.

    `sigma` (N, 6): standard deviations of the readings. `used` (N, 6) bool: n in all. `sharing` (N,): number
    of a shared unloaded reading, -1 for none: half of the variance is that reading's. Each item holds the
    blocks of one size: the places 0..n-1 of their components (B, s), and their covariance (B, s, s).
    """
    n = len(used)
    joined = np.where(sharing >= 0, sharing, -1 - np.arange(n))
    if disturbance.common.any():
        joined = pose if (sharing < 0).all() else _connected(joined, pose)
    row, component = np.nonzero(used)
    block = equal_rows(joined[row][:, None].astype(np.float64))
    order = np.argsort(block, kind="stable")
    sizes = np.bincount(block)
    starts = np.cumsum(sizes) - sizes
    result = []
    for size in np.unique(sizes):
        at = order[starts[sizes == size][:, None] + np.arange(size)]  # (B, s)
        rows, components = row[at], component[at]
        spread = sigma[rows, components]
        own, common = disturbance.own[rows, components], disturbance.common[rows, components]
        same_row = rows[:, :, None] == rows[:, None, :]
        reading = (same_row & (components[:, :, None] == components[:, None, :])).astype(np.float64)
        shared = (sharing[rows] >= 0)[:, :, None] & (sharing[rows][:, :, None] == sharing[rows][:, None, :])
        shared &= components[:, :, None] == components[:, None, :]
        reading = np.where(shared, 0.5 * (1 + reading), reading)
        covariance = spread[:, :, None] * reading * spread[:, None, :]
        covariance += same_row * (own @ own.swapaxes(1, 2))
        poses = pose[rows]
        covariance += (poses[:, :, None] == poses[:, None, :]) * (common @ common.swapaxes(1, 2))
        result.append((at.astype(np.int64), covariance))
    return result


def inverse_root(blocks: list[tuple[Integers, Array]]) -> sparse.csr_array:
    """Return W (n, n) with ``W cov W^T = 1``; the symmetric root of the correlation in every block.

    Of all roots this one leaves each residual closest to its own component, so that a robust loss sees which
    row is off.
    """
    rows, columns, values = [], [], []
    for at, covariance in blocks:
        spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        value, vectors = np.linalg.eigh(covariance / (spread[:, :, None] * spread[:, None, :]))
        root = (vectors / np.sqrt(value)[:, None, :]) @ vectors.swapaxes(1, 2) / spread[:, None, :]
        size = at.shape[1]
        rows.append(np.repeat(at, size, axis=1).ravel())
        columns.append(np.tile(at, (1, size)).ravel())
        values.append(root.ravel())
    n = sum(at.size for at, _ in blocks)
    places = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array((np.concatenate(values), places), shape=(n, n))


def _connected(sharing: Integers, pose: Integers) -> Integers:
    """Return numbers that are equal for rows joined by a shared reading, by a pose, or by a chain of both."""
    a, b = equal_rows(sharing[:, None].astype(np.float64)), equal_rows(pose[:, None].astype(np.float64))
    both = sparse.csr_array((np.ones(len(a)), (a, a.max() + 1 + b)), shape=(a.max() + b.max() + 2,) * 2)
    group = sparse.csgraph.connected_components(both, directed=False)[1]
    return np.asarray(group[a], dtype=np.int64)
