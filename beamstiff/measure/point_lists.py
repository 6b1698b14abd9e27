"""A list of points, read by its profile (`measure.profiles`), as a table of measurements."""

import csv
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.measure.columns import LABELS, QUANTITIES, Column, fail, to_si
from beamstiff.measure.orientation import Orientation, Quaternion, named_orientation
from beamstiff.measure.profiles import ANGLES, POSITION, QUATERNION, Profile
from beamstiff.measure.registration import Registration, register
from beamstiff.measure.signals import Signal, SignalKind
from beamstiff.measure.table import WRENCH
from beamstiff.measure.text import RawTable, RowError, numbers, split_table
from beamstiff.measure.writer import table_text
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation
from beamstiff.units import UNITS, quantity, unit_factor

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "whitespace": None}


@dataclass(frozen=True)
class PointTable:
    """A list of points as a table of measurements."""

    text: str  # CSV, SI
    count: int  # rows
    notes: tuple[str, ...]  # what to know of it


def convert_points(
    path: str | os.PathLike[str], profile: Profile, joints: str | os.PathLike[str] | None = None
) -> PointTable:
    """Return a list of points as a table of measurements in CSV.

    `path`: the list. `joints`: CSV table of joint values and loads, written beside the points: rows of the
    same `pose` where both have one, else as many rows in the same order.
    """
    return parse_points(
        read_text(Path(path)),
        profile,
        str(path),
        None if joints is None else split_table(read_text(Path(joints)), str(joints)),
    )


def parse_points(
    text: str, profile: Profile, name: str = "<points>", joints: RawTable | None = None
) -> PointTable:
    """Return the text of a list of points as a table of measurements; otherwise as `convert_points`."""
    rows, lines = _rows(text, profile, name)
    labels, values = _cells(rows, lines, profile, name)
    notes: list[str] = []
    values = _turned(values, profile, name, lines)
    keep = np.ones(len(lines), dtype=np.bool_)
    if profile.base is not None:
        keep &= ~np.isin(labels["point"], list(profile.base))
        placed = _registered(labels["point"], values, profile.base, name)
        values = _carried(values, placed)
        notes.append(_registration_note(placed, len(profile.base)))
    if profile.points is not None:
        known = np.isin(labels["point"], list(profile.points))
        left_out = sorted(set(np.array(labels["point"])[keep & ~known].tolist()))
        if left_out:
            notes.append(f"skipped, as `points` does not name them: {listed(left_out)}")
        keep &= known
        labels["point"] = [profile.points.get(point, point) for point in labels["point"]]
    if not keep.any():
        raise BeamstiffError(
            f"{name}: found no point that `points` names, expected {listed(profile.points or ())}"
        )
    at = np.flatnonzero(keep).tolist()
    if profile.point is not None:
        labels["point"] = [profile.point] * len(lines)
    columns = {key: [cells[row] for row in at] for key, cells in labels.items()}
    columns |= {_header(key, profile): [_text(cells[row]) for row in at] for key, cells in values.items()}
    if joints is not None:
        columns = _joined(columns, joints, name)
    elif not any(key in values for key in values if key not in QUANTITIES):
        notes.append("without joint values (columns of their own, or --joints) this is a list of points only")
    metadata = []
    if profile.sigma_position is not None:
        quantity(profile.sigma_position, "length")
        metadata = [f"sigma_position: {profile.sigma_position}"]
    return PointTable(table_text(metadata, columns), len(at), tuple(notes))


def signals_of(text: str, profile: Profile, name: str = "<log>") -> list[Signal]:
    """Return the signals of a log in columns: joints, points one each, a wrench; times are those of `t`."""
    rows, lines = _rows(text, profile, name)
    labels, values = _cells(rows, lines, profile, name)
    values = _turned(values, profile, name, lines)
    if "t" not in values:
        raise BeamstiffError(f"{name}: columns: found no `t`, expected the time of each sample")
    time = values["t"]
    joints = tuple(key for key in values if key not in QUANTITIES)
    wrench = tuple(key for key in WRENCH if key in values)
    found: list[Signal] = []
    if joints:
        found.append(_signal("joints", "joints", joints, time, values))
    if wrench:
        values |= {key: np.zeros(len(time)) for key in WRENCH if key not in values}
        found.append(_signal("wrench", "wrench", WRENCH, time, values))
    if "x" in values:
        points = np.array(labels.get("point", [profile.point or "point"] * len(time)))
        for point in dict.fromkeys(points.tolist()):
            own = {key: cells[points == point] for key, cells in values.items()}
            placed = _signal((profile.points or {}).get(point, point), "point", POSITION, own["t"], own)
            if "a" in own:
                known = ~np.isnan(np.stack([own[key] for key in (*POSITION, *ANGLES)], axis=1)).any(axis=1)
                turned = np.stack([own[key] for key in ANGLES], axis=1)[known]
                quaternions = Rotation.from_rotvec(turned).as_quat()
                flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0)
                quaternions[1:] *= np.cumprod(flips)[:, None]
                at = np.stack([own[key] for key in POSITION], axis=1)[known]
                columns, poses = (*POSITION, "qx", "qy", "qz", "qw"), np.hstack([at, quaternions])
                placed = Signal(placed.name, "pose", columns, own["t"][known], poses)
            found.append(placed)
    return [one.shifted(one.time) for one in found if len(one)]


def _signal(
    name: str, kind: SignalKind, columns: tuple[str, ...], time: Array, values: Mapping[str, Array]
) -> Signal:
    table = np.stack([values[key] for key in columns], axis=1)
    known = ~np.isnan(table).any(axis=1) & ~np.isnan(time)
    return Signal(name, kind, columns, time[known], table[known])


def _rows(text: str, profile: Profile, name: str) -> tuple[list[list[str]], list[int]]:
    """Return the cells that the profile names, in its order, and their lines."""
    separator = SEPARATORS[profile.separator]
    found: list[tuple[int, list[str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        plain = line.strip()
        if number <= profile.skip or not plain or plain.startswith(profile.comment):
            continue
        cells = plain.split() if separator is None else next(csv.reader([plain], delimiter=separator))
        found.append((number, [cell.strip() for cell in cells]))
    if not found:
        raise BeamstiffError(f"{name}: found no points, expected rows with {listed(profile.columns)}")
    wanted: list[int] = []
    if any(isinstance(column, str) for column in profile.columns.values()):
        line_of_header, header = found.pop(0)
        for ours, column in profile.columns.items():
            if isinstance(column, str) and column not in header:
                missing = f"there is no column {column!r} in the header{suggest(column, header)}"
                fail(name, line_of_header, ours, missing)
            wanted.append(header.index(column) if isinstance(column, str) else column - 1)
    else:
        wanted = [int(column) - 1 for column in profile.columns.values()]
    for number, cells in found:
        if len(cells) <= max(wanted):
            fail(
                name,
                number,
                "",
                f"found {len(cells)} cells separated by {profile.separator}, expected at least "
                f"{max(wanted) + 1}",
            )
    if not found:
        raise BeamstiffError(f"{name}: found a header without points")
    return [[cells[at] for at in wanted] for _, cells in found], [number for number, _ in found]


def _cells(
    rows: list[list[str]], lines: list[int], profile: Profile, name: str
) -> tuple[dict[str, list[str]], dict[str, Array]]:
    labels: dict[str, list[str]] = {}
    values: dict[str, Array] = {}
    for (column, _), cells in zip(profile.columns.items(), zip(*rows, strict=True), strict=True):
        if column in LABELS:
            labels[column] = list(cells)
            continue
        try:
            raw = numbers(cells, may_be_empty=column in QUANTITIES, decimal_comma=profile.decimal == "comma")
        except RowError as error:
            fail(name, lines[error.row], column, str(error))
        kind = _kind(column, profile)
        unit = profile.unit_of(column) or ""
        values[column] = raw if column in QUATERNION else to_si(raw, Column(column, kind, unit))
    return labels, values


def _kind(column: str, profile: Profile) -> str:
    if column in QUANTITIES or column in QUATERNION:
        return QUANTITIES.get(column, "number")
    try:
        unit_factor(profile.unit_of(column) or "", "angle")
    except BeamstiffError:
        return "length"
    return "angle"


def _turned(values: dict[str, Array], profile: Profile, name: str, lines: Sequence[int]) -> dict[str, Array]:
    """Return the values with every orientation as a rotation vector a b c."""
    group: tuple[str, ...]
    convention: Orientation
    if profile.orientation is not None:
        group, convention = ANGLES, named_orientation(profile.orientation)
    elif "qw" in values:
        group, convention = QUATERNION, Quaternion()
    else:
        return values
    table = np.stack([values[key] for key in group], axis=1)
    vectors = np.full((len(table), 3), np.nan)
    known = ~np.isnan(table).any(axis=1)
    try:
        vectors[known] = vector_from_rotation(convention.rotations(table[known]))
    except RowError as error:
        fail(name, lines[int(np.flatnonzero(known)[error.row])], group[0], str(error))
    kept = {key: value for key, value in values.items() if key not in group}
    return kept | dict(zip(ANGLES, vectors.T, strict=True))


def _registered(
    points: Sequence[str],
    values: Mapping[str, Array],
    base: Mapping[str, tuple[float, float, float]],
    name: str,
) -> Registration:
    """Return the list's frame in the base frame; a point read several times counts by its mean."""
    if "x" not in values:
        raise BeamstiffError(f"{name}: base: needs the columns x y z")
    table = np.stack([values[key] for key in POSITION], axis=1)
    read = {point: table[[at for at, other in enumerate(points) if other == point]] for point in base}
    missing = [point for point, rows in read.items() if not len(rows)]
    if missing:
        raise BeamstiffError(
            f"{name}: base: the list has no point {missing[0]!r}{suggest(missing[0], set(points))}"
        )
    try:
        return register([rows.mean(axis=0) for rows in read.values()], list(base.values()))
    except BeamstiffError as error:
        raise BeamstiffError(f"{name}: base: {error}") from None


def _carried(values: dict[str, Array], placed: Registration) -> dict[str, Array]:
    result = dict(values)
    position = placed.points(np.stack([values[key] for key in POSITION], axis=1))
    result |= dict(zip(POSITION, position.T, strict=True))
    if "a" in values:
        vectors = np.stack([values[key] for key in ANGLES], axis=1)
        known = ~np.isnan(vectors).any(axis=1)
        vectors[known] = vector_from_rotation(placed.rotation @ rotation_from_vector(vectors[known]))
        result |= dict(zip(ANGLES, vectors.T, strict=True))
    return result


def _registration_note(placed: Registration, count: int) -> str:
    note = f"carried to the base frame by {count} points, which fit to {1e3 * placed.rms:.3g} mm (rms)"
    if placed.scale_doubtful:
        note += f"; their distances are {1e6 * (placed.apparent_scale - 1):.3g} ppm off: temperature, units?"
    return note


def _header(column: str, profile: Profile) -> str:
    kind = _kind(column, profile) if column not in ANGLES else "angle"
    return f"{column} [{UNITS[kind].replace('**', '^')}]"


def _text(value: float) -> str:
    return "" if value != value else repr(float(value))


def _joined(columns: Mapping[str, list[str]], joints: RawTable, name: str) -> dict[str, list[str]]:
    """Return the columns with those of the joints' table before them."""
    names = [re.split(r"\s*\[", cell)[0] for cell in joints.header]
    count = len(next(iter(columns.values())))
    twice = [own for own in columns if re.split(r"\s*\[", own)[0] in names and own != "pose"]
    if twice:
        raise BeamstiffError(f"{joints.source}: the column {twice[0]!r} stands in the list of points too")
    if "pose" in names and "pose" in columns:
        row_of: dict[str, int] = {}
        for at, cells in enumerate(joints.cells):
            pose = cells[names.index("pose")].strip()
            if pose in row_of:
                joints.fail_in_row(at, "pose", f"found {pose!r} a second time, expected one row a pose")
            row_of[pose] = at
        for pose in columns["pose"]:
            if pose not in row_of:
                raise BeamstiffError(
                    f"{joints.source}: pose: the list of points has the pose {shown(pose)}, which is "
                    f"missing here"
                    f"{suggest(pose, row_of)}"
                )
        order = [row_of[pose] for pose in columns["pose"]]
    elif len(joints.cells) == count:
        order = list(range(count))
    else:
        raise BeamstiffError(
            f"{joints.source}: found {len(joints.cells)} rows for {count} points of {name}, expected as "
            "many, or a column pose in both"
        )
    beside = {
        header: [joints.cells[at][column].strip() for at in order]
        for column, header in enumerate(joints.header)
        if names[column] != "pose" or "pose" not in columns
    }
    return beside | dict(columns)
