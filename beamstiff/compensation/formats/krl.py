"""KUKA KRL (``.src``, ``.dat``): literals ``{X 1,Y 2,Z 3,A 0,B 90,C 0,...}`` of POS, E6POS and FRAME.

X Y Z are mm in $BASE, A B C degrees about the turned axes z, y, x (intrinsic Z-Y-X). Targets are literals in
declarations, assignments and motions (PTP, LIN, CIRC, SPL, SLIN, ...). Not targets, and left as they are:
$BASE, $TOOL, BASE_DATA[..] and the like, and variables that these are set to; FRAME variables that no motion
of the file goes to, since they may be bases and tools (move one, and all its targets move); axis values
{A1 ..}; relative motions (LIN_REL ...); structures within structures. S, T and the external axes E1 to E6 of
a target stay. A motion to {X ..,Y ..,Z ..} alone keeps the orientation of the target before it.

Frames (`krl_frames`): of a literal those that hold where it stands; of a declared point those of its FDAT,
else those that hold at the motions to it. S and T choose the posture, but of targets that only LIN, CIRC and
the like go to, where the controller does not look at them.

A literal in a motion is called by both, with its line: ``LIN 14``. Others have the names that they are given.

The points of a ``.src`` may stand in the ``.dat`` beside it: then both are one text with a seam, the targets
are those that its motions go to, in the order of these, and both are written.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from beamstiff.compensation.editing import NUMBER, Slot, lines, masked
from beamstiff.compensation.formats.krl_frames import FrameState, Literals
from beamstiff.compensation.formats.program import SEAM, Place, Program, make_program
from beamstiff.compensation.posture import TURNING, WHOLE, Configuration, StatedPosture
from beamstiff.errors import BeamstiffError, shown
from beamstiff.measure.columns import fail
from beamstiff.measure.orientation import KUKA
from beamstiff.units import unit_factor

MOTIONS = ("PTP", "SPTP", "LIN", "SLIN", "CIRC", "SCIRC", "SPL")
POSITION, ROTATION = ("X", "Y", "Z"), ("A", "B", "C")
MILLIMETRE, DEGREE = 1e-3, unit_factor("deg", "angle")[0]
AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
LEFT = (
    "frames, tools and loads",
    "relative motions",
    "axis values",
    "components set one by one",
    "frames combined by ':'",
    "literals that are neither moved to nor given a name",
)
DECIMALS = {"position": 3, "orientation": 4}
_MOTION = re.compile(r"\b(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?\b", re.IGNORECASE)
_NAME = re.compile(r"([A-Za-z$_][\w$.]*(?:\[[^\]]*\])?)\s*=\s*\Z")
_FRAMES = re.compile(
    r"\$.*|(?:BASE|TOOL|MACHINE|MACH|LOAD)_?(?:DATA|DEF|NAME|FRAME)?(?:\[.*)?", re.IGNORECASE
)
_COMPONENT = re.compile(r"\s*(?P<key>[A-Za-z_]\w*(?:\[\s*\d*\s*\])?)(?:\s+(?P<value>\S.*?))?\s*", re.DOTALL)
_NUMBER = re.compile(NUMBER)
_PART = re.compile(r"^\s*[A-Za-z_]\w*(?:\[[^\]]*\])?\.[XYZABC]\s*=", re.IGNORECASE)
_EXTERNAL = re.compile(r"E[1-6]")
_GIVEN = re.compile(r"(?:\$(?:BASE|TOOL)|(?:BASE|TOOL)_DATA\s*\[[^\]]*\])\s*=(?P<from>.*)", re.IGNORECASE)
_FRAME = re.compile(
    r"\s*(?:DECL\s+)?(?:GLOBAL\s+)?(?:CONST\s+)?FRAME\s+(?P<names>[A-Za-z_].*)", re.IGNORECASE
)
_LITERAL = re.compile(r"\{[^{}]*\}?")
_WORD = re.compile(r"[A-Za-z_]\w*")
_BITS = re.compile(r"'?(?P<base>[BH]?)(?P<digits>[0-9A-F]+)'?", re.IGNORECASE)


def read(text: str, source: str, points: str = "") -> Program:
    """Return the targets of a KRL text; `text` as of `editing.read_bytes`.

    `points`: name of the ``.dat``, whose text stands behind a seam.
    """
    places: list[Place] = []
    notes: list[str] = []
    left: dict[str, list[str]] = {what: [] for what in LEFT}
    code = masked(text, ";")
    apart = _frame_names(code)
    state = FrameState(Literals(code))
    reached: dict[str, list[tuple[str, FrameState]]] = {}  # motions to a named point, and what holds there
    first: dict[str, int] = {}  # line of the first of them
    file, above = source, 0
    for at_line, at, line in lines(code):
        if line == SEAM.strip("\n"):
            file, above = points, at_line
        number = at_line - above
        here = f"{points}:{number}" if above else str(number)
        state = state.after(line, number)
        for match in _MOTION.finditer(bare := _LITERAL.sub("", line)):
            for word in _WORD.findall(bare[match.end() :].upper()):
                reached.setdefault(word, []).append((match[1].upper(), state))
                first.setdefault(word, number)
        if _PART.search(line):
            left["components set one by one"].append(here)
        if "{" not in line or line.lstrip().startswith("&"):
            continue
        if above and not (set(_WORD.findall(_LITERAL.sub("", line).upper())) & reached.keys()):
            continue  # no motion goes to what this line of the .dat declares
        for start, end in _groups(line, file, number):
            inner = line[start + 1 : end]
            motion, name = _before(line[:start])
            keys = _keys(inner)
            if name is not None and (_FRAMES.fullmatch(name) or name.partition("[")[0].upper() in apart):
                if not name.startswith("$"):  # $ variables belong to the controller
                    left["frames, tools and loads"].append(here)
            elif "{" in inner or not keys:
                continue
            elif motion is not None and motion.endswith("_REL"):
                left["relative motions"].append(here)
            elif keys[0] in AXES:
                left["axis values"].append(here)
            elif not set(POSITION + ROTATION) & set(keys):
                continue
            elif line[:start].rstrip().endswith(":") or line[end + 1 :].lstrip().startswith(":"):
                left["frames combined by ':'"].append(here)
            elif label := name or motion:
                place = _target(inner, at + start + 1, label, number, file, places, name is None)
                followed = name is not None or motion in ("PTP", "SPTP")
                posture = place.posture if followed else None
                place = replace(place, posture=posture, file=points if above else "")
                places.append(replace(place, base=state.base, tool=state.tool))
            else:
                left["literals that are neither moved to nor given a name"].append(here)
    notes += [f"{what} are left as they are: {_lines(found)}" for what, found in left.items() if found]
    if not places:
        raise BeamstiffError(
            f"{source}: found no target, expected literals such as {{X 1,Y 2,Z 3,A 0,B 90,C 0}}; the points "
            "of a .src may stand in its .dat"
        )
    places = [_as_reached(place, reached, state) for place in places]
    if points:  # a path goes from motion to motion
        places.sort(key=lambda place: first.get(_base_name(place), place.line))
    return make_program(text, source, places, KUKA, partial(read, points=points), notes)


def _base_name(place: Place) -> str:
    return place.name.upper().partition("[")[0]


def _as_reached(place: Place, reached: dict[str, list[tuple[str, FrameState]]], end: FrameState) -> Place:
    """Return a named target with the frames of its data, else of the motions to it; a literal as it is."""
    if place.name.partition(" ")[0] in MOTIONS:
        return place
    name = _base_name(place)
    motions = reached.get(name, [])
    here = replace(end, base=place.base, tool=place.tool)
    if (own := end.of_point(name)) is None:
        own = end.common([state for _, state in motions] or [here], place)
    posture = None if motions and all(kind not in ("PTP", "SPTP") for kind, _ in motions) else place.posture
    return replace(place, base=own.base, tool=own.tool, posture=posture)


def _frame_names(code: str) -> set[str]:
    """Return variables that are bases or tools: what these are set to, frames that no motion goes to."""
    given, declared, moved_to = set(), set(), set()
    for _, _, line in lines(code):
        bare = _LITERAL.sub("", line)
        if match := _GIVEN.search(bare):
            given.update(_WORD.findall(match["from"].upper()))
        if match := _FRAME.match(bare):
            declared.update(_WORD.findall(match["names"].upper()))
        elif match := _MOTION.search(bare):
            moved_to.update(_WORD.findall(bare[match.end() :].upper()))
    return given | (declared - moved_to)


def _groups(line: str, source: str, number: int) -> Iterator[tuple[int, int]]:
    """Yield the places of outermost braces."""
    depth, start = 0, 0
    for at, letter in enumerate(line):
        if letter == "{":
            start = at if depth == 0 else start
            depth += 1
        elif letter == "}":
            depth -= 1
            if depth < 0:
                fail(source, number, "", "found '}' without '{' before it")
            if depth == 0:
                yield start, at
    if depth:
        fail(source, number, "", f"found {shown(line[start:].strip())}, expected a closing '}}' in this line")


def _before(text: str) -> tuple[str | None, str | None]:
    """Return the motion and the name that a literal belongs to, from what stands before it in its line."""
    match = _NAME.search(text)
    if match is not None:
        return None, match[1]
    motions = list(_MOTION.finditer(text))
    return (motions[-1][0].upper() if motions else None), None


def _keys(inner: str) -> list[str]:
    return [match["key"].upper() for _, match in _parts(inner) if match is not None]


def _parts(inner: str) -> Iterator[tuple[int, re.Match[str] | None]]:
    """Yield the components (after ``E6POS:``), each with its place."""
    prefix = re.match(r"\s*[A-Za-z_]\w*\s*:", inner)
    at = prefix.end() if prefix else 0
    for piece in inner[at:].split(","):
        yield at, _COMPONENT.fullmatch(piece)
        at += len(piece) + 1


def _target(
    inner: str, at: int, name: str, line: int, source: str, before: list[Place], motion: bool
) -> Place:
    slots: dict[str, Slot] = {}
    stated: dict[str, int] = {}
    external: dict[str, float] = {}
    for offset, match in _parts(inner):
        if match is None or match["value"] is None:
            end = inner.find(",", offset)
            piece = inner[offset : end if end >= 0 else len(inner)].strip()
            hint = "; decimals follow a point, not a comma" if _NUMBER.fullmatch(piece) else ""
            fail(source, line, name, f"found {shown(piece)}, expected a component such as X 12.5{hint}")
        key, value = match["key"].upper(), match["value"]
        if key in ("S", "T") and (bits := _BITS.fullmatch(value)):
            stated[key] = int(bits["digits"], {"B": 2, "H": 16}.get(bits["base"].upper(), 10))
        if _EXTERNAL.fullmatch(key) and _NUMBER.fullmatch(value):
            external[key] = float(value)
        if key not in POSITION + ROTATION:
            continue
        if not _NUMBER.fullmatch(value):
            fail(source, line, name, f"{key}: found {shown(value)}, expected a number")
        if key in slots:
            fail(source, line, name, f"{key}: found twice, expected once")
        kind = "position" if key in POSITION else "orientation"
        unit = MILLIMETRE if kind == "position" else DEGREE
        slots[key] = Slot(at + offset + match.start("value"), value, unit, DECIMALS[kind])
    missing = [key for key in POSITION + ROTATION if key not in slots]
    inherited: tuple[float, ...] = ()
    if missing == list(ROTATION) and motion and before:
        last = before[-1]
        inherited = last.inherited or tuple(slot.value for slot in last.orientation)
    elif missing:
        why = ": values that it does not state follow the target before, which is corrected" if motion else ""
        fail(source, line, name, f"found no {', '.join(missing)}, expected all of X, Y, Z, A, B, C{why}")
    rotation = () if missing else tuple(slots[key] for key in ROTATION)
    position = tuple(slots[key] for key in POSITION)
    own = f"{name} {line}" if motion else name  # a literal in a motion has no other name
    return Place(own, line, position, rotation, inherited, posture=_stated(stated), external=external)


def _stated(bits: dict[str, int]) -> StatedPosture | None:
    """Return the posture of S and T (KUKA System Software, status and turn).

    S: bit 0 overhead, bit 1 A3 beyond the stretched arm, bit 2 A5 negative. T: bit n, axis n + 1 negative.
    """
    if not bits:
        return None
    status, turn = bits.get("S"), bits.get("T")
    text = ", ".join(f"{key} {value}" for key, value in bits.items())
    turns: tuple[tuple[int, float, float], ...] = ()
    if turn is not None:  # KUKA's axes 1, 4 and 6 turn the other way
        turns = tuple((axis, 0.0, WHOLE) if turn >> axis & 1 else (axis, -WHOLE, 0.0) for axis in TURNING)
    if status is None:
        return StatedPosture(text, turns=turns, write=_status_and_turn)
    sides = not status & 1, bool(status & 2), not status & 4
    return StatedPosture(text, *sides, turns, write=_status_and_turn)


def _status_and_turn(stated: StatedPosture, found: Configuration) -> str:
    """Return a configuration as S and T; as S alone where the arm's side changes the signs of A2 and A3."""
    text = f"S {1 * (not found.front) + 2 * found.elbow_up + 4 * (not found.wrist_down)}"
    turn = re.search(r"T (\d+)", stated.text)
    if turn is None or (found.front, found.elbow_up) != (stated.front, stated.elbow_up):
        return text
    bits = {axis: found.angles[axis] > 0 for axis in TURNING} | {4: not found.wrist_down}
    kept = int(turn[1]) & ~sum(1 << axis for axis in bits)
    return f"{text}, T {kept + sum(1 << axis for axis, on in bits.items() if on)}"


def _lines(numbers: list[str]) -> str:
    some = ", ".join(numbers[:6])
    more = f" and {len(numbers) - 6} more" if len(numbers) > 6 else ""
    return f"line{'s' if len(numbers) > 1 else ''} {some}{more}"
