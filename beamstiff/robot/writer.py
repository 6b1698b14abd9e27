"""Robots to YAML that people read: one line a part, SI numbers exact, what is default left out."""

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from beamstiff.errors import BeamstiffError, shown
from beamstiff.files import write_whole
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import Described, stiffness_text
from beamstiff.robot.fitted_model import FittedModel
from beamstiff.robot.parts import AXES, AddedEffect, Joint, JointStiffness
from beamstiff.robot.reader import VERSION, parse_robot

ENDINGS = (".yaml", ".yml", ".urdf")  # of files that are written whole, nothing lost
CONVERTED = (".sdf", ".xml", ".csv")  # what loses something, which `convert` notes
_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*\Z")
# lines that YAML keeps as they are in a block: the first not blank, at most one line end at the end
_BLOCK = re.compile(r"[^\s\x85\u2028\u2029\ufeff](?:[\t\x20-\x7e\xa0-\u2027\u202a-\ud7ff]|\n)*?[^\s]\n?")
_RESOLVER: Any = yaml.resolver.Resolver()
_ESCAPES = {'"': '\\"', "\\": "\\\\"}


def robot_to_yaml(robot: Robot) -> str:
    """Return the YAML text of a robot; `parse_robot` makes the same robot of it."""
    return "\n".join([f"beamstiff: {VERSION}", *rows_of(_written_fields(robot))]) + "\n"


def fragment_to_yaml(robot: Robot, keys: Iterable[str]) -> str:
    """Return the YAML text of some keys of a robot, those with their default value too."""
    written = _written_fields(robot)
    return "\n".join(rows_of({key: written.get(key, getattr(robot, key)) for key in keys})) + "\n"


def save_robot(robot: Robot, path: str | os.PathLike[str]) -> None:
    """Write a robot to a file, in one step: an old file stays as it is when anything goes wrong.

    Parameters
    ----------
    robot : Robot
    path : path of the file
        Its ending says the format: ``.yaml``, ``.yml`` or ``.urdf``. A robot that was read from a URDF is
        written into that text; what URDF cannot say stands in its ``<beamstiff>`` elements.

    Raises
    ------
    BeamstiffError
        When the file cannot be written, its ending is another one, or `load_robot` would refuse it: a robot
        that was changed by ``model_copy`` has not been checked.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        other = f"; `beamstiff convert robot.yaml --out {path}` writes others" if ending in CONVERTED else ""
        raise BeamstiffError(
            f"{path}: found the ending {ending or 'none'!r}, expected {' or '.join(ENDINGS)}{other}"
        )
    text = robot_to_yaml(robot)
    parse_robot(text, f"{path}: cannot be written")
    if ending == ".urdf":
        from beamstiff.robot.urdf.writer import robot_to_urdf  # which writes its extension with this module

        text = robot_to_urdf(robot)
    write_whole(Path(path), text)


def rows_of(fields: Mapping[str, object]) -> Iterator[str]:
    """Yield the lines of keys with their values, one line a part."""
    for name, value in fields.items():
        if name == "urdf" and isinstance(value, str) and _BLOCK.fullmatch(value):
            yield f"{name}: |{'' if value.endswith(chr(10)) else '-'}"
            yield from (f"  {line}" if line else "" for line in value.removesuffix("\n").split("\n"))
        elif isinstance(value, FittedModel):
            yield f"{name}:"
            yield from (f"  {row}" for row in model_rows(value))
        elif isinstance(value, Mapping) and value:
            yield f"{name}:"
            yield from (f"  {_text(key)}: {flow_text(item)}" for key, item in value.items())
        elif isinstance(value, tuple) and value and isinstance(value[0], Described):
            yield f"{name}:"
            yield from (f"  {row}" for item in value for row in item_rows(item))
        else:
            yield f"{name}: {flow_text(value)}"


def item_rows(item: object) -> Iterator[str]:
    """Yield the lines of an item of a list: one line, or of an effect one a key."""
    if not isinstance(item, AddedEffect):
        yield f"- {flow_text(item)}"
        return
    start = "- "
    for row in _tables(_written_fields(item)):
        yield f"{start}{row}"
        start = "  "


def model_rows(model: FittedModel) -> Iterator[str]:
    """Yield the lines of a fitted model: a line a cube, a term or a reading."""
    for name, value in _written_fields(model).items():
        if isinstance(value, Described):
            yield f"{name}:"
            yield from (f"  {row}" for row in _tables(_written_fields(value)))
        else:
            yield from _tables({name: value})


def _tables(fields: Mapping[str, object]) -> Iterator[str]:
    for name, value in fields.items():
        if isinstance(value, tuple) and value and isinstance(value[0], tuple | Described):
            yield f"{name}:"
            yield from (f"  - {flow_text(item)}" for item in value)
        else:
            yield f"{name}: {flow_text(value)}"


def _written_fields(part: Described) -> dict[str, object]:
    """Return the fields that differ from their default, stiffness in words where it is rigid or free."""
    # a rigid direction that was given as such may not be left out: a passive joint must name its own axis
    kept = part.model_fields_set if isinstance(part, JointStiffness) else set()
    fields: dict[str, object] = {}
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if value == field.get_default(call_default_factory=True) and name not in kept:
            continue
        if isinstance(value, float) and (isinstance(part, JointStiffness) or name == "stiffness"):
            value = stiffness_text(value)
        elif isinstance(part, Joint) and name == "axis":
            value = next((letter for letter, axis in AXES.items() if axis == value), value)
        fields[name] = value
    return fields


def flow_text(value: object) -> str:
    """Return a value in YAML's flow style."""
    match value:
        case bool():
            return str(value).lower()
        case int():
            return str(value)
        case str():
            return _text(value)
        case float():
            return _number(value)
        case Described():
            return flow_text(_written_fields(value))
        case Mapping():
            return f"{{{', '.join(f'{_text(key)}: {flow_text(item)}' for key, item in value.items())}}}"
        case tuple():
            return f"[{', '.join(map(flow_text, value))}]"
    raise BeamstiffError(f"a robot with {shown(value)} in it cannot be written")


def _number(value: float) -> str:
    """Return the shortest text that is read back as the same number, by YAML 1.1 readers too."""
    if not math.isfinite(value):
        raise BeamstiffError(f"a robot with the number {value} in it cannot be written")
    if value.is_integer() and abs(value) < 1e6 and repr(value) != "-0.0":
        return str(int(value))
    if value == 0.0 or 1e-4 <= abs(value) < 1e6:
        return repr(value)
    return np.format_float_scientific(value, trim="0")  # 1.0e-05: 1e-05 is text in YAML 1.1


def _text(value: str) -> str:
    """Return a text, quoted where some YAML reader would make anything else of it."""
    if _BARE.match(value) and _RESOLVER.resolve(yaml.ScalarNode, value, (True, False)).endswith(":str"):
        return value
    return f'"{"".join(map(_escaped, value))}"'


def _escaped(character: str) -> str:
    if character.isprintable() or character in _ESCAPES:
        return _ESCAPES.get(character, character)
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
