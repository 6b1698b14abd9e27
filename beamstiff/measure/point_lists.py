"""A list of points, read by its profile (`measure.profiles`), as a table of measurements."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError, counted, listed, suggest
from beamstiff.files import read_text
from beamstiff.measure.columns import LABELS, QUANTITIES
from beamstiff.measure.joint_tables import joined, read_joints
from beamstiff.measure.profile_cells import in_si, mass_notes, number_text, profile_cells, profile_values
from beamstiff.measure.profiles import ANGLES, POSITION, SIGMAS, Profile
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.registration import Registration, register
from beamstiff.measure.signals import Signal, SignalKind
from beamstiff.measure.table import WRENCH
from beamstiff.measure.text import RawTable
from beamstiff.measure.writer import table_text
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

MOST_SKIPPED = 0.1  # share of the rows; more of them are skipped by mistake, such as a name spelled otherwise


@dataclass(frozen=True)
class PointTable:
    """A list of points as a table of measurements."""

    text: str  # CSV, SI
    count: int  # rows
    notes: tuple[str, ...]  # what to know of it


def convert_points(
    path: str | os.PathLike[str],
    profile: Profile,
    joints: str | os.PathLike[str] | None = None,
    joints_profile: Profile | None = None,
    robot: Robot | None = None,
) -> PointTable:
    """Return a list of points as a table of measurements in CSV.

    `path`: the list. `joints`: joint values and loads, written beside the points: rows of the same `pose`
    where both have one, else as many rows in the same order. A CSV table of ours, unless `joints_profile`
    says what its columns are. `robot`: whose joints and nodes the names are; not checked without it.
    """
    beside = None if joints is None else read_joints(joints, joints_profile)
    made = parse_points(read_text(Path(path)), profile, str(path), beside)
    notes = [] if joints_profile is None else mass_notes(joints_profile)
    if robot is not None:
        parse_measurements(made.text, robot, f"{path}, as a table", require_measured=False)
    elif beside is not None or _has_joints(profile):
        notes.append("names of joints and points are not checked; --like ROBOT checks them")
    return replace(made, notes=(*made.notes, *notes))


def _has_joints(profile: Profile) -> bool:
    return not {*profile.columns} <= {*QUANTITIES, *LABELS}


def parse_points(
    text: str, profile: Profile, name: str = "<points>", joints: RawTable | None = None
) -> PointTable:
    """Return the text of a list of points as a table of measurements; otherwise as `convert_points`."""
    cells = profile_cells(text, profile, name)
    labels = {column: list(cells.columns[column]) for column in cells.columns if column in LABELS}
    values = profile_values(cells, profile, name)
    notes: list[str] = []
    keep = np.ones(len(cells.lines), dtype=np.bool_)
    if profile.base is not None:
        keep &= ~np.isin(labels["point"], list(profile.base))
        placed = _registered(labels["point"], values, profile.base, name)
        values = _carried(values, placed)
        notes.append(_registration_note(placed, len(profile.base)))
    if profile.points is not None:
        notes = _skipped_notes(np.array(labels["point"])[keep], profile.points, notes)
        keep &= np.isin(labels["point"], list(profile.points))
        labels["point"] = [profile.points.get(point, point) for point in labels["point"]]
    if not keep.any():
        raise BeamstiffError(
            f"{name}: found no point that `points` names, expected {listed(profile.points or ())}"
        )
    at = np.flatnonzero(keep).tolist()
    for key in ("point", "load_point"):
        if (node := getattr(profile, key)) is not None:
            labels[key] = [node] * len(keep)
    notes += mass_notes(profile)
    if cells.unused:
        notes.append(f"not used, as `columns` of the profile does not name them: {listed(cells.unused, 12)}")
    columns = {key: [texts[row] for row in at] for key, texts in labels.items()}
    columns |= {in_si(key, profile): [number_text(one) for one in values[key][keep]] for key in values}
    if joints is not None:
        columns, more = joined(columns, [cells.lines[row] for row in at], name, joints)
        notes += more
    elif not any(key in values for key in values if key not in QUANTITIES):
        notes.append("without joint values (columns of their own, or --joints) this is a list of points only")
    along = ("history", "unloaded_reading", *SIGMAS)
    metadata = [f"{key}: {value}" for key in along if (value := getattr(profile, key)) is not None]
    return PointTable(table_text(metadata, columns), len(at), tuple(notes))


def _skipped_notes(read: NDArray[np.str_], named: Mapping[str, str], notes: Sequence[str]) -> list[str]:
    """Return notes with those on points that are skipped, or missing; on many that are skipped first.

    `read`: the point of each row. `named`: nodes of the points that the profile names.
    """
    skipped = ~np.isin(read, list(named))
    others = f"as `points` does not name them: {listed(sorted(set(read[skipped].tolist())))}"
    said = list(notes)
    if skipped.sum() > MOST_SKIPPED * len(read):
        said.insert(0, f"{int(skipped.sum())} of {len(read)} rows skipped, {others}")
    elif skipped.any():
        said.append(f"{counted(int(skipped.sum()), 'row')} skipped, {others}")
    if missing := [point for point in named if point not in set(read.tolist())]:
        said.append(f"`points` names what the list lacks: {listed(missing)}")
    return said


def signals_of(text: str, profile: Profile, name: str = "<log>") -> list[Signal]:
    """Return the signals of a log in columns: joints, points one each, a wrench; times are those of `t`."""
    cells = profile_cells(text, profile, name)
    values = profile_values(cells, profile, name)
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
        points = np.array(cells.columns.get("point", [profile.point or "point"] * len(time)))
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
