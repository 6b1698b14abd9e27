"""The columns of a table that hold readings without a tracker (`measure.instruments`)."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NoReturn

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.measure.instruments import INSTRUMENTS, PLACE, Target, target, unit_vector
from beamstiff.measure.text import RawTable
from beamstiff.se3 import Array

Wrong = Callable[[str, str], NoReturn]  # raises the error of a cell


@dataclass(frozen=True, eq=False)
class Read:
    """What the columns of instruments hold; N rows."""

    measured: Array  # (N, 6): with the readings, in the first place of the row's own axes
    sigma: Array  # (N, 6)
    direction: Array  # (N, 3): along which a row reads; NaN where it is no single known one
    target: tuple[str, ...]  # (N,): "" for rows of a tracker
    targets: tuple[Target, ...]


def read_instruments(
    cells: Mapping[str, Sequence[str]],
    values: Mapping[str, Array],
    measured: Array,
    sigma: Array,
    absolute: bool,
    reserved: Collection[str],
    raw: RawTable,
) -> Read:
    """Return rows with the readings of instruments among those of a tracker.

    `measured`, `sigma` (N, 6): of the columns x y z or dx dy dz, NaN empty. `absolute`: whether the readings
    are of states, not of differences. `reserved`: names that a target cannot have.
    """
    count = len(measured)
    measured, sigma = measured.copy(), sigma.copy()
    direction, names = np.full((count, 3), np.nan), [""] * count
    nothing = np.full(count, np.nan)
    column = "reading" if absolute else "dreading"
    reading, own = values.get(column, nothing), values.get("sigma_reading", nothing)
    length = values.get("length", nothing)
    places = np.stack([values.get(name, nothing) for name in PLACE], axis=1)
    targets: dict[str, tuple[int, Target]] = {}
    for row, cell in enumerate(cells.get("instrument", [""] * count)):
        wrong: Wrong = partial(raw.fail_in_row, row)
        kind = cell.strip().lower()
        along = _direction(cells["direction"][row], wrong) if "direction" in cells else None
        if not kind:
            if not np.isnan(reading[row]):
                wrong("instrument", f"found none beside a {column}, expected one of {listed(INSTRUMENTS)}")
            continue
        if kind not in INSTRUMENTS:
            wrong(
                "instrument",
                f"found {shown(cell)}, expected one of {listed(INSTRUMENTS)}{suggest(kind, INSTRUMENTS)}",
            )
        if not np.isnan(measured[row]).all():
            wrong("instrument", f"found a {kind} beside measured coordinates, expected empty cells there")
        name = cells["target"][row].strip() if "target" in cells else ""
        name = name or f"{kind} {cells['direction'][row].strip() if along is not None else ''}".strip()
        if name in reserved or "." in name or not name.isprintable():
            wrong(
                "target", f"found {shown(name)}, expected a name that the robot does not use, without a dot"
            )
        if length[row] <= 0:
            wrong("length", f"found {length[row]:g} m, expected a positive length")
        at = None if np.isnan(places[row]).all() else places[row]
        if at is not None and np.isnan(at).any():
            wrong("target_x", "found some of target_x target_y target_z empty, expected all or none")
        if kind == "socket":
            if not absolute:
                wrong(
                    "instrument",
                    "found a socket in a table of displacements: a ball that is held does not move",
                )
            if reading[row] not in (0.0,) and not np.isnan(reading[row]):
                wrong(column, f"found {reading[row]:g} m at a socket, expected nothing: it reads no number")
            measured[row, :3], sigma[row, :3] = 0.0, own[row]
        else:
            measured[row, 0], sigma[row, 0] = reading[row], own[row]
        needed = kind == "gauge" or not absolute
        if needed and along is None:
            wrong(
                "direction",
                f"found none, expected the direction that the {kind} reads along: z, or 0.6 0 0.8",
            )
        if along is not None and kind in ("socket", "ball-bar") and absolute:
            wrong("direction", f"found one at a {kind}, expected none: it follows from where the point is")
        if along is not None:
            direction[row] = along
        names[row] = name
        said = target(
            name,
            kind,
            place=at if absolute else None,
            normal=along if absolute or kind != "ball-bar" else None,
            length=None if np.isnan(length[row]) else float(length[row]),
        )
        if not absolute:
            said = replace(said, sought=())
        first, before = targets.setdefault(name, (row, said))
        if before != said:
            wrong(
                "target",
                f"found {name!r} unlike in line {raw.lines[first]} (instrument, direction, length or "
                "place), expected another name for another set-up",
            )
    return Read(measured, sigma, direction, tuple(names), tuple(one for _, one in targets.values()))


def _direction(cell: str, wrong: Wrong) -> Array | None:
    """Return the unit vector that a cell says: ``x``, ``-z``, or three numbers."""
    text = cell.strip().lower().strip("[]()")
    if not text:
        return None
    sign, axis = (-1.0 if text[0] == "-" else 1.0), text.lstrip("+-")
    if axis in ("x", "y", "z"):
        return np.asarray(sign * np.eye(3)["xyz".index(axis)])
    try:
        numbers = np.array([float(part) for part in text.split()])
        if numbers.shape != (3,):
            raise ValueError
        return np.array(unit_vector(numbers, "direction"))
    except (ValueError, BeamstiffError):
        wrong("direction", f"found {shown(cell)}, expected x, -z, or three numbers such as 0.6 0 0.8")
