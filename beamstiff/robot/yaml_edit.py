"""Robots written into the YAML text that they came from: only what changed is replaced.

Comments, order, units, line breaks and the digits of all other numbers are the user's. ruamel.yaml's round
trip keeps less (of the 8 bundled robots 5 come back with other lines: flow maps over two lines are joined,
`-0` becomes `0`, last digits of floats change), so values are replaced at the places that the parser tells.
"""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import yaml

from beamstiff.errors import BeamstiffError
from beamstiff.files import read_text
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import Described, stiffness_text
from beamstiff.robot.fitted_model import FittedModel
from beamstiff.robot.parts import JointStiffness, Strut
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import flow_text, item_rows, model_rows, robot_to_yaml, rows_of
from beamstiff.robot.yaml_text import LOADER
from beamstiff.units import NUMBER, unit_size

NOISE = 1e-14  # relative: what conversions of units and 1/(1/k) leave behind
GUARD = 100.0  # rounding moves a value by no more than this part of its standard deviation

Edit: TypeAlias = tuple[int, int, str]  # from one character to another, and the text between them
# "1047 mm", "q2 - 90 deg", "q2 + 0.001": the last number, with what stands before it
_LAST = re.compile(
    rf"(?P<head>(?:.*?[^\s*/])??\s*)(?P<sign>[+-]?)\s*(?P<number>{NUMBER.removeprefix('[+-]?')})"
    r"(?:(?P<gap>\s*)(?P<unit>[A-Za-zµμ°%][^+-]*))?"
)


class _NotInPlaceError(Exception):
    """A change that the text cannot take in place."""


def robot_yaml(
    robot: Robot, source: str | Path, std: Mapping[str, float] | None = None, head: str = ""
) -> str:
    """Return the YAML text of a robot that may have changed since its file was read, `head` lines first.

    Of a file that is not YAML nothing can be kept. A parameter such as ``J12.torsional`` or ``f3.d`` is
    rounded to a hundredth of its standard deviation in `std`, SI; without one it is written with all its
    digits.
    """
    text = read_text(source) if Path(source).suffix.lower() in (".yaml", ".yml") else ""
    edited = edited_yaml(text, robot, std or {}, source)
    if edited is None:
        return head + robot_to_yaml(robot)
    newline, known = _newline(text), set(text.splitlines())
    return "".join(f"{line}{newline}" for line in head.splitlines() if line not in known) + edited


def edited_yaml(
    text: str, robot: Robot, std: Mapping[str, float], source: str | Path = "<text>"
) -> str | None:
    """Return a robot file's text with what differs in `robot`; None where that cannot be said in place."""
    try:
        old = parse_robot(text, str(source))
        edits = set(_edits(yaml.compose(text, Loader=LOADER), old, robot, "", text, std))
        result = _applied(text, edits)
        return result if _same(parse_robot(result), robot, std) else None
    except (BeamstiffError, _NotInPlaceError):
        return None


def _applied(text: str, edits: set[Edit]) -> str:
    at, parts = 0, []
    for start, end, new in sorted(edits):
        if start < at:  # two values for one place: it has an alias
            raise _NotInPlaceError
        parts += [text[at:start], new]
        at = end
    return "".join([*parts, text[at:]])


def _edits(node: Any, old: Any, new: Any, name: str, text: str, std: Mapping[str, float]) -> Iterator[Edit]:
    """Yield what makes the new value of the old one at a node; `name` is that of the parameter."""
    if isinstance(new, FittedModel) and (old != new or isinstance(node, yaml.ScalarNode)):
        # a model in a file of its own goes into the robot's: what is written may stand elsewhere
        rows = f"{_newline(text)}  ".join(["", *model_rows(new)])
        key_end = len(text[: node.start_mark.index].rstrip())  # behind the key's colon
        yield key_end, _end(node), rows
        return
    if old == new:
        return
    if isinstance(node, yaml.ScalarNode):
        if not _near(new, old, None):
            yield node.start_mark.index, node.end_mark.index, _scalar(node, new, std.get(name))
    elif isinstance(node, yaml.MappingNode) and isinstance(new, Described | Mapping):
        below = {key.value: value for key, value in node.value}
        before, after = _items(old), _items(new)
        if not (below and before.keys() <= after.keys()):
            raise _NotInPlaceError
        for key, value in after.items():
            if key == "model" and key in below and value is None:
                yield _line_of(node, key, text)
            elif key == "calibrated" and key in below and value and before[key] != value:
                start = below[key].start_mark  # another calibration: its list as a whole
                items = [row.strip() for row in list(rows_of({key: value}))[1:]]
                yield start.index, _end(below[key]), f"{_newline(text)}{' ' * start.column}".join(items)
            elif key in below:
                yield from _edits(below[key], before.get(key), value, _inner(name, key), text, std)
            elif key not in before or before[key] != value:
                yield _added(node, node.value[-1][1], {key: value}, text)
    elif isinstance(node, yaml.SequenceNode) and isinstance(new, tuple) and node.value:
        names = [_inner(name, item, at) for at, item in enumerate(new)]
        if names[: len(old)] == [_inner(name, item, at) for at, item in enumerate(old)]:
            for below, was, now, inner in zip(node.value, old, new, names, strict=False):
                yield from _edits(below, was, now, inner, text, std)
            if more := [_added(node, node.value[-1], item, text) for item in new[len(old) :]]:
                yield *more[0][:2], "".join(new for _, _, new in more)  # one edit keeps their order
        elif isinstance(old[0], Described):
            raise _NotInPlaceError
        elif node.flow_style:
            yield node.start_mark.index, node.end_mark.index, flow_text(new)
        elif new and new == tuple(item for item in old if item in new):
            for below, item in zip(node.value, old, strict=True):
                if item not in new:  # with its line
                    stop = text.find("\n", below.end_mark.index) + 1 or len(text)
                    yield text.rfind("\n", 0, below.start_mark.index) + 1, stop, ""
        else:
            raise _NotInPlaceError
    else:
        raise _NotInPlaceError


def _added(node: Any, last: Any, value: Any, text: str) -> Edit:
    """Return a new key with its value, or item of a list, behind the last one."""
    end = _end(last)
    if node.flow_style:
        return end, end, f", {flow_text(value)[1:-1] if isinstance(value, dict) else flow_text(value)}"
    lines = rows_of(value) if isinstance(value, dict) else item_rows(value)
    stop, newline = text.find("\n", end), _newline(text)
    stop = len(text) if stop < 0 else stop - len(newline) + 1
    return stop, stop, "".join(f"{newline}{' ' * node.start_mark.column}{line}" for line in lines)


def _end(node: Any) -> int:
    """Return where a node ends; the parser counts the comments below a block as part of it."""
    while isinstance(node, yaml.CollectionNode) and not node.flow_style:
        node = node.value[-1][1] if isinstance(node, yaml.MappingNode) else node.value[-1]
    end: int = node.end_mark.index
    return end


def _line_of(node: Any, key: str, text: str) -> Edit:
    """Return what takes a key and its value away, with their lines."""
    found, value = next(pair for pair in node.value if pair[0].value == key)
    stop = text.find("\n", _end(value)) + 1 or len(text)
    return text.rfind("\n", 0, found.start_mark.index) + 1, stop, ""


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _items(part: Any) -> Mapping[str, Any]:
    if isinstance(part, Mapping):
        return part
    items = {name: getattr(part, name) for name in type(part).model_fields}
    if isinstance(part, JointStiffness | Strut):
        springs = items if isinstance(part, JointStiffness) else ("stiffness",)
        return {
            name: stiffness_text(item) if name in springs and item in (0.0, math.inf) else item
            for name, item in items.items()
        }
    return items


def _inner(name: str, key: Any, at: int = 0) -> str:
    """Return the name of what stands below a key, or of an item of a list, as parameters are called."""
    if isinstance(key, Described):
        return str(getattr(key, "name", at))
    if not isinstance(key, str):  # a coordinate
        return f"{name.removesuffix('.at')}.{'xyz'[at]}" if at < 3 else name
    return name if key == "stiffness" or not name else f"{name}.{key}"


def _scalar(node: Any, new: Any, std: float | None) -> str:
    """Return a value as the old one was written: in its unit and its quotes."""
    old = _LAST.fullmatch(node.value.strip())
    unit = old["unit"].strip() if old and old["unit"] else ""
    size, quote = 1.0, node.style or ""
    try:
        size = unit_size(unit) if unit else 1.0
    except BeamstiffError:  # of an expression, `10 mm/rad * q1`
        unit = ""
    if isinstance(new, str) and (last := _LAST.fullmatch(new)) and last["sign"] and not last["unit"]:
        body = f"{last['head']}{last['sign']} {_magnitude(float(last['number']), size, std)}"
    elif isinstance(new, float) and math.isfinite(new):
        body = _magnitude(new, size, std)
        if not unit:
            return flow_text(float(body))
    else:
        return flow_text(new)
    whole = f"{body}{(old and old['gap']) or ' '}{unit}".strip() if unit else body
    return f"{quote}{whole}{quote}" if quote or unit else flow_text(whole)


def _magnitude(value: float, size: float, std: float | None) -> str:
    """Return the shortest number of a unit that is near enough to an SI value."""
    for digits in range(1, 18):
        short = float(f"{value / size:.{digits}g}")
        if _near(short * size, value, std) or digits == 17:
            break
    if short == 0.0 or 1e-4 <= abs(short) < 1e6:
        return np.format_float_positional(short, trim="-")
    return np.format_float_scientific(short, trim="-", exp_digits=1).replace("e+", "e")


def _near(one: Any, other: Any, std: float | None) -> bool:
    """Tell whether two values are the same to rounding errors, or to a small part of a standard deviation."""
    if not (isinstance(one, float) and isinstance(other, float)):
        return bool(one == other)
    known = std / GUARD if std is not None and math.isfinite(std) else 0.0
    return abs(one - other) <= max(known, NOISE * abs(other))


def _same(written: Robot, robot: Robot, std: Mapping[str, float]) -> bool:
    """Tell whether the text stands for the robot, to the digits that are written."""
    pairs = zip(_leaves(written), _leaves(robot), strict=False)
    loose = {name: 1.001 * value for name, value in std.items()}
    return len([*_leaves(written)]) == len([*_leaves(robot)]) and all(
        name == other and _near(one, two, loose.get(name)) for (name, one), (other, two) in pairs
    )


def _leaves(robot: Robot) -> Iterator[tuple[str, Any]]:
    """Yield every value of a robot with its name."""

    def below(part: Any, name: str) -> Iterator[tuple[str, Any]]:
        if isinstance(part, Described | Mapping):
            for key, item in _items(part).items():
                yield from below(item, _inner(name, key))
        elif isinstance(part, tuple):
            for at, item in enumerate(part):
                yield from below(item, _inner(name, item, at))
        else:
            yield name, part

    yield from below(robot.model_copy(update={"frames": ()}), "")
    expressions = frame_expressions(robot)
    for frame in robot.frames:
        yield frame.name, frame.parent
        for name, exact in expressions[frame.name].items():
            yield f"{frame.name}.{name}", exact.constant
            yield f"{frame.name}.{name}", dict(exact.coefficients)
