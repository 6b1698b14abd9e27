"""Types of the fields of a robot description: names, quantities, stiffness with its two exact ends."""

import math
import re
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, PlainSerializer, ValidationError

from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.units import UNITS, quantity, with_unit

RIGID = math.inf
FREE = 0.0

_BARE = re.compile(r"\s*[+-]?[0-9]+(\.[0-9]*)?\s*")

Problem = tuple[tuple[str | int, ...], str]


class DescriptionError(BeamstiffError):
    """A description that cannot be used: path (keys, list positions) and message of each problem."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        path, message = problems[0]
        super().__init__(f"{path_text(path)}: {message}" if path else message)


def path_text(path: tuple[str | int, ...]) -> str:
    """Return a key path as an engineer would write it: ``joints[3].stiffness.radial``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f"{'.' if text else ''}{part[:80]}"
    return text if len(text) <= 120 else f"{text[:117]}..."


class Described(BaseModel):
    """Base of all description classes: frozen, no unknown keys, faults raised as `DescriptionError`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise DescriptionError(_problems(error, type(self))) from None


def _problems(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Flatten pydantic's error, nested descriptions included, into paths and messages of ours."""
    problems: list[Problem] = []
    for item in error.errors(include_url=False):
        path = tuple(part for part in item["loc"] if part != "[key]")
        inner = item.get("ctx", {}).get("error")
        if isinstance(inner, DescriptionError):
            problems += [((*path, *sub), message) for sub, message in inner.problems]
        elif isinstance(inner, BeamstiffError):
            problems.append((path, str(inner)))
        elif item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]:
            continue  # long enough, but for items with faults of their own
        elif item["type"] == "missing" and isinstance(path[-1], int):  # of a pair or a vector
            problems.append((path[:-1], f"found {shown(item['input'])}, expected more values in the list"))
        else:
            problems.append((path, _message(item, model)))
    return problems


def _message(item: Any, model: type[BaseModel]) -> str:
    """Say one of pydantic's own findings in our words."""
    found = f"found {shown(item['input'])}"
    match item["type"]:
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return f"unknown key{suggest(item['loc'][-1], model.model_fields)}"
        case "model_type" | "dict_type" | "mapping_type" | "model_attributes_type":
            return f"{found}, expected keys with values"
        case "list_type" | "tuple_type":
            return f"{found}, expected a list"
        case "too_short":
            return f"{found}, expected at least {item['ctx']['min_length']} in the list"
        case "too_long":
            return f"{found}, expected at most {item['ctx']['max_length']} in the list"
        case "literal_error":
            expected = item["ctx"]["expected"]
            hint = suggest(item["input"], re.findall("'([^']*)'", expected))
            return f"{found}, expected {expected}{hint}"
    return f"{found}: {item['msg']}"


def _name(value: Any) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        value = shown(value)  # YAML reads a node called 7 as a number
    quoted = isinstance(value, bool | float) and ", in quotes"
    if (
        not isinstance(value, str)
        or not 0 < len(value) <= 200
        or not value.isprintable()
        or value != value.strip()
    ):
        raise BeamstiffError(
            f"found {shown(value)}, expected a name: printable text of at most 200 characters{quoted or ''}"
        )
    return value


def _assembly(value: Any) -> str:
    return _name(f"{value:+d}" if type(value) is int else value)  # YAML reads +2 as a number


def _identifier(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,99}", value):
        raise BeamstiffError(f"found {shown(value)}, expected a variable name of letters, digits and _")
    if reads_as_number(value):
        raise BeamstiffError(f"found {shown(value)}, which reads as a number, expected a variable name")
    return value


def reads_as_number(name: str) -> bool:
    """Tell whether a word is a number for somebody: no variable is called so."""
    return name == "pi" or name.lower() in ("nan", "inf", "infinity")


def _truth(value: Any) -> bool:
    if not isinstance(value, bool):
        raise BeamstiffError(f"found {shown(value)}, expected true or false")
    return value


def described(value: Any, kind: str) -> float:
    """Return a quantity in SI; quoted numbers, which hold no unit though text carries one, are refused.

    ``2e11`` is no such text: YAML 1.1 makes text of a plain number that is written so.
    """
    check_has_unit(value, UNITS[kind])
    return quantity(value, kind)


def check_has_unit(value: Any, unit: str) -> None:
    """Refuse text that is a number alone, where a unit is to be expected; `unit` is an example."""
    if unit and isinstance(value, str) and _BARE.fullmatch(value) and float(value) != 0:
        raise BeamstiffError(
            f"found the text {shown(value)} without a unit: text carries its unit, such as "
            f"'{value.strip()} {unit}'; a number in {unit} stands without quotes"
        )


def _of(kind: str, positive: bool = False, least: float = -math.inf) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        result = described(value, kind)
        if positive and result <= 0:
            raise BeamstiffError(f"found {shown(value)}, expected a positive {kind}")
        if result < least:
            raise BeamstiffError(f"found {shown(value)}, expected a {kind} of at least {least:g}")
        return result

    return read


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*value)
    if length == 0.0:
        raise BeamstiffError("found a zero vector, expected a direction")
    if not 1e-12 < length < 1e12:  # its square must be a number
        raise BeamstiffError(f"found a vector of length {length:g}, expected a direction of length about 1")
    return value


def _stiffness(kind: str) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        if isinstance(value, str) and value in ("rigid", "free"):
            return RIGID if value == "rigid" else FREE
        try:
            result = described(value, kind)
        except BeamstiffError as error:
            raise BeamstiffError(f"{error}; or rigid, or free") from None
        if result <= 0:
            raise BeamstiffError(f"found {shown(value)}, expected a positive {kind}, or rigid, or free")
        return result

    return read


def _parameter_value(value: Any) -> float | str:
    """Return a number, or text with a unit as it is: only who knows the parameter knows its unit."""
    try:
        return quantity(value, "number")
    except BeamstiffError:
        with_unit(value)
    return str(value)


def _scale(value: Any) -> float | tuple[float, ...]:
    if isinstance(value, list | tuple) and value:
        return tuple(quantity(item, "number") for item in value)
    return quantity(value, "number")


def _correlation(value: Any) -> float:
    result = quantity(value, "number")
    if not -1.0 <= result <= 1.0:
        raise BeamstiffError(f"found {shown(value)}, expected a correlation from -1 to 1")
    return result


def stiffness_text(value: float) -> float | str:
    """Return a stiffness as it is written: a number, or ``rigid`` or ``free``."""
    return "rigid" if value == RIGID else "free" if value == FREE else value


Name = Annotated[str, BeforeValidator(_name)]
AssemblyName = Annotated[str, BeforeValidator(_assembly)]
Identifier = Annotated[str, BeforeValidator(_identifier)]
Truth = Annotated[bool, BeforeValidator(_truth)]
Length = Annotated[float, BeforeValidator(_of("length"))]
PositiveLength = Annotated[float, BeforeValidator(_of("length", positive=True))]
Acceleration = Annotated[float, BeforeValidator(_of("acceleration"))]
PositiveMass = Annotated[float, BeforeValidator(_of("mass", positive=True))]
PositiveModulus = Annotated[float, BeforeValidator(_of("modulus", positive=True))]
PositiveArea = Annotated[float, BeforeValidator(_of("area", positive=True))]
PositiveSecondMoment = Annotated[float, BeforeValidator(_of("second moment of area", positive=True))]
PositiveForce = Annotated[float, BeforeValidator(_of("force", positive=True))]
LeastLength = Annotated[float, BeforeValidator(_of("length", least=0.0))]
Density = Annotated[float, BeforeValidator(_of("density", least=0.0))]
ParameterValue = Annotated[float | str, BeforeValidator(_parameter_value)]
Scale = Annotated[float | tuple[float, ...], BeforeValidator(_scale)]
Number = Annotated[float, BeforeValidator(_of("number"))]
PositiveNumber = Annotated[float, BeforeValidator(_of("number", positive=True))]
Correlation = Annotated[float, BeforeValidator(_correlation)]
TranslationalStiffness = Annotated[
    float, BeforeValidator(_stiffness("translational stiffness")), PlainSerializer(stiffness_text)
]
RotationalStiffness = Annotated[
    float, BeforeValidator(_stiffness("rotational stiffness")), PlainSerializer(stiffness_text)
]
Vector = tuple[Number, Number, Number]
Direction = Annotated[Vector, AfterValidator(_direction)]
Point = tuple[Length, Length, Length]
