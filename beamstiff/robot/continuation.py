"""Closing loops in one assembly branch: from the reference, along lines, and from elsewhere where need be."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import KDTree
from scipy.spatial.distance import pdist, squareform

from beamstiff.robot.branch import Assembly, near_singular
from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.robot.newton import LARGEST_STEP, Mask, close_at_once, least_squares, newton
from beamstiff.se3 import Array

SMALLEST_STRIDE = 1 / 512  # of the way
STARTS = 12
CELLS = 256  # of the grid of starts
SAME_DRIVES = 1e-9  # between poses of the same drives: a distance of zero would be none
ANOTHER = 1e-3  # rad and machine sizes, between two postures at the same drives
STEEP = 50.0  # near a singular posture rates lead nowhere


class Attempt(NamedTuple):
    """How far closing came."""

    free: Array  # (P, A + Q): free variables
    gaps: Array  # (P, M)
    closed: Mask  # (P,): in the branch asked for
    flipped: Mask  # (P,): where only other branches were found


@dataclass(frozen=True, eq=False)
class Starts:
    """Closed postures on a grid over the actuated variables, to start from where there are many poses."""

    # low, width, (A,), rad or m: where the first cell begins, and how wide a cell is
    low: Array
    width: Array
    counts: NDArray[np.int64]  # (A,): cells along each variable; one where it moves no loop
    # (G, Q): passive variables at the middle of each cell; those of the assembly where the loops do not close
    free: Array
    rates: Array  # (G, Q, A): how the passive variables follow there; zero where the loops do not close

    def passive(self, q: Array) -> Array:
        """Return passive variables (P, Q) near those at actuated ones (P, A)."""
        at = np.zeros(len(q), dtype=np.int64)
        ways = []
        for column, low, width, count in zip(q.T, self.low, self.width, self.counts.tolist(), strict=True):
            cell = np.clip(np.nan_to_num((column - low) * (1.0 / width)), 0, count - 1).astype(np.int64)
            at = at * count + cell
            ways.append(np.clip(column - (low + (cell + 0.5) * width), -0.5 * width, 0.5 * width))
        passive: Array = self.free[at]
        for way, rate in zip(ways, np.moveaxis(self.rates, 2, 0), strict=True):
            passive += rate[at] * way[:, None]
        return passive


@lru_cache(maxsize=32)
def grid_of_starts(system: LoopSystem, assembly: Assembly) -> Starts:
    """Return starts for a system and its assembly, over the limits of its actuated variables."""
    joined, first = system.kinematics.coupling, system.actuated
    limits = {variable.name: variable.limits for variable in system.kinematics.robot.variables}
    wide = np.where(system.prismatic, 0.5 * system.scale, np.pi)
    box = [
        limits[name] or (middle - reach, middle + reach)
        for name, middle, reach in zip(joined.free[:first], assembly.free, wide, strict=False)
    ]
    low, high = np.array(box, dtype=np.float64).reshape(-1, 2).T
    each = int(CELLS ** (1 / max(1, int(system.moving.sum()))) + 1e-9)
    counts = np.where(system.moving & (high > low), max(each, 1), 1)
    width = np.where(high > low, (high - low) / counts, 1.0)
    cells = np.indices(tuple(counts)).reshape(first, -1).T
    centres = low + (cells + 0.5) * width
    free = np.concatenate([centres, np.zeros((len(centres), len(assembly.free) - first))], axis=1)
    attempt = close_in_branch(system, assembly, free)
    passive = np.where(attempt.closed[:, None], attempt.free[:, first:], assembly.free[first:])
    _, jacobian = loop_equations(system, attempt.free)
    rates = np.zeros((len(free), passive.shape[1], first))
    for column in range(first):
        rate = -least_squares(jacobian[:, :, first:], jacobian[:, :, column])
        rates[:, :, column] = rate * system.scale[first:] / system.scale[column]
    steep = np.abs(rates).max(axis=(1, 2), initial=0.0) > STEEP
    rates[~attempt.closed | steep] = 0.0
    return Starts(low, width, counts.astype(np.int64), passive, rates)


def close_in_branch(
    system: LoopSystem, assembly: Assembly, free: Array, starts: Array | None = None
) -> Attempt:
    """Close the loops at every pose (P, A + Q) in the branch of the assembly; the passive part is not used.

    First from the reference, or from `starts` (P, Q), at once. What did not close, or flipped, is reached
    from the nearest good pose by continuation, and at last tried from starts all over the passive variables:
    not every pose can be reached along straight lines.
    """
    first = system.actuated
    start = free.copy()
    start[:, first:] = assembly.free[first:] if starts is None else starts
    best, gaps = start, np.zeros((len(free), system.rows[-1].stop))
    good, flipped = np.zeros((2, len(free)), dtype=np.bool_)
    if starts is not None:
        best, good = close_at_once(system, assembly, start)
    if not good.all():
        left = np.flatnonzero(~good)
        best[left], gaps[left], jacobian, closed = newton(system, start[left])
        good[left] = _in_branch(assembly, jacobian, closed)
        flipped[left] = closed & ~good[left]
    while assembly.blocks and not good.all():
        todo = np.flatnonzero(~good)
        origin = _nearest(system, assembly, best, good, todo)
        found, arrived = continuation(system, assembly, origin, free[todo, :first])
        taken = todo[arrived]
        # to the last digit: strides stop when they are close enough for the next one
        best[taken], gaps[taken], _, _ = newton(system, found[arrived], iterations=3)
        good[taken] = True
        # those that could not be reached may be from the poses just won
        if arrived.sum() < 0.1 * len(todo):
            break
    if starts is None and good.any():
        some = np.flatnonzero(good)
        best[some] = _as_neighbours(system, assembly, best[some])
        best[some], gaps[some], _, _ = newton(system, best[some], iterations=3)
    return _other_starts(system, assembly, Attempt(best, gaps, good, flipped & ~good))


def _as_neighbours(system: LoopSystem, assembly: Assembly, free: Array) -> Array:
    """Return closed postures (P, A + Q) as their neighbours are closed, from the reference on.

    Where more than two variables close together, the sign of a block does not tell its postures apart: some
    platforms come to another posture at the same drives with no singular one between (McAree and Daniel
    1999). Which is meant, the way there says; taken is the way along the shortest tree of poses. Drives that
    come back to where they were are taken to be back, for poses have no order.
    """
    first, moving = system.actuated, system.moving
    if all(len(columns) <= 2 for _, columns in assembly.blocks) or not moving.any():
        return free
    nodes = np.concatenate([assembly.free[None], free])
    apart = squareform(pdist((nodes / system.scale)[:, :first][:, moving])) + SAME_DRIVES
    order, before = breadth_first_order(minimum_spanning_tree(apart), 0, directed=False)
    rest = order[1:]
    found, arrived = continuation(system, assembly, nodes[before[rest]], nodes[rest, :first])
    changed = np.zeros(len(nodes), dtype=np.bool_)
    for number, node in enumerate(rest.tolist()):
        here, come = found[number], arrived[number]
        if changed[before[node]]:
            some = slice(node, node + 1)
            (here,), (come,) = continuation(system, assembly, nodes[before[some]], nodes[some, :first])
        away = (here - nodes[node]) / system.scale
        away -= np.where(system.turning, 2 * np.pi * np.round(away / (2 * np.pi)), 0.0)
        if come and np.abs(away).max() > ANOTHER:
            nodes[node], changed[node] = here, True
    return nodes[1:]


def _in_branch(assembly: Assembly, jacobian: Array, closed: Mask) -> Mask:
    """Return which closed postures are in the branch, or where branches meet and signs say nothing."""
    same = assembly.same_branch(jacobian)
    others = np.flatnonzero(closed & ~same)
    same[others] = near_singular(jacobian[others])
    return closed & same


def _nearest(
    system: LoopSystem, assembly: Assembly, free: Array, good: Mask, todo: NDArray[np.intp]
) -> Array:
    """Return for each pose to do the good posture nearest to it in the variables that move the loops."""
    first, moving = system.actuated, system.moving
    origins = np.concatenate([assembly.free[None], free[good]])
    scale = system.scale[:first][moving]
    if not moving.any():
        return np.repeat(assembly.free[None], len(todo), axis=0)
    tree = KDTree(origins[:, :first][:, moving] / scale)
    _, nearest = tree.query(free[todo, :first][:, moving] / scale)
    return origins[nearest]


def continuation(system: LoopSystem, assembly: Assembly, origin: Array, target: Array) -> tuple[Array, Mask]:
    """Follow closed postures (P, A + Q) along straight lines of the actuated variables to targets (P, A).

    Every pose takes strides of its own: doubled when a stride closes in the same branch without a jump,
    halved when not; it gives up below a smallest stride. Returns where each got to, and which arrived (P,).
    """
    first = system.actuated
    scale, way = system.scale[first:], target - origin[:, :first]
    free = origin.copy()
    # what does not move the loops goes along at once
    free[:, :first][:, ~system.moving] = target[:, ~system.moving]
    way[:, ~system.moving] = 0.0
    start = free[:, :first].copy()
    _, jacobian = loop_equations(system, free)
    done, stride = np.zeros(len(free)), np.full(len(free), 0.5)
    active = np.arange(len(free))
    while active.size:
        share = np.minimum(stride[active], 1.0 - done[active])
        arriving = done[active] + share > 1.0 - 1e-12
        trial = free[active]
        change = (share[:, None] * way[active]) / system.scale[:first]
        to_passive = jacobian[active][:, :, first:]
        moved = (jacobian[active][:, :, :first] @ change[:, :, None])[:, :, 0]
        step = least_squares(to_passive, -moved)
        step /= np.maximum(1.0, np.abs(step).max(axis=1, initial=0.0))[:, None]
        trial[:, :first] = np.where(
            arriving[:, None], target[active], start[active] + (done[active] + share)[:, None] * way[active]
        )
        trial[:, first:] += step * scale
        trial, _, _, closed = newton(system, trial, iterations=8)
        _, trial_jacobian = loop_equations(system, trial)
        jump = np.abs((trial - free[active])[:, first:] / scale).max(axis=1, initial=0.0)
        fine = closed & (jump < 2 * LARGEST_STEP)
        fine &= assembly.same_branch(trial_jacobian[:, :, first:], to_passive)
        taken = active[fine]
        free[taken], jacobian[taken] = trial[fine], trial_jacobian[fine]
        done[taken] = np.where(arriving, 1.0, done[active] + share)[fine]
        stride[active] = np.where(fine, 2.0 * share, 0.5 * share)
        active = active[(done[active] < 1.0) & (stride[active] > SMALLEST_STRIDE)]
    return free, done >= 1.0


def _other_starts(system: LoopSystem, assembly: Assembly, attempt: Attempt) -> Attempt:
    """Try starts all over the passive variables at the poses that are not closed; keeps the smallest gaps."""
    first = system.actuated
    free, gaps, closed, flipped = attempt
    width = search_width(system)
    random = np.random.default_rng(0)
    for _ in range(STARTS):
        todo = np.flatnonzero(~closed)
        if not todo.size:
            break
        start = free[todo]
        # the same start for all poses: what one pose gets does not depend on the others
        start[:, first:] = assembly.free[first:] + random.uniform(-width, width)
        found, found_gaps, jacobian, shut = newton(system, start)
        right = _in_branch(assembly, jacobian, shut)
        nearer = ~shut & ~flipped[todo] & (_norm(found_gaps) < _norm(gaps[todo]))
        flipped[todo] |= shut & ~right
        taken = right | nearer
        free[todo[taken]], gaps[todo[taken]] = found[taken], found_gaps[taken]
        closed[todo[right]] = True
    return Attempt(free, gaps, closed, flipped & ~closed)


def search_width(system: LoopSystem) -> Array:
    """Return how far from a guess to seek passive variables, (Q,): half a turn, half the machine's size."""
    passive = slice(system.actuated, None)
    return np.where(system.prismatic[passive], 0.5 * system.scale[passive], np.pi)


def _norm(gaps: Array) -> Array:
    return np.asarray(np.sqrt((gaps**2).sum(axis=1)))
