"""Noise that is not white: what errors of the loads and of the joint readings do to the rows.

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

from beamstiff.measure.arrays import Integers, equal_rows
from beamstiff.se3 import Array


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
    sigma: Array,
    used: NDArray[np.bool_],
    sharing: Integers,
    pose: Integers,
    disturbance: Disturbance,
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
