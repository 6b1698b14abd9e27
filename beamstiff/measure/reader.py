"""Reads measurements from CSV.

The format: ``# key: value`` lines, a header whose cells may carry units (``q1 [deg]``, ``dx [mm]``; SI
otherwise), one row a measured state. Columns: the actuated variables by name; ``fx fy fz mx my mz``; either
``dx dy dz rx ry rz`` or ``x y z a b c``; optionally ``point``, ``load_point``, ``pose``, ``step``, ``t``,
``temperature``, ``remark`` (passed over). Empty measured cells are unmeasured. What the format leaves open is
decided so:

- ``sigma_dx`` (``sigma_x``, ...) is the standard deviation of ``dx`` of that row; where it is empty or
  missing, that of the ``# sigma_position`` or ``# sigma_rotation`` line holds.
- ``a b c`` are a rotation vector, never longer than pi. Euler angles are refused unless declared:
  ``# orientation: KUKA ABC`` converts columns A B C (or a b c), R = Rz(A) Ry(B) Rx(C), to the rotation
  vector, and so do ``Euler ZYZ``, ``fixed XYZ`` and the like; ``# orientation: rotation vector`` says that
  columns A B C (or a b c) are one.
- Orientations may be quaternions or matrices instead (`measure.orientation`).
- ``q2_link`` is the reading of an encoder behind the gear of q2, ``tau_q2`` the measured torque (or force) of
  its drive; empty cells are unmeasured.
- Semicolons or tabs separate where the header has these and no comma; decimal commas only after
  ``# decimal: comma``, since 1,234 may be either.
- An empty cell of a wrench or joint variable is an error; of ``step``, ``t``, ``temperature`` unknown; of
  ``point`` or ``load_point`` the TCP. A pose id is a whole number or any label; labels are numbered as they
  appear.
- Lines that begin with ``#`` after the header are comments; empty lines are skipped.
"""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.measure.arrays import Integers
from beamstiff.measure.camera import corner_noise, robot_poses
from beamstiff.measure.columns import NODES, READINGS, RESERVED, Column, kind_of, read_header, to_si
from beamstiff.measure.foreign_tables import refuse_foreign
from beamstiff.measure.instrument_cells import read_instruments
from beamstiff.measure.instruments import COLUMNS
from beamstiff.measure.orientation import EulerAngles, Orientation, named_orientation, with_rotation_vectors
from beamstiff.measure.table import MEASURED, WRENCH, Kind, Measurements, Names, make_measurements
from beamstiff.measure.text import CHOICES, RawTable, RowError, choice, decimal_comma, numbers, split_table
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike, as_robot
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.units import MOST_TURN, quantity, unit_factor

LARGEST = 1 << 30  # bytes; a table of some five million states
SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".ods")
LARGEST_VALUE = 1e100  # SI, of any column: its square, over the least sigma's, is a number still
LEAST_SIGMA = 1e-12  # m or rad; below the resolution of anything
SAME_POSE = 1e-2  # rad or m: readings of one configuration differ by far less, two configurations by more

_WHOLE = re.compile(r"([+-]?\d{1,15})(?:\.0*)?", re.ASCII)
_NO_LABEL = re.compile(r"|[+-]?(?:[\d.,]+(?:e[+-]?\d+)?|nan|inf|infinity)", re.ASCII | re.IGNORECASE)


def read_measurements(path: str | Path, robot: RobotLike, *, require_measured: bool = True) -> Measurements:
    """Read a CSV table of measurements.

    Parameters
    ----------
    path : path of the file
    robot : Robot, path, or name of a bundled robot
        Names the actuated variables and the nodes.
    require_measured : bool
        Whether a table without a single measured value is an error; a plan or a list of loads has none.

    Returns
    -------
    Measurements
        SI, base frame.

    Raises
    ------
    BeamstiffError
        When the file cannot be read as such a table: ``FILE:LINE: column: found ..., expected ...``.
    """
    if not isinstance(path, str | os.PathLike):
        raise BeamstiffError(f"path: found {shown(path)}, expected the path of a CSV file")
    file, machine = Path(path), as_robot(robot)
    if file.suffix.lower() in SPREADSHEETS:
        raise BeamstiffError(f"{path}: found a spreadsheet, expected CSV: save it as 'CSV UTF-8'")
    return parse_measurements(read_text(file, LARGEST), machine, str(path), require_measured=require_measured)


def parse_measurements(
    text: str, robot: Robot, name: str = "<text>", *, require_measured: bool = True
) -> Measurements:
    r"""Read measurements from the text of a table; otherwise as `read_measurements`.

    >>> from beamstiff.robot.description import Robot
    >>> robot = Robot(
    ...     name="axis",
    ...     variables=[{"name": "q1", "type": "revolute"}],
    ...     nodes=[{"name": "root"}, {"name": "tip"}],
    ...     rigids=[{"name": "link", "nodes": ["root", "tip"]}],
    ...     fixed=["root"],
    ...     tcp="tip",
    ... )
    >>> table = parse_measurements("# sigma_position: 0.03 mm\nq1 [deg],fz,dz [mm]\n90,-500,-1.5\n", robot)
    >>> float(table.displacement[0, 2]), table.sigma_position
    (-0.0015, 3.0e-05)
    """
    raw = split_table(text, name)
    refuse_foreign(raw, robot)
    raw = with_rotation_vectors(raw, [variable.name for variable in robot.variables])
    choices = {key: choice(key, raw) for key in CHOICES}
    turns = _declared_orientation(raw)
    columns = read_header(raw.header, robot, turns is not None, name, raw.header_line)
    kind = kind_of(columns, name, raw.header_line)
    if not raw.cells:
        raw.fail_in_header("", "found a header without rows, expected at least one row of measurements")
    if kind is None and require_measured:
        raw.fail_in_header("", "found no measured column, expected dx dy dz rx ry rz or x y z a b c")
    kind = kind or "displacement"
    _check_choices(choices, kind, raw)
    if isinstance(turns, EulerAngles):
        _check_angles(columns, raw)

    cells = dict(zip((column.name for column in columns), zip(*raw.cells, strict=True), strict=True))
    actuated = [variable.name for variable in robot.actuated]
    values = _values(columns, actuated, cells, raw, choices["decimal"] == "comma")

    def stack(names: Sequence[str], default: float) -> Array:
        columns = [values.get(name, np.full(len(raw.cells), default)) for name in names]
        return np.stack(columns, axis=1) if columns else np.zeros((len(raw.cells), 0))

    reserved = {*RESERVED, "base", *(one.name for one in robot.nodes), *(one.name for one in robot.frames)}
    reserved |= {one.name for one in robot.variables}
    read = read_instruments(
        cells,
        values,
        stack(MEASURED[kind], np.nan),
        stack([f"sigma_{column}" for column in MEASURED[kind]], np.nan),
        kind == "absolute",
        reserved,
        raw,
    )
    measured = read.measured
    if require_measured and np.isnan(measured).all():
        raw.fail_in_row(
            0,
            "",
            f"found no measured value from here on, expected some: fill in {' '.join(MEASURED[kind][:3])}"
            f"{f' or {READINGS[kind]}' if 'instrument' in cells else ''}",
        )
    if kind == "absolute":
        measured[:, 3:] = _orientation(measured[:, 3:], turns, raw)
    sigmas = [_sigma("sigma_position", "length", raw), _sigma("sigma_rotation", "angle", raw)]
    tracked: dict[str, Any] = {"position": measured[:, :3], "rotation": measured[:, 3:], "sigma": read.sigma}
    if camera := choices["camera"]:
        tracked = _of_camera(measured, read.sigma, sigmas, camera, raw)
    tracked = tracked if kind == "absolute" else {"displacement": measured, "sigma": read.sigma}
    q = stack(actuated, 0.0)
    nodes = {column: _nodes(column, cells[column], robot, raw) for column in NODES if column in cells}
    return make_measurements(
        actuated,
        q,
        tcp=robot.tcp,
        wrench=stack(WRENCH, 0.0),
        sigma_position=sigmas[0],
        sigma_rotation=sigmas[1],
        sigma_load=_sigma("sigma_load", "force", raw),
        point=nodes.get("point"),
        load_point=nodes.get("load_point"),
        pose=_poses(cells["pose"], q, actuated, raw) if "pose" in cells else None,
        step=values.get("step"),
        time=values.get("t"),
        temperature=values.get("temperature"),
        link=stack([f"{name}_link" for name in actuated], np.nan),
        torque=stack([f"tau_{name}" for name in actuated], np.nan),
        target=read.target,
        targets=read.targets,
        rows=raw.lines,
        shared_unloaded=choices["unloaded_reading"] == "shared",
        continuous=choices["history"] == "continuous",
        metadata={key: value for key, (value, _) in raw.metadata.items()},
        source=name,
        units={one.name: one.unit for one in columns if one.name in (*actuated, "t") and one.unit},
        camera=camera or "",
        **({"direction": read.direction} | tracked),
    )


def _values(
    columns: Sequence[Column],
    actuated: Sequence[str],
    cells: Mapping[str, Sequence[str]],
    raw: RawTable,
    comma: bool,
) -> dict[str, Array]:
    """Return the numeric columns in SI; of several bad cells the uppermost is told."""
    values: dict[str, Array] = {}
    bad: list[tuple[int, int, str]] = []
    for at, column in enumerate(columns):
        if column.name in ("pose", "remark", *NODES, *COLUMNS):
            continue
        may_be_empty = column.name not in actuated and column.name not in WRENCH
        try:
            read = numbers(cells[column.name], may_be_empty=may_be_empty, decimal_comma=comma)
            values[column.name] = to_si(read, column)
            _check_range(column, values[column.name], cells[column.name])
        except RowError as error:
            bad.append((error.row, at, str(error)))
    if bad:
        row, at, message = min(bad)
        column = columns[at]
        raw.fail_in_row(
            row, column.name, message + _unit_hint(column, cells[column.name][row].strip("[]() "))
        )
    return values


def _unit_hint(column: Column, cell: str) -> str:
    """Return where a unit belongs, if that is what the cell of a number holds."""
    if not column.quantity:
        return ""
    try:
        unit_factor(cell, column.quantity)
    except BeamstiffError:
        return ""
    return f": units stand in the header, {column.name} [{cell}], not in a row of their own"


def _check_range(column: Column, values: Array, cells: Sequence[str]) -> None:
    """Refuse what no column of this name can hold."""
    if column.name.startswith("sigma_"):
        wrong, expected = values <= 0, "a positive finite standard deviation"
    elif column.name == "step":
        wrong, expected = values != np.round(values), "a whole number"
        wrong = wrong & ~np.isnan(values)
    elif column.name == "temperature":
        wrong, expected = values < -273.15, "a temperature above absolute zero"
    elif column.quantity == "angle":
        wrong, expected = np.abs(values) > MOST_TURN, f"an angle of at most {MOST_TURN:g} rad"
    else:
        wrong, expected = np.isinf(values), "a number that is finite in SI"
    wrong = wrong | np.isinf(values)
    if not wrong.any():  # products of matrices overflow without a word
        wrong, expected = (
            np.abs(values) > LARGEST_VALUE,
            f"at most {LARGEST_VALUE:g} in SI: numbers out of range",
        )
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise RowError(row, f"found {shown(cells[row].strip())}, expected {expected}")


def _check_choices(choices: Mapping[str, str | None], kind: Kind, raw: RawTable) -> None:
    """Refuse declarations that contradict the table."""
    decimal_comma(raw)
    if choices["camera"] and kind != "absolute":
        raw.fail_in_metadata("camera", "found in a table of displacements, expected the poses of a tag")
    if choices["unloaded_reading"] == "shared" and kind == "absolute":
        raw.fail_in_metadata(
            "unloaded_reading",
            "found shared in a table of absolute positions, expected a table of differences",
        )


def _of_camera(
    measured: Array, sigma: Array, table: Sequence[float | None], camera: str, raw: RawTable
) -> dict[str, Array]:
    """Return the columns of rows that a camera read: poses (N, 6) of a tag in its frame."""
    if np.isnan(measured).any():
        row = int(np.argmax(np.isnan(measured).any(axis=1)))
        raw.fail_in_row(row, "x", "found no pose of the tag, expected x y z and an orientation: # camera")
    if (measured[:, 2] <= 0).any():
        row = int(np.argmax(measured[:, 2] <= 0))
        raw.fail_in_row(row, "z", "found a tag behind the camera, expected z along its view, positive")
    sigma = np.where(np.isnan(sigma), np.repeat([np.nan if one is None else one for one in table], 3), sigma)
    kinds = {"pixel_noise": "number", "focal_length": "number", "tag_size": "length"}
    noise, focal, size = (_sigma(key, kind, raw) for key, kind in kinds.items())
    if noise and focal and size:
        corners = corner_noise(measured[:, :3], measured[:, 3:], noise, focal, size)
        sigma = np.where(np.isnan(sigma), corners, sigma)
    elif noise or focal or size:
        key = next(key for key in kinds if key in raw.metadata)
        raw.fail_in_metadata(key, f"expected all of {' '.join(kinds)}, or none")
    return robot_poses(measured[:, :3], measured[:, 3:], sigma, camera)


def _declared_orientation(raw: RawTable) -> Orientation | None:
    if "orientation" not in raw.metadata:
        return None
    try:
        return named_orientation(raw.metadata["orientation"][0])
    except BeamstiffError as error:
        raw.fail_in_metadata("orientation", str(error))


def _check_angles(columns: Sequence[Column], raw: RawTable) -> None:
    said = shown(raw.metadata["orientation"][0])
    names = [column.name for column in columns]
    if "a" not in names:
        raw.fail_in_metadata("orientation", f"found {said}, expected columns A B C beside x y z")
    if any(f"sigma_{name}" in names for name in "abc"):
        raw.fail_in_metadata(
            "orientation", f"found {said} with sigma_a, sigma_b or sigma_c, expected '# sigma_rotation'"
        )


def _sigma(key: str, kind: str, raw: RawTable) -> float | None:
    if key not in raw.metadata:
        return None
    value = raw.metadata[key][0]
    try:
        sigma = quantity(value, kind)
    except BeamstiffError as error:
        raw.fail_in_metadata(key, str(error))
    if sigma < LEAST_SIGMA:
        raw.fail_in_metadata(
            key, f"found {shown(value)}, expected a positive number, at least {LEAST_SIGMA:g}"
        )
    return sigma


def _orientation(angles: Array, turns: Orientation | None, raw: RawTable) -> Array:
    """Return rotation vectors of the columns a b c."""
    partly = np.isnan(angles).any(axis=1) & ~np.isnan(angles).all(axis=1)
    if partly.any():
        row = int(np.flatnonzero(partly)[0])
        raw.fail_in_row(row, "a b c", "found some of the three empty, expected all or none")
    if isinstance(turns, EulerAngles):
        known = ~np.isnan(angles).any(axis=1)
        result = angles.copy()
        result[known] = vector_from_rotation(turns.rotations(angles[known]))
        return result
    length = np.linalg.norm(angles, axis=1)
    if turns is None and (length > np.pi * (1 + 1e-9)).any():
        row = int(np.flatnonzero(length > np.pi * (1 + 1e-9))[0])
        raw.fail_in_row(
            row,
            "a b c",
            f"found a rotation vector of {np.rad2deg(length[row]):.0f} deg, expected at most 180 deg; Euler "
            "angles need '# orientation: KUKA ABC' (or fixed XYZ ...) before the header, degrees a [deg]",
        )
    return angles


def _poses(cells: Sequence[str], q: Array, actuated: Sequence[str], raw: RawTable) -> Integers:
    """Return the pose ids, once it is sure that rows of one id have one configuration."""
    labels: dict[str, int] = {}
    whole = True
    for label in dict.fromkeys(cells):  # distinct cells only: there are far fewer than rows
        text = label.strip()
        number = _WHOLE.fullmatch(text)
        if number is None and (_NO_LABEL.fullmatch(text) or len(text) > 200 or not text.isprintable()):
            row = cells.index(label)
            raw.fail_in_row(row, "pose", f"found {shown(text)}, expected a whole number or a label")
        whole &= number is not None
        labels[label] = int(number[1]) if number else -1
    if not whole:
        names = dict.fromkeys(label.strip() for label in labels)
        order = {name: at for at, name in enumerate(names)}
        labels = {label: order[label.strip()] for label in labels}
    pose = np.fromiter((labels[cell] for cell in cells), dtype=np.int64, count=len(cells))
    _, first, group = np.unique(pose, return_index=True, return_inverse=True)
    away = np.abs(q - q[first[group]])
    if (away > SAME_POSE).any():
        row, at = (int(i) for i in np.argwhere(away > SAME_POSE)[0])
        other = first[group[row]]
        raw.fail_in_row(
            row,
            "pose",
            f"found {actuated[at]} = {q[row, at]:.6g} in pose {cells[row].strip()}, expected "
            f"{q[other, at]:.6g} as in line {raw.lines[other]}: one id stands for one configuration",
        )
    return pose


def _nodes(name: str, cells: Sequence[str], robot: Robot, raw: RawTable) -> Names:
    known = dict.fromkeys(node.name for node in robot.nodes)
    nodes: dict[str, str] = {}
    for cell in dict.fromkeys(cells):
        node = cell.strip() or robot.tcp
        if node not in known:
            added = "or add it: in a URDF a link on a fixed joint, in YAML a node and a rigid"
            moving = {name for joint in robot.joints for name in joint.nodes} | {*robot.fixed}
            first = sorted(known, key=moving.__contains__)  # a reflector is at none of these
            hint = suggest(node, known) or f", expected one of {listed(first)}; {added}"
            row = cells.index(cell)
            raw.fail_in_row(row, name, f"found {shown(node)}, which is no node of robot {robot.name!r}{hint}")
        nodes[cell] = node
    return np.array([nodes[cell] for cell in cells], dtype=np.str_)
