"""YAML text to plain maps, lists and scalars, with the line of every key: safe, bounded, no surprises.

Built from the parser's events, not by PyYAML's constructors: no tag is ever acted upon, so nothing can
run; nothing recurses; aliases are counted before they are used. Scalars follow YAML 1.2 (true, false, null,
decimal numbers): ``1:30``, ``010``, ``on`` or a date stay the text they are, and ``2e11`` is a number.
"""

import re
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn, TypeAlias

import yaml

from beamstiff.errors import BeamstiffError, shown
from beamstiff.files import LARGEST
from beamstiff.robot.fields import path_text

DEEPEST = 40  # levels; a robot has five
MOST_VALUES = 10_000_000
MOST_REPEATED = 1_000_000  # values that aliases stand for

# the line of a value, and the places below it: by key in a map, by index in a list, none in a scalar
_Place: TypeAlias = tuple[int, dict[Any, Any]]
_Path: TypeAlias = tuple[str | int, ...]

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_LEAF: dict[Any, Any] = {}  # no places below
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
            if part not in below:
                break
            line, below = below[part]
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
    builder = _Builder(iter(yaml.parse(text, Loader=LOADER)), name)
    try:
        return builder.document()
    except yaml.MarkedYAMLError as error:
        raise BeamstiffError(_not_valid(error, text, name)) from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        if isinstance(error, BeamstiffError):
            raise
        # an escape such as "\\U00110000" names no character
        raise BeamstiffError(f"{name}:{builder.line}: not valid YAML: {str(error)[:200]}") from None


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
    if len(rows) >= line and re.match(r"\s*\t", rows[line - 1]):
        message += " (indent with spaces, not tabs)"
    return message


class _Builder:
    """Builds plain data from the parser's events; it may recurse, since nesting is bounded."""

    def __init__(self, events: Iterator[Any], name: str) -> None:
        self.events, self.name = events, name
        self.line, self.values, self.repeated = 1, 0, 0
        # what an anchor stands for: value, places below, number of values; None while it is open
        self.anchors: dict[str, tuple[Any, Any, int] | None] = {}

    def document(self) -> tuple[Any, Lines]:
        documents, value, place = 0, None, (1, _LEAF)
        for event in self.events:
            self.line = event.start_mark.line + 1
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self.refuse("found a second document (---), expected one robot a file")
            elif isinstance(event, yaml.NodeEvent):
                line = self.line
                value, below = self.node(event, ())
                place = (line, below)
        if value is None:
            raise BeamstiffError(f"{self.name}: is empty, expected keys of a robot file")
        return value, Lines(place)

    def node(self, event: Any, path: _Path) -> tuple[Any, Any]:
        """Return what begins with an event, and the places below it."""
        self.line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event.anchor or "", path)
        self.untagged(event, path)
        before = self.values
        if isinstance(event, yaml.ScalarEvent):
            self.count(1, path)
            data, places = (_resolve(event.value) if event.implicit[0] else event.value), _LEAF
        else:
            if len(path) >= DEEPEST:
                self.refuse(f"nested deeper than {DEEPEST} levels", path)
            self.count(1, path)
            if event.anchor is not None:
                self.anchors[event.anchor] = None
            data, places = (self.map_of if isinstance(event, yaml.MappingStartEvent) else self.list_of)(path)
        if event.anchor is not None:
            self.anchors[event.anchor] = (data, places, self.values - before)
        return data, places

    def map_of(self, path: _Path) -> tuple[Any, Any]:
        data: dict[str, Any] = {}
        places: dict[str, _Place] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            key = self.key(event, path, places)
            line = self.line
            data[key], below = self.node(next(self.events), (*path, key))
            places[key] = (line, below)
        return data, places

    def list_of(self, path: _Path) -> tuple[Any, Any]:
        data: list[Any] = []
        places: dict[int, _Place] = {}
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            value, below = self.node(event, (*path, len(data)))
            places[len(data)] = (event.start_mark.line + 1, below)
            data.append(value)
        return data, places

    def key(self, event: Any, path: _Path, places: dict[str, _Place]) -> str:
        self.line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            self.refuse(f"found the alias *{(event.anchor or '')[:40]} as a key, expected text", path)
        self.untagged(event, path)
        if not isinstance(event, yaml.ScalarEvent):
            kind = "map" if isinstance(event, yaml.MappingStartEvent) else "list"
            self.refuse(f"found a {kind} as a key, expected text", path)
        key: str = event.value
        if event.anchor is not None:
            self.refuse(
                f"found the anchor &{event.anchor[:40]} on a key, expected anchors on values only", path
            )
        if not key.strip():
            self.refuse("found an empty key, expected a name before the colon", path)
        if key == "<<" and event.implicit[0]:
            self.refuse("found the merge key <<, which is not supported: write the keys out", path)
        if key in places:
            self.refuse(f"duplicate key {shown(key)}, first on line {places[key][0]}", path)
        return key

    def alias(self, anchor: str, path: _Path) -> tuple[Any, Any]:
        name = anchor[:40]
        if anchor not in self.anchors:
            self.refuse(f"found the alias *{name}, but no anchor &{name} before it", path)
        anchored = self.anchors[anchor]
        if anchored is None:
            self.refuse(f"the alias *{name} holds itself", path)
        value, places, size = anchored
        self.repeated += size
        if self.repeated > MOST_REPEATED:
            self.refuse(f"the aliases of this file stand for more than {MOST_REPEATED:,} values", path)
        self.count(size, path)
        return value, places

    def count(self, values: int, path: _Path) -> None:
        self.values += values
        if self.values > MOST_VALUES:
            self.refuse(f"holds more than {MOST_VALUES:,} values, which is the most that is read", path)

    def untagged(self, event: Any, path: _Path) -> None:
        if event.tag is not None:
            text = event.tag.replace("tag:yaml.org,2002:", "!!")
            self.refuse(
                f"found the tag {shown(text)}, expected plain values: nothing in a file is ever run", path
            )

    def refuse(self, message: str, path: _Path = ()) -> NoReturn:
        where = f"{path_text(path)}: " if path else ""
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
