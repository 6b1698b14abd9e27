"""Types of the fields of a robot description: names, quantities, stiffness with its two exact ends."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, PlainSerializer, ValidationError

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.units import quantity

RIGID = math.inf
FREE = 0.0

Problem = tuple[tuple[str | int, ...], str]


class DescriptionError(BeamstiffError):
    """A description that cannot be used: where in it, and why; the first problem makes the message.

    Attributes
    ----------
    problems : list of (path, message)
        ``path`` holds the keys and list positions from the described object down to the fault.
    """

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        path, message = problems[0]
        super().__init__(f"{path_text(path)}: {message}" if path else message)


def path_text(path: tuple[str | int, ...]) -> str:
    """Return a key path as an engineer would write it: ``joints[3].stiffness.radial``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


class Described(BaseModel):
    """Base of all description classes: frozen, no unknown keys, faults raised as `DescriptionError`."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise DescriptionError(_problems(error, type(self))) from None


def _problems(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Flatten pydantic's error, nested descriptions included, into paths and messages of ours."""
    problems: list[Problem] = []
    for item in error.errors(include_url=False):
        path = tuple(item["loc"])
        inner = item.get("ctx", {}).get("error")
        shown = repr(item["input"])
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        if isinstance(inner, DescriptionError):
            problems += [((*path, *sub), message) for sub, message in inner.problems]
        elif isinstance(inner, BeamstiffError):
            problems.append((path, str(inner)))
        elif item["type"] == "missing":
            problems.append((path, "is missing"))
        elif item["type"] == "extra_forbidden":
            problems.append((path, f"unknown key{suggest(path[-1], model.model_fields)}"))
        elif item["type"] in ("model_type", "dict_type", "model_attributes_type"):
            problems.append((path, f"found {shown}, expected keys with values"))
        elif item["type"] in ("list_type", "tuple_type"):
            problems.append((path, f"found {shown}, expected a list"))
        elif item["type"] in ("too_short", "too_long"):
            problems.append((path, f"found {shown}: {item['msg']}"))
        elif item["type"] == "literal_error":
            expected = item["ctx"]["expected"]
            hint = suggest(item["input"], re.findall(r"'([^']*)'", expected))
            problems.append((path, f"found {shown}, expected {expected}{hint}"))
        else:
            problems.append((path, f"found {shown}: {item['msg']}"))
    return problems


def _name(value: Any) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        value = str(value)  # YAML reads a node called 7 as a number
    if (
        not isinstance(value, str)
        or not 0 < len(value) <= 200
        or not value.isprintable()
        or value != value.strip()
    ):
        raise BeamstiffError(
            f"found {str(value)[:60]!r}, expected a name: printable text of at most 200 characters"
        )
    return value


def _identifier(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,99}", value) or value == "pi":
        raise BeamstiffError(
            f"found {str(value)[:60]!r}, expected a variable name of letters, digits and _, not 'pi'"
        )
    return value


def _of(kind: str, positive: bool = False) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        result = quantity(value, kind)
        if positive and result <= 0:
            raise BeamstiffError(f"found {value!r}, expected a positive {kind}")
        return result

    return read


def _stiffness(kind: str) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        if value in ("rigid", RIGID):
            return RIGID
        if value == "free" or (isinstance(value, float) and value == FREE):
            return FREE
        try:
            result = quantity(value, kind)
        except BeamstiffError as error:
            raise BeamstiffError(f"{error}; or rigid, or free") from None
        if result <= 0:
            raise BeamstiffError(f"found {value!r}, expected a positive {kind}, or rigid, or free")
        return result

    return read


def stiffness_text(value: float) -> float | str:
    """Return a stiffness as it is written: a number, or ``rigid`` or ``free``."""
    return "rigid" if value == RIGID else "free" if value == FREE else value


Name = Annotated[str, BeforeValidator(_name)]
Identifier = Annotated[str, BeforeValidator(_identifier)]
Length = Annotated[float, BeforeValidator(_of("length"))]
PositiveLength = Annotated[float, BeforeValidator(_of("length", positive=True))]
Acceleration = Annotated[float, BeforeValidator(_of("acceleration"))]
PositiveMass = Annotated[float, BeforeValidator(_of("mass", positive=True))]
PositiveModulus = Annotated[float, BeforeValidator(_of("modulus", positive=True))]
PositiveArea = Annotated[float, BeforeValidator(_of("area", positive=True))]
PositiveSecondMoment = Annotated[float, BeforeValidator(_of("second moment of area", positive=True))]
Number = Annotated[float, BeforeValidator(_of("number"))]
TranslationalStiffness = Annotated[
    float, BeforeValidator(_stiffness("translational stiffness")), PlainSerializer(stiffness_text)
]
RotationalStiffness = Annotated[
    float, BeforeValidator(_stiffness("rotational stiffness")), PlainSerializer(stiffness_text)
]
Vector = tuple[Number, Number, Number]
Point = tuple[Length, Length, Length]
