"""Tables whose columns are not ours: those of another robot, and exports of other programs."""

import json
import re
from collections.abc import Sequence
from shlex import quote

from beamstiff.errors import listed, shown
from beamstiff.measure.columns import (
    ALIASES,
    LABELS,
    QUANTITIES,
    READINGS,
    bare_name,
    fail,
    unit_fault,
    unit_in,
    unit_outside,
)
from beamstiff.measure.profile_cells import clock_times
from beamstiff.measure.profile_headers import with_row_of_units
from beamstiff.measure.profiles import JOINTS, POSITION, QUATERNION
from beamstiff.measure.table import MEASURED
from beamstiff.measure.text import SEPARATORS, RawTable
from beamstiff.robot.description import Robot
from beamstiff.robot.dh_tables import KINDS
from beamstiff.units import UNITS

# words that other programs name such columns with
_POINT = {"point", "name", "target", "reflector", "marker", "prism", "smr"}
_POSE = {"pose", "posture", "pos", "position", "no", "nr", "id", "frame"}
_LOAD = {"load", "weight", "mass", "payload", "kg", "fz", "last", "gewicht", "masse"}
_TIME = {"time", "timestamp", "zeit"}
_JOINT = re.compile(r"(?:j|a|q|axis|achse|joint|gelenk)[ _.]?([1-9][0-9]?)")
_EXTERNAL = re.compile(r"e[1-6]")  # axes, as controllers call them
_FORCE = re.compile(r"(?:f|force|kraft)[ _.]?([xyz])")
_AXIS = re.compile(r"[pt]?([xyz])")
_DISPLACED = re.compile(r"(?:d|delta)[ _.]?([xyz])")
_UNIT_BEHIND = re.compile(
    r"(.+?)[ _.](deg|rad|mm|um|m|n|kn|kg|s|ms)", re.IGNORECASE
)  # of a name: j1_deg, Fx_N
_IN_CAPITALS = {"n": "N", "kn": "kN"}  # units
_PLAIN = re.compile(r"[A-Za-z][\w.]*")
MOST_POINTS = 12  # names that a column of reflectors has; more are names of postures


def refuse_foreign(raw: RawTable, robot: Robot) -> None:
    """Refuse a table of another robot, and an export whose columns only a profile can name."""
    names = [cell.partition("[")[0].strip() for cell in raw.header]
    unknown = [name for name in names if not _ours(name, robot)]
    if len(unknown) < 2 or any(re.match(r"[-+.\d]|\Z", name) or re.search("[;\t]", name) for name in unknown):
        return  # a table without a header, or with two separators
    joints = [variable.name for variable in robot.actuated]
    measured = any(name in (*MEASURED[kind][:3], READINGS[kind]) for kind in MEASURED for name in names)
    if measured and all(re.search(r"\d\Z", name) for name in unknown):
        if joints and not {*names} & {*joints} and len(unknown) != len(joints):
            raw.fail_in_header(
                "",
                f"found the joints {listed(unknown, 6)} and none of robot {robot.name!r}, expected "
                f"{listed(joints, 6)}: the table is of another robot",
            )
        return  # of as many joints by other names
    seen = raw.separator, joints, raw.cells, [node.name for node in robot.nodes]
    foreign = not measured and (raw.separator != "," or bool(guessed_profile(raw.header, *seen)))
    if foreign or 2 * len(unknown) > len(names):
        raw.fail_in_header("", profile_hint(raw.header, raw.source, *seen))


def refuse_points(text: str, source: str) -> None:
    """Refuse a list of points where a robot is read, in CSV: a table of frames names other columns."""
    lines = ((at, line) for at, line in enumerate(text.splitlines(), start=1) if line.strip(" \t,;"))
    for at, line in lines:
        if line.lstrip().startswith("#"):
            continue
        separator = next((mark for mark in ";\t" if mark in line), ",")
        rows = (line, *(row for _, row in lines))
        header, *cells = ([cell.strip(' \t"') for cell in row.split(separator)] for row in rows)
        names = {bare_name(cell) for cell in header}
        if not names & {*KINDS} and guessed_profile(header, separator, (), cells):
            if names >= {*POSITION}:
                fail(source, at, "", "found a table of measurements, expected a robot")
            fail(source, at, "", profile_hint(header, source, separator, (), cells))
        return


def profile_hint(
    header: Sequence[str],
    file: str,
    separator: str,
    joints: Sequence[str] = (),
    cells: Sequence[Sequence[str]] = (),
    nodes: Sequence[str] = (),
) -> str:
    """Return that a header is that of another program's export, and the profile that would read it.

    `joints`, `nodes`: variables and nodes of the robot, where it is known; else they are called q1, q2, ...
    """
    found = f"unknown columns {listed([shown(name) for name in header], 3)}: an export of a controller? "
    call = f"`beamstiff convert {quote(file)} --profile profile.yaml --out data.csv` reads it (docs/files.md)"
    guess = guessed_profile(header, separator, joints, cells, nodes)
    if not guess:
        return f"{found}{call}; the profile says which columns hold which values, and their units"
    asked = {
        "NODE_": "NODE_... are the nodes at the reflectors",
        "point: NODE": "NODE is the node at the reflector",
        "NOISE": "NOISE is what the instrument reads to, such as 0.02; of a displacement 1.4 times that",
        "UNIT": "UNIT is that of the column",
        "fz: ": "add load_point: NODE where loads act elsewhere than at the TCP",
    }
    said = [what for mark, what in asked.items() if mark in guess]
    said += [] if joints or "q1: " not in guess else ["q1, q2, ... are the joints of the robot file"]
    return f"{found}{call}, with this in profile.yaml, once it is checked ({'; '.join(said)}): {guess}"


def guessed_profile(
    header: Sequence[str],
    separator: str,
    joints: Sequence[str] = (),
    cells: Sequence[Sequence[str]] = (),
    nodes: Sequence[str] = (),
) -> str:
    """Return a profile, YAML in one line, of the columns that can be guessed; empty without positions.

    >>> guessed_profile(["P", "X [mm]", "Y [mm]", "Z [mm]"], ";")  # doctest: +ELLIPSIS
    '{separator: semicolon, columns: {x: "X [mm]", y: ...}, units: {length: mm}, point: NODE, sigma_...}'
    """
    with_units, has_units = with_row_of_units(header, cells)
    cells = cells[has_units:]
    names, behind = zip(*map(_name_and_unit, with_units), strict=True)
    forces = {match[1] for name in names if (match := _FORCE.fullmatch(name.casefold()))}
    at, points = _reflectors(names, cells, nodes)
    columns: dict[str, str] = {}
    units: dict[str, str] = {}
    for place, (cell, name, unit) in enumerate(zip(header, names, behind, strict=True)):
        key, kind = ("point", "") if place == at else _guessed(name, joints)
        if key == "fz" and "z" in forces and not _FORCE.fullmatch(name.casefold()):
            continue  # a mass beside the force
        if key and key not in columns:
            columns[key] = cell
            if kind == JOINTS and unit and unit_fault(unit, ("angle",)):
                kind = key  # one that slides among others that turn
            if kind == "time" and clock_times([row[place] for row in cells if place < len(row)]) is not None:
                unit = "s"
            if kind:
                units.setdefault(kind, unit if unit and not unit_fault(unit, _kinds(kind)) else "UNIT")
    absolute = {*POSITION} <= {*columns}
    if not absolute and not {*MEASURED["displacement"][:3]} <= {*columns}:
        return ""
    comma = separator != "," and any(re.fullmatch(r"[+-]?\d+,\d+", cell) for row in cells[:9] for cell in row)
    parts = [
        f"separator: {SEPARATORS[separator]}" if separator != "," else "",
        "decimal: comma" if comma else "",
        f"columns: {{{', '.join(f'{key}: {_quoted(cell)}' for key, cell in columns.items())}}}",
        f"units: {{{', '.join(f'{key}: {_quoted(unit)}' for key, unit in units.items())}}}",
        f"points: {{{', '.join(points)}}}" if points else "point: NODE" if absolute else "",
        "sigma_position: NOISE mm",
        "sigma_rotation: NOISE mrad" if {*QUATERNION} <= {*columns} else "",
    ]
    return f"{{{', '.join(filter(None, parts))}}}"


def _reflectors(
    names: Sequence[str], cells: Sequence[Sequence[str]], known: Sequence[str]
) -> tuple[int | None, list[str]]:
    """Return the column of text with few different values and its entries of `points`; None without one.

    One that is called like a point comes first, one that is called like a pose is none.
    """
    found: dict[int, list[str]] = {}
    for at, name in enumerate(names):
        texts = [row[at] for row in cells if at < len(row)]
        values = sorted({*texts})
        words = {*re.split(r"[\W_]+", name.casefold())}
        named = bool(words & _POINT)
        few = 2 - named <= len(values) <= min(MOST_POINTS, len(texts) // 2)
        if few and all(re.match(r"[^\W\d]", value) for value in values) and not words & _POSE:
            nodes = [value if value in known else re.sub(r"\W", "_", f"NODE_{value}") for value in values]
            found[at] = [f"{_quoted(value)}: {node}" for value, node in zip(values, nodes, strict=True)]
            if named:
                return at, found[at]
    return next(iter(found.items()), (None, []))


def _name_and_unit(cell: str) -> tuple[str, str | None]:
    """Return the name of a header cell, and its unit, which stands in brackets or behind it."""
    name, unit = bare_name(cell), unit_in(cell)
    if unit is None and (match := _UNIT_BEHIND.fullmatch(name)):
        name, unit = match[1], match[2].lower()
    return name, _IN_CAPITALS.get(unit, unit) if unit else None


def _guessed(name: str, joints: Sequence[str]) -> tuple[str, str]:
    """Return our column of a name, and the key of its unit; empty where it cannot be guessed."""
    plain = name.casefold().strip()
    words = re.split(r"[\W_]+", plain)
    if named := [joint for joint in joints if joint.casefold() == plain]:
        return named[0], JOINTS
    if _EXTERNAL.fullmatch(plain) and not joints:
        return name.strip(), JOINTS
    if match := _JOINT.fullmatch(plain):
        at = int(match[1]) - 1
        return (joints[at] if at < len(joints) else "" if joints else f"q{at + 1}"), JOINTS
    if match := _FORCE.fullmatch(plain):
        return f"f{match[1]}", "force"
    if match := _DISPLACED.fullmatch(plain):
        return f"d{match[1]}", "length"
    if plain in QUATERNION:
        return plain, ""
    if len(axes := [match[1] for word in words if (match := _AXIS.fullmatch(word))]) == 1:
        return axes[0], "length"
    if _TIME & {*words}:
        return "t", "time"
    if _LOAD & {*words}:
        return "fz", "fz"
    return ("pose", "") if (_POSE | _POINT) & {*words} else ("", "")


def _kinds(key: str) -> tuple[str, ...]:
    return {"fz": ("mass", "force")}.get(key, (key,) if key in UNITS else ("angle", "length"))


def _quoted(text: str) -> str:
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def _ours(name: str, robot: Robot) -> bool:
    """Return whether a name is that of a column, or one that is told how it is to be written."""
    declared = {variable.name for variable in robot.variables}
    behind = name.removesuffix("_link").removeprefix("tau_")
    known = name in declared or behind in declared or name in ("A", "B", "C", *QUATERNION)
    return (
        known or ALIASES.get(name.lower(), name) in (*LABELS, *QUANTITIES) or bool(unit_outside(name, robot))
    )
