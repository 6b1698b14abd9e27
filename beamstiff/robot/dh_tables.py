"""Tables of frames, as papers print them, in: classic DH, modified DH (Craig), Khalil-Kleinfinger.

========================  ==================================================================================
classic                   rot(z, theta) trans(z, d) trans(x, a) rot(x, alpha)
modified                  rot(x, alpha) trans(x, a) rot(z, theta) trans(z, d)
khalil-kleinfinger        rot(z, gamma) trans(z, b) rot(x, alpha) trans(x, d) rot(z, theta) trans(z, r)
========================  ==================================================================================

In CSV the convention stands before the header, which gives every column its unit; a cell holds a number, or
the joint's variable and an offset in the unit of the column, ``q2 - 90``. A column `type` may say it instead:
revolute, prismatic or fixed, its theta (or d, r) then being the offset, its variables q1, q2, ...

.. code-block:: text

    # convention: classic
    name,theta [deg],d [mm],a [mm],alpha [deg],torsional [N*m/rad]
    f1,q1,450,150,90,2e6
    f2,q2 + 90,0,600,0,1e6

Columns ``mass [kg]``, ``cx cy cz`` say what the row's joint moves: a mass, and its centre in the frame that
the row ends in.

In YAML rows are maps of the same names, a quantity each: ``{convention: classic, rows: [{theta: "q1 - 90
deg", a: "600 mm"}]}``.
"""

import csv
import os
import re
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import parse_expression
from beamstiff.robot.fields import reads_as_number
from beamstiff.robot.link_tree import LinkTree, TreeJoint, TreeLink, robot_data, robot_of
from beamstiff.robot.parts import FRAME_PARAMETERS, STIFFNESS_KINDS
from beamstiff.robot.yaml_text import parse_yaml
from beamstiff.units import NUMBER, quantity, unit_factor

CONVENTIONS: dict[str, tuple[str, ...]] = {
    "classic": ("theta", "d", "a", "alpha"),
    "modified": ("alpha", "a", "theta", "d"),
    "khalil-kleinfinger": ("gamma", "b", "alpha", "d", "theta", "r"),
}
KINDS = {
    "theta": "angle",
    "alpha": "angle",
    "gamma": "angle",
    **dict.fromkeys(("a", "b", "d", "r", "cx", "cy", "cz"), "length"),
    "mass": "mass",
    **dict.fromkeys(("torsional", "tilting"), "rotational stiffness"),
    **dict.fromkeys(("axial", "radial"), "translational stiffness"),
}
USUAL_UNITS = {"angle": "deg", "length": "mm", "mass": "kg"}
CENTRE = ("cx", "cy", "cz")
TYPES = {"revolute": "revolute", "r": "revolute", "0": "revolute"}
TYPES |= {"prismatic": "prismatic", "p": "prismatic", "1": "prismatic"}
TYPES |= {"fixed": "fixed", "f": "fixed", "2": "fixed"}  # 0, 1, 2: Khalil's sigma
_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_VARIABLE = r"[A-Za-z_][A-Za-z0-9_]*"
_CELL = re.compile(
    rf"(?P<sign>[+-]?)\s*(?P<variable>{_VARIABLE})\s*(?:(?P<side>[+-])\s*(?P<offset>{NUMBER}))?"
)
_REVERSED = re.compile(rf"(?P<offset>{NUMBER})\s*(?P<sign>[+-])\s*(?P<variable>{_VARIABLE})")
_META = re.compile(r"#+\s*(?P<key>convention|name)\s*:\s*(?P<value>.*?)[\s,;]*")

Row = dict[str, Any]


def read_table(path: str | os.PathLike[str], convention: str | None = None) -> Robot:
    """Return the robot of a table of frames, CSV or YAML; `convention` where the file does not say."""
    file = Path(path)
    if file.suffix.lower() in (".yaml", ".yml"):
        return parse_yaml_table(read_text(file), convention, str(path))
    return parse_csv_table(read_text(file), convention, str(path))


def parse_csv_table(text: str, convention: str | None = None, name: str = "<text>") -> Robot:
    r"""Return the robot of a table in CSV; otherwise as `read_table`.

    >>> robot = parse_csv_table("# convention: modified\nalpha [deg],a [mm],theta [deg],d [mm]\n-90,600,q1,0")
    >>> robot.frames[0].d, robot.frames[0].theta, robot.joints[0].variable
    (0.6, 'q1', 'q1')
    """
    said: dict[str, str] = {}
    lines = [(at, line) for at, line in enumerate(text.splitlines(), start=1) if line.strip(" \t,;")]
    while lines and lines[0][1].lstrip().startswith("#"):
        if match := _META.fullmatch(lines[0][1].strip()):
            said[match["key"]] = match["value"]
        lines.pop(0)
    if len(lines) < 2:
        raise BeamstiffError(f"{name}: found no rows, expected a header with names and units, and rows")
    separator = next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    first, *rest = [
        (at, [cell.strip() for cell in next(csv.reader([line], delimiter=separator))])
        for at, line in lines
        if not line.lstrip().startswith("#")
    ]
    columns = _columns(first[1], f"{name}:{first[0]}")
    rows: list[Row] = []
    for at, cells in rest:
        place = f"{name}:{at}"
        if len(cells) != len(columns):
            raise BeamstiffError(
                f"{place}: found {len(cells)} cells, expected {len(columns)} as in the header"
            )
        row: Row = {}
        for (column, unit), cell in zip(columns, cells, strict=True):
            if cell:
                row[column] = _with_unit(cell, column, unit, place)
        rows.append(row | {"place": place})
    return _robot(rows, convention, said.get("convention"), said.get("name") or _stem(name), name)


def parse_yaml_table(text: str, convention: str | None = None, name: str = "<text>") -> Robot:
    """Return the robot of a table in YAML; otherwise as `read_table`."""
    data, lines = parse_yaml(text, name)
    found = data.get("rows") if isinstance(data, dict) else None
    if not isinstance(found, list) or not found or not all(isinstance(row, dict) for row in found):
        raise BeamstiffError(
            f"{name}:{lines.at(('rows',))}: rows: expected a list of rows, each keys with values"
        )
    for key in data:
        if key not in ("convention", "name", "rows"):
            raise BeamstiffError(
                f"{name}:{lines.at((key,))}: unknown key {shown(key)}"
                f"{suggest(key, ('convention', 'name', 'rows'))}"
            )
    rows = [{**row, "place": f"{name}:{lines.at(('rows', at))}"} for at, row in enumerate(found)]
    given = data.get("convention")
    said = None if given is None else str(given)
    return _robot(rows, convention, said, str(data.get("name", _stem(name))), name)


def _columns(header: Sequence[str], place: str) -> list[tuple[str, str]]:
    columns: list[tuple[str, str]] = []
    for cell in header:
        match = _HEADER.fullmatch(cell)
        name, unit = (match["name"].strip(), match["unit"]) if match else (cell, None)
        name = {"sigma": "type", "frame": "name"}.get(name, name)
        if name not in KINDS and name not in ("name", "type", "variable", "parent"):
            raise BeamstiffError(
                f"{place}: unknown column {shown(cell)}{suggest(name, [*KINDS, 'name', 'type'])}"
            )
        if name in KINDS:
            if unit is None:
                raise BeamstiffError(
                    f"{place}: {name}: its unit is missing, expected for instance {name} "
                    f"[{USUAL_UNITS.get(KINDS[name], 'N*m/rad')}]"
                )
            try:
                unit_factor(unit, KINDS[name])
            except BeamstiffError as error:
                raise BeamstiffError(f"{place}: {name}: {error}") from None
        if name in [other for other, _ in columns]:
            raise BeamstiffError(f"{place}: {name}: found twice, expected one column")
        columns.append((name, unit or ""))
    return columns


def _with_unit(cell: str, column: str, unit: str, place: str) -> str:
    """Return a cell as an expression with units: ``q2 - 90`` in a column of degrees is ``q2 - 90 deg``."""
    if column not in KINDS or cell in ("rigid", "free"):
        return cell
    if re.fullmatch(NUMBER, cell):
        return f"{cell} {unit}"
    if match := _CELL.fullmatch(cell):
        offset = f" {match['side']} {match['offset']} {unit}" if match["offset"] else ""
        return f"{match['sign']}{match['variable']}{offset}"
    if match := _REVERSED.fullmatch(cell):
        return f"{match['offset']} {unit} {match['sign']} {match['variable']}"
    raise BeamstiffError(
        f"{place}: {column}: found {shown(cell)}, expected a number, or a variable and an "
        "offset such as q2 - 90"
    )


def known_convention(name: str, place: str) -> str:
    """Return one of `CONVENTIONS` by its name or short name; `place` begins the message of the error."""
    short = {"craig": "modified", "dh": "classic", "kk": "khalil-kleinfinger"}
    convention = short.get(name.strip().lower(), name.strip().lower())
    if convention not in CONVENTIONS:
        raise BeamstiffError(
            f"{place}: found {shown(name)}{suggest(convention, CONVENTIONS)}, expected one of "
            f"{listed(CONVENTIONS)}"
        )
    return convention


def _robot(rows: list[Row], given: str | None, said: str | None, name: str, source: str) -> Robot:
    """Return the robot of rows in a given convention, or in the one that the file says."""
    told = None if said is None else known_convention(said, f"{source}: convention")
    asked = None if given is None else known_convention(given, "convention")
    convention = asked or told
    if convention is None:
        raise BeamstiffError(
            f"{source}: its convention is not said, expected `# convention: classic` (or modified, "
            "khalil-kleinfinger) before the header, or --convention"
        )
    if told is not None and told != convention:
        raise BeamstiffError(
            f"{source}: convention: found {told} in the file and {convention} asked for, expected one of them"
        )
    turning, sliding = "theta", "r" if convention == "khalil-kleinfinger" else "d"
    read = [_read(row, convention, turning, sliding) for row in rows]
    _name_variables(rows, read, turning, sliding)
    frames, joints = _chain(rows, read, convention)
    links = [TreeLink("base")]
    for row, frame in zip_longest(rows, frames):  # a classic table's last frame has no row
        links += [TreeLink(frame["name"], *_mass(row or {}, convention))] if frame else []
    data = robot_data(LinkTree(name, tuple(links), tuple(joints), source))
    data["frames"] = [frame if frame["parent"] else frame | {"parent": "base"} for frame in frames]

    def fail(message: str) -> NoReturn:
        raise BeamstiffError(f"{source}: {message}")

    return robot_of(fail, data)


def _read(row: Row, convention: str, turning: str, sliding: str) -> Row:
    """Return the row with its type, checked."""
    allowed = (*CONVENTIONS[convention], "name", "type", "variable", "parent", "place", *STIFFNESS_KINDS)
    allowed = (*allowed, "mass", *CENTRE)
    for key in row:
        if key not in allowed:
            raise BeamstiffError(
                f"{row['place']}: {key}: does not belong to {convention}{suggest(key, allowed)}, expected "
                f"{listed(CONVENTIONS[convention])}"
            )
    found = {
        key: re.findall(
            rf"(?<![\w.]){_VARIABLE}", re.sub(rf"{NUMBER}\s*[A-Za-z°]+", "", str(row.get(key, "")))
        )
        for key in CONVENTIONS[convention]
    }
    for key, variables in found.items():
        if any(map(reads_as_number, {*variables} - {"pi"})):
            raise BeamstiffError(
                f"{row['place']}: {key}: found {shown(row[key])}, expected a finite number, or a variable "
                "such as q1"
            )
        if variables and key not in (turning, sliding):
            raise BeamstiffError(
                f"{row['place']}: {key}: found {shown(row[key])}, expected a number: the joint moves by "
                f"{turning} or {sliding}"
            )
    given = row.get("type")
    kind = None if given is None else TYPES.get(str(given).strip().lower())
    if given is not None and kind is None:
        raise BeamstiffError(
            f"{row['place']}: type: found {shown(given)}{suggest(given, TYPES)}, expected revolute, "
            "prismatic or fixed"
        )
    told = "revolute" if found[turning] else "prismatic" if found[sliding] else None
    if found[turning] and found[sliding]:
        raise BeamstiffError(
            f"{row['place']}: found variables in {turning} and in {sliding}, expected one joint"
        )
    if kind is not None and told is not None and kind != told:
        raise BeamstiffError(
            f"{row['place']}: type: found {kind}, but the variable stands in that of another"
        )
    return {"kind": kind or told, "variable": (found[turning] or found[sliding] or [None])[0]}


def _mass(row: Row, convention: str) -> tuple[float, tuple[float, float, float]]:
    """Return a row's mass, kg, and its centre in our frame of the row, m."""
    try:
        mass, x, y, z = (quantity(row.get(key, 0.0), KINDS[key]) for key in ("mass", *CENTRE))
        if mass < 0 or (mass == 0 and any((x, y, z))):
            raise BeamstiffError(f"found {mass:g} kg, expected a positive mass (with its centre cx cy cz)")
        if convention == "classic":  # which ends in the frame that the next of ours begins with
            a, alpha = (quantity(row.get(key, 0.0), KINDS[key]) for key in ("a", "alpha"))
            sine, cosine = np.sin(alpha), np.cos(alpha)
            x, y, z = a + x, float(cosine * y - sine * z), float(sine * y + cosine * z)
    except BeamstiffError as error:
        raise BeamstiffError(f"{row['place']}: mass: {error}") from None
    return mass, (x, y, z) if mass else (0.0, 0.0, 0.0)


def _name_variables(rows: list[Row], read: list[Row], turning: str, sliding: str) -> None:
    """Give every joint its variable; a row without type or variable is fixed if others have them."""
    if all(row["kind"] is None for row in read):
        raise BeamstiffError(
            f"{rows[0]['place']}: found no joint, expected a variable such as q1 in a cell, or a column type"
        )
    taken = {row["variable"] for row in read} - {None}
    count = 0
    for row, own in zip(rows, read, strict=True):
        own["kind"] = own["kind"] or "fixed"
        if own["kind"] == "fixed":
            continue
        count += 1
        if own["variable"] is None:
            name = row.get("variable") or f"q{count}"
            if name in taken:
                raise BeamstiffError(f"{row['place']}: variable: {name!r} moves another joint already")
            taken.add(name)
            own["variable"] = name
            key = turning if own["kind"] == "revolute" else sliding
            row[key] = f"{name} + {row[key]}" if key in row else name
            row[key] = row[key].replace("+ -", "- ").replace("+ +", "+ ")


def _chain(rows: list[Row], read: list[Row], convention: str) -> tuple[list[Row], list[TreeJoint]]:
    """Return frames of ours, and the joints between them; x motions of a classic row are the next frame's."""
    kinds = {
        own["variable"]: "angle" if own["kind"] == "revolute" else "length"
        for own in read
        if own["variable"] is not None
    }
    frames: list[Row] = []
    joints: list[TreeJoint] = []
    names, moved = {"base"}, set[str]()
    before: Row = {}
    previous = "base"

    def add(name: str, parent: str, values: Row, row: Row, own: Row) -> None:
        if name in names:
            raise BeamstiffError(f"{row['place']}: name: {name!r} is taken, expected another name")
        names.add(name)
        if own.get("variable") in moved:
            raise BeamstiffError(f"{row['place']}: {own['variable']} moves another row already")
        moved.update([own["variable"]] if own.get("variable") else [])
        frame: Row = {"name": name, "parent": parent}
        for key, value in values.items():
            try:
                expression = parse_expression(value, FRAME_PARAMETERS[key], kinds)
            except BeamstiffError as error:
                raise BeamstiffError(f"{row['place']}: {key}: {error}") from None
            if expression.coefficients:
                frame[key] = value
            elif expression.constant:
                frame[key] = expression.constant
        stiffness = {key: row[key] for key in STIFFNESS_KINDS if key in row} if own else {}
        joint, kind = own.get("variable") or f"{name} mount", own.get("kind", "fixed")
        joints.append(TreeJoint(joint, parent, name, kind, np.eye(4), stiffness=stiffness))
        frames.append(frame)

    for at, (row, own) in enumerate(zip(rows, read, strict=True), start=1):
        name, parent = str(row.get("name", f"f{at}")), str(row.get("parent", previous))
        if convention == "khalil-kleinfinger":
            values = {key: row[key] for key in CONVENTIONS[convention] if key in row}
        else:
            if "parent" in row:
                raise BeamstiffError(f"{row['place']}: parent: a {convention} table is a chain, leave it out")
            across = before if convention == "classic" else row
            values = {ours: across[key] for ours, key in (("alpha", "alpha"), ("d", "a")) if key in across}
            values |= {ours: row[key] for ours, key in (("theta", "theta"), ("r", "d")) if key in row}
        add(name, parent, values, row, own)
        before, previous = row, name
    if convention == "classic":
        left = {ours: before[key] for ours, key in (("alpha", "alpha"), ("d", "a")) if key in before}
        if left:
            add("flange", previous, left, before, {})
            if not frames[-1].keys() - {"name", "parent"}:  # zeros
                frames.pop()
                joints.pop()
    return frames, joints


def _stem(name: str) -> str:
    return re.sub(r"[^\w-]", "_", Path(name).stem) or "robot"


def is_table(data: Mapping[str, Any]) -> bool:
    """Tell whether the data of a YAML file are a table of frames and not a robot."""
    return "rows" in data and "beamstiff" not in data
