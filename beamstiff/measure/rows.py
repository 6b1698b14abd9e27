"""Rows of measurement tables: some of them, those of several tables, and the order they were measured in."""

from collections.abc import Sequence
from dataclasses import fields, replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.arrays import Integers, equal_rows
from beamstiff.measure.instruments import joined_targets
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

# how a table states what differs: the key, and its values
STATED = {
    "shared_unloaded": ("unloaded_reading", {True: "shared", False: "independent"}),
    "continuous": ("history", {True: "continuous", False: "unloaded"}),
}


def subset(measurements: Measurements, mask: ArrayLike) -> Measurements:
    """Return some rows of a table: where a mask (N,) is true, or by their indices in the wanted order."""
    chosen = np.asarray(mask)
    if chosen.dtype == np.bool_:
        if chosen.shape != (len(measurements),):
            raise BeamstiffError(f"mask: found shape {chosen.shape}, expected ({len(measurements)},)")
        chosen = np.flatnonzero(chosen)
    if chosen.ndim != 1 or not len(chosen):
        raise BeamstiffError(f"{measurements.source}: no row of {len(measurements)} is left in the selection")
    if not np.issubdtype(chosen.dtype, np.integer):
        raise BeamstiffError(f"mask: found values of type {chosen.dtype}, expected bool or int")
    outside = (chosen < 0) | (chosen >= len(measurements))
    if outside.any():
        raise BeamstiffError(
            f"mask: found row {chosen[outside][0]}, expected rows from 0 to {len(measurements) - 1}"
        )
    arrays = {f.name: getattr(measurements, f.name) for f in fields(measurements)}
    return replace(
        measurements, **{name: a[chosen] for name, a in arrays.items() if isinstance(a, np.ndarray)}
    )


def evenly(count: int, most: int) -> Integers:
    """Return numbers of at most so many of some things, evenly chosen, the first and the last among them."""
    return np.linspace(0, count - 1, min(count, most)).astype(np.intp)


def without_rows(rows: Measurements, places: Sequence[str]) -> Measurements:
    """Return a table without some rows, ``file:line`` each."""
    if not places:
        return rows
    return subset(rows, np.array([rows.place(row) not in places for row in range(len(rows))]))


def row_digests(rows: Measurements) -> list[str]:
    """Return six hexadecimal digits of each row's state and readings, to nm and nrad; few agree by chance."""
    values = np.nan_to_num(np.column_stack([rows.q, rows.wrench, rows.measured])).round(9) + 0.0  # no -0
    return [sha256(row.tobytes()).hexdigest()[:6] for row in values]


def ranges_of(rows: Measurements) -> dict[str, tuple[float, float]]:
    """Return the least and largest value, rad or m, of each variable in rows that were read."""
    q = rows.q[rows.measured_mask.any(axis=1)].round(6) + 0.0  # no -0
    return {name: (min(own), max(own)) for name, own in zip(rows.variables, q.T.tolist(), strict=True) if own}


def without_displacement(rows: Measurements, moved: Array) -> Measurements:
    """Return absolute rows without a displacement ``[d, r]`` (N, 6), in their measuring frame."""
    rotation = rows.rotation.copy()
    known = ~np.isnan(rotation).any(axis=1)
    if known.any():
        read = rotation_from_vector(-moved[known, 3:]) @ rotation_from_vector(rotation[known])
        rotation[known] = vector_from_rotation(read)
    return replace(rows, position=rows.position - moved[:, :3], rotation=rotation)


def in_runs(measurements: Measurements, most: int, runs: int = 10) -> Measurements:
    """Return at most so many rows: runs of whole postures, as they were measured, evenly spread over a table.

    Neighbours stay together, for a machine has a memory.

    >>> from beamstiff.measure.table import make_measurements
    >>> q = 0.1 * np.arange(100)[:, None]
    >>> table = make_measurements(["q1"], q, tcp="tip", displacement=np.zeros((100, 3)))
    >>> [round(float(q), 1) for q in in_runs(table, 6, runs=2).q[:, 0]]
    [0.0, 0.1, 0.2, 5.0, 5.1, 5.2]
    """
    if len(measurements) <= most:
        return measurements
    _, first, posture = np.unique(measurements.pose, return_index=True, return_inverse=True)
    place = np.argsort(np.argsort(first))[posture]  # number of each row's posture, in the order of the table
    count = np.bincount(place)
    run, end = np.arange(len(first)) * runs // len(first), np.cumsum(count)
    start = (end - count)[np.searchsorted(run, np.arange(runs))]
    return subset(measurements, (end - start[run] <= most // runs)[place])


def concatenate(data: Measurements | Sequence[Measurements]) -> Measurements:
    """Return several tables as one. Poses are numbered anew: those of different files stay apart.

    Where the tables' noise differs, `sigma` keeps it row by row and `sigma_position` (`_rotation`) is None.
    """
    if isinstance(data, Measurements):
        return data
    tables = data
    if not tables:
        raise BeamstiffError("found no table of measurements, expected at least one")
    first = tables[0]
    for other in tables[1:]:
        for name in ("variables", "kind", "shared_unloaded", "continuous", "sigma_load", "camera"):
            a, b = getattr(first, name), getattr(other, name)
            if a != b:
                key, texts = STATED.get(name, (name, {}))
                one, two = (texts.get(value, _text(value)) for value in (a, b))
                raise BeamstiffError(
                    f"{first.source} and {other.source}: found {key} {one} in the first and {two} in the "
                    "second, expected the same in both"
                )
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(table, name) for table in tables])
        for name in (f.name for f in fields(first) if isinstance(getattr(first, f.name), np.ndarray))
    }
    runs = np.cumsum([0, *(len(table.sources) for table in tables)])
    arrays["run"] = np.concatenate([table.run + start for table, start in zip(tables, runs, strict=False)])
    origin = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
    if len(tables) > 1:
        arrays["pose"] = equal_rows(np.stack([origin, arrays["pose"]], axis=1).astype(np.float64))
    metadata: dict[str, str] = {}
    for key in dict.fromkeys(key for table in tables for key in table.metadata):
        metadata[key] = "; ".join(dict.fromkeys(t.metadata[key] for t in tables if key in t.metadata))
    return replace(
        first,
        **arrays,
        sigma_position=_common([table.sigma_position for table in tables]),
        sigma_rotation=_common([table.sigma_rotation for table in tables]),
        metadata=metadata,
        targets=joined_targets([(table.source, table.targets) for table in tables]),
        sources=tuple(source for table in tables for source in table.sources),
    )


def require_tracker(measurements: Measurements, what: str) -> None:
    """Refuse rows of instruments that say no position, or of a camera, for what needs positions."""
    if measurements.camera:
        raise BeamstiffError(
            f"{measurements.source}: camera: {what} needs the rows of a tracker; such rows are for calibrate "
            "and diagnose"
        )
    alone = np.flatnonzero(~measurements.by_tracker)
    if alone.size:
        raise BeamstiffError(
            f"{measurements.place(int(alone[0]))}: instrument: {what} needs x y z or dx dy dz in every row; "
            "such readings are for calibrate, identify and diagnose"
        )


def history_order(measurements: Measurements) -> Integers:
    """Return the rows in the order in which the machine went through them, as indices (N,).

    Runs follow one another; within a run poses are ordered by their first `time`, else by row; within a pose
    rows by `time`, else `step`, else row. In a continuous history with `time` everywhere, time alone counts.
    """
    n = len(measurements)
    row = np.arange(n, dtype=np.float64)
    group = equal_rows(np.stack([measurements.run, measurements.pose], axis=1).astype(np.float64))

    def complete(value: Array, within: Integers) -> NDArray[np.bool_]:
        gaps = np.bincount(within, weights=np.isnan(value), minlength=1)
        return np.asarray(gaps[within] == 0)

    def first_of(value: Array) -> Array:
        start = np.full(group.max() + 1, np.inf)
        np.minimum.at(start, group, value)
        return start[group]

    timed_run = complete(measurements.time, measurements.run)
    start = first_of(np.where(timed_run, measurements.time, row))
    stepped = np.where(complete(measurements.step, group), measurements.step, row)
    within = np.where(complete(measurements.time, group), measurements.time, stepped)
    if measurements.continuous:
        start = np.where(timed_run, measurements.time, start)
    # the last key counts most; step and row distinguish equal times
    keys = (row, stepped, within, first_of(row), start, measurements.run)
    return np.lexsort(keys).astype(np.int64)


def _common(values: Sequence[float | None]) -> float | None:
    return values[0] if len(set(values)) == 1 else None


def _text(value: object) -> str:
    return listed(value) if isinstance(value, tuple) else str(value)
