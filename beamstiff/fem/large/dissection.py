"""Nested dissection: in which order to eliminate the nodes of a large graph, and in which groups.

The graph is cut in two across its longest extent, both halves again, and so on; the nodes on a cut come after
both its sides. In a slender frame the cuts are cross-sections, and the groups fold up like a chain. A part as
wide as long may be cut across a diagonal: where nodes meet along the axes of a grid, a diagonal plane parts
it with a quarter fewer nodes than a plane along the grid does, and leaves parts that are rounder.
Source: George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973) 345.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from beamstiff.se3 import Array

Index = NDArray[np.int64]
TOGETHER = 4
LEAF = 24  # nodes: fewer are not worth a cut
MANY = 200  # nodes: for fewer it is not worth looking for the best cut
COMPACT = 5.0  # longest by shortest extent of a part that diagonal cuts may suit
UNEVEN = 5.0  # how much a cut with unlike sides counts as longer
OFTEN = 0.05  # of all neighbours: a direction of a grid
ACROSS = 0.1  # sine between a direction and those before it
DIAGONALS = np.array([[1.0, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]])


@dataclass(frozen=True, eq=False)
class Group:
    """Nodes that are eliminated together."""

    # start, stop: places of its nodes in the order
    start: int
    stop: int
    boundary: Index  # (b,): places of the later nodes that it meets, ascending
    children: tuple[int, ...]  # groups that hand their rest on to this one


def _middle(values: Array) -> float:
    """Return the median, of an even number the lower one of the two in the middle."""
    at = (len(values) - 1) // 2
    return float(np.partition(values, at)[at])


def _half(points: Array) -> NDArray[np.bool_]:
    """Return which points lie in the lower half along their longest extent."""
    extent = np.ptp(points, axis=0)
    along = points[:, int(np.argmax(extent))]
    low: NDArray[np.bool_] = along <= _middle(along) + 1e-9 * extent.max()
    if low.all() or not low.any():  # all at one place: by halves
        low = np.arange(len(points)) < len(points) // 2
    return low


def _cuts(points: Array) -> Iterator[NDArray[np.bool_]]:
    """Yield ways to halve some points: which ones are on the lower side."""
    yield _half(points)
    extent = np.ptp(points, axis=0)
    if len(points) < MANY or extent.max() > COMPACT * extent.min():
        return
    for along in DIAGONALS @ points.T:
        middle, rounding = _middle(along), 1e-9 * np.ptp(along)
        for low in (along <= middle + rounding, along <= middle - rounding):
            if low.any() and not low.all():
                yield low


def _in_pitches(points: Array, pointers: Index, neighbours: Index) -> Array:
    """Return the coordinates (N, 3) of the points along the axes of the grid that they form, in its pitches.

    The axes are the directions of the shortest of many like neighbours; points in no order stay as they are.
    """
    way = points[neighbours] - np.repeat(points, np.diff(pointers), axis=0)
    length = np.sqrt((way * way).sum(axis=1))
    some = (length > 0.0) & np.isfinite(length)
    way, length = way[some], length[some]
    if not len(way):
        return points
    unit = way / length[:, None]
    code = np.round(500.0 * unit).astype(np.int64) @ [1, 10**4, 10**8]  # alike to some thousandths
    _, first, number, counts = np.unique(code, return_index=True, return_inverse=True, return_counts=True)
    directions = unit[first]
    pitches = np.bincount(number, weights=length) / counts
    often = counts > 0.5 * OFTEN * len(unit)  # each way there and back
    axes: list[int] = []
    for at in np.flatnonzero(often)[np.argsort(pitches[often], kind="stable")].tolist():
        tried = directions[[*axes, at]]
        if np.linalg.det(tried @ tried.T) > ACROSS**2:
            axes.append(at)
    if len(axes) < 3:
        return points
    basis = directions[axes] * pitches[axes, None]
    return np.linalg.solve(basis.T, points.T).T


def _folded(nodes: Index, points: Array) -> Index:
    """Return the nodes of a cut half by half: what the parts beside it meet of it then follows on."""
    if len(nodes) <= TOGETHER:
        return nodes
    low = _half(points[nodes])
    return np.concatenate([_folded(nodes[low], points), _folded(nodes[~low], points)])


def dissect(graph: sparse.csr_array, points: Array, last: Index) -> tuple[Index, list[Group]]:
    """Return the order of elimination (N,) of the nodes of a graph, and its groups, each after its children.

    `graph` (N, N) has an entry for each pair of nodes that meet, both ways; the nodes `last` come last and
    are no part of a group.
    """
    pointers, neighbours = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    points = _in_pitches(points, pointers, neighbours)
    side = np.zeros(len(points), dtype=np.int8)
    order: list[Index] = []
    found: list[tuple[int, int, tuple[int, ...]]] = []
    placed = 0

    def around(nodes: Index) -> tuple[Index, Index]:
        """Return the neighbours of some nodes, and which of the nodes each is a neighbour of."""
        counts = pointers[nodes + 1] - pointers[nodes]
        owner = np.repeat(np.arange(len(nodes)), counts)
        entries = np.arange(len(owner)) + np.repeat(pointers[nodes] - (np.cumsum(counts) - counts), counts)
        return neighbours[entries], owner

    def meets(nodes: Index, mark: int) -> NDArray[np.bool_]:
        """Return which of the nodes have a neighbour on a side."""
        beside, owner = around(nodes)
        result = np.zeros(len(nodes), dtype=np.bool_)
        result[owner[side[beside] == mark]] = True
        return result

    def add(nodes: Index, children: tuple[int, ...]) -> int:
        nonlocal placed
        order.append(nodes)
        found.append((placed, placed + len(nodes), children))
        placed += len(nodes)
        return len(found) - 1

    def parted(nodes: Index) -> tuple[Index, Index, Index]:
        """Return the nodes on the best of some cuts, and those on both its sides."""
        best, least = (nodes, nodes[:0], nodes[:0]), np.inf
        for low in _cuts(points[nodes]):
            one, other = nodes[low], nodes[~low]
            side[one], side[other] = 1, 2
            near, far = meets(one, 2), meets(other, 1)
            side[nodes] = 0
            for found in ((one[near], one[~near], other), (other[far], one, other[~far])):
                between, left, right = map(len, found)
                length = between * (1.0 + UNEVEN * ((left - right) / len(nodes)) ** 2)
                if length < least:
                    best, least = found, length
        return best

    def cut(nodes: Index) -> int:
        if len(nodes) <= LEAF:
            return add(nodes, ())
        between, one, other = parted(nodes)
        children = tuple(cut(part) for part in (one, other) if len(part))
        return add(_folded(between, points), children)

    rest = np.setdiff1d(np.arange(len(points)), last)
    if len(rest):
        cut(rest)
    whole = np.concatenate([*order, np.asarray(last, dtype=np.int64)])
    place = np.empty(len(points), dtype=np.int64)
    place[whole] = np.arange(len(points))
    groups: list[Group] = []
    for start, stop, children in found:
        nodes = whole[start:stop]
        own = place[around(nodes)[0]]
        met = np.unique(np.concatenate([own, *(groups[child].boundary for child in children)]))
        groups.append(Group(start, stop, met[met >= stop], children))
    return whole, groups
