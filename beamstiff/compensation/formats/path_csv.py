"""Path tables (CSV): columns x y z and an orientation, units in the header, SI otherwise.

Orientation, one of: ``a b c``, a rotation vector unless ``# orientation: KUKA ABC`` (or ``Euler ZYX``,
``fixed XYZ``, ...) before the header says otherwise, which those in degrees need; ``qw qx qy qz``; ``i j k``,
the tool axis from tip to holder. Loads ``fx fy fz mx my mz`` act on the tool at its tip, in the base frame of
the robot. ``name`` names a target. Other columns of numbers are kept for the process (depth of cut, ...).

Without any of x y z the targets are joint values: a column for each joint, in the order of the robot file.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.compensation.editing import NUMBER, Slot, lines, proper
from beamstiff.compensation.formats.program import Place, Program, make_program
from beamstiff.compensation.path import ToolPath
from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import Orientation, Quaternion, RotationVector, ToolAxis, named_orientation
from beamstiff.measure.table import WRENCH
from beamstiff.se3 import Array
from beamstiff.units import UNITS, unit_factor

POSITION, ANGLES, QUATERNION, AXIS = (
    ("x", "y", "z"),
    ("a", "b", "c"),
    ("qw", "qx", "qy", "qz"),
    ("i", "j", "k"),
)
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}
# what decimals must show, SI
NEEDED = {"length": 1e-6, "angle": np.radians(1e-4), "number": 1e-7, "joint": 1e-7}
_KIND = {
    **dict.fromkeys(POSITION, "length"),
    **dict.fromkeys(ANGLES, "angle"),
    **dict.fromkeys((*QUATERNION, *AXIS), "number"),
    **dict.fromkeys(WRENCH[:3], "force"),
    **dict.fromkeys(WRENCH[3:], "moment"),
}
LOADS = ("force", "moment")
TURN = 2.0 * np.pi * (1.0 + 1e-6)  # rad; but for rounding
_CELL = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_NUMBER = re.compile(NUMBER)
_QUOTED = re.compile(r'"[^"]*"')


@dataclass(frozen=True)
class _Column:
    name: str
    kind: str | None  # None: whatever the cells hold
    unit: float
    offset: float = 0.0  # of temperatures
    load: bool = False


def read(text: str, source: str) -> Program:
    """Return the targets of a path table; `text` as of `editing.read_bytes`."""
    declared: tuple[str, int] | None = None
    header: list[_Column] | None = None
    separator, header_line = ",", 0
    rows: list[tuple[int, list[tuple[int, str]]]] = []
    for number, at, line in lines(text):
        bare = line.removeprefix("\xef\xbb\xbf") if number == 1 else line
        at += len(line) - len(bare)
        if not bare.strip(' ,;\t"'):
            continue
        if bare.lstrip(' "').startswith("#"):
            key, colon, value = bare.lstrip(' "#').partition(":")
            if colon and key.strip().lower() == "orientation" and header is None:
                declared = value.strip(' \t",;'), number
            continue
        if header is None:
            masked = _QUOTED.sub("", bare)
            separator = next((mark for mark in SEPARATORS if mark in masked), ",")
            header_line = number
            header = _header(_cells(bare, at, separator), source, number)
            continue
        cells = _cells(bare, at, separator)
        if len(cells) != len(header):
            comma = separator == "," and len(cells) > len(header)
            hint = "; write decimal points, not commas" if comma else ""
            said = f"found {len(cells)} cells, expected {len(header)} as in the header{hint}"
            fail(source, number, "", said)
        rows.append((number, cells))
    if header is None or not rows:
        raise BeamstiffError(
            f"{source}: found no row, expected a header with x, y, z (or joints) and a row for each target"
        )
    if not any(column.name in POSITION for column in header):
        return _of_joints(text, source, header, rows)
    orientation, names = _orientation([column.name for column in header], declared, source, header_line)
    program = _program(text, source, header, rows, orientation, names)
    notes = list(_no_loads(header, source))
    turned = not (program.path.poses[:, :3, :3] == np.eye(3)).all()
    if names == ANGLES and declared is None and turned:
        if any(column.name in ANGLES and column.unit != 1.0 for column in header):
            said = (
                "a, b, c in degrees: angles of a controller, or a rotation vector? Say so before the header, "
                "in a line # orientation: KUKA ABC (or Euler ZYX, fixed XYZ, ..., rotation vector)"
            )
            fail(source, header_line, "", said)
        notes.append(
            f"{source}: a, b, c are read as rotation vectors; angles of a controller are declared before the "
            "header: # orientation: KUKA ABC"
        )
    return replace(program, notes=(*program.notes, *notes))


def write(path: ToolPath, made_by: str) -> str:
    """Return a path as a table of its own: mm, rotation vectors in deg, N, N m, other columns in SI."""
    from beamstiff.se3 import vector_from_rotation

    header = ["name", *(f"{axis} [mm]" for axis in POSITION)]
    vectors = np.degrees(vector_from_rotation(path.poses[:, :3, :3]))
    columns = [[f"{1e3 * value:.6f}" for value in path.poses[:, axis, 3]] for axis in range(3)]
    if path.stated:
        header += [f"{name} [deg]" for name in ANGLES]
        columns += [[f"{value:.7f}" for value in vectors[:, axis]] for axis in range(3)]
    if path.wrench is not None:
        header += [*(f"{name} [N]" for name in WRENCH[:3]), *(f"{name} [N*m]" for name in WRENCH[3:])]
        columns += [[f"{value:.6g}" for value in path.wrench[:, axis]] for axis in range(6)]
    for name, values in path.columns.items():
        header.append(name)
        columns.append([f"{value:.9g}" for value in values])
    names = [_quoted(name) for name in path.names]
    body = [",".join(row) for row in zip(names, *columns, strict=True)]
    return "\n".join([f"# {made_by}", "# orientation: rotation vector", ",".join(header), *body, ""])


def _quoted(name: str) -> str:
    plain = name.replace('"', "'")
    return f'"{plain}"' if re.search(r'[,;\t#"]', name) else name


def _cells(line: str, at: int, separator: str) -> list[tuple[int, str]]:
    """Return place and text of every cell, without blanks and quotes around it."""
    hidden = _QUOTED.sub(lambda found: "\0" * len(found[0]), line)
    cells, start = [], 0
    for piece in hidden.split(separator):
        cell = line[start : start + len(piece)]
        bare = cell.strip().strip('"').strip()
        cells.append((at + start + (cell.find(bare) if bare else 0), bare))
        start += len(piece) + 1
    return cells


def _header(cells: Sequence[tuple[int, str]], source: str, line: int) -> list[_Column]:
    columns: list[_Column] = []
    for number, cell in enumerate((proper(cell) for _, cell in cells), start=1):
        match = _CELL.fullmatch(cell)
        if match is None or not match["name"] or _NUMBER.fullmatch(cell):
            fail(
                source, line, f"column {number}", f"found {shown(cell)}, expected a name and its unit: x [mm]"
            )
        name = match["name"]
        known = name.lower() if name.lower() in (*_KIND, "name") else name
        if any(column.name == known for column in columns):
            fail(source, line, known, "found twice, expected once")
        columns.append(_column(known, match["unit"], source, line))
    names = [column.name for column in columns]
    for axis in POSITION:
        if axis not in names and set(POSITION) & {*names}:
            hint = suggest(axis, names)
            fail(source, line, axis, f"this column is missing{hint}, found {listed(names)}, expected x, y, z")
    return columns


def _no_loads(header: Sequence[_Column], source: str) -> Iterator[str]:
    others = [column.name for column in header if column.kind is None and column.load]
    if others:
        yield (
            f"{source}: {listed(others)}: kept for the process, no load on the tool; loads are called "
            f"{' '.join(WRENCH)}"
        )


def _column(name: str, unit: str | None, source: str, line: int) -> _Column:
    if name == "name":
        return _Column(name, "name", 1.0)
    kinds = [_KIND[name]] if name in _KIND else list(UNITS)
    if unit is None or unit.strip() in ("", "-", "1"):
        return _Column(name, _KIND.get(name), 1.0)
    problem = ""
    for kind in kinds:
        try:
            factor, offset = unit_factor(unit, kind)
            return _Column(name, _KIND.get(name), factor, offset, load=kind in LOADS)
        except BeamstiffError as error:
            problem = problem or str(error)
    if name in _KIND:
        fail(source, line, name, problem)
    fail(source, line, name, f"unknown unit {shown(unit)}")


def _orientation(
    names: Sequence[str], declared: tuple[str, int] | None, source: str, line: int
) -> tuple[Orientation, tuple[str, ...]]:
    """Return the convention of a table and its columns; none where it holds positions only."""
    angles: Orientation = RotationVector()
    if declared is not None:
        try:
            angles = named_orientation(declared[0])
        except BeamstiffError as error:
            fail(source, declared[1], "orientation", str(error))
    kinds = ((ANGLES, angles), (QUATERNION, Quaternion()), (AXIS, ToolAxis()))
    present = [(columns, kind) for columns, kind in kinds if set(columns) & set(names)]
    if len(present) > 1:
        fail(source, line, present[1][0][0], f"found beside {present[0][0][0]}, expected one orientation")
    if not present:
        return RotationVector(), ()
    columns, kind = present[0]
    if missing := [name for name in columns if name not in names]:
        fail(source, line, missing[0], f"this column is missing, expected all of {' '.join(columns)}")
    return kind, columns


def _program(
    text: str,
    source: str,
    header: Sequence[_Column],
    rows: Sequence[tuple[int, list[tuple[int, str]]]],
    orientation: Orientation,
    turning: tuple[str, ...],
) -> Program:
    at = {column.name: number for number, column in enumerate(header)}
    places: list[Place] = []
    for line, cells in rows:
        slots: dict[str, Slot] = {}
        for name in (*POSITION, *turning):
            column, (start, cell) = header[at[name]], cells[at[name]]
            turned = float(_number(cell, source, line, name)) * column.unit
            if name in ANGLES and abs(turned) > TURN:
                found = f"{proper(cell)}, which is {turned:.3g} rad: more than a turn"
                fail(source, line, name, f"found {found}; angles in degrees have a header {name} [deg]")
            slots[name] = Slot(start, cell, column.unit, _decimals(_KIND[name], column.unit))
        position, rotation = (tuple(slots[name] for name in names) for names in (POSITION, turning))
        known = () if turning else (0.0, 0.0, 0.0)
        places.append(Place(_label(cells, at, len(places)), line, position, rotation, known))
    columns = {}
    for column in header:
        if column.kind is None:
            values = _numbers(column, at[column.name], rows, source, strict=False)
            if values is not None:
                columns[column.name] = values
    return make_program(
        text,
        source,
        places,
        orientation,
        read,
        stated=bool(turning),
        wrench=_wrench(header, at, rows, source),
        columns=columns,
    )


def _of_joints(
    text: str, source: str, header: Sequence[_Column], rows: Sequence[tuple[int, list[tuple[int, str]]]]
) -> Program:
    """Return targets that are written as joint values: whether these are the robot's is not known here."""
    at = {column.name: number for number, column in enumerate(header)}
    joints = [column for column in header if column.name not in ("name", *WRENCH)]
    places: list[Place] = []
    for line, cells in rows:
        slots = []
        for column in joints:
            start, cell = cells[at[column.name]]
            number = _number(cell, source, line, column.name)
            slots.append(Slot(start, number, column.unit, _decimals("joint", column.unit)))
        places.append(Place(_label(cells, at, len(places)), line, joints=tuple(slots)))
    return make_program(
        text,
        source,
        places,
        RotationVector(),
        read,
        wrench=_wrench(header, at, rows, source),
        joint_names=tuple(column.name for column in joints),
    )


def _decimals(kind: str, unit: float) -> int:
    """Return the decimals that a corrected number needs in a unit of the file."""
    return max(0, round(float(-np.log10(NEEDED[kind] / unit)) + 0.49))


def _label(cells: Sequence[tuple[int, str]], at: Mapping[str, int], before: int) -> str:
    """Return the name of a target, after so many others."""
    label = proper(cells[at["name"]][1]) if "name" in at else ""
    return label or f"row {before + 1}"


def _number(cell: str, source: str, line: int, name: str) -> str:
    """Return a cell that is a number."""
    if not _NUMBER.fullmatch(cell) or not np.isfinite(float(cell)):
        hint = "; decimals follow a point" if re.fullmatch(r"[+-]?\d+,\d+", cell) else ""
        fail(source, line, name, f"found {shown(proper(cell))}, expected a number{hint}")
    return cell


def _wrench(
    header: Sequence[_Column],
    at: Mapping[str, int],
    rows: Sequence[tuple[int, list[tuple[int, str]]]],
    source: str,
) -> Array | None:
    """Return the loads that a table states, (N, 6), or None."""
    if not any(name in at for name in WRENCH):
        return None
    wrench = np.zeros((len(rows), 6))
    for number, name in enumerate(WRENCH):
        if name in at:
            values = _numbers(header[at[name]], at[name], rows, source, strict=True)
            wrench[:, number] = 0.0 if values is None else values
    return wrench


def _numbers(
    column: _Column, at: int, rows: Sequence[tuple[int, list[tuple[int, str]]]], source: str, *, strict: bool
) -> Array | None:
    """Return a column in SI; None where a cell is no number, unless that is an error (`strict`)."""
    values = np.zeros(len(rows))
    for row, (line, cells) in enumerate(rows):
        cell = cells[at][1]
        if not _NUMBER.fullmatch(cell) or not np.isfinite(float(cell)):
            if strict:
                fail(source, line, column.name, f"found {shown(proper(cell))}, expected a number")
            return None
        values[row] = float(cell) * column.unit + column.offset
    return values
