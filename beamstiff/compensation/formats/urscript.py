"""Universal Robots URScript (``.script``): poses ``p[x,y,z,rx,ry,rz]`` and joint lists ``[q1,...,q6]``.

m and rad, orientations as rotation vectors. Targets are what movej, movel, movep, movec and servoj go to, and
what get_inverse_kin is asked for: written there, or a name that is given a literal. Joint lists are values of
the robot file's own variables. ``pose_trans(frame, p[..])`` counts from a frame, set_tcp says the tool; both
are known where they are literals or names that one line gives a literal to. Motions from where the robot is
(``pose_trans(get_actual_tcp_pose(), ..)``) and poses that are computed stay as they are.
"""

import re
from dataclasses import replace

import numpy as np

from beamstiff.compensation.editing import NUMBER, Slot, line_of, masked
from beamstiff.compensation.formats.program import Place, Program, common_frame, make_program
from beamstiff.compensation.path import StatedFrame
from beamstiff.errors import BeamstiffError
from beamstiff.measure.orientation import RotationVector
from beamstiff.se3 import Array, rotation_from_vector, transform
from beamstiff.units import unit_factor

GOALS = {"movej": 1, "movel": 1, "movep": 1, "movec": 2, "servoj": 1, "servoc": 1, "get_inverse_kin": 1}
DECIMALS = {"position": 6, "rotation": 7}
DEGREE = unit_factor("deg", "angle")[0]
LEFT = {
    "relative": "motions from where the robot is",
    "computed": "poses that are computed",
    "unused": "poses that no motion goes to",
}
_LIST = re.compile(r"(?P<pose>\bp\s*)?\[(?P<inner>[^\[\]]*)\]")
_ELEMENT = re.compile(rf"\s*(?:(?P<number>{NUMBER})|d2r\(\s*(?P<degrees>{NUMBER})\s*\))\s*")
_GIVEN = re.compile(r"(?:\b(?:global|local)\s+)?\b(?P<name>[A-Za-z_]\w*)\s*=\s*\Z")
_TOOL = re.compile(r"\bset_tcp\s*\((?P<value>[^()]*)\)")
_CALL = re.compile(r"([A-Za-z_]\w*)\s*\Z")
_WORD = re.compile(r"(?<![.\w])[A-Za-z_]\w*")


class _Script:
    """A script whose comments and texts are blank."""

    def __init__(self, code: str) -> None:
        self.code = code
        self.tools = list(_TOOL.finditer(code))
        self.given = re.findall(r"\b([A-Za-z_]\w*)\s*=(?!=)", code)
        self.literal = {
            match["name"]: found[0]
            for found in _LIST.finditer(code)
            if (match := _GIVEN.search(code, self.start(found.start()), found.start()))
        }
        self.uses: dict[str, list[tuple[int, str]]] = {}  # places and roles of names in calls
        for word in _WORD.finditer(code):
            if word[0] in self.literal and (role := self.role(word.start())) != "given":
                self.uses.setdefault(word[0], []).append((word.start(), role))

    def start(self, at: int) -> int:
        """Return where the line of a place begins."""
        return max(self.code.rfind("\n", 0, at), self.code.rfind("\r", 0, at)) + 1

    def calls(self, at: int) -> list[tuple[str, int, int]]:
        """Return the calls around a place, innermost first: name, number of the argument, where it opens."""
        depth, argument, found = 0, 0, []
        for place in range(at - 1, self.start(at) - 1, -1):
            letter = self.code[place]
            if letter in ")]":
                depth += 1
            elif letter in "([" and depth:
                depth -= 1
            elif letter == "(":
                name = _CALL.search(self.code, self.start(at), place)
                found.append((name[1] if name else "", argument, place))
                argument = 0
            elif letter == "," and not depth:
                argument += 1
        return found

    def role(self, at: int) -> str:
        """Return what a pose at a place is: target, frame, tool, given (to a name), or a key of `LEFT`."""
        calls = self.calls(at)
        if not calls:
            return "given" if _GIVEN.search(self.code, self.start(at), at) or self._named(at) else "unused"
        name, argument, opens = calls[0]
        if name == "set_tcp":
            return "tool"
        if name == "pose_trans" and len(calls) > 1:
            if argument == 0:
                return "frame"
            frame = self.code[opens + 1 : at].rsplit(",", 1)[0]
            if "(" in frame:
                return "relative" if re.search(r"actual|target|forward_kin", frame) else "computed"
            return self._goal(*calls[1][:2])
        return self._goal(name, argument)

    def frame(self, at: int) -> StatedFrame | None:
        """Return the frame that the pose at a place counts from, where pose_trans says one."""
        calls = self.calls(at)
        if not calls or calls[0][0] != "pose_trans":
            return None
        text = self.code[calls[0][2] + 1 : at].rsplit(",", 1)[0].strip()
        return StatedFrame(text, line_of(self.code, at), self.pose(text))

    def tool(self, at: int) -> StatedFrame | None:
        """Return the tool that was set last before a place."""
        before = [match for match in self.tools if match.start() < at]
        if not before:
            return None
        text = before[-1]["value"].strip()
        return StatedFrame(f"set_tcp({text})", line_of(self.code, before[-1].start()), self.pose(text))

    def pose(self, text: str) -> Array | None:
        """Return the frame (4, 4) that an expression stands for, or None."""
        if self.given.count(text) == 1:
            text = self.literal.get(text, text)
        match = _LIST.fullmatch(text)
        slots = _slots(match["inner"], 0, True) if match and match["pose"] else None
        if slots is None:
            return None
        values = np.array([slot.value for slot in slots])
        return np.asarray(transform(rotation_from_vector(values[None, 3:]), values[None, :3])[0])

    def _named(self, at: int) -> bool:
        """Tell whether a word at a place is a name that is given something."""
        return re.match(r"\w+\s*=(?!=)", self.code[at : at + 200]) is not None

    def _goal(self, name: str, argument: int) -> str:
        return "target" if argument < GOALS.get(name, 0) else "computed" if name not in GOALS else "unused"


def read(text: str, source: str) -> Program:
    """Return the targets of a script; `text` as of `editing.read_bytes`."""
    script = _Script(masked(text, "#"))
    places: list[Place] = []
    left: dict[str, list[int]] = {}
    for match in _LIST.finditer(script.code):
        slots = _slots(match["inner"], match.start("inner"), match["pose"] is not None)
        line = line_of(text, match.start())
        for role, place in _meanings(script, match, line):
            if role == "target" and slots is not None:
                places.append(_filled(place, slots, match["pose"] is not None))
            elif role in LEFT and (match["pose"] or role == "target"):
                left.setdefault(role, []).append(line)
    if not places:
        raise BeamstiffError(
            f"{source}: found no target, expected motions such as movel(p[0.4,0.1,0.3,0,3.14,0]) or "
            "movej([0,-1.57,1.57,0,1.57,0])"
        )
    notes = [f"{LEFT[role]} are left as they are, first in line {lines[0]}" for role, lines in left.items()]
    return make_program(text, source, places, RotationVector(), read, notes)


def _meanings(script: _Script, match: re.Match[str], line: int) -> list[tuple[str, Place]]:
    """Return the role of a literal, and its target without the numbers."""
    at = match.start()
    role = script.role(at)
    if role != "given":
        calls = script.calls(at)
        name = next((call for call, *_ in reversed(calls) if call in GOALS), "")
        return [(role, Place(name, line, base=script.frame(at), tool=script.tool(at)))]
    given = _GIVEN.search(script.code, script.start(at), at)
    name = given["name"] if given else ""
    uses = script.uses.get(name, [])
    goals = [place for place, use in uses if use == "target"]
    if not goals:
        kinds = {use for _, use in uses}
        if kinds & {"frame", "tool"}:
            return []
        return [("relative" if "relative" in kinds else "unused", Place(name, line))]
    base, tool = (
        common_frame([where(goal) for goal in goals], name, line) for where in (script.frame, script.tool)
    )
    return [("target", Place(name, line, base=base, tool=tool))]


def _filled(place: Place, slots: tuple[Slot, ...], pose: bool) -> Place:
    if pose:
        return replace(place, position=slots[:3], orientation=slots[3:])
    return replace(place, joints=slots, base=None)


def _slots(inner: str, at: int, pose: bool) -> tuple[Slot, ...] | None:
    """Return the six numbers of a list, or None where it is another."""
    slots: list[Slot] = []
    pieces = inner.split(",")
    for number, piece in enumerate(pieces):
        match = _ELEMENT.fullmatch(piece)
        if match is None:
            return None
        kind = "number" if match["number"] is not None else "degrees"
        decimals = DECIMALS["position" if pose and number < 3 else "rotation"]
        unit = 1.0 if kind == "number" else DEGREE
        slots.append(Slot(at + match.start(kind), match[kind], unit, decimals))
        at += len(piece) + 1
    return tuple(slots) if len(slots) == 6 else None
