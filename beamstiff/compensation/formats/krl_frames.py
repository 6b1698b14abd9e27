"""What $BASE and $TOOL are at every line of a KRL program, as far as its text says.

They are set by ``$BASE = ..``, ``BAS(#BASE,n)``, and the FDAT of a point (``FDAT_ACT = ..``; FP1 belongs to
the point XP1). A frame is known where it is a literal, $NULLFRAME, number 0, or a variable that one line of
the file gives a literal to.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.compensation.editing import NUMBER
from beamstiff.compensation.formats.program import Place, common_frame
from beamstiff.compensation.path import StatedFrame
from beamstiff.measure.orientation import KUKA
from beamstiff.se3 import Array, transform

_NAME = r"[A-Za-z$_]\w*(?:\s*\[\s*\d*\s*\])?"
_LITERAL = re.compile(rf"({_NAME})\s*=\s*(\{{[^{{}}]*\}})")
_SET = re.compile(r"\$(?P<what>BASE|TOOL|ROBROOT|WORLD)(?P<part>\.\w+)?\s*=(?!=)(?P<value>.*)", re.IGNORECASE)
_FIXED_TOOL = re.compile(r"\$IPO_MODE\s*=\s*#TCP", re.IGNORECASE)
_BAS = re.compile(r"\bBAS\s*\(\s*#(?P<what>BASE|TOOL)\s*,\s*(?P<number>\w+)\s*\)", re.IGNORECASE)
_ACTIVE = re.compile(rf"\bFDAT_ACT\s*=\s*(?P<value>\{{[^{{}}]*\}}|{_NAME})", re.IGNORECASE)
_NUMBERS = re.compile(r"\b(?P<what>TOOL|BASE)_NO\s+(?P<number>\d+)", re.IGNORECASE)
_PART = re.compile(r"\b([XYZABC])\s+([^\s,}]+)", re.IGNORECASE)
_NUMBER = re.compile(NUMBER)


class Literals:
    """The structures that a program gives to names, each once."""

    def __init__(self, code: str) -> None:
        found = [(_plain(name), value) for name, value in _LITERAL.findall(code)]
        names = [name for name, _ in found]
        self.by_name = {name: value for name, value in found if names.count(name) == 1}

    def pose(self, text: str) -> Array | None:
        """Return the frame (4, 4) that an expression stands for, or None."""
        text = _plain(text)
        if text == "$NULLFRAME":
            return np.eye(4)
        text = self.by_name.get(text, text)
        if not re.fullmatch(r"\{[^{}]*\}", text):
            return None
        found = _PART.findall(text)
        if not found or not all(_NUMBER.fullmatch(value) for _, value in found):
            return None
        parts = {key.upper(): float(value) for key, value in found}
        position, angles = ([parts.get(key, 0.0) for key in keys] for keys in ("XYZ", "ABC"))
        return np.asarray(transform(KUKA.rotations(np.radians([angles])), 1e-3 * np.array([position]))[0])

    def numbered(self, what: str, number: str, line: int) -> StatedFrame:
        """Return base or tool by its number."""
        pose = np.eye(4) if number == "0" else self.pose(f"{what}_DATA[{number}]")
        return StatedFrame(f"{what.lower()} {number}", line, pose)


@dataclass(frozen=True, eq=False)
class FrameState:
    """The frame and the tool that hold at a line; None: nothing was said."""

    literals: Literals
    base: StatedFrame | None = None
    tool: StatedFrame | None = None

    def after(self, line: str, number: int) -> FrameState:
        """Return what holds after a line."""
        state = self
        for match in _SET.finditer(line):
            what, value = match["what"].upper(), match["value"].strip()
            known = match["part"] is None and what in ("BASE", "TOOL")
            name = f"${what}{match['part'] or ''} = {value}"
            frame = StatedFrame(name, number, self.literals.pose(value) if known else None)
            state = state._with(what, frame)
        for match in _BAS.finditer(line):
            frame = self.literals.numbered(match["what"].upper(), match["number"], number)
            state = state._with(match["what"].upper(), frame)
        if _FIXED_TOOL.search(line):
            state = replace(state, base=StatedFrame("$IPO_MODE = #TCP", number, None))
        if active := _ACTIVE.search(line):
            value = active["value"]
            state = state._of_data(value, number) or replace(
                state,
                base=StatedFrame(f"the base of {value}", number, None),
                tool=StatedFrame(f"the tool of {value}", number, None),
            )
        return state

    def of_point(self, name: str) -> FrameState | None:
        """Return what the FDAT of a point says (FP1 of XP1), if the file holds it."""
        return self._of_data(f"F{name[1:]}", 0) if name.startswith("X") else None

    def common(self, states: Sequence[FrameState], place: Place) -> FrameState:
        """Return what holds at all motions to a place; where they differ, frames of unknown pose."""
        base = common_frame([state.base for state in states], place.name, place.line)
        tool = common_frame([state.tool for state in states], place.name, place.line)
        return FrameState(self.literals, base, tool)

    def _of_data(self, value: str, line: int) -> FrameState | None:
        data = self.literals.by_name.get(_plain(value), value)
        numbers = {match["what"].upper(): match["number"] for match in _NUMBERS.finditer(data)}
        if not numbers:
            return None
        if "#TCP" in data.upper():
            return replace(self, base=StatedFrame("IPO_FRAME #TCP", line, None))
        state = self
        for what, number in numbers.items():
            state = state._with(what, self.literals.numbered(what, number, line))
        return state

    def _with(self, what: str, frame: StatedFrame) -> FrameState:
        return replace(self, tool=frame) if what == "TOOL" else replace(self, base=frame)


def _plain(text: str) -> str:
    """Return an expression without the blanks that mean nothing, in capitals."""
    return text.strip().upper() if "{" in text else re.sub(r"\s+", "", text).upper()
