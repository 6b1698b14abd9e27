"""What friction outside the drives could do: seats that slip, readings that stick.

Stop operators of vectors (Visintin, Differential Models of Hysteresis, 1994, ch. VI): what is held moves on
with what is followed, and stays within a ball. No effect of the library has a name for them.
"""

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.external import tool_axes
from beamstiff.diagnosis.effects.hysteresis import LIMITS, history
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.place import Place
from beamstiff.se3 import Array


def held_back(
    followed: Array,
    start: Array,
    order: NDArray[np.intp],
    fresh: NDArray[np.bool_],
    limit: Array,
    *,
    carried: bool | NDArray[np.bool_] = False,
    released: bool | NDArray[np.bool_] = False,
    whole: bool = False,
) -> Array:
    """Return what is held of vectors that are followed, (N, m, 3), since the start of each row's history.

    `followed`, `start`: (N, m, 3) arrays; in each row, and where its history starts: m vectors side by side.
    `order`: (N,) int array.
    `fresh`: (N,) bool array; whether a row is the first of its history.
    `limit`: (m,) array; length that is held at most.
    `carried`: bool or (m,) bool array; whether what is held when a history ends is still held when the next
        one starts.
    `released`: bool or (m,) bool array; whether all is let go where the limit is passed, as what sticks does;
        else the limit stays held.
    `whole`: whether what is held when a history starts counts too, as where positions are absolute.

    >>> way = np.zeros((4, 1, 3))
    >>> way[:, 0, 0] = 1.0, 2.0, 1.0, 0.0
    >>> first = np.array([True, False, False, False])
    >>> held_back(way, 0.0 * way, np.arange(4), first, np.array([0.5]))[:, 0, 0]
    array([ 0.5,  0.5, -0.5, -0.5])
    """
    result = np.zeros_like(followed)
    held = before = first = np.zeros_like(followed[0])
    kept = np.broadcast_to(np.where(released, 0.0, limit), limit.shape)

    def moved(by: Array) -> Array:
        now = held + by
        length = np.sqrt((now**2).sum(axis=-1))
        beyond = length > limit
        share = np.where(beyond, kept / np.where(beyond, length, 1.0), 1.0)
        result: Array = now * share[:, None]
        return result

    for row in order.tolist():
        if fresh[row]:
            held = np.where(np.reshape(carried, (-1, 1)), moved(start[row] - before), 0.0)
            before, first = start[row], held
        held, before = moved(followed[row] - before), followed[row]
        result[row] = held if whole else held - first
    return result


def slipping(baseline: Baseline, place: Place) -> Array:
    """Return what a seat with friction holds back, (N, 6, c): in one direction, or whatever the direction."""
    loads, starts = [], []
    for part in (slice(3), slice(3, 6)):
        load, dead = (place.load + place.dead)[:, part], place.dead[:, part]
        largest = float(np.linalg.norm(load, axis=1).max(initial=0.0)) or 1.0
        loads.append(_each(load / largest))
        starts.append(_each(dead / largest))
    ways = loads[0].shape[1]
    load, start = (np.tile(np.concatenate(parts, axis=1), (1, 2, 1)) for parts in (loads, starts))
    carried = np.repeat([False, True], 2 * ways)
    held = held_back(
        load, start, *history(baseline), np.tile(_limits(), 4), carried=carried, whole=baseline.absolute
    )
    shift = place.shift.reshape(*place.shift.shape[:2], 2, 3)
    columns = np.einsum("napi,ncpmi->nacpmi", shift, held.reshape(len(held), 2, 2, ways, 3))
    flat = columns.reshape(*columns.shape[:2], -1)
    result: Array = flat[:, :, np.abs(flat).any(axis=(0, 1))]
    return result


def lagging(baseline: Baseline) -> Array:
    """Return what readings lag by that stick or drag, each direction by itself or all together, (N, 6, c).

    Every reflector has a gauge of its own.
    """
    moved, point = baseline.predicted[:, :3], baseline.rows.point
    largest = float(np.linalg.norm(moved, axis=1).max(initial=0.0)) or 1.0
    frames = [np.broadcast_to(np.eye(3), (len(moved), 3, 3)), tool_axes(baseline)]
    ways = [_each(np.einsum("nai,na->ni", frame, moved / largest)) for frame in frames]
    count = ways[0].shape[1]
    along = np.tile(np.concatenate(ways, axis=1), (1, 2, 1))
    released, limit = np.repeat([False, True], 2 * count), np.tile(_limits(), 4)
    held = np.zeros_like(along)
    for one in np.unique(point):
        own = history(baseline, point == one)
        held += held_back(along, np.zeros_like(along), *own, limit, released=released)
    by_frame = held.reshape(len(held), 2, 2, count, 3)  # ways to stick, frames, directions and limits
    columns = np.einsum("fnai,nrfmi->narfm", np.stack(frames), by_frame).reshape(len(held), 3, -1)
    return np.concatenate([columns, np.zeros_like(columns)], axis=1)


def _each(vector: Array) -> Array:
    """Return vectors (N, 3) whole and along each direction, for each limit: (N, 4 limits, 3)."""
    ways = np.stack([np.eye(3), *(np.diag(one) for one in np.eye(3))])
    return np.tile(np.einsum("wij,nj->nwi", ways, vector), (1, len(LIMITS), 1))


def _limits() -> Array:
    """Return the limits of what `_each` gives, over the largest, (4 limits,)."""
    return np.repeat(LIMITS, 4)
