"""The columns of a measurement table: their names, their units, and which of them a robot has."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NoReturn

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.measure import instruments
from beamstiff.measure.table import ABSOLUTE, DISPLACEMENT, MEASURED, WRENCH, Kind
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Variable
from beamstiff.se3 import Array
from beamstiff.units import scaled, unit_factor

# kind of quantity of every column that is no joint variable
QUANTITIES: dict[str, str] = {
    **dict.fromkeys(WRENCH[:3], "force"),
    **dict.fromkeys(WRENCH[3:], "moment"),
    **dict.fromkeys((*DISPLACEMENT[:3], *ABSOLUTE[:3]), "length"),
    **dict.fromkeys((*DISPLACEMENT[3:], *ABSOLUTE[3:]), "angle"),
    "t": "time",
    "temperature": "temperature",
}
QUANTITIES |= instruments.QUANTITIES
QUANTITIES |= {f"sigma_{name}": QUANTITIES[name] for name in (*DISPLACEMENT, *ABSOLUTE)}
NODES = ("point", "load_point")
READINGS: dict[Kind, str] = {"displacement": "dreading", "absolute": "reading"}
LABELS = (
    "pose",
    "step",
    *NODES,
    *instruments.COLUMNS,
    "remark",
)  # a remark is for people: nothing is made of it
RESERVED = (*QUANTITIES, *LABELS)

ALIASES = {"time": "t", "timestamp": "t"}  # read as these columns, in capitals too
# what other programs call our columns
_SYNONYMS = {
    "temp": "temperature",
    "node": "point",
    "comment": "remark",
    "note": "remark",
    "remarks": "remark",
    "configuration": "pose",
    "config": "pose",
    "u": "dx",
    "v": "dy",
    "w": "dz",
}
KUKA_HINT = (
    "Euler angles of a KUKA A B C table are not rotation vectors: declare '# orientation: KUKA ABC' "
    "before the header to have them converted, or '# orientation: rotation vector' if that is what they are"
)
_BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*\Z")
_CELL = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")

Wrong = Callable[[str, str], NoReturn]  # raises the error of a column


@dataclass(frozen=True)
class Column:
    """A column of a file: its name, quantity ("" for labels) and unit."""

    name: str
    quantity: str
    unit: str


def fail(source: str, line: int, column: str, message: str) -> NoReturn:
    """Raise the error of a place in a file."""
    raise BeamstiffError(f"{source}:{line}: {column}: {message}" if column else f"{source}:{line}: {message}")


def read_header(
    cells: Sequence[str], robot: Robot, turns_declared: bool, source: str, line: int
) -> list[Column]:
    """Return the columns of cells such as ``q1 [deg]``; `turns_declared`: what A, B, C mean is said above."""
    declared = {variable.name: variable for variable in robot.variables}
    wrong = partial(fail, source, line)
    columns: list[Column] = []
    actuated = [variable.name for variable in robot.actuated]
    given = [cell.partition("[")[0].strip() for cell in cells]
    missing = [name for name in actuated if name not in given]
    for at, cell in enumerate(cells, start=1):
        name, unit = name_and_unit(cell, at, wrong)
        column = _read_cell(name, unit, declared, robot, turns_declared, missing, wrong)
        for place, other in enumerate(columns, start=1):
            if other.name == column.name:
                wrong(column.name, f"found twice, in columns {place} and {at}, expected once")
        columns.append(column)
    if missing:
        every = listed(actuated, 12)
        wrong(missing[0], f"this column is missing, expected one for each actuated variable ({every})")
    return columns


def name_and_unit(cell: str, at: int, wrong: Wrong) -> tuple[str, str | None]:
    """Return the two parts of a header cell, `at` counted from 1; None where no unit is stated."""
    match = _CELL.fullmatch(cell)
    if match is None or not match["name"]:
        wrong(f"column {at}", f"found {shown(cell)}, expected a name and its unit, like dx [mm]")
    return match["name"], match["unit"]


def bare_name(cell: str) -> str:
    """Return the name of a header cell without its unit in brackets.

    >>> bare_name("J1 [deg]"), bare_name("X (mm)"), bare_name("t")
    ('J1', 'X', 't')
    """
    return _BRACKETED.sub("", cell).strip() or cell


def unit_in(cell: str) -> str | None:
    """Return what stands in brackets behind the name of a header cell; None where nothing does.

    >>> unit_in("J1 [deg]"), unit_in("X (mm)"), unit_in("t")
    ('deg', 'mm', None)
    """
    match = _BRACKETED.search(cell)
    return match[1] if match else None


def unit_fault(unit: str, kinds: Sequence[str]) -> str:
    """Return why a unit is of none of these kinds of quantity; empty where it is of one."""
    fault = ""
    for kind in kinds:
        try:
            unit_factor(unit, kind)
        except BeamstiffError as error:
            fault = str(error)
        else:
            return ""
    return fault


def _read_cell(
    name: str,
    unit: str | None,
    declared: dict[str, Variable],
    robot: Robot,
    turns_declared: bool,
    missing: Sequence[str],
    wrong: Wrong,
) -> Column:
    if name in declared:
        variable = declared[name]
        if variable.passive:
            wrong(name, "this variable is passive, solved by loop closure: leave the column out")
        if not variable.actuated:
            wrong(name, f"this variable follows others (= {variable.equals}): leave the column out")
        return Column(name, variable.kind, _unit(variable.kind, unit, name, wrong))
    behind = name.removesuffix("_link") if name.endswith("_link") else name.removeprefix("tau_")
    if behind != name and behind in declared and declared[behind].actuated:
        kind = declared[behind].kind
        if name.startswith("tau_"):
            kind = "force" if kind == "length" else "moment"
        return Column(name, kind, _unit(kind, unit, name, wrong))
    if name in ("A", "B", "C"):
        if not turns_declared:
            wrong(name, KUKA_HINT)
        name = name.lower()
    name = ALIASES.get(name.lower(), name)
    if name in LABELS:
        if unit is not None and unit.strip() not in ("-", "1"):
            wrong(name, f"found the unit {shown(unit)}, expected none")
        return Column(name, "", "")
    if name not in QUANTITIES:
        _unknown(name, robot, missing, wrong)
    return Column(name, QUANTITIES[name], _unit(QUANTITIES[name], unit, name, wrong))


def _unit(quantity: str, unit: str | None, name: str, wrong: Wrong) -> str:
    if unit is not None:
        try:
            unit_factor(unit, quantity)
        except BeamstiffError as error:
            wrong(name, str(error))
    return unit or ""


def _unknown(name: str, robot: Robot, missing: Sequence[str], wrong: Wrong) -> NoReturn:
    known = [*(variable.name for variable in robot.actuated), *RESERVED]
    bare = re.split(r"[\s(/_]", name.strip())[0]
    if re.fullmatch(r"[-+.\d\s]+([eE][-+]?\d+)?", name):
        wrong("", f"found {shown(name)}, expected a line with the names of the columns before the numbers")
    if ";" in name or "\t" in name:
        wrong("", f"found {shown(name)} as one column, expected one separator throughout, a comma")
    if hint := unit_outside(name, robot):
        wrong(shown(name), f"unknown column (did you mean {hint!r}?): a unit stands in square brackets")
    lower = {candidate.lower(): candidate for candidate in known}
    for spelling in (name.lower(), _SYNONYMS.get(name.lower(), ""), bare, bare.lower()):
        if spelling in lower:
            hint = f" (did you mean '{lower[spelling]}'?)"
            break
    else:
        joints = f" (no column is named {listed(missing)}: is this it?)" if missing else ""
        hint = _alike(name, known) or joints
    if hint:
        wrong(shown(name), f"unknown column{hint}; or delete the column")
    variables = [variable.name for variable in robot.actuated]
    moved = f"{listed(variables, 12)}, " if variables else ""
    wrong(
        shown(name),
        f"unknown column, expected one of {moved}fx fy fz mx my mz, dx dy dz rx "
        "ry rz (or x y z a b c), reading (dreading) with instrument, target, direction, length, target_x, "
        "point, load_point, pose, step, t, temperature, a joint's encoder behind "
        "the gear (q1_link), its torque (tau_q1), remark "
        "(for text of your own); delete the column if it is none of these",
    )


def unit_outside(name: str, robot: Robot) -> str:
    """Return a column with its unit in brackets of a name that ends in it: x_mm, x (mm); else nothing."""
    match = re.fullmatch(r"(\w+?)[\s_]*[(_\s]\s*([A-Za-zµ°*/]+)\s*\)?", name.strip())
    kinds = QUANTITIES | {variable.name: variable.kind for variable in robot.actuated}
    if match is None or match[1] not in kinds:
        return ""
    try:
        unit_factor(match[2], kinds[match[1]])
    except BeamstiffError:
        return ""
    return f"{match[1]} [{match[2]}]"


def _alike(name: str, known: Sequence[str]) -> str:
    """Return a hint at what is meant: of a joint's name, such as A1, only at a joint."""
    if not re.search(r"[0-9]\Z", name):
        return suggest(name, known)
    joints = [one for one in known if one not in RESERVED]
    own = name.casefold()
    ends = [one for one in joints if one.casefold().endswith(own) or own.endswith(one.casefold())]
    return f" (did you mean '{ends[0]}'?)" if len(ends) == 1 else suggest(name, joints)


def kind_of(columns: Sequence[Column], source: str, line: int) -> Kind | None:
    """Return the kind of measurement that the columns hold, or None where they hold none."""
    names, wrong = [column.name for column in columns], partial(fail, source, line)
    found: dict[Kind, list[str]] = {
        kind: [name for name in names if name.removeprefix("sigma_") in (*MEASURED[kind], READINGS[kind])]
        for kind in MEASURED
    }
    if "instrument" in names and not found["displacement"]:
        found["absolute"].append("instrument")  # a socket reads no number
    if found["displacement"] and found["absolute"]:
        wrong(
            found["absolute"][0],
            f"found beside {found['displacement'][0]}, expected displacements (dx dy dz rx ry rz, "
            "dreading) or absolute positions (x y z a b c, reading), not both in one table",
        )
    for name in names:
        if name.startswith("sigma_") and name.removeprefix("sigma_") not in names and name != "sigma_reading":
            wrong(name, f"found without the column {name.removeprefix('sigma_')}")
    turned = [name for name in ABSOLUTE[3:] if name in names]
    if turned and len(turned) < 3:
        wrong(turned[0], f"found only {listed(turned)}, expected all of a b c (a rotation vector)")
    return next((kind for kind, some in found.items() if some), None)


def to_si(values: Array, column: Column) -> Array:
    """Return the values of a column in SI; a column without a unit is in SI already (temperature in degC)."""
    if not column.unit:
        return values
    with np.errstate(over="ignore"):
        return np.asarray(scaled(values, *unit_factor(column.unit, column.quantity)))
