"""What turns readings into values of unit variance, independent of one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from beamstiff.measure.arrays import Integers
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
        result: Array = alone - (self.left @ ((self.right.T @ alone) / shared)) / own
        return result

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
