"""Multifrontal Cholesky factorisation and condensation of a sparse stiffness, in groups of nodes.

Each group gathers its own entries and what its children hand on into one dense matrix, eliminates its
unknowns, and hands on the rest: ``F22 - L21 L21^T``. All work is in dense products. Where only some nodes
matter (the TCP), they come last and no factor is kept.
Source: Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302.

A factor in double precision leaves an error of condition times 1e-16: at a million unknowns one of 1e-3.
Residuals in extended precision bring it down to the last digits (Wilkinson; Higham, Accuracy and Stability of
Numerical Algorithms, ch. 12). Where `numpy.longdouble` is no more than a double the refinement stops earlier,
and the error that remains says so.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg.blas import dgemm, dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from beamstiff.fem.large.dissection import Group, dissect
from beamstiff.se3 import Array

Index = NDArray[np.int64]
SOFTEST = 1e-13  # of what went into a pivot: what is left is rounding
SMALL = 32
RUNS = 60  # more pieces than this are added one index at a time
ENOUGH = 1e-11  # relative error
MOST = 12  # refinements

Solve = Callable[[Array], Array]


class Softness(Exception):  # noqa: N818 - turned into a message where the node has a name
    """The stiffness against some unknown is zero or rounding."""

    def __init__(self, unknown: int) -> None:
        super().__init__(unknown)
        self.unknown = unknown


@dataclass(frozen=True, eq=False)
class Plan:
    """The order of elimination of a frame, and what it takes."""

    order: Index  # (n,): unknowns in the order of elimination
    groups: list[Group]  # in places of unknowns
    flops: float  # floating point operations of the factorisation
    factor_bytes: float  # size of the factor
    peak_bytes: float  # most that the dense matrices take at one time without a factor
    kept: int  # how many unknowns stand last, outside all groups


def make_plan(graph: sparse.csr_array, points: Array, last: Index, first: Index) -> Plan:
    """Return the plan for a graph of nodes (see `dissect`); node i begins at unknown ``first[i]``."""
    nodes, small = dissect(graph, points, last)
    sizes = np.diff(first)[nodes]
    ends = np.concatenate([[0], np.cumsum(sizes)])
    order = _stretches(first[:-1][nodes], sizes)
    groups = [
        Group(
            int(ends[group.start]),
            int(ends[group.stop]),
            _stretches(ends[group.boundary], sizes[group.boundary]),
            group.children,
        )
        for group in small
    ]
    flops = factor = now = peak = 0.0
    for group in groups:
        own, met = float(group.stop - group.start), float(len(group.boundary))
        flops += own**3 / 3 + own**2 * met + own * met**2
        factor += 8 * own * (own + met)
        now += 8 * met**2
        peak = max(peak, now + 8 * own * (own + met))
        now -= sum(8.0 * len(groups[child].boundary) ** 2 for child in group.children)
    return Plan(order, groups, flops, factor, peak, len(order) - int(ends[len(nodes) - len(last)]))


def _stretches(starts: Index, sizes: Index) -> Index:
    """Return ``start, start + 1, ...`` of so many numbers each, one after another."""
    before = np.cumsum(sizes) - sizes
    return np.repeat(starts - before, sizes) + np.arange(int(sizes.sum()))


@dataclass(frozen=True, eq=False)
class Factor:
    """What a factorisation leaves."""

    plan: Plan
    rest: Array  # (k, k): stiffness of the unknowns that stand last, all others eliminated
    blocks: list[tuple[Array, Array]]  # (L11, L21): the factor group by group; empty where it was not kept

    def solve(self, right: Array) -> Array:
        """Return the solution (n, c) for right sides (n, c), in the order of the matrix."""
        x = np.asfortranarray(right[self.plan.order])
        for group, (root, below) in zip(self.plan.groups, self.blocks, strict=True):
            own = dtrsm(1.0, root, x[group.start : group.stop], lower=1)
            x[group.start : group.stop] = own
            x[group.boundary] -= below @ own
        kept = len(x) - self.plan.kept
        if self.plan.kept:
            x[kept:] = np.linalg.solve(self.rest, x[kept:])
        for group, (root, below) in zip(reversed(self.plan.groups), reversed(self.blocks), strict=True):
            own = x[group.start : group.stop] - below.T @ x[group.boundary]
            x[group.start : group.stop] = dtrsm(1.0, root, own, lower=1, trans_a=1)
        result = np.empty_like(right)
        result[self.plan.order] = x
        return result


def factorise(matrix: sparse.csc_array, plan: Plan, keep: bool = True) -> Factor:
    """Factorise a symmetric positive definite matrix (n, n); unless `keep`, only `Factor.rest` is left.

    Raises `Softness` when a pivot is zero or rounding: a mechanism.
    """
    place = np.empty_like(plan.order)
    place[plan.order] = np.arange(len(plan.order))
    entries = matrix.tocoo()
    rows, columns = place[entries.row], place[entries.col]
    lower = rows >= columns
    shape = matrix.shape
    below = sparse.coo_array((entries.data[lower], (rows[lower], columns[lower])), shape=shape).tocsc()
    del entries, rows, columns, lower
    pointers, indices, data = below.indptr.astype(np.int64), below.indices.astype(np.int64), below.data
    size = matrix.diagonal()[plan.order]
    handed: dict[int, Array] = {}
    pool = _Pool()
    blocks: list[tuple[Array, Array]] = []

    def gathered(start: int, stop: int, boundary: Index, children: tuple[int, ...]) -> list[Array]:
        own, met = stop - start, len(boundary)
        # what is kept takes no more memory than it needs
        make = (lambda *shape: np.zeros(shape, order="F")) if keep else pool.take
        first, side, rest = make(own, own), make(met, own), pool.take(met, met)
        some = slice(pointers[start], pointers[stop])
        row, value = indices[some], data[some]
        column = np.repeat(np.arange(own), np.diff(pointers[start : stop + 1]))
        inside = row < stop
        first[row[inside] - start, column[inside]] = value[inside]
        side[np.searchsorted(boundary, row[~inside]), column[~inside]] = value[~inside]
        for child in children:
            given, update = plan.groups[child].boundary, handed.pop(child)
            split = int(np.searchsorted(given, stop))
            near, far = given[:split] - start, np.searchsorted(boundary, given[split:])
            _add_lower(first, near, update[:split, :split])
            _add(side, far, near, update[split:, :split])
            _add_lower(rest, far, update[split:, split:])
            pool.give(update)
        return [first, side, rest]

    for number, group in enumerate(plan.groups):
        first, side, rest = gathered(group.start, group.stop, group.boundary, group.children)
        if group.stop > group.start:
            root, failed = dpotrf(first, lower=1, overwrite_a=1)
            if failed:
                raise Softness(int(plan.order[group.start + failed - 1]))
            pivots = np.diagonal(root) ** 2
            if (pivots < SOFTEST * size[group.start : group.stop]).any():
                worst = int(np.argmin(pivots / size[group.start : group.stop]))
                raise Softness(int(plan.order[group.start + worst]))
            if len(side):
                _divide(side, root)
            if len(rest):
                rest = dsyrk(-1.0, side, beta=1.0, c=rest, lower=1, overwrite_c=1)
            first = root
        if keep:
            blocks.append((first, side))
        else:
            pool.give(first, side)
        handed[number] = rest
    kept = len(plan.order) - plan.kept
    last, _, _ = gathered(kept, len(plan.order), np.zeros(0, dtype=np.int64), tuple(handed))
    return Factor(plan, np.tril(last) + np.tril(last, -1).T, blocks)


class _Pool:
    """Memory for matrices that is used again: to touch fresh pages takes longer than the sums in them."""

    def __init__(self) -> None:
        self._free: list[Array] = []

    def take(self, rows: int, columns: int) -> Array:
        """Return zeros (rows, columns), a column after another."""
        size = rows * columns
        fitting = [at for at, buffer in enumerate(self._free) if buffer.size >= size]
        if fitting:
            buffer = self._free.pop(min(fitting, key=lambda at: self._free[at].size))
            buffer[:size] = 0.0
        else:
            if self._free and size:  # in place of the largest that is too small
                self._free.pop(max(range(len(self._free)), key=lambda at: self._free[at].size))
            buffer = np.zeros(size)
        return buffer[:size].reshape(rows, columns, order="F")

    def give(self, *matrices: Array) -> None:
        """Take back what `take` gave."""
        for matrix in matrices:
            buffer = matrix
            while isinstance(buffer.base, np.ndarray):
                buffer = buffer.base
            if buffer.size:
                self._free.append(buffer)


def _divide(side: Array, root: Array) -> None:
    """Replace `side` by ``side root^-T``, by halves: products are faster than divisions."""
    half = len(root) // 2
    if half < SMALL:
        side[:] = dtrsm(1.0, root, side, side=1, lower=1, trans_a=1, overwrite_b=1)
        return
    _divide(side[:, :half], root[:half, :half])
    rest = side[:, half:]
    rest[:] = dgemm(-1.0, side[:, :half], root[half:, :half], beta=1.0, c=rest, trans_b=1, overwrite_c=1)
    _divide(rest, root[half:, half:])


def _runs(index: Index) -> list[tuple[slice, slice]]:
    """Return stretches of an ascending index that follow on one another: there, and here."""
    ends = [0, *(np.flatnonzero(np.diff(index) != 1) + 1).tolist(), len(index)]
    return [
        (slice(int(index[a]), int(index[a]) + b - a), slice(a, b))
        for a, b in itertools.pairwise(ends)
        if b > a
    ]


def _add(to: Array, rows: Index, columns: Index, what: Array) -> None:
    """Add a matrix into rows and columns of another."""
    runs = _runs(rows)
    for there, here in _runs(columns):
        if len(runs) > RUNS:
            to[rows, there] += what[:, here]
            continue
        for there_too, here_too in runs:
            to[there_too, there] += what[here_too, here]


def _add_lower(to: Array, index: Index, what: Array) -> None:
    """Add the lower triangle of a symmetric matrix into that of another; the upper triangle is ignored."""
    runs = _runs(index)
    for number, (there, here) in enumerate(runs):
        if len(runs) > RUNS:
            to[index[here.start :], there] += what[here.start :, here]
            continue
        for there_too, here_too in runs[number:]:
            to[there_too, there] += what[here_too, here]


@dataclass(frozen=True)
class Quality:
    """What is known of a solution."""

    # largest relative error of a column that is to be expected, in the norm scaled to unit diagonal
    error: float
    residual: float  # largest ``|b - K x| / |b|``, likewise
    refinements: int  # how often it was refined
    first_error: float  # relative error before the refinement


def refined(
    scale: Array, forces: Callable[[NDArray[Any]], NDArray[Any]], solve: Solve, right: Array
) -> tuple[Array, Quality]:
    """Return the solution (n, c) of a symmetric system, refined as far as it goes, and how good it is.

    `scale` (n,) holds the square roots of the diagonal, `forces` gives ``K x`` in extended precision, `solve`
    ``K^-1 b`` in double precision.
    """
    row = scale[:, None]
    load = np.maximum(_norms(right / row), np.finfo(float).tiny)
    x: NDArray[Any] = solve(right).astype(np.longdouble)
    size = np.maximum(_norms(row * x.astype(np.float64)), np.finfo(float).tiny)
    error = before = np.inf
    first, times = 0.0, 0
    left = (right - forces(x)).astype(np.float64)
    while times < MOST and error > ENOUGH:
        step = solve(left)
        change = float((_norms(row * step) / size).max())
        first = change if times == 0 else first
        if not change < 0.5 * before:  # it grows no better
            break
        x = x + step
        times += 1
        left = (right - forces(x)).astype(np.float64)
        # what a step leaves is to the step as the step was to the one before, or to the whole
        rate = change / before if np.isfinite(before) else change
        error, before = max(change * min(rate, 1.0), np.finfo(float).eps), change
    residual = float((_norms(left / row) / load).max())
    return x.astype(np.float64), Quality(min(error, before) if times else first, residual, times, first)


def _norms(columns: Array) -> Array:
    return np.asarray(np.sqrt((columns * columns).sum(axis=0)))
