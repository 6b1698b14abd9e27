r"""Which tool and work object the targets of a RAPID program are in, as far as its text says.

A motion names both; they are known where the file declares them once and sets them nowhere else, and tool0
and wobj0 always. ConfJ \Off and ConfL \Off take the configuration away from targets of such motions.
"""

import re
from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.compensation.editing import line_of
from beamstiff.compensation.formats.program import Place, common_frame
from beamstiff.compensation.path import StatedFrame
from beamstiff.measure.orientation import Quaternion
from beamstiff.measure.text import RowError
from beamstiff.se3 import Array, transform

_POSE = r"\[\s*\[([^\[\]]*)\]\s*,\s*\[([^\[\]]*)\]\s*\]"
_TOOL = re.compile(rf"\btooldata\s+(\w+)\s*:=\s*\[\s*(TRUE|FALSE)\s*,\s*{_POSE}", re.IGNORECASE)
_OBJECT = re.compile(
    rf"\bwobjdata\s+(\w+)\s*:=\s*\[\s*(TRUE|FALSE)\s*,\s*(TRUE|FALSE)\s*,\s*,\s*{_POSE}\s*,\s*{_POSE}",
    re.IGNORECASE,
)
_MOTION = re.compile(
    r"\b(?:Move|Search|Trigg|Arc|Spot|Paint|Disp)(?P<kind>[JLC])\w*(?P<rest>[\s\\][^;]*);", re.IGNORECASE
)
_WORK_OBJECT = re.compile(r"\\\s*WObj\s*:=\s*(\w+)", re.IGNORECASE)
_DISPLACED = re.compile(r"\b(PDispOn|PDispSet)\b", re.IGNORECASE)
_WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True)
class _Motion:
    start: int
    end: int
    line: int
    linear: bool
    tool: str
    work_object: str


class Motions:
    """The motions of a program and the frames that it declares."""

    def __init__(self, code: str) -> None:
        self._frames = {"tool0": np.eye(4), "wobj0": np.eye(4)}
        for name, held, *numbers in _TOOL.findall(code):
            self._declare(code, name, held.upper() == "TRUE", [numbers])
        for name, held, fixed, *numbers in _OBJECT.findall(code):
            usable = held.upper() == "FALSE" and fixed.upper() == "TRUE"
            self._declare(code, name, usable, [numbers[:2], numbers[2:]])
        self._motions: list[_Motion] = []
        self._to: dict[str, list[_Motion]] = {}
        for match in _MOTION.finditer(code):
            motion = _motion(code, match)
            self._motions.append(motion)
            for word in set(_WORD.findall(match["rest"].lower())):
                self._to.setdefault(word, []).append(motion)
        self._starts = [motion.start for motion in self._motions]
        self._off = {kind for kind in "JL" if re.search(rf"\bConf{kind}\s*\\\s*Off\b", code, re.IGNORECASE)}
        displaced = _DISPLACED.search(code)
        self._displaced = displaced and StatedFrame(displaced[1], line_of(code, displaced.start()), None)

    def applied(self, place: Place) -> Place:
        """Return a target with the frames of the motions to it, and without a configuration that is off."""
        start = place.position[0].start
        at = bisect_right(self._starts, start) - 1
        if at >= 0 and start < self._motions[at].end:
            used = [self._motions[at]]
        else:
            used = self._to.get(place.name.lower().partition("{")[0], [])
        kinds = {"L" if motion.linear else "J" for motion in used}
        return replace(
            place,
            base=self._displaced or self._common([(one.work_object, one.line) for one in used], place),
            tool=self._common([(one.tool, one.line) for one in used], place),
            posture=None if used and kinds <= self._off else place.posture,
        )

    def _common(self, used: list[tuple[str, int]], place: Place) -> StatedFrame | None:
        frames = [StatedFrame(name, line, self._frames.get(name)) for name, line in used]
        return common_frame(frames, place.name, place.line)

    def _declare(self, code: str, name: str, usable: bool, numbers: list[list[str]]) -> None:
        set_often = len(re.findall(rf"\b{name}\b(?:\.\w+)*\s*:=", code, re.IGNORECASE)) > 1
        pose = np.eye(4)
        for position, orientation in numbers:
            part = _pose(position, orientation)
            usable = usable and part is not None
            pose = pose @ (np.eye(4) if part is None else part)
        if usable and not set_often:
            self._frames[name.lower()] = pose


def _motion(code: str, match: re.Match[str]) -> _Motion:
    """Return a motion; its tool is the last of its arguments."""
    found = _WORK_OBJECT.search(match["rest"])
    last = _arguments(match["rest"].lower())[-1].strip()
    tool = _WORD.match(last)
    return _Motion(
        start=match.start(),
        end=match.end(),
        line=line_of(code, match.start()),
        linear=match["kind"].upper() != "J",
        tool=tool[0] if tool else last,
        work_object=found[1].lower() if found else "wobj0",
    )


def _arguments(text: str) -> list[str]:
    """Return what commas outside of brackets part."""
    depth, parts = 0, [""]
    for letter in text:
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _pose(position: str, orientation: str) -> Array | None:
    try:
        at = np.array([[float(number) for number in position.split(",")]])
        turn = Quaternion().rotations(np.array([[float(number) for number in orientation.split(",")]]))
    except (ValueError, RowError):
        return None
    return transform(turn, 1e-3 * at)[0] if at.shape == (1, 3) else None
