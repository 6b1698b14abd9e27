"""YAML text to plain maps, lists and scalars, with the line of every key: safe, bounded, no surprises.

Built from the parser's events, not by PyYAML's constructors: no tag is ever acted upon, so nothing can
run; nothing recurses; aliases are counted before they are used. Scalars follow YAML 1.2 (true, false, null,
decimal numbers): ``1:30``, ``010``, ``on`` or a date stay the text they are, and ``2e11`` is a number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeAlias

import yaml

from beamstiff.errors import BeamstiffError, shown
from beamstiff.files import LARGEST
from beamstiff.robot.fields import path_text

DEEPEST = 40  # levels; a robot has five
MOST_VALUES = 10_000_000
MOST_REPEATED = 1_000_000  # values that aliases stand for

# the line of a value, and the places below it: by key in a map, in order in a list, none in a scalar
_Place: TypeAlias = tuple[int, Any]

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]*)\Z")
_FLOAT = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?\Z")
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Lines:
    """The line of every key path of a YAML text, counted from 1."""

    __slots__ = ("_root",)

    def __init__(self, root: _Place) -> None:
        self._root = root

    def at(self, path: Sequence[str | int]) -> int:
        """Return the line of a key path, or of the nearest part of it that exists."""
        line, below = self._root
        for part in path:
            place: _Place | None = None
            if isinstance(below, dict) and isinstance(part, str):
                place = below.get(part)
            elif isinstance(below, list) and isinstance(part, int) and 0 <= part < len(below):
                place = below[part]
            if place is None:
                break
            line, below = place
        return line


def parse_yaml(text: str, name: str = "<text>") -> tuple[Any, Lines]:
    r"""Return the plain data of a YAML text, and the line of every key; messages call the text by `name`.

    >>> data, lines = parse_yaml("gravity: [0, 0, -9.81]\nstart: 1:30\nE: 2e11")
    >>> data, lines.at(("start",))
    ({'gravity': [0, 0, -9.81], 'start': '1:30', 'E': 200000000000.0}, 2)
    """
    text = text.removeprefix("\ufeff")
    if len(text) > LARGEST:
        raise BeamstiffError(f"{name}: larger than {LARGEST / 1e6:g} MB, which is the most that is read")
    if character := _UNPRINTABLE.search(text):
        line = text.count("\n", 0, character.start()) + 1
        raise BeamstiffError(f"{name}:{line}: found the character {character[0]!r}, expected printable text")
    builder = _Builder(name)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.MarkedYAMLError as error:
        raise BeamstiffError(_not_valid(error, text, name)) from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        if isinstance(error, BeamstiffError):
            raise
        # an escape such as "\\U00110000" names no character
        raise BeamstiffError(f"{name}:{builder.line}: not valid YAML: {str(error)[:200]}") from None
    return builder.result()


def _not_valid(error: yaml.MarkedYAMLError, text: str, name: str) -> str:
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark else 1
    if "maximum nesting depth" in (error.problem or ""):  # the limit of libyaml, which reads ahead
        return f"{name}:{line}: nested deeper than {DEEPEST} levels"
    message = f"{name}:{line}: not valid YAML: {(error.problem or 'cannot be read')[:200]}"
    if error.context:
        message += f" {error.context}"
        if error.context_mark and error.context_mark.line + 1 != line:
            message += f" that starts on line {error.context_mark.line + 1}"
    rows = text.split("\n", line)
    if len(rows) >= line and "\t" in re.match(r"\s*", rows[line - 1])[0]:  # type: ignore[index]  # always matches
        message += " (indent with spaces, not tabs)"
    return message


@dataclass(slots=True)
class _Open:
    """A map or list that has not ended yet."""

    data: Any
    places: Any
    anchor: str | None
    values_before: int
    is_map: bool
    key: str | None = None
    key_line: int = 0


class _Builder:
    """Builds plain data from the parser's events, one after the other."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.line = 1
        self.documents = 0
        self.values = 0
        self.repeated = 0
        self.open: list[_Open] = []
        # what an anchor stands for: value, places below, number of values; None while it is open
        self.anchors: dict[str, tuple[Any, Any, int] | None] = {}
        self.root: tuple[Any, _Place] = (None, (1, None))

    def take(self, event: Any) -> None:
        kind = type(event)
        if kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
            ended = self.open.pop()
            if ended.anchor is not None:
                self.anchors[ended.anchor] = (ended.data, ended.places, self.values - ended.values_before)
            return
        self.line = event.start_mark.line + 1
        if kind is yaml.DocumentStartEvent:
            self.documents += 1
            if self.documents > 1:
                self.refuse("found a second document (---), expected one robot a file")
        elif kind is yaml.ScalarEvent:
            self.take_scalar(event)
        elif kind is yaml.AliasEvent:
            self.take_alias(event.anchor)
        elif kind is yaml.MappingStartEvent:
            self.take_start(event, {}, {})
        elif kind is yaml.SequenceStartEvent:
            self.take_start(event, [], [])

    def take_scalar(self, event: yaml.ScalarEvent) -> None:
        if event.tag is not None:
            self.refuse_tag(event.tag)
        if self.awaits_key():
            self.take_key(event)
            return
        value = _resolve(event.value) if event.implicit[0] else event.value
        self.add(value, None)
        if event.anchor is not None:
            self.anchors[event.anchor] = (value, None, 1)

    def take_key(self, event: yaml.ScalarEvent) -> None:
        key, inside = event.value, self.open[-1]
        if event.anchor is not None:
            self.refuse(f"found the anchor &{event.anchor[:40]} on a key, expected anchors on values only")
        if not key.strip():
            self.refuse("found an empty key, expected a name before the colon")
        if key == "<<" and event.implicit[0]:
            self.refuse("found the merge key <<, which is not supported: write the keys out")
        if key in inside.data:
            self.refuse(f"duplicate key {shown(key)}, first on line {inside.places[key][0]}")
        inside.key, inside.key_line = key, self.line

    def take_start(self, event: yaml.CollectionStartEvent, data: Any, places: Any) -> None:
        if event.tag is not None:
            self.refuse_tag(event.tag)
        is_map = isinstance(data, dict)
        if self.awaits_key():
            self.refuse(f"found a {'map' if is_map else 'list'} as a key, expected text")
        if len(self.open) >= DEEPEST:
            self.refuse(f"nested deeper than {DEEPEST} levels")
        before = self.values
        self.add(data, places)
        self.open.append(_Open(data, places, event.anchor, before, is_map))
        if event.anchor is not None:
            self.anchors[event.anchor] = None

    def take_alias(self, anchor: str) -> None:
        name = anchor[:40]
        if self.awaits_key():
            self.refuse(f"found the alias *{name} as a key, expected text")
        if anchor not in self.anchors:
            self.refuse(f"found the alias *{name}, but no anchor &{name} before it")
        anchored = self.anchors[anchor]
        if anchored is None:
            self.refuse(f"the alias *{name} holds itself")
        value, places, size = anchored
        self.repeated += size
        if self.repeated > MOST_REPEATED:
            self.refuse(f"the aliases of this file stand for more than {MOST_REPEATED:,} values")
        self.values += size - 1
        self.add(value, places)

    def awaits_key(self) -> bool:
        return bool(self.open) and self.open[-1].is_map and self.open[-1].key is None

    def add(self, value: Any, places: Any) -> None:
        """Put a value into the map or list that is open."""
        self.values += 1
        if self.values > MOST_VALUES:
            self.refuse(f"holds more than {MOST_VALUES:,} values, which is the most that is read")
        if not self.open:
            self.root = (value, (self.line, places))
            return
        inside = self.open[-1]
        if inside.is_map:
            inside.data[inside.key] = value
            inside.places[inside.key] = (inside.key_line, places)
            inside.key = None
        else:
            inside.data.append(value)
            inside.places.append((self.line, places))

    def result(self) -> tuple[Any, Lines]:
        value, place = self.root
        if value is None:
            raise BeamstiffError(f"{self.name}: is empty")
        return value, Lines(place)

    def refuse_tag(self, tag: str) -> NoReturn:
        text = tag.replace("tag:yaml.org,2002:", "!!")
        self.refuse(f"found the tag {shown(text)}, expected plain values: nothing in a file is ever run")

    def refuse(self, message: str) -> NoReturn:
        # what holds another open one holds it as its last entry
        path: list[str | int] = [
            next(reversed(outer.data)) if outer.is_map else len(outer.data) - 1 for outer in self.open[:-1]
        ]
        for inside in self.open[-1:]:
            if not inside.is_map:
                path.append(len(inside.data))
            elif inside.key is not None:
                path.append(inside.key)
        where = f"{path_text(tuple(path))}: " if path else ""
        raise BeamstiffError(f"{self.name}:{self.line}: {where}{message}")


def _resolve(text: str) -> Any:
    """Return what a plain scalar stands for."""
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in "+-.0123456789" or len(text) > 300:
        return text
    if _INTEGER.match(text):
        return int(text)
    if _FLOAT.match(text):
        value = float(text)
        # 1e999 stays text, so that whoever needs a number can say what was written
        return value if abs(value) < float("inf") else text
    return text
