"""Writes measurements as CSV that `read_measurements` reads back."""

import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed, shown
from beamstiff.files import write_whole
from beamstiff.measure.arrays import Integers
from beamstiff.measure.columns import READINGS, Column, to_si
from beamstiff.measure.instruments import PLACE
from beamstiff.measure.table import ABSOLUTE, DISPLACEMENT, MEASURED, WRENCH, Measurements
from beamstiff.measure.text import METADATA
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Variable
from beamstiff.robot.reader import RobotLike, as_robot
from beamstiff.se3 import Array
from beamstiff.units import UNITS, quantity, unit_factor

# lengths in mm, as people read them; the rest in SI, which is exact
_UNITS = {
    **dict.fromkeys(WRENCH[:3], "N"),
    **dict.fromkeys(WRENCH[3:], "N*m"),
    **dict.fromkeys((*DISPLACEMENT[:3], *ABSOLUTE[:3]), "mm"),
    **dict.fromkeys((*DISPLACEMENT[3:], *ABSOLUTE[3:]), "rad"),
}


def write_measurements(measurements: Measurements, path: str | Path, robot: RobotLike) -> None:
    """Write a table to a CSV file, whole or not at all.

    Displacements and positions are written in mm, joint variables in the units of the file that they come
    from, everything else in SI, units in the header; read back, every number is the same to 1e-15 relative.
    Columns that hold nothing are left out; without any measured value those of the table's kind stay, and the
    time where the file had it, empty, to be filled in.

    Raises
    ------
    BeamstiffError
        When the table is not of this robot, or the file cannot be written.
    """
    if not isinstance(measurements, Measurements):
        raise BeamstiffError(f"measurements: found {shown(measurements)}, expected measurements")
    if not isinstance(path, str | os.PathLike):
        raise BeamstiffError(f"path: found {shown(path)}, expected the path of a CSV file")
    write_whole(path, measurements_to_csv(measurements, as_robot(robot)))


def measurements_to_csv(measurements: Measurements, robot: Robot) -> str:
    """Return the text of the file that `write_measurements` writes."""
    if measurements.camera and measurements.measured_mask.any():
        raise BeamstiffError(f"{measurements.source}: rows that a camera read are not written again")
    variables = tuple(variable.name for variable in robot.actuated)
    if variables != measurements.variables:
        raise BeamstiffError(
            f"{measurements.source}: found the variables {listed(measurements.variables)}, expected "
            f"those of robot {robot.name!r}: {listed(variables)}"
        )
    nodes = {node.name for node in robot.nodes}
    for name, column in (("point", measurements.point), ("load_point", measurements.load_point)):
        unknown = sorted(set(column.tolist()) - nodes)
        if unknown:
            raise BeamstiffError(
                f"{measurements.source}: {name}: found {unknown[0]!r}, expected a node of {robot.name!r}"
            )
    return table_text(_metadata(measurements), dict(_columns(measurements, robot)))


def table_text(metadata: Iterable[str], columns: Mapping[str, Sequence[str]]) -> str:
    """Return a table as CSV: lines of metadata, which follow a ``#``, and columns by their heads."""
    out = io.StringIO()
    out.writelines(f"# {line}\n" for line in metadata)
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return out.getvalue()


def _columns(measurements: Measurements, robot: Robot) -> Iterator[tuple[str, list[str]]]:
    for variable, q in zip(robot.actuated, measurements.q.T, strict=True):
        unit = measurements.units.get(variable.name, UNITS[variable.kind])
        yield (
            f"{variable.name} [{unit}]",
            _texts(q) if unit == UNITS[variable.kind] else _in_unit(q, variable, unit),
        )
    kinds = [variable.kind for variable in robot.actuated]
    units = [UNITS[kind] for kind in kinds], ["N" if kind == "length" else "N*m" for kind in kinds]
    drives = zip(measurements.drive_columns, units, (measurements.link, measurements.torque), strict=True)
    for label, unit, values in (
        (n, u, v) for ns, us, vs in drives for n, u, v in zip(ns, us, vs.T, strict=True)
    ):
        if not np.isnan(values).all():
            yield f"{label} [{unit}]", _texts(values)
    for name, values in zip(WRENCH, measurements.wrench.T, strict=True):
        yield f"{name} [{_UNITS[name]}]", _texts(values)
    names = MEASURED[measurements.kind]
    measured = np.where(measurements.by_tracker[:, None], measurements.measured, np.nan)
    present: NDArray[np.bool_] = np.asarray(~np.isnan(measured).all(axis=0))
    yield from _of_instruments(measurements)
    if not present.any() and not measurements.targets:
        present[:3], present[3:] = True, measurements.sigma_rotation is not None
    table = [measurements.sigma_position] * 3 + [measurements.sigma_rotation] * 3
    for at in np.flatnonzero(present):
        yield _quantity(names[at], measured[:, at])
    for at in np.flatnonzero(present):
        own = np.where(measurements.sigma[:, at] == table[at], np.nan, measurements.sigma[:, at])
        own = np.where(measurements.by_tracker, own, np.nan)
        if not np.isnan(own).all():
            label, texts = _quantity(names[at], own)
            yield f"sigma_{label}", texts
    for name, nodes in (("point", measurements.point), ("load_point", measurements.load_point)):
        if (nodes != robot.tcp).any():
            yield name, nodes.tolist()
    yield "pose", _whole(measurements.pose)
    if not np.isnan(measurements.step).all():
        yield "step", _whole(measurements.step)
    for label, values in (("t [s]", measurements.time), ("temperature [degC]", measurements.temperature)):
        if not np.isnan(values).all() or (label == "t [s]" and "t" in measurements.units):
            yield label, _texts(values)


def _of_instruments(measurements: Measurements) -> Iterator[tuple[str, list[str]]]:
    """Yield the columns of readings without a tracker, and of what is known of their set-ups."""
    if not measurements.targets:
        return
    found = {one.name: one for one in measurements.targets}
    own = [found.get(name) for name in measurements.target.tolist()]
    yield "instrument", ["" if one is None else one.instrument for one in own]
    yield "target", measurements.target.tolist()
    directions = [
        one.normal if one and one.normal and "tilt1" not in one.sought else tuple(along)
        for one, along in zip(own, measurements.direction.tolist(), strict=True)
    ]
    derived = [one is None or (measurements.kind == "absolute" and one.normal is None) for one in own]
    texts = [
        "" if not_told or along[0] != along[0] else " ".join(map(repr, map(float, along)))
        for along, not_told in zip(directions, derived, strict=True)
    ]
    if any(texts):
        yield "direction", texts
    lengths = [one.length if one and one.length and "length" not in one.sought else np.nan for one in own]
    if not np.isnan(lengths).all():
        yield "length [m]", _texts(np.array(lengths))
    free = {"x", "offset"}
    places = [one.place if one and one.place and not free & set(one.sought) else (np.nan,) * 3 for one in own]
    if measurements.kind == "absolute" and not np.isnan(places).all():
        yield from ((f"{name} [m]", _texts(at)) for name, at in zip(PLACE, np.array(places).T, strict=True))
    reads = np.array([one is not None and one.instrument != "socket" for one in own])
    if reads.any():
        name = READINGS[measurements.kind]
        yield (
            f"{name} [mm]",
            [_millimetres(x) for x in np.where(reads, measurements.measured[:, 0], np.nan).tolist()],
        )
    sigma = np.where(measurements.by_tracker, np.nan, measurements.sigma[:, 0])
    sigma = np.where(sigma == measurements.sigma_position, np.nan, sigma)
    if not np.isnan(sigma).all():
        yield "sigma_reading [m]", _texts(sigma)


def _quantity(name: str, values: Array) -> tuple[str, list[str]]:
    unit = _UNITS[name]
    if unit != "mm" or np.nanmax(np.abs(values), initial=0.0) > 1e300:
        unit = "m" if unit == "mm" else unit
        return f"{name} [{unit}]", _texts(values)
    return f"{name} [mm]", [_millimetres(value) for value in values.tolist()]


def _millimetres(value: float) -> str:
    """Return metres as text in mm: the short decimal where it stands for the same number."""
    if value != value:
        return ""
    short = f"{value * 1e3:.15g}"
    return short if float(short) / 1e3 == value else repr(value * 1e3)


def _in_unit(values: Array, variable: Variable, unit: str) -> list[str]:
    """Return SI values as text in a unit: the short decimal where it stands for the same number."""
    column = Column(variable.name, variable.kind, unit)
    factor, offset = unit_factor(unit, variable.kind)
    plain = (values - offset) / factor
    short = [f"{value:.15g}" for value in plain.tolist()]
    same = to_si(np.array([float(text) for text in short]), column) == values
    return [
        text if equal else repr(value) for text, equal, value in zip(short, same, plain.tolist(), strict=True)
    ]


def _texts(values: Array) -> list[str]:
    return ["" if value != value else repr(value) for value in values.tolist()]


def _whole(values: Array | Integers) -> list[str]:
    return ["" if value != value else str(int(value)) for value in values.tolist()]


def _metadata(measurements: Measurements) -> Iterator[str]:
    for key, value in measurements.metadata.items():
        if key not in METADATA:
            line = f"{key}: {value}"
            if not line.isprintable():
                raise BeamstiffError(
                    f"{measurements.source}: metadata {key[:60]!r}: expected one line of printable text"
                )
            yield line
    for key, sigma, unit in (
        ("sigma_position", measurements.sigma_position, "mm"),
        ("sigma_rotation", measurements.sigma_rotation, "rad"),
    ):
        if sigma is not None:
            short = f"{sigma * 1e3:.15g} mm"
            exact = unit == "mm" and quantity(short, "length") == sigma
            yield f"{key}: {short}" if exact else f"{key}: {sigma!r} {'m' if unit == 'mm' else unit}"
    if measurements.sigma_load is not None:
        yield f"sigma_load: {measurements.sigma_load!r} N"
    if (np.linalg.norm(measurements.rotation, axis=1) > np.pi).any():
        yield "orientation: rotation vector"  # else refused: probably Euler angles
    if measurements.shared_unloaded:
        yield "unloaded_reading: shared"
    if measurements.continuous:
        yield "history: continuous"
