"""Readings without a tracker in a calibration: what they should be, and how they follow point and set-up.

Places of sockets and base balls, lengths of bars, planes and zeros of gauges are parameters of the estimate
like the base of the robot in the frame of a tracker, and as little of interest. A row of an instrument reads
along one direction u at the point: its row of the error Jacobian is ``u^T`` times the point's, and beside it
stand the derivatives by the set-up (equations in `measure.instruments`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from beamstiff.calibration.parameters import AXES, LENGTH, PLACED, SETUP, SPARE, Parameter
from beamstiff.errors import BeamstiffError
from beamstiff.measure.camera import SCALE
from beamstiff.measure.instruments import Target, across
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

TILTS = ("tilt1", "tilt2")


def instrument_parameters(rows: Measurements) -> tuple[Parameter, ...]:
    """Return what is sought of the set-ups, such as ``S1.x`` of a socket."""
    return tuple(
        Parameter(f"{one.name}.{name}", "instrument", "rad" if name in TILTS else "m", PLACED, SETUP)
        for one in rows.targets
        for name in one.sought
    )


def camera_parameters(rows: Measurements) -> tuple[Parameter, ...]:
    """Return what may be sought of a camera: its scale, which a robot that is as much longer hides."""
    return (Parameter(SCALE, "instrument", "1", LENGTH, SPARE),) if rows.camera else ()


def knows_a_frame(rows: Measurements) -> bool:
    """Return whether rows are measured in a frame of their own: by a tracker, or at places that are known."""
    placed = ("x", "y", "z", "offset")
    known = (not set(placed) & set(one.sought) for one in rows.targets)
    return bool(rows.by_tracker.any()) or any(known)


def of_targets(rows: Measurements) -> Iterator[tuple[Target, NDArray[np.intp]]]:
    """Yield each set-up with its rows."""
    for one in rows.targets:
        if (at := np.flatnonzero(rows.target == one.name)).size:
            yield one, at


def begun(rows: Measurements, position: Array) -> Measurements:
    """Return rows whose set-ups are where they fit points (N, 3) best; what is known of them stays."""
    at = {
        one.name: _fitted(one, position[own], rows.position[own, 0], rows.place(own[0]))
        for one, own in of_targets(rows)
    }
    return replace(rows, targets=tuple(at.get(one.name, one) for one in rows.targets))


def _fitted(one: Target, points: Array, reading: Array, place: str) -> Target:
    reading, middle = np.nan_to_num(reading), points.mean(axis=0)
    if one.instrument == "socket":
        return one if one.place is not None else replace(one, place=_vector(middle))
    if one.instrument == "ball-bar":
        return _bar(one, points, reading)
    normal = np.array(one.normal) if one.normal else np.linalg.svd(points - middle)[2][2]
    if one.place is not None:
        return replace(one, normal=_vector(normal))
    if len(points) < 3 and one.normal is None:
        raise BeamstiffError(
            f"{place}: {one.name}: found {len(points)} points of a plane, expected 3 or more"
        )
    return replace(one, normal=_vector(normal), place=_vector(middle - normal * reading.mean()))


def _bar(one: Target, points: Array, reading: Array) -> Target:
    """Return a ball bar with its base ball, and its length, where the distances fit best."""
    known = None if one.place is None else np.array(one.place)
    if known is not None:
        far = np.linalg.norm(points - known, axis=1) - reading
        return replace(one, length=float(far.mean()) if one.length is None else one.length)
    middle = points.mean(axis=0)
    off = points - middle
    # |p|^2 - 2 p.s + |s|^2 = (length + reading)^2 is linear in s and one number more
    right = (off**2).sum(axis=1) - (0.0 if one.length is None else (one.length + reading) ** 2)
    found = np.linalg.lstsq(np.c_[2.0 * off, np.ones(len(off))], right, rcond=1e-9)[0]
    length = one.length or float(np.sqrt(max(found[3] + found[:3] @ found[:3], (off**2).mean())))
    normal = np.linalg.svd(off)[2][2]

    def misfit(values: Array) -> Array:
        away = np.linalg.norm(off - values[:3], axis=1)
        return np.asarray(away - reading - (length if one.length is not None else values[3]))

    starts = [found[:3], length * normal, -length * normal]  # points of a patch may be seen from either side
    fits = [
        least_squares(misfit, [*start, *([] if one.length is not None else [length])]) for start in starts
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    return replace(one, place=_vector(middle + best[:3]), length=one.length or float(best[3]))


def settled(one: Target, values: Mapping[str, float]) -> Target:
    """Return a set-up with what was found of it, `values` by name, added."""
    by = {name: values.get(f"{one.name}.{name}", 0.0) for name in one.sought}
    if one.place is None or not by:
        return one
    place = np.array(one.place) + [by.get(axis, 0.0) for axis in AXES]
    if one.normal is None:
        return replace(
            one,
            place=_vector(place),
            length=None if one.length is None else one.length + by.get("length", 0.0),
        )
    normal, _ = _normal(one, by)
    return replace(one, normal=_vector(normal), place=_vector(place + by.get("offset", 0.0) * normal))


def start_of(rows: Measurements, name: str) -> float:
    """Return the value that a parameter of a set-up starts at, SI; 0 for tilts and offsets."""
    owner, _, what = name.rpartition(".")
    if name == SCALE:
        return 0.0
    one = next(item for item in rows.targets if item.name == owner)
    if what in AXES and one.place is not None:
        return one.place[AXES.index(what)]
    return (one.length or 0.0) if what == "length" else 0.0


def turned_rows(rows: Measurements, turn: Array, shift: Array, position: Array) -> Measurements:
    """Return rows with set-ups and directions in another frame: p there is ``turn^T (p - shift)``.

    `turn` (3, 3), `shift` (3,). `position` (N, 3): of the points, in the frame that the rows are in; where a
    direction follows from them it is stated in the rows from here on.
    """
    direction = rows.direction.copy()
    for one, at in of_targets(rows):
        if one.instrument != "socket":
            direction[at] = _directions(one, position[at]) @ turn
    targets = tuple(
        replace(
            one,
            place=None if one.place is None else _vector((np.array(one.place) - shift) @ turn),
            normal=None if one.normal is None else _vector(np.array(one.normal) @ turn),
        )
        for one in rows.targets
    )
    return replace(rows, direction=direction, targets=targets)


def gap_of_rows(rows: Measurements, values: Mapping[str, float], position: Array, gap: Array) -> Array:
    """Return a gap (N, 6) with that of instruments: what was read less what points (N, 3) make them read."""
    result = gap.copy()
    for one, at in of_targets(rows):
        here = settled(one, values)
        off = position[at] - np.array(here.place)
        result[at] = 0.0
        if one.instrument == "socket":
            result[at, :3] = rows.position[at] - off
            continue
        far = np.linalg.norm(off, axis=1) - (here.length or 0.0) if here.normal is None else off @ here.normal
        result[at, 0] = np.nan_to_num(rows.position[at, 0]) - np.where(
            np.isnan(rows.position[at, 0]), 0.0, far
        )
    return result


def linearised_rows(
    rows: Measurements,
    parameters: Sequence[Parameter],
    values: Mapping[str, float],
    position: Array,
    jacobian: Array,
) -> Array:
    """Return an error Jacobian (N, 6, t) with the rows of instruments as they read.

    `position` (N, 3), `jacobian`: of the points, in the measuring frame; its columns are of `parameters`.
    """
    result = jacobian.copy()
    number = {item.name: at for at, item in enumerate(parameters)}
    for one, at in of_targets(rows):
        own = {name: number[f"{one.name}.{name}"] for name in one.sought if f"{one.name}.{name}" in number}
        if one.instrument == "socket":
            for axis, name in enumerate(AXES):
                if name in own:
                    result[at, axis, own[name]] = -1.0
            continue
        along = _directions(settled(one, values), position[at])
        result[at, 0] = np.einsum("ni,nit->nt", along, jacobian[at, :3])
        result[at, 1:] = 0.0
        for axis, name in enumerate(AXES):
            if name in own:
                result[at, 0, own[name]] = -along[:, axis]
        for name in ("length", "offset"):
            if name in own:
                result[at, 0, own[name]] = -1.0
        if TILTS[0] in own:
            _, slopes = _normal(one, {name: values.get(f"{one.name}.{name}", 0.0) for name in TILTS})
            result[at, 0, [[own[name]] for name in TILTS]] = slopes @ (position[at] - np.array(one.place)).T
    return result


def _directions(one: Target, points: Array) -> Array:
    """Return the direction (n, 3) in which a set-up reads points (n, 3)."""
    if one.normal is not None:
        return np.broadcast_to(np.array(one.normal), points.shape)
    off = points - np.array(one.place)
    return np.asarray(off / np.linalg.norm(off, axis=1, keepdims=True))


def _normal(one: Target, by: Mapping[str, float]) -> tuple[Array, Array]:
    """Return the normal (3,) of a plane tilted about its start, and its derivatives (2, 3)."""
    start = np.array(one.normal)
    sides = across(start)
    tilted = start + by.get("tilt1", 0.0) * sides[0] + by.get("tilt2", 0.0) * sides[1]
    size = float(np.linalg.norm(tilted))
    normal = tilted / size
    return normal, (sides - np.outer(sides @ normal, normal)) / size


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
