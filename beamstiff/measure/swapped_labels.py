"""Reflectors whose names were exchanged, or that slipped: their distances to one another tell.

Reflectors on one body keep their distances, whatever the posture, the load and the measuring frame. Each
state has the distances that its names say; the most states that agree are taken for right, or those that
agree with the places in the robot file. A state that disagrees, and agrees with other names, has its names
exchanged; one in which a single reflector is off by itself has lost that one's place. How much distances
scatter is seen without names, in their sorted sizes. `mend_labels` puts exchanged names back.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.arrays import Integers
from beamstiff.measure.position_plausibility import comparable, laid_over
from beamstiff.measure.rows import evenly, subset
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array

LEAST_STATES = 4  # that see the same reflectors
MOST_POINTS = 6  # whose names are tried in every order
TOLERANCE = 1e-3  # m of a distance, beyond six standard deviations of it where these are known: a slip
SCATTERS = 8.0  # of a distance between states, beyond which it is that of other names
SCALE = 1.4826  # of a median absolute deviation, to a standard deviation
TRIED = 100  # states whose distances are held against all
LISTED = 6  # rows that are named
CLEARLY = 1 / 3  # of what the next best names leave of distances

Order = tuple[int, ...]


@dataclass(frozen=True)
class Body:
    """States that read the same reflectors of one body, and what their distances say."""

    names: tuple[str, ...]  # (P)
    rows: Integers  # (S, P): row of the table of each reflector in each state
    # by state whose names are wrong: orders in which they are right, ``rows[state, order[k]]`` being
    # reflector ``names[k]``
    orders: dict[int, list[Order]]
    off: dict[int, Order]  # by state that no names make right: reflectors without which its distances are
    far: Array  # (S, P), m: how far the distances of each reflector are off, by its name
    sides: tuple[int, int]  # how many states are held for right, and of the most that agree on other names
    placed: bool  # the robot file's places say which names are right
    # (P,): reflectors that may be exchanged without a change of distances beyond `fine`
    alike: NDArray[np.bool_]
    fine: float  # m

    @property
    def exchanged(self) -> dict[Order, list[int]]:
        """The states of each exchange that is the only one to make them right."""
        found: dict[Order, list[int]] = {}
        for state, orders in self.orders.items():
            if len(orders) == 1:
                found.setdefault(orders[0], []).append(state)
        return found

    def said(self, order: Order) -> str:
        """Return an exchange in words."""
        changed = [(self.names[one], self.names[k]) for k, one in enumerate(order) if one != k]
        return ", ".join(f"{name} is {right}" for name, right in changed)


def label_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield which rows seem to have exchanged names of reflectors, and which reflectors seem to have slipped.

    Asks for three reflectors or more that the same states read at different distances from one another, or
    for two that the robot file places.
    """
    yield from _reversed_pairs(table, robot)
    for body in _bodies(table, robot):
        for order, states in body.exchanged.items():
            yield (
                f"names of reflectors seem to be exchanged in {len(states)} of {len(body.rows)} states, by "
                f"their distances: {body.said(order)}; {_listed(table, body.rows[states, 0])} "
                "(`convert --mend-labels` puts them back)"
            )
        slips = Counter(one for some in body.off.values() for one in some)
        if slips:
            one = min(slips, key=lambda k: (-slips[k], k))
            states = [state for state, some in body.off.items() if one in some]
            yield (
                f"reflector {body.names[one]} seems to have slipped in {len(states)} of {len(body.rows)} "
                f"states: its distances to the others are off by up to "
                f"{1e3 * body.far[states, one].max():.3g} mm; {_listed(table, body.rows[states, one])}"
            )


def _reversed_pairs(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield in which states the way from one of two reflectors to the other is that of the file, reversed.

    Along the axes of the body that carries them: their distance is the same whatever their names.
    """
    found = list(_states(table, 2, 2)) if table.kind == "absolute" else []
    if not found or not len(some := comparable(table)):
        return
    try:
        turn = laid_over(table, robot, some, table.q[some], table.position[some]).rotation
    except BeamstiffError:  # of points on one line nothing can be said
        return
    kinematics = compile_kinematics(robot)
    for names, rows in found:
        where = posture(kinematics, table.q[rows[:, 0]])
        one, other = (pose_of(kinematics, where, name) for name in names)
        ways = other[:, :3, 3] - one[:, :3, 3], np.diff(table.position[rows], axis=1)[:, 0] @ turn
        placed, read = (np.einsum("sji,sj->si", one[:, :3, :3], way) for way in ways)
        off, otherwise = (np.linalg.norm(read - sign * placed, axis=1) for sign in (1.0, -1.0))
        wrong = np.flatnonzero(otherwise < CLEARLY * off)
        if wrong.size and np.ptp(placed, axis=0).max() < TOLERANCE:  # on one body
            yield (
                f"{listed(names)} seem to be exchanged in {wrong.size} of {len(rows)} states: the way from "
                "one to the other is that of the robot file reversed. Correct the column point, or their "
                f"places in the robot file; {_listed(table, rows[wrong, 0])}"
            )


def mend_labels(table: Measurements, robot: Robot) -> tuple[Measurements, tuple[str, ...]]:
    """Return a table with exchanged names of reflectors put back, and what was done, a sentence each.

    Rows of a reflector that slipped are left out in the states where it did.

    `table`: absolute positions; four states or more read the same three reflectors or more of one body.
    `robot`: where its file places the reflectors apart, this says which of several names are right; else
        those of the most states.
    Raises BeamstiffError when distances say nothing, or several exchanges, or no exchange and no single slip,
    explain a state.
    """
    bodies = list(_bodies(table, robot))
    if not bodies:
        raise BeamstiffError(
            f"{table.source}: found no reflectors that keep their distances, expected absolute positions of "
            f"the same three or more on one body in {LEAST_STATES} states: nothing says which names are right"
        )
    point, keep, done = table.point.copy(), np.ones(len(table), dtype=np.bool_), list[str]()
    for body in bodies:
        _refuse_ambiguous(table, body)
        for order, states in body.exchanged.items():
            moved = [one for k, one in enumerate(order) if one != k]
            for state in states:
                where = ", ".join(table.place(row) for row in sorted(body.rows[state, moved].tolist()))
                done.append(f"{where}: {body.said(order)}")
            for k, one in enumerate(order):
                point[body.rows[states, one]] = body.names[k]
        for state, (one,) in body.off.items():
            row = int(body.rows[state, one])
            keep[row] = False
            done.append(
                f"{table.place(row)}: left out: {body.names[one]} slipped, off by "
                f"{1e3 * body.far[state, one]:.3g} mm"
            )
        right, count = body.sides[0], len(body.rows)
        held = "by their places in the robot file" if body.placed else "for they are the most that agree"
        done.append(f"the names of {right} of {count} states of {listed(body.names)} count as right, {held}")
        if body.alike.any():
            alike = [name for name, one in zip(body.names, body.alike, strict=True) if one]
            done.append(
                f"exchanges among {listed(alike)} cannot be seen: their distances are the same to "
                f"{1e3 * body.fine:.2g} mm"
            )
    return subset(replace(table, point=point), keep), tuple(done)


def _refuse_ambiguous(table: Measurements, body: Body) -> None:
    """Refuse what distances leave open."""
    right, other = body.sides
    if right == other and not body.placed:
        raise BeamstiffError(
            f"{table.source}: {listed(body.names)} are named one way in {right} states and otherwise in "
            f"{other}: give them their places in the robot file, so that it says which is right"
        )
    for state, orders in body.orders.items():
        if len(orders) > 1:
            raise BeamstiffError(
                f"{table.place(int(body.rows[state, 0]))}: several exchanges explain the distances "
                f"({listed([f'({body.said(one)})' for one in orders])}): name its reflectors by hand, or "
                "leave them out"
            )
    for state, some in body.off.items():
        if len(some) != 1:
            who = listed([body.names[one] for one in some]) if some else "no single reflector"
            raise BeamstiffError(
                f"{table.place(int(body.rows[state, 0]))}: distances are off by "
                f"{1e3 * body.far[state].max():.3g} mm, by no exchange, and {who} may have slipped: "
                "name its reflectors by hand, or leave them out"
            )


def _bodies(table: Measurements, robot: Robot) -> Iterator[Body]:
    """Yield the bodies whose reflectors keep their distances in a third of the states or more."""
    if table.kind != "absolute":
        return
    for names, rows in _states(table):
        at = table.position[rows]  # (S, P, 3)
        sigma = float(np.nan_to_num(np.nanmax(table.sigma[rows][..., :3], initial=0.0)))
        tolerance = max(TOLERANCE, 6.0 * np.sqrt(2.0) * sigma)
        apart = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)  # (S, P, P)
        sizes = np.sort(apart[:, *np.triu_indices(len(names), 1)], axis=1)  # whatever the names
        scatter = SCALE * np.median(np.abs(sizes - np.median(sizes, axis=0)), axis=0).max()
        fine = min(tolerance, SCATTERS * max(scatter, 1e-7))
        tried = apart[evenly(len(rows), TRIED)]
        most = max((_near(apart, one, fine) for one in tried), key=np.count_nonzero)
        if most.sum() < max(2, len(rows) // 3):
            continue  # on several bodies, or they move
        right = np.median(apart[most], axis=0)
        every = np.array(list(permutations(range(len(names)))))
        own = tuple(range(len(names)))
        seen = {orders[0] for orders in _fitting(apart, right, every, fine, tolerance) if orders}
        placed = _placed(names, right, sorted(seen | {own}), robot)
        if placed is not None:
            right = right[np.ix_(placed, placed)]
        fits = _fitting(apart, right, every, fine, tolerance)
        wrong = {state: orders for state, orders in enumerate(fits) if orders and orders[0] != own}
        lost = np.flatnonzero(~_near(apart, right, tolerance)).tolist()
        off = {state: _alone_off(apart[state], right, tolerance) for state in lost if not fits[state]}
        sure = {some[0] for some in off.values() if len(some) == 1}  # who slipped has slipped in all
        off = {state: tuple(one for one in some if one in sure) or some for state, some in off.items()}
        others = Counter(orders[0] for orders in wrong.values())
        alike = (np.array(_fitting(right[None], right, every, fine, tolerance)[0]) != every[0]).any(axis=0)
        yield Body(
            names=names,
            rows=rows,
            orders=wrong,
            off=off,
            far=np.abs(apart - right).max(axis=2),
            sides=(len(rows) - len(wrong) - len(off), max(others.values(), default=0)),
            placed=placed is not None,
            alike=alike,
            fine=fine,
        )


def _fitting(apart: Array, right: Array, every: Integers, fine: float, tolerance: float) -> list[list[Order]]:
    """Return the orders, of `every`, that make the distances of each state (S, P, P) right.

    To `fine`; or, of a reading worse than others, the one that is clearly nearest.
    """
    found = []
    for one in apart:
        off = np.abs(one[every[:, :, None], every[:, None, :]] - right).max(axis=(1, 2))
        best, second = np.sort(off)[:2]
        limit = fine if best <= fine or best > min(tolerance, CLEARLY * second) else best
        found.append([tuple(order) for order in every[off <= limit].tolist()])
    return found


def _placed(names: Sequence[str], right: Array, orders: Sequence[Order], robot: Robot) -> Order | None:
    """Return the order whose distances are those of the robot file; None where it does not say."""
    nodes = [node for name in names for node in robot.nodes if node.name == name]
    if len({node.frame for node in nodes}) != 1:
        return None
    at = np.array([node.at for node in nodes])
    apart = np.linalg.norm(at[:, None] - at, axis=-1)
    off = np.array([np.abs(right[np.ix_(order, order)] - apart).max() for order in orders])
    if len(off) < 2 or np.sort(off)[0] > CLEARLY * np.sort(off)[1]:
        return None
    return orders[int(off.argmin())]


def _states(
    table: Measurements, least: int = 3, most: int = MOST_POINTS
) -> Iterator[tuple[tuple[str, ...], Integers]]:
    """Yield the reflectors that some states read, and their rows, (S, P); each reading of a state is one."""
    read = np.flatnonzero(np.isfinite(table.position).all(axis=1) & table.by_tracker)
    found: dict[tuple[bytes, int], dict[str, int]] = {}
    times = Counter[tuple[bytes, str]]()
    for row in read.tolist():
        name = str(table.point[row])
        state = np.concatenate([[table.run[row], table.pose[row]], table.q[row], table.wrench[row]]).tobytes()
        found.setdefault((state, times[state, name]), {})[name] = row
        times[state, name] += 1
    alike: dict[tuple[str, ...], list[list[int]]] = {}
    for points in found.values():
        names = tuple(sorted(points))
        if least <= len(names) <= most:
            alike.setdefault(names, []).append([points[name] for name in names])
    for names, rows in alike.items():
        if len(rows) >= LEAST_STATES:
            yield names, np.array(rows)


def _near(apart: Array, right: Array, tolerance: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(apart - right).max(axis=(1, 2)) <= tolerance)


def _alone_off(apart: Array, right: Array, tolerance: float) -> Order:
    """Return the points without which all distances are right."""
    off = np.abs(apart - right) > tolerance
    every = np.arange(len(off))
    return tuple(one for one in every.tolist() if not off[np.ix_(every != one, every != one)].any())


def _listed(table: Measurements, rows: Integers) -> str:
    more = f" and {len(rows) - LISTED} more" if len(rows) > LISTED else ""
    return ", ".join(table.place(row) for row in rows[:LISTED].tolist()) + more
