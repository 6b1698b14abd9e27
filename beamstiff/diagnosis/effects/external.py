"""What effects outside the machine share: the axes of the tool, the clock of the campaign."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.effect import Quantities, Shape, stated_scale
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.internal_wrench import find_places
from beamstiff.measure.arrays import places_of_each
from beamstiff.measure.rows import history_order
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

OF_LOADS = ("load", "payload")  # places of effects that are errors of loads
POSTURES = 40  # beyond which nobody does anything anew by hand in each
SPREAD = 4.0  # of what is another each time: so many values of any size could be anything
SETUPS = 80  # the same of a posture with a load that pulls one way
SAME = 1e-6  # rad or m, within which joint values are of one posture
SAME_WAY = np.deg2rad(2.0)  # within which forces pull one way
LEAST = 0.15  # share of the rows before and after a moment at which something moved
CLOSE = 60  # moments at most, each a form: a move between two of them would look like two moves
SLACK = 0.01  # share of the largest force, below which nothing pulls


def each_by_each(frame: Array, vector: Array) -> Array:
    """Return the axes (N, 3, 3) of a frame, each times each part of vectors (N, 3) in it: (N, 3, 9)."""
    own = np.einsum("nai,na->ni", frame, vector)
    return np.asarray((frame[:, :, :, None] * own[:, None, None, :]).reshape(len(own), 3, 9))


def shift_alone(columns: Array) -> Array:
    """Return shifts or forces (N, 3, c) without rotations or moments, (N, 6, c)."""
    return np.pad(columns, ((0, 0), (0, 3), (0, 0)))


def turn_alone(columns: Array) -> Array:
    """Return rotations or moments (N, 3, c) without shifts or forces, (N, 6, c)."""
    return np.pad(columns, ((0, 0), (3, 0), (0, 0)))


def tool_axes(baseline: Baseline) -> Array:
    """Return the axes of the TCP's frame in the base frame as columns, (N, 3, 3)."""
    return baseline.described[1]


def under_errors(baseline: Baseline, errors: Iterable[tuple[str, Array]]) -> Baseline:
    """Return what a baseline's effects look at where errors of its loads pass through the places as well.

    What is compliant deforms under these too.

    Parameters
    ----------
    baseline : Baseline
    errors : pairs of a place of effects, and (N, 6) array
        Wrenches: of ``payload`` at the TCP, others where the loads act.
    """
    rows, places = baseline.rows, baseline.places
    tcp = np.full(len(rows), baseline.robot.tcp)
    total = dict[str, Array]()
    for place, wrench in errors:
        total[place] = total.get(place, np.zeros_like(wrench)) + wrench
    for place, wrench in total.items():
        at = tcp if place == "payload" else rows.load_point
        places = places.beside(find_places(baseline.robot, replace(rows, wrench=wrench, load_point=at)))
    return replace(baseline, places=places)


def read_by_camera(baseline: Baseline) -> list[str | None]:
    """Return the component of what only a camera's readings show, also of a robot that has it already."""
    return [None] if baseline.rows.camera or baseline.stated is not None else []


@dataclass(frozen=True)
class Clock:
    """When the rows that were fitted began, how long they took (0: no times), and how many they are."""

    start: float
    duration: float
    rows: float


def clock_of(baseline: Baseline) -> Clock:
    """Return the campaign by which the clock goes: as stated, else that of the rows that were fitted."""
    stated = [stated_scale(baseline, item.name) for item in fields(Clock)]
    if None not in stated:
        return Clock(*(value for value in stated if value is not None))
    fitted, time = baseline.fit.rows, _elapsed(baseline.fit.rows)
    if not np.isfinite(time).all():
        return Clock(0.0, 0.0, float(len(fitted)))
    return Clock(float(time.min()), float(np.ptp(time)), float(len(fitted)))


def clock(baseline: Baseline) -> Array:
    """Return when each row was read, (N,): its time, else its place in the order, from 0 to about 1."""
    rows, fitted = baseline.rows, clock_of(baseline)
    if fitted.duration > 0:
        return np.nan_to_num((_elapsed(rows) - fitted.start) / fitted.duration)
    result = np.empty(len(rows))
    result[history_order(rows)] = np.arange(len(rows)) / max(fitted.rows - 1, 1)
    return result


def _elapsed(rows: Measurements) -> Array:
    """Return the times of rows (N,); those of a run that starts its clock again follow on the run before."""
    time: Array = rows.time.copy()
    for before, after in pairwise(np.unique(rows.run)):
        last, first = time[rows.run == before].max(), time[rows.run == after].min()
        if last >= first:
            steps = np.diff(np.unique(time[rows.run == after]))
            time[rows.run == after] += last - first + (np.median(steps) if steps.size else 1.0)
    return time


def moments(fit: Baseline, most: int) -> list[float]:
    """Return moments by the clock, between postures, at which something may have moved, so many at most."""
    time = clock(fit)
    order = np.argsort(time, kind="stable")
    changed = np.flatnonzero(np.diff(fit.rows.pose[order]) != 0)
    early, late = np.quantile(time, [LEAST, 1.0 - LEAST])
    between = 0.5 * (time[order][changed] + time[order][changed + 1])
    between = between[(between > early) & (between < late)]
    if not between.size:
        return []
    picked: list[float] = between[
        np.unique(np.linspace(0, between.size - 1, most).round().astype(np.intp))
    ].tolist()
    return picked


def row_before(at: float, fit: Baseline) -> str:
    """Return the last row before a moment by the clock, ``FILE:ROW``, the file without its folder."""
    time = clock(fit)
    return os.path.basename(fit.rows.place(int(np.argmax(np.where(time <= at, time, -np.inf)))))


def by_posture(baseline: Baseline) -> NDArray[np.bool_]:
    """Return which rows are of each posture that was fitted, (N, postures); none where that tells nothing.

    That is of one posture, of more than anybody would work on one by one, or of most under one load alone:
    then whatever is another in every posture could be anything.
    """
    fit = baseline.fit.rows
    postures, number = np.unique(np.round(fit.q, 9), axis=0, return_inverse=True)
    if not _tells(number.reshape(-1), fit.wrench, POSTURES):
        return np.zeros((len(baseline.rows), 0), dtype=np.bool_)
    return np.asarray((np.abs(baseline.rows.q[:, None] - postures) < SAME).all(axis=2))


def by_setup(baseline: Baseline) -> NDArray[np.bool_]:
    """Return which rows are of each posture with a force that pulls one way, (N, setups); as `by_posture`.

    None either where most postures are pulled one way only: then it is another in every posture.
    """
    nothing = np.zeros((len(baseline.rows), 0), dtype=np.bool_)
    fit = baseline.fit.rows
    ways, pulled = _ways(fit.wrench)
    every = np.concatenate([fit.q, ways], axis=1)
    number = np.full(len(fit), -1)
    states: list[Array] = []
    while (left := np.flatnonzero(pulled & (number < 0))).size:
        states.append(every[left[0]])
        number[left[_alike(every[left], states[-1])]] = len(states) - 1
        if len(states) > SETUPS:
            return nothing
    if not states or not _tells(number[pulled], fit.wrench[pulled], SETUPS):
        return nothing
    postures = np.unique(np.round(np.array(states)[:, :-3], 9), axis=0, return_counts=True)[1]
    if float(np.median(postures)) <= 1 or len(postures) > POSTURES:
        return nothing
    ways, pulled = _ways(baseline.rows.wrench)
    every = np.concatenate([baseline.rows.q, ways], axis=1)
    return np.stack([pulled & _alike(every, one) for one in states], -1)


def _ways(wrench: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the directions in which forces pull, (N, 3), and whether they do."""
    size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
    pulled = size > SLACK * size.max(initial=0.0)
    return wrench[:, :3] / np.where(pulled, size, 1.0), pulled[:, 0]


def _alike(states: Array, one: Array) -> NDArray[np.bool_]:
    """Return which states (N, n + 3), joint values and a direction, are the same as one."""
    posture = (np.abs(states[:, :-3] - one[:-3]) < SAME).all(axis=1)
    return np.asarray(posture & (states[:, -3:] @ one[-3:] > np.cos(SAME_WAY)))


def _tells(number: NDArray[np.intp], wrench: Array, most: int) -> bool:
    """Return whether there are some states, no more than `most`, most of them under several loads."""
    loads = np.unique(np.column_stack([number, wrench]), axis=0)[:, 0].astype(np.intp)
    each = np.unique(loads, return_counts=True)[1]
    return 1 < each.size <= most and float(np.median(each)) > 1


def anew(
    name: str,
    baseline: Baseline,
    columns: Array,
    quantities: Quantities,
    times: Callable[[Baseline], NDArray[np.bool_]] = by_posture,
) -> Iterator[Shape]:
    """Yield the shape of columns (N, 6, c) that are others each time, about common ones.

    Of a robot that states it only the common ones are known.
    """
    parts, every = [columns], list(quantities)
    if baseline.stated is None:
        here = times(baseline)
        if not here.shape[1]:
            return
        parts.append((columns[:, :, None] * here[:, None, :, None]).reshape(*columns.shape[:2], -1))
        every += [
            replace(one, name=f"{one.name}_in_{k}", posture_specific=True)
            for k in range(here.shape[1])
            for one in quantities
        ]
    yield Shape(name, np.concatenate(parts, -1), tuple(every), prior_factor=SPREAD, weight=0.5)


def first_of_pose(baseline: Baseline) -> NDArray[np.intp]:
    """Return for each row the first reading of its pose, (N,)."""
    time, pose = clock(baseline), baseline.rows.pose
    result = np.empty(len(pose), dtype=np.intp)
    for at in places_of_each(pose):
        result[at] = at[np.argmin(time[at])]
    return result


def since_pose(baseline: Baseline, course: Array) -> Array:
    """Return by how much a course (N,) has moved on since the first reading of a row's pose, (N,)."""
    return course - course[first_of_pose(baseline)]
