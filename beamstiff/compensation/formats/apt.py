"""APT cutter location files: ``GOTO/x,y,z`` and ``GOTO/x,y,z,i,j,k``.

mm, unless UNITS/INCHES (or any other unit of UNITS) comes before. i, j, k is the tool axis, from the tip to
the holder; without it the last one holds, at first 0,0,1. ``$`` at the end of a line continues it, ``$$``
begins a comment. FROM, GODLTA, CIRCLE and all else stay as they are.
"""

import re

from beamstiff.compensation.editing import NUMBER, Slot, lines
from beamstiff.compensation.formats.program import Place, Program, make_program
from beamstiff.compensation.path import StatedFrame
from beamstiff.errors import BeamstiffError, shown
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import ToolAxis

UNITS = {
    **dict.fromkeys(("MM", "MILLIMETERS", "MILLIMETRES"), 1e-3),
    **dict.fromkeys(("IN", "INCH", "INCHES"), 0.0254),
    **dict.fromkeys(("CM", "CENTIMETERS"), 1e-2),
    **dict.fromkeys(("M", "METERS", "METRES"), 1.0),
    **dict.fromkeys(("FT", "FEET", "FOOT"), 0.3048),
}
DECIMALS = {1e-3: 3, 1e-2: 4, 0.0254: 5, 0.3048: 6, 1.0: 6}
AXIS_DECIMALS = 7
PLACED = ("MSYS", "ORIGIN", "TRACUT", "TRANS", "COPY")  # of the coordinates that targets count in
_WORD = re.compile(r"\s*(?:\d+\s+)?(?P<word>[A-Za-z]\w*)\s*/", re.ASCII)
_TEXT = re.compile(r"\s*(?:\d+\s+)?(?:PARTNO|PPRINT|REMARK|INSERT|LETTER)\b", re.IGNORECASE)
_NUMBER = re.compile(NUMBER)


def read(text: str, source: str) -> Program:
    """Return the targets of an APT text; `text` as of `editing.read_bytes`."""
    places: list[Place] = []
    left: dict[str, list[int]] = {}
    moved: StatedFrame | None = None
    unit, axis = 1e-3, tuple[float, ...]((0.0, 0.0, 1.0))
    for number, at, statement in _statements(text):
        match = _WORD.match(statement)
        if match is None or _TEXT.match(statement):
            continue
        word, tail = match["word"].upper(), statement[match.end() :]
        if word == "UNITS":
            if (name := tail.strip().upper()) not in UNITS:
                fail(source, number, "", f"found UNITS/{tail.strip()}, expected one of {', '.join(UNITS)}")
            unit = UNITS[name]
        elif word == "GOTO":
            name = f"GOTO {len(places) + 1}"
            slots = _numbers(tail, at + match.end(), source, number, name, unit)
            place = Place(name, number, slots[:3], slots[3:], () if slots[3:] else axis, base=moved)
            if place.orientation:
                axis = tuple(slot.value for slot in place.orientation)
            places.append(place)
        elif word in ("GODLTA", "CIRCLE", "FROM", "ARC", "MOVARC"):
            left.setdefault(word, []).append(number)
        elif word in PLACED:
            moved = StatedFrame(f"{word}/{tail.strip()}", number, None)
    if not places:
        raise BeamstiffError(f"{source}: found no target, expected lines such as GOTO/10.0,0.0,25.0")
    notes = [f"{word} is left as it is, first in line {numbers[0]}" for word, numbers in left.items()]
    return make_program(text, source, places, ToolAxis(), read, notes)


def _statements(text: str) -> list[tuple[int, int, str]]:
    """Return number, place and code of every statement, continued lines joined, characters in place."""
    result: list[tuple[int, int, str]] = []
    more = False
    for number, at, line in lines(text):
        code = line.split("$$", 1)[0]
        # texts end with their line, whatever stands in them
        goes_on = code.rstrip().endswith("$") and (more or not _TEXT.match(line))
        if goes_on:
            code = code[: code.rstrip().rfind("$")]
        if more:
            first, begin, before = result[-1]
            result[-1] = (first, begin, before + " " * (at - begin - len(before)) + code)
        else:
            result.append((number, at, code))
        more = goes_on
    return result


def _numbers(tail: str, at: int, source: str, line: int, name: str, unit: float) -> tuple[Slot, ...]:
    slots: list[Slot] = []
    pieces = tail.split(",")
    if len(pieces) not in (3, 6):
        fail(source, line, name, f"found {len(pieces)} numbers, expected 3 (x,y,z) or 6 (x,y,z,i,j,k)")
    for number, piece in enumerate(pieces):
        bare = piece.strip()
        if not _NUMBER.fullmatch(bare):
            fail(source, line, name, f"found {shown(bare)}, expected a number")
        form = (unit, DECIMALS[unit]) if number < 3 else (1.0, AXIS_DECIMALS)
        slots.append(Slot(at + len(piece) - len(piece.lstrip()), bare, *form))
        at += len(piece) + 1
    return tuple(slots)
