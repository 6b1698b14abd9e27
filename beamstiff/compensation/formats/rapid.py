"""ABB RAPID (``.mod``, ``.prg``): robtargets ``[[x,y,z],[q1,q2,q3,q4],[cf1,cf4,cf6,cfx],[eax_a,...,eax_f]]``.

x y z are mm in the work object, q1 is the scalar of the quaternion. Targets are found wherever such a literal
stands: declared (CONST, PERS, VAR, arrays too) or in a motion. Axis configuration and external axes stay, and
so do tooldata, wobjdata, jointtargets and what is computed from a target (Offs, RelTool). The configuration
chooses the posture, tool and work object of the motions say where a target is (`rapid_frames`).
"""

import re
from collections.abc import Iterator
from typing import NoReturn

import numpy as np

from beamstiff.compensation.editing import NUMBER, Slot, line_of, masked
from beamstiff.compensation.formats.program import Place, Program, make_program
from beamstiff.compensation.formats.rapid_frames import Motions
from beamstiff.compensation.posture import TURNING, Configuration, StatedPosture
from beamstiff.errors import BeamstiffError, shown
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import Quaternion

SIZES = (3, 4, 4, 6)
EXTERNAL = tuple(f"eax_{letter}" for letter in "abcdef")
PARTS = ("position x, y, z", "quaternion q1 to q4", "axis configuration", "external axes")
MILLIMETRE, DECIMALS = 1e-3, (3, 7)
NO_AXIS = 9e8  # an external axis of 9E9 is not there
_DECLARED = re.compile(r"\brobtarget\s+(?P<name>\w+)\s*(?P<size>\{[^}]*\})?\s*:=\s*(?=\[)", re.IGNORECASE)
_MOTION = re.compile(
    r"\b(?P<name>(?:Move(?!Abs)|Search|Trigg)\w*)(?:\s|\\\w+(?:\s*:=\s*\w+)?,?)*\s*(?=\[)", re.IGNORECASE
)
_NEXT = re.compile(r",\s*(?=\[)")  # a second target of MoveC
_NESTED = re.compile(r"\[\s*\[")
_NAME = re.compile(r"(\w+)\s*(?:\{[^}]*\})?\s*:=\s*\Z")
_PART = re.compile(r"\.(?:trans|rot)(?:\.\w+)?\s*:=", re.IGNORECASE)
_TOKEN = re.compile(rf"\s*(?:(?P<number>{NUMBER})|(?P<mark>[\[\],])|(?P<other>[^\s\[\],;]+|;))")
_OFFSETS = re.compile(r"\b(?:Offs|RelTool)\s*\(", re.IGNORECASE)


def read(text: str, source: str) -> Program:
    """Return the targets of a RAPID text; `text` as of `editing.read_bytes`."""
    code = masked(text, "!")
    places: list[Place] = []
    ends = [0]
    for name, at, count in _literals(code):
        found, end = _bracket(code, at, source, name)
        ends += [at, end]
        items = found if count else [found]
        for number, item in enumerate(items, start=1):
            label = f"{name}{{{number}}}" if count else name
            places.append(_target(item, label, code, at, source))
    for start, stop in zip(ends[::2], [*ends[1::2], len(code)], strict=True):
        places += _elsewhere(code, start, stop, source)
    places.sort(key=lambda place: place.position[0].start)
    if not places:
        raise BeamstiffError(
            f"{source}: found no target, expected robtargets such as [[600,0,900],[0,0,1,0],[0,0,0,0],"
            "[9E9,9E9,9E9,9E9,9E9,9E9]]"
        )
    notes = []
    motions = Motions(code)
    places = [motions.applied(place) for place in places]
    if match := _PART.search(code):
        notes.append(f"components set one by one are left as they are: line {line_of(text, match.start())}")
    if match := _OFFSETS.search(code):
        notes.append(f"Offs and RelTool are left as they are, first in line {line_of(text, match.start())}")
    return make_program(text, source, places, Quaternion(), read, notes)


def _literals(code: str) -> Iterator[tuple[str, int, bool]]:
    """Yield name and place of every literal, and whether it is an array of targets."""
    found = [(match["name"], match.end(), bool(match["size"])) for match in _DECLARED.finditer(code)]
    for match in _MOTION.finditer(code):
        found.append((match["name"], match.end(), False))
        if match["name"].lower().startswith("movec"):
            end = _end(code, match.end())
            if second := _NEXT.match(code, end):
                found.append((match["name"], second.end(), False))
    yield from sorted(found, key=lambda item: item[1])


def _elsewhere(code: str, start: int, stop: int, source: str) -> Iterator[Place]:
    """Yield the targets of a part of the text that are only assigned or passed on."""
    for match in _NESTED.finditer(code, start, stop):
        try:
            found, _ = _bracket(code, match.start(), source, "")
            name = _NAME.search(code, max(start, match.start() - 100), match.start())
            yield _target(found, name[1] if name else "robtarget", code, match.start(), source)
        except BeamstiffError:
            continue  # other data: tools, work objects, poses


def _end(code: str, at: int) -> int:
    depth = 0
    for place in range(at, len(code)):
        depth += {"[": 1, "]": -1}.get(code[place], 0)
        if depth == 0:
            return place + 1
    return len(code)


def _bracket(code: str, at: int, source: str, name: str) -> tuple[list[object], int]:
    """Return the nested lists of number matches that begin with the bracket at a place, and their end."""
    stack: list[list[object]] = []
    wanted = True  # a value; else a comma or an end
    place = at
    while match := _TOKEN.match(code, place):
        mark = match["mark"]
        begin = match.start(match.lastgroup or 0)
        place = match.end()
        if mark == "[" and wanted:
            stack.append([])
        elif mark == "]" and stack and not wanted:
            closed = stack.pop()
            if not stack:
                return closed, place
            stack[-1].append(closed)
        elif mark == "," and not wanted:
            wanted = True
            continue
        elif match["number"] is not None and wanted and stack:
            stack[-1].append((begin, match["number"]))
        else:
            what = "a number or '['" if wanted else "',' or ']'"
            _fail(source, code, begin, name, f"found {shown(match[match.lastgroup or 0])}, expected {what}")
        wanted = mark == "["
    _fail(source, code, at, name, "found '[' without its ']'")


def _target(item: object, name: str, code: str, at: int, source: str) -> Place:
    """Return the target of a literal."""
    if not isinstance(item, list) or len(item) != 4 or not all(isinstance(part, list) for part in item):
        count = len(item) if isinstance(item, list) else 1
        _fail(
            source, code, at, name,
            f"found {count} part{'' if count == 1 else 's'}, expected a robtarget [[x,y,z],[q1,q2,q3,q4],"
            "[4 numbers],[6 numbers]]",
        )  # fmt: skip
    for part, size, what in zip(item, SIZES, PARTS, strict=True):
        if len(part) != size or not all(isinstance(number, tuple) for number in part):
            where = part[0][0] if part and isinstance(part[0], tuple) else at
            _fail(source, code, where, name, f"found {len(part)} numbers for the {what}, expected {size}")
    line = line_of(code, item[0][0][0])
    axes = zip(EXTERNAL, (float(number) for _, number in item[3]), strict=True)
    external = {name: value for name, value in axes if abs(value) < NO_AXIS}
    units = (MILLIMETRE, 1.0)
    slots = [
        tuple(Slot(start, number, unit, decimals) for start, number in part)
        for part, unit, decimals in zip(item[:2], units, DECIMALS, strict=True)
    ]
    configuration = tuple(int(float(number)) for _, number in item[2])
    return Place(name, line, slots[0], slots[1], posture=_stated(configuration), external=external)


def _stated(configuration: tuple[int, ...]) -> StatedPosture:
    """Return the posture of an axis configuration (RAPID reference, confdata, robots of six axes).

    cf1, cf4, cf6: quarters of a turn of these axes; cfx: 4 wrist behind axis 1, 2 behind the lower arm, 1
    axis 5 negative.
    """
    turns = tuple(
        (axis, 0.5 * np.pi * quarter, 0.5 * np.pi * (quarter + 1))
        for axis, quarter in zip(TURNING, configuration, strict=False)
    )
    kind = configuration[3]
    text = f"configuration [{','.join(map(str, configuration))}]"
    if not 0 <= kind <= 7:
        return StatedPosture(text, turns=turns, write=_confdata)
    return StatedPosture(text, not kind & 4, not kind & 2, not kind & 1, turns, write=_confdata)


def _confdata(_: StatedPosture, found: Configuration) -> str:
    """Return a configuration as confdata."""
    quarters = [int(np.floor(found.angles[axis] / (0.5 * np.pi))) for axis in TURNING]
    kind = 4 * (not found.front) + 2 * (not found.elbow_up) + (not found.wrist_down)
    return f"[{','.join(map(str, [*quarters, kind]))}]"


def _fail(source: str, code: str, at: int, name: str, message: str) -> NoReturn:
    fail(source, line_of(code, at), name, message)
