"""The gap in units of its noise, in the axes of what nobody thought of.

An unknown effect is taken for a random displacement: smooth over the postures and its own in each, and in
each growing with the load and its square. In the eigenvectors of that covariance K, whitened, both the
noise ``s^2`` and the unknown ``v^2 K`` are diagonal, so that every sum below is a weighted one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.residual.baseline import SILENT, Baseline
from beamstiff.identification.problem import whitening
from beamstiff.se3 import Array

LARGE = 800  # rows from which on postures are taken one by one
REACH = 1.0  # rad or m over which the unknown changes with the posture
LEVER = 0.7  # m: unknown rotations are unknown displacements over this
CONSTANT, SQUARE = 0.3, 0.5  # weights of what does not grow with the load, or with its square


@dataclass(frozen=True)
class Whitened:
    """A baseline's gap and tangent in whitened axes; n values, t fitted parameters.

    Attributes
    ----------
    axes : tuple of ((m,) int array, (m, m) array)
        Which values each block turns, and into what; whitened ones stand block after block.
    unknown : (n,) array
        Variance of the unknown there; its mean is 1.
    component : (n,) int array
        Which of the six it is a mixture of values of.
    gap : (n,) array
    tangent : (n, t) array
        Orthonormal.
    used : (N, 6) bool array
    loose : (n, m) array
        What a cause that is fitted as well may do beside its shape: the unknown has it in addition to K.
    """

    axes: tuple[tuple[NDArray[np.intp], Array], ...]
    unknown: Array
    component: NDArray[np.intp]
    gap: Array
    tangent: Array
    used: NDArray[np.bool_]
    loose: Array

    @property
    def freedom(self) -> int:
        """Values less fitted parameters."""
        return int(self.gap.size - self.tangent.shape[1])

    def turn(self, columns: Array) -> Array:
        """Return columns (N, 6, c) whitened, (n, c)."""
        values = columns[self.used]
        return np.concatenate([block @ values[at] for at, block in self.axes])

    def back(self, columns: Array) -> Array:
        """Return the transpose of `turn`: columns (n, c) of whitened values to (n, c) of used values."""
        result = np.empty_like(columns)
        start = 0
        for at, block in self.axes:
            result[at] = block.T @ columns[start : start + at.size]
            start += at.size
        return result

    def undo(self, columns: Array) -> Array:
        """Return the inverse of `turn`: columns (n, c) of whitened values as they were measured, (n, c)."""
        result = np.empty_like(columns)
        start = 0
        for at, block in self.axes:
            result[at] = np.linalg.solve(block, columns[start : start + at.size])
            start += at.size
        return result

    def beside(self, cause: Array, loose: Array | None = None) -> Whitened:
        """Return the same where the whitened columns (n, c) of a cause are fitted as well.

        Beside them `loose` (n, m), of mean square 1 together, is what its place may do else.
        """
        fitted = orthonormal(np.concatenate([self.tangent, shown(cause)], axis=1))
        return replace(self, tangent=fitted, loose=self.loose if loose is None else loose)

    def leave(self, columns: Array) -> Array:
        """Return what the fit leaves of whitened columns (n, c)."""
        result: Array = columns - self.tangent @ (self.tangent.T @ columns)
        return result


def whiten(baseline: Baseline, used: NDArray[np.bool_] | None = None) -> Whitened:
    """Return a baseline's gap whitened.

    Parameters
    ----------
    baseline : Baseline
    used : (N, 6) bool array, optional
        Values that count, of those measured.
    """
    chosen = baseline.used if used is None else used & baseline.used
    axes, unknown, component = _axes(baseline, chosen)
    nothing = np.zeros((int(chosen.sum()), 0))
    white = Whitened(axes, unknown, component, np.zeros(len(nothing)), nothing, chosen, nothing)
    gap = white.turn(baseline.gap[..., None])[:, 0]
    return replace(white, gap=gap, tangent=orthonormal(white.turn(baseline.tangent)))


def shown(columns: Array) -> Array:
    """Return columns (n, c) without those that are nothing but rounding beside the others."""
    size = np.linalg.norm(columns, axis=0)
    result: Array = columns[:, size > SILENT * size.max(initial=0.0)]
    return result


def orthonormal(columns: Array) -> Array:
    """Return orthonormal columns (n, t) that span columns (n, c) of any sizes."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0] / size[size > 0]
    if not kept.shape[1]:
        return np.zeros((len(columns), 0))
    left, values, _ = np.linalg.svd(kept, full_matrices=False)
    result: Array = left[:, values > SILENT * values[0]]
    return result


def _axes(
    baseline: Baseline, used: NDArray[np.bool_]
) -> tuple[tuple[tuple[NDArray[np.intp], Array], ...], Array, NDArray[np.intp]]:
    """Return the axes, the variance of the unknown in each (n,), and their component (n,)."""
    white = whitening(baseline.sigma, used, baseline.sharing)
    number = np.full(used.shape, -1)
    number[used] = np.arange(int(used.sum()))
    poses = baseline.rows.pose
    groups = [np.arange(len(poses))]
    if len(poses) > LARGE:
        groups = [np.flatnonzero(poses == pose) for pose in np.unique(poses)]
    features = _features(baseline)
    blocks, variances, components = [], [], []
    for rows in groups:
        close = _closeness(baseline, rows)
        own = close * (features[rows] @ features[rows].T)
        for component in range(6):
            there = used[rows, component]
            at = number[rows[there], component]
            if not at.size:
                continue
            part = white[at][:, at].toarray()
            scale = 1.0 if component < 3 else 1.0 / LEVER**2
            values, vectors = np.linalg.eigh(scale * part @ own[np.ix_(there, there)] @ part.T)
            blocks.append((at.astype(np.intp), vectors.T @ part))
            components.append(np.full(at.size, component, dtype=np.intp))
            variances.append(np.maximum(values, 0.0))
    unknown = np.concatenate(variances)
    mean = float(unknown.mean()) or 1.0
    return tuple(blocks), unknown / mean, np.concatenate(components)


def _features(baseline: Baseline) -> Array:
    """Return what the unknown grows with in each row, (N, k)."""
    wrench = baseline.rows.wrench
    acts = np.abs(wrench).max(axis=0) > 0
    load = wrench[:, acts] / np.sqrt((wrench[:, acts] ** 2).mean(axis=0)) if acts.any() else wrench[:, :0]
    size = np.linalg.norm(load, axis=1, keepdims=True)
    size = size / (size.max(initial=0.0) or 1.0)
    constant = np.full((len(wrench), 1), 1.0 if baseline.absolute else CONSTANT)
    return np.concatenate([constant, load, SQUARE * load * size], axis=1)


def _closeness(baseline: Baseline, rows: NDArray[np.intp]) -> Array:
    """Return the correlation (r, r) of what the unknown does in the postures of some rows."""
    q, pose = baseline.rows.q[rows], baseline.rows.pose[rows]
    square = ((q[:, None] - q[None]) ** 2).sum(axis=2) / REACH**2
    result: Array = 0.5 * np.exp(-0.5 * square) + 0.5 * (pose[:, None] == pose[None])
    return result
