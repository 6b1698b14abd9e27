"""The gap in units of its noise, in the axes of what nobody thought of.

An unknown effect is taken for a random displacement: smooth over the postures and its own in each, and in
each growing with the load and its square. In the eigenvectors of that covariance K, whitened, both the
noise ``s^2`` and the unknown ``v^2 K`` are diagonal, so that every sum below is a weighted one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline
from beamstiff.identification.whitening import whitening
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

LARGE = 800  # rows from which on postures are taken one by one, and of one posture as many at a time
AT_ONCE = 1_000_000  # entries of the blocks that are made at a time
REACH = 1.0  # rad or m over which the unknown changes with the posture
ROTATION_LENGTH = 0.7  # m: unknown rotations are unknown displacements over this
EQUAL = 1e-9  # of the largest: variances that differ by less are equal, but for rounding
CONSTANT, SQUARE = 0.3, 0.5  # weights of what does not grow with the load, or with its square


@dataclass(frozen=True)
class Whitened:
    """A baseline's gap and tangent in whitened axes; n values, t fitted parameters.

    `axes`: tuple of ((B, m) int array, (B, m, m) array); blocks of one size: which values each turns, and
        into what; whitened ones stand block after block.
    `unknown`: (n,) array; variance of the unknown there; its mean is 1.
    `component`: (n,) int array; which of the six it is a mixture of values of.
    `gap`: (n,) array.
    `tangent`: (n, t) array; orthonormal.
    `used`: (N, 6) bool array.
    `nuisance`: (n, m) array; what a cause that is fitted as well may do beside its shape: the unknown has it
        in addition to K.
    """

    axes: tuple[tuple[NDArray[np.intp], Array], ...]
    unknown: Array
    component: NDArray[np.intp]
    gap: Array
    tangent: Array
    used: NDArray[np.bool_]
    nuisance: Array
    rows: Measurements | None = None

    @property
    def freedom(self) -> int:
        """Values less fitted parameters."""
        return int(self.gap.size - self.tangent.shape[1])

    def whiten(self, columns: Array) -> Array:
        """Return columns (N, 6, c) whitened, (n, c)."""
        values = columns[self.used]
        return np.concatenate([(block @ values[at]).reshape(at.size, -1) for at, block in self.axes])

    def whiten_moved(self, columns: Array) -> Array:
        """Return columns (N, 6, c) of displacements in the base frame whitened as they are read, (n, c)."""
        return self.whiten(columns if self.rows is None else self.rows.along(columns))

    def adjoint(self, columns: Array) -> Array:
        """Return the transpose of `turn`: columns (n, c) of whitened values to (n, c) of used values."""
        result = np.empty_like(columns)
        for at, block, own in self._blocks(columns):
            result[at] = block.swapaxes(1, 2) @ own
        return result

    def unwhiten(self, columns: Array) -> Array:
        """Return the inverse of `turn`: columns (n, c) of whitened values as they were measured, (n, c)."""
        result = np.empty_like(columns)
        for at, block, own in self._blocks(columns):
            result[at] = np.linalg.solve(block, own)
        return result

    def squares(self, weight: Array) -> Array:
        """Return the diagonal (n,) of ``W^T diag(weight) W``, W as of `turn`, for weights (n,)."""
        result = np.empty(len(weight))
        for at, block, own in self._blocks(weight[:, None]):
            result[at] = (own * block**2).sum(axis=1)
        return result

    def products(self, weight: Array, chosen: NDArray[np.intp]) -> Array:
        """Return the entries (k, k) of ``W^T diag(weight) W`` among some used values (k,)."""
        result = np.zeros((chosen.size, chosen.size))
        place = np.full(len(weight), -1)
        place[chosen] = np.arange(chosen.size)
        for at, block, own in self._blocks(weight[:, None]):
            for one in np.flatnonzero((place[at] >= 0).any(axis=1)).tolist():
                inside = np.flatnonzero(place[at[one]] >= 0)
                part, where = block[one][:, inside], place[at[one, inside]]
                result[np.ix_(where, where)] = part.T @ (own[one] * part)
        return result

    def _blocks(self, columns: Array) -> Iterator[tuple[NDArray[np.intp], Array, Array]]:
        """Yield the axes, each with its part (B, m, c) of columns (n, c) of whitened values."""
        start = 0
        for at, block in self.axes:
            yield at, block, columns[start : start + at.size].reshape(*at.shape, -1)
            start += at.size

    def with_fitted(self, cause: Array, nuisance: Array | None = None) -> Self:
        """Return the same where the whitened columns (n, c) of a cause are fitted as well.

        Beside them `nuisance` (n, m), of mean square 1 together, is what its place may do else.
        """
        fitted = orthonormal(np.concatenate([self.tangent, shown(cause)], axis=1))
        return replace(self, tangent=fitted, nuisance=self.nuisance if nuisance is None else nuisance)

    def project_out(self, columns: Array) -> Array:
        """Return what the fit leaves of whitened columns (n, c)."""
        return columns - self.tangent @ (self.tangent.T @ columns)


def whiten(baseline: Baseline, used: NDArray[np.bool_] | None = None) -> Whitened:
    """Return a baseline's gap whitened.

    `used`: (N, 6) bool array; values that count, of those measured.
    """
    chosen = baseline.used if used is None else used & baseline.used
    axes, unknown, component = _axes(baseline, chosen)
    nothing = np.zeros((int(chosen.sum()), 0))
    white = Whitened(
        axes, unknown, component, np.zeros(len(nothing)), nothing, chosen, nothing, baseline.rows
    )
    gap = white.whiten(baseline.gap[..., None])[:, 0]
    return replace(white, gap=gap, tangent=orthonormal(white.whiten(baseline.tangent)))


def shown(columns: Array) -> Array:
    """Return columns (n, c) without those that are nothing but rounding beside the others."""
    size = np.linalg.norm(columns, axis=0)
    return columns[:, size > ROUNDING * size.max(initial=0.0)]


def orthonormal(columns: Array) -> Array:
    """Return orthonormal columns (n, t) that span columns (n, c) of any sizes."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0] / size[size > 0]
    if not kept.shape[1]:
        return np.zeros((len(columns), 0))
    left, values, _ = np.linalg.svd(kept, full_matrices=False)
    return left[:, values > ROUNDING * values[0]]


def _axes(
    baseline: Baseline, used: NDArray[np.bool_]
) -> tuple[tuple[tuple[NDArray[np.intp], Array], ...], Array, NDArray[np.intp]]:
    """Return the axes, the variance of the unknown in each (n,), and their component (n,)."""
    part, sharing = _parts(baseline)
    white = whitening(baseline.sigma, used, sharing)
    row, component = np.nonzero(used)
    number = np.unique(6 * part[row] + component, return_inverse=True)[1].reshape(-1)
    order, sizes = np.argsort(number, kind="stable"), np.bincount(number)
    starts = np.cumsum(sizes) - sizes
    features = _features(baseline)
    axes, variances, components = [], [], []
    for blocks in _of_one_size(sizes):
        at = order[starts[blocks][:, None] + np.arange(sizes[blocks[0]])]
        rows, kind = row[at], component[at]
        own = (
            _closeness(baseline, rows)
            * _aligned(baseline, rows, kind)
            * np.stack([some @ some.T for some in features[rows]])
        )
        scale = np.where(kind < 3, 1.0, 1.0 / ROTATION_LENGTH**2)[:, :, None]
        rooted = white.among(at)
        values, vectors = np.linalg.eigh((scale * rooted) @ own @ rooted.swapaxes(1, 2))
        vectors = _by_place(values, vectors)
        axes.append((at.astype(np.intp), vectors.swapaxes(1, 2) @ rooted))
        components.append(kind.ravel())
        variances.append(np.maximum(values, 0.0).ravel())
    unknown = np.concatenate(variances)
    mean = float(unknown.mean()) or 1.0
    return tuple(axes), unknown / mean, np.concatenate(components).astype(np.intp)


def _by_place(values: Array, vectors: Array) -> Array:
    """Return eigenvectors (B, m, m), those of equal eigenvalues (B, m) turned to be in order of their place.

    Rounding would turn them among themselves, and with them what a robust scale takes for large.
    """
    result, place = vectors.copy(), np.linspace(0.0, 1.0, values.shape[1])[:, None]
    for block, own in enumerate(values):
        different = np.flatnonzero(np.diff(own) > EQUAL * own[-1]) + 1
        for some in np.split(np.arange(own.size), different):
            if some.size > 1:
                alike = vectors[block][:, some]
                result[block][:, some] = alike @ np.linalg.eigh(alike.T @ (place * alike))[1]
    return result


def _parts(baseline: Baseline) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which rows are looked at together (N,), and which share an unloaded reading, -1 for none.

    All of few rows; of many those of a posture, and of a posture with many some at a time: what the unknown
    does, and the error of a reading that they share, then count anew in each part.
    """
    poses = baseline.rows.pose
    if len(poses) <= LARGE:
        return np.zeros(len(poses), dtype=np.intp), baseline.sharing
    order = np.argsort(poses, kind="stable")
    number = np.unique(poses, return_inverse=True)[1].reshape(-1)[order]
    first = np.flatnonzero(np.diff(number, prepend=-1))
    inside = np.arange(len(poses)) - first[number]
    part = np.empty(len(poses), dtype=np.intp)
    part[order] = np.cumsum((inside % LARGE) == 0) - 1
    return part, np.where(baseline.sharing >= 0, part, -1)


def _of_one_size(sizes: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield numbers of blocks that have one size, not too many at a time."""
    order = np.argsort(sizes, kind="stable") if sizes.size > 6 else np.arange(sizes.size)
    for some in np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1):
        most = max(1, AT_ONCE // int(sizes[some[0]]) ** 2)
        yield from (some[at : at + most] for at in range(0, some.size, most))


def _features(baseline: Baseline) -> Array:
    """Return what the unknown grows with in each row, (N, k)."""
    wrench = baseline.rows.wrench
    acts = np.abs(wrench).max(axis=0) > 0
    load = wrench[:, acts] / np.sqrt((wrench[:, acts] ** 2).mean(axis=0)) if acts.any() else wrench[:, :0]
    size = np.linalg.norm(load, axis=1, keepdims=True)
    size = size / (size.max(initial=0.0) or 1.0)
    constant = np.full((len(wrench), 1), 1.0 if baseline.absolute else CONSTANT)
    return np.concatenate([constant, load, SQUARE * load * size], axis=1)


def _aligned(baseline: Baseline, rows: NDArray[np.intp], kind: NDArray[np.intp]) -> Array | float:
    """Return the cosines (B, m, m) between the axes along which groups of values (B, m) are read."""
    if baseline.rows.axes is None:
        return 1.0
    turned = kind[..., None] > 2
    along = np.where(turned, np.eye(3)[kind % 3], baseline.rows.axes[rows, kind % 3])
    return along @ along.swapaxes(1, 2)


def _closeness(baseline: Baseline, rows: NDArray[np.intp]) -> Array:
    """Return the correlation (B, m, m) of what the unknown does in the postures of groups of rows (B, m)."""
    q, pose = baseline.rows.q[rows], baseline.rows.pose[rows]
    square = np.zeros((*rows.shape, rows.shape[1]))
    for at in range(q.shape[2]):
        square += (q[:, :, None, at] - q[:, None, :, at]) ** 2
    same = pose[:, :, None] == pose[:, None, :]
    return np.asarray(0.5 * np.exp(-0.5 * square / REACH**2) + 0.5 * same)
