"""FANUC TP programs as text (``.ls``): positions ``P[1]{ GP1: UF : 0, UT : 1, CONFIG : .., X = .. mm, ..};``.

X Y Z are mm in the user frame UF, W P R degrees about its fixed axes x, y, z. Targets are the positions of
group 1. CONFIG chooses the posture. Frame and tool 0 are the robot's own, of others only the controller knows
where they are. Positions in joint values, other groups, position registers and offsets stay as they are.
FANUC's world frame is where axes 1 and 2 cross: where a robot file's base stands on the floor, the base of
the path is that much higher.
"""

import re
from collections.abc import Iterator

import numpy as np

from beamstiff.compensation.editing import NUMBER, Slot, line_of
from beamstiff.compensation.formats.program import Place, Program, make_program
from beamstiff.compensation.path import StatedFrame
from beamstiff.compensation.posture import Configuration, StatedPosture
from beamstiff.errors import BeamstiffError, listed, shown
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import EulerAngles
from beamstiff.units import unit_factor

POSITION, ROTATION = ("X", "Y", "Z"), ("W", "P", "R")
UNITS = {"mm": 1e-3, "deg": unit_factor("deg", "angle")[0]}
DECIMALS = {"mm": 3, "deg": 4}
TURNED = ((0, 1), (3, -1), (5, -1))  # axes 1, 4, 6, and how FANUC counts them
_SECTION = re.compile(r"^/POS\b.*$", re.MULTILINE)
_POINT = re.compile(r"\bP\[(?P<number>\d+)[^\]]*\]\s*\{(?P<body>[^{}]*)\}")
_GROUP = re.compile(r"\bGP(\d+)\s*:")
_FRAME = re.compile(r"\b(UF|UT)\s*:\s*(\w+)")
_CONFIG = re.compile(r"\bCONFIG\s*:\s*'(?P<text>[^']*)'")
_PART = re.compile(r"(?<![\w.])(?P<key>[A-Z]\d?)\s*=\s*(?P<value>[^\s,;]+)\s*(?P<unit>mm|deg)?")
_NUMBER = re.compile(NUMBER)
_OFFSET = re.compile(r"\b(?:Tool_)?Offset\b|\bINC\b|\b(?:TOOL_)?OFFSET\s+CONDITION", re.IGNORECASE)


def read(text: str, source: str) -> Program:
    """Return the targets of a TP program; `text` as of `editing.read_bytes`."""
    section = _SECTION.search(text)
    places: list[Place] = []
    joints: list[str] = []
    for name, at, body in _points(text, section.end() if section else len(text)):
        line = line_of(text, at)
        parts = {match["key"]: match for match in _PART.finditer(body)}
        if "J1" in parts:
            joints.append(name)
            continue
        external = {
            key: float(part["value"])
            for key, part in parts.items()
            if key[0] == "E" and _NUMBER.fullmatch(part["value"])
        }
        position, rotation = (
            tuple(_slot(parts, key, at, text, source, name) for key in keys) for keys in (POSITION, ROTATION)
        )
        frames = {
            what: StatedFrame(f"{what} : {number}", line, np.eye(4) if number == "0" else None)
            for what, number in _FRAME.findall(body)
        }
        config = _CONFIG.search(body)
        posture = _stated(config["text"]) if config else None
        base, tool = frames.get("UF"), frames.get("UT")
        places.append(
            Place(name, line, position, rotation, base=base, tool=tool, posture=posture, external=external)
        )
    if not places:
        raise BeamstiffError(
            f"{source}: found no target, expected positions of group 1 after /POS, such as P[1]{{ GP1: UF : 0"
            ", UT : 1, CONFIG : 'N U T, 0, 0, 0', X = 500 mm, ...};"
        )
    notes = []
    if joints:
        notes.append(f"positions in joint values are left as they are: {listed(joints, 4)}")
    if match := _OFFSET.search(text, 0, section.start() if section else 0):
        notes.append(f"offsets and INC are left as they are, first in line {line_of(text, match.start())}")
    return make_program(text, source, places, EulerAngles("xyz"), read, notes)


def _points(text: str, start: int) -> Iterator[tuple[str, int, str]]:
    """Yield name, place and text of what every position says of group 1."""
    for match in _POINT.finditer(text, start):
        groups = list(_GROUP.finditer(match["body"]))
        for group, after in zip(groups, [*[other.start() for other in groups[1:]], None], strict=True):
            if group[1] == "1":
                body = match["body"][group.end() : after]
                yield f"P{match['number']}", match.start("body") + group.end(), body


def _slot(parts: dict[str, re.Match[str]], key: str, at: int, text: str, source: str, name: str) -> Slot:
    """Return the number of a component, or refuse what stands there."""
    unit = "mm" if key in POSITION else "deg"
    if key not in parts:
        fail(source, line_of(text, at), name, f"found no {key}, expected all of X, Y, Z, W, P, R")
    match = parts[key]
    start = at + match.start("value")
    if not _NUMBER.fullmatch(match["value"]):
        found = shown(match["value"])
        fail(source, line_of(text, start), name, f"{key}: found {found}, expected a number")
    if match["unit"] != unit:
        fail(
            source, line_of(text, start), name, f"{key}: found {match['unit'] or 'no unit'}, expected {unit}"
        )
    return Slot(start, match["value"], UNITS[unit], DECIMALS[unit])


def _stated(text: str) -> StatedPosture:
    """Return the posture of a CONFIG.

    N no flip (axis 5 down) or F; U elbow up or D; T front or B; then the turns of axes 1, 4 and 6.
    """
    letters, *numbers = text.split(",")
    said = set(letters.upper().split())

    def either(yes: str, no: str) -> bool | None:
        return True if yes in said else False if no in said else None

    turns = []
    for (axis, sign), number in zip(TURNED, numbers, strict=False):
        if re.fullmatch(r"\s*[-+]?\d+\s*", number):
            middle = sign * 2 * np.pi * int(number)
            turns.append((axis, middle - np.pi, middle + np.pi))
    sides = either("T", "B"), either("U", "D"), either("N", "F")
    return StatedPosture(f"CONFIG '{text.strip()}'", *sides, tuple(turns), flange_up=True, write=_config)


def _config(_: StatedPosture, found: Configuration) -> str:
    """Return a configuration as CONFIG."""
    sides = "N" if found.wrist_down else "F", "U" if found.elbow_up else "D", "T" if found.front else "B"
    turns = [round(sign * found.angles[axis] / (2 * np.pi)) for axis, sign in TURNED]
    return f"CONFIG '{', '.join([' '.join(sides), *map(str, turns)])}'"
