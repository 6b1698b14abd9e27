"""Reflectors whose names were exchanged, or that slipped: their distances to one another tell.

Reflectors on one body keep their distances, whatever the posture, the load and the measuring frame. Each
state has the distances that its names say; the most states that agree are taken for right. A state that
disagrees, and agrees with other names, has its names exchanged; one in which a single reflector is off by
itself has lost that one's place.
"""

from collections.abc import Iterator
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

LEAST_STATES = 4  # that see the same reflectors
MOST_POINTS = 6  # whose names are tried in every order
TOLERANCE = 1e-3  # m of a distance, beyond six standard deviations of it where these are known
TRIED = 100  # states whose distances are held against all
LISTED = 6  # rows that are named


def label_doubts(table: Measurements) -> Iterator[str]:
    """Yield which rows seem to have exchanged names of reflectors, and which reflectors seem to have slipped.

    Asks for three reflectors or more that the same states read at different distances from one another.
    """
    if table.kind != "absolute":
        return
    for names, rows in _states(table):
        at = table.position[rows]  # (S, P, 3)
        sigma = float(np.nan_to_num(np.nanmax(table.sigma[rows][..., :3], initial=0.0)))
        tolerance = max(TOLERANCE, 6.0 * np.sqrt(2.0) * sigma)
        apart = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)  # (S, P, P)
        tried = apart[np.linspace(0, len(rows) - 1, min(len(rows), TRIED)).astype(np.intp)]
        most = max((_near(apart, one, tolerance) for one in tried), key=np.count_nonzero)
        if most.sum() < max(2, len(rows) // 3):
            continue  # on several bodies, or they move
        right = np.median(apart[most], axis=0)
        exchanged: dict[tuple[int, ...], list[int]] = {}
        off: dict[int, tuple[int, ...]] = {}  # by state: reflectors without which its distances are right
        for state in np.flatnonzero(~_near(apart, right, tolerance)).tolist():
            orders = [
                order
                for order in permutations(range(len(names)))
                if np.abs(apart[state][np.ix_(order, order)] - right).max() <= tolerance
            ]
            if len(orders) == 1:
                exchanged.setdefault(orders[0], []).append(state)
            elif not orders:
                off[state] = _alone_off(apart[state], right, tolerance)
        for order, states in exchanged.items():
            said = ", ".join(f"{names[order[k]]} is {names[k]}" for k in range(len(names)) if order[k] != k)
            yield (
                f"names of reflectors seem to be exchanged in {len(states)} of {len(rows)} states, by their "
                f"distances: {said}; {_listed(table, rows[states, 0])}"
            )
        counts = np.bincount([one for some in off.values() for one in some], minlength=len(names))
        if counts.any():
            one = int(np.argmax(counts))
            states = [state for state, some in off.items() if one in some]
            far = 1e3 * np.abs(apart[states][:, one] - right[one]).max()
            yield (
                f"reflector {names[one]} seems to have slipped in {len(states)} of {len(rows)} states: its "
                f"distances to the others are off by up to {far:.3g} mm; {_listed(table, rows[states, one])}"
            )


def _states(table: Measurements) -> Iterator[tuple[tuple[str, ...], Integers]]:
    """Yield the reflectors that some states read, and their rows, (S, P)."""
    read = np.flatnonzero(np.isfinite(table.position).all(axis=1) & table.by_tracker)
    found: dict[bytes, dict[str, int]] = {}
    for row in read.tolist():
        state = np.concatenate([[table.run[row], table.pose[row]], table.q[row], table.wrench[row]])
        found.setdefault(state.tobytes(), {}).setdefault(str(table.point[row]), row)
    alike: dict[tuple[str, ...], list[list[int]]] = {}
    for points in found.values():
        names = tuple(sorted(points))
        if 3 <= len(names) <= MOST_POINTS:
            alike.setdefault(names, []).append([points[name] for name in names])
    for names, rows in alike.items():
        if len(rows) >= LEAST_STATES:
            yield names, np.array(rows)


def _near(apart: Array, right: Array, tolerance: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(apart - right).max(axis=(1, 2)) <= tolerance)


def _alone_off(apart: Array, right: Array, tolerance: float) -> tuple[int, ...]:
    """Return the points without which all distances are right."""
    off = np.abs(apart - right) > tolerance
    every = np.arange(len(off))
    return tuple(one for one in every.tolist() if not off[np.ix_(every != one, every != one)].any())


def _listed(table: Measurements, rows: Integers) -> str:
    more = f" and {len(rows) - LISTED} more" if len(rows) > LISTED else ""
    return ", ".join(table.place(row) for row in rows[:LISTED].tolist()) + more
