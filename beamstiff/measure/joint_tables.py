"""Joint values and loads in a file of their own: read, checked, and joined with a list of points."""

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from beamstiff.errors import BeamstiffError, counted, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.measure.columns import ALIASES, LABELS, QUANTITIES, name_and_unit, unit_fault
from beamstiff.measure.profile_cells import number_text, profile_cells, profile_values
from beamstiff.measure.profiles import QUATERNION, SIGMAS, Profile
from beamstiff.measure.table import WRENCH
from beamstiff.measure.text import RawTable, RowError, decimal_comma, numbers, split_table

OF_POINTS = (
    "samples",
    "points",
    "point",
    "load_point",
    "base",
    "orientation",
    "history",
    "unloaded_reading",
    *SIGMAS,
)  # keys of a profile
_NUMBER_AT_END = re.compile(r"(?<![0-9])(?<![0-9][.,])([0-9]{1,15})\Z")


def read_joints(path: str | os.PathLike[str], profile: Profile | None = None) -> RawTable:
    """Return a file of joint values and loads: a table of ours, or what the profile makes of it."""
    text = read_text(Path(path))
    return split_table(text, str(path)) if profile is None else joints_by_profile(text, profile, str(path))


def joints_by_profile(text: str, profile: Profile, name: str = "<joints>") -> RawTable:
    """Return joint values and loads as a table of ours, in the units of the file; hung masses as forces."""
    for key in OF_POINTS:
        if getattr(profile, key):
            raise BeamstiffError(f"{name}: its profile states `{key}`, which goes with points or logs")
    cells = profile_cells(text, profile, name)
    values = profile_values(cells, profile, name)
    columns: dict[str, Sequence[str]] = {}
    for column, texts in cells.columns.items():
        if column in LABELS or column in QUATERNION:
            columns[column] = texts
        elif column == "fz" and profile.hung_mass:
            columns["fz [N]"] = [number_text(value) for value in values["fz"]]
        else:
            points = [text.replace(",", ".") for text in texts] if profile.decimal == "comma" else texts
            columns[f"{column} [{profile.unit_of(column)}]"] = points
    rows = [list(row) for row in zip(*columns.values(), strict=True)]
    return RawTable(name, {}, ",", list(columns), cells.lines[0], rows, list(cells.lines))


def checked(joints: RawTable) -> RawTable:
    """Return the table with decimal points, once its units are known and its numbers are some."""
    comma = decimal_comma(joints)
    names: list[str] = []
    columns: list[list[str]] = []
    for at, head in enumerate(joints.header):
        name, unit = name_and_unit(head, at + 1, joints.fail_in_header)
        if name in names:
            joints.fail_in_header(name, "found twice, expected once")
        names.append(name)
        cells = [row[at].strip() for row in joints.cells]
        if name not in LABELS:
            if unit is not None and (fault := unit_fault(unit, _kinds(name))):
                hangs = name == "fz" and not unit_fault(unit, ("mass",))
                hint = "; hung masses need --joints-profile, with `units: {fz: kg}`" if hangs else ""
                joints.fail_in_header(name, f"{fault}{hint}")
            try:
                numbers(cells, may_be_empty=_may_be_empty(name), decimal_comma=comma)
            except RowError as error:
                joints.fail_in_row(error.row, name, str(error))
            cells = [cell.replace(",", ".") for cell in cells] if comma else cells
        columns.append(cells)
    return replace(joints, cells=[list(row) for row in zip(*columns, strict=True)])


def _kinds(name: str) -> Sequence[str]:
    """Return the kinds of quantity that a column may be: one, or those of a joint variable or its drive."""
    if known := QUANTITIES.get(ALIASES.get(name.lower(), name)):
        return (known,)
    of_drive = ("force", "moment") if name.startswith("tau_") else ()
    return ("length", "angle", *of_drive)


def _may_be_empty(name: str) -> bool:
    """Return whether an empty cell is unmeasured; of joint variables and loads it is none."""
    measured = name in QUANTITIES or name.startswith("tau_") or name.endswith("_link")
    return measured and name not in WRENCH


def joined(
    columns: Mapping[str, list[str]], lines: Sequence[int], name: str, joints: RawTable
) -> tuple[dict[str, list[str]], list[str]]:
    """Return the columns of a list of points with those of the joints' table before them, and notes.

    `lines`: of the list, whose file is `name`. Rows of the same `pose` belong together where both have one,
    else as many rows in the same order.
    """
    joints = checked(joints)
    names = [head.partition("[")[0].strip() for head in joints.header]
    twice = [own for own in columns if own.partition("[")[0].strip() in names and own != "pose"]
    if twice:
        raise BeamstiffError(f"{joints.source}: the column {twice[0]!r} stands in the list of points too")
    notes: list[str] = []
    if "pose" in names and "pose" in columns:
        row_of: dict[str, int] = {}
        for at, cells in enumerate(joints.cells):
            pose = cells[names.index("pose")]
            if pose in row_of:
                joints.fail_in_row(at, "pose", f"found {pose!r} a second time, expected one row a pose")
            row_of[pose] = at
        theirs = _paired(columns["pose"], row_of)
        for pose, line in zip(columns["pose"], lines, strict=True):
            if pose not in theirs:
                # of a number another number is no likely spelling, but another pose
                hint = "" if _NUMBER_AT_END.search(pose) else suggest(pose, row_of)
                raise BeamstiffError(
                    f"{joints.source}: pose: the list of points has the pose {shown(pose)} ({name}:{line}), "
                    f"which is missing here{hint}"
                )
        order = [row_of[theirs[pose]] for pose in columns["pose"]]
        if others := [f"{pose} is {their}" for pose, their in theirs.items() if pose != their]:
            notes.append(f"poses are paired by the number that their names end in: {listed(others, 3)}")
        read = set(theirs.values())
        if unread := [pose for pose in row_of if pose not in read]:
            which = f"{counted(len(unread), 'pose')} of {joints.source}"
            notes.append(f"no point of the list belongs to {which}: {listed(unread)}")
    elif len(joints.cells) == len(lines):
        order = list(range(len(lines)))
    else:
        raise BeamstiffError(
            f"{joints.source}: found {len(joints.cells)} rows for {len(lines)} points of {name}, expected as "
            "many, or a column pose in both"
        )
    beside = {
        head: [joints.cells[at][column] for at in order]
        for column, head in enumerate(joints.header)
        if names[column] != "pose" or "pose" not in columns
    }
    return beside | dict(columns), notes


def _paired(poses: Sequence[str], known: Mapping[str, int]) -> dict[str, str]:
    """Return by pose the known one of its name, else the one that alone ends in the same whole number."""
    ours, theirs = _by_number(poses), _by_number(known)
    ending = {ours[number]: theirs[number] for number in ours if number in theirs}
    return ending | {pose: pose for pose in poses if pose in known}


def _by_number(names: Iterable[str]) -> dict[int, str]:
    """Return names by the whole number that they end in, where it is that of one name only."""
    found: dict[int, list[str]] = {}
    for name in dict.fromkeys(names):
        if match := _NUMBER_AT_END.search(name):
            found.setdefault(int(match[1]), []).append(name)
    return {number: same[0] for number, same in found.items() if len(same) == 1}
