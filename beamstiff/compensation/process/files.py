"""Process models from YAML, faults told by key and line, and to YAML: what measured runs taught."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, model_validator

from beamstiff.compensation.process.cantilever import Cantilever, Method
from beamstiff.compensation.process.load import (
    Constant,
    CuttingTable,
    FromPath,
    Process,
    TableFrame,
    Together,
)
from beamstiff.compensation.process.parameters import LoadCell
from beamstiff.errors import BeamstiffError, shown
from beamstiff.files import read_text
from beamstiff.measure.table import WRENCH
from beamstiff.robot.fields import Described, DescriptionError, Direction
from beamstiff.robot.writer import rows_of
from beamstiff.robot.yaml_text import parse_yaml
from beamstiff.se3 import Array, transform
from beamstiff.units import UNITS, quantity

DIGITS = 7  # that are written: of a clamp 2 m away a micrometre


def _of(kind: str, wrong: Callable[[float], bool] | None = None, expected: str = "") -> BeforeValidator:
    """Return what reads a quantity in SI, and refuses some values."""

    def read(value: Any) -> float:
        result = quantity(value, kind)
        if wrong is not None and wrong(result):
            raise BeamstiffError(f"found {shown(value)}, expected {expected}")
        return result

    return BeforeValidator(read)


def _any_quantity(value: Any) -> float:
    """Return a quantity of whatever dimension in SI."""
    for kind in UNITS:
        try:
            return quantity(value, kind)
        except BeamstiffError:
            continue
    raise BeamstiffError(f"found {shown(value)}, expected a number with a unit such as 2 mm")


Length = Annotated[float, _of("length")]
Size = Annotated[float, _of("length", lambda value: value <= 0, "more than 0")]
Modulus = Annotated[float, _of("modulus", lambda value: value <= 0, "more than 0")]
Friction = Annotated[float, _of("number", lambda value: value < 0, "0 or more")]
Force = Annotated[float, _of("force")]
Moment = Annotated[float, _of("moment")]
Angle = Annotated[float, _of("angle")]
Gain = Annotated[float, _of("number", lambda value: value <= 0, "more than 0")]
Forces = tuple[Force, ...]
Moments = tuple[Moment, ...]


class _Clamp(Described):
    at: tuple[Length, Length, Length]
    x: Direction
    z: Direction  # made square to x

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        x, z = (np.array(axis) / np.linalg.norm(axis) for axis in (self.x, self.z))
        return x, z - (z @ x) * x

    @model_validator(mode="after")
    def _across(self) -> Self:
        if np.linalg.norm(self.axes[1]) < 1e-6:
            raise DescriptionError([(("z",), "found the direction of x, expected one across it")])
        return self


class _Cantilever(Described):
    length: Size
    width: Size
    thickness: Size
    E: Modulus
    clamp: _Clamp
    method: Method = "incremental"
    friction: Friction = 0.0

    def made(self) -> Process:
        x, z = self.clamp.axes
        z /= np.linalg.norm(z)
        clamp = transform(np.stack([x, np.cross(z, x), z], axis=1), np.array(self.clamp.at))
        return Cantilever(self.length, self.width, self.thickness, self.E, clamp, self.method, self.friction)


class _Table(Described):
    variable: Annotated[str, BeforeValidator(str)]
    values: tuple[Annotated[float, BeforeValidator(_any_quantity)], ...]
    fx: Forces = ()
    fy: Forces = ()
    fz: Forces = ()
    mx: Moments = ()
    my: Moments = ()
    mz: Moments = ()
    frame: TableFrame = "base"

    @model_validator(mode="after")
    def _rising(self) -> Self:
        count = len(self.values)
        if count < 2 or (np.diff(self.values) <= 0).any():
            what = "found values that do not rise, expected at least two, each above the one before"
            raise DescriptionError([(("values",), what)])
        for name in WRENCH:
            if name in self.model_fields_set and len(own := getattr(self, name)) != count:
                what = f"found {shown(list(own))}, expected a list of {count} numbers"
                raise DescriptionError([((name,), what)])
        return self

    def made(self) -> Process:
        loads = np.stack([getattr(self, name) or np.zeros(len(self.values)) for name in WRENCH], axis=1)
        return CuttingTable(self.variable, np.array(self.values), loads, self.frame)


class _Constant(Described):
    fx: Force = 0.0
    fy: Force = 0.0
    fz: Force = 0.0
    mx: Moment = 0.0
    my: Moment = 0.0
    mz: Moment = 0.0

    def made(self) -> Process:
        return Constant(tuple(getattr(self, name) for name in WRENCH))


class _FromPath(Described):
    def made(self) -> Process:
        return FromPath()


class _LoadCell(Described):
    gain: Gain = 1.0
    turn: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    def made(self) -> Process:
        return LoadCell(self.gain, self.turn)


def _process(data: Any) -> Process:
    """Return the process that keys and values describe."""
    if not isinstance(data, dict):
        raise BeamstiffError(f"found {shown(data)}, expected keys and values")
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        found = (
            "is missing" if "kind" not in data else f"found {shown(kind)}, expected one of {', '.join(KINDS)}"
        )
        raise DescriptionError([(("kind",), found)])
    made: Process = KINDS[kind](**{key: value for key, value in data.items() if key != "kind"}).made()
    return made


class _Together(Described):
    parts: tuple[Annotated[Any, BeforeValidator(_process)], ...]

    def made(self) -> Process:
        if not self.parts:
            raise DescriptionError([(("parts",), "found [], expected a list")])
        whole: list[Process] = []
        for part in self.parts:
            whole += part.parts if isinstance(part, Together) else [part]
        return Together(tuple(whole))


KINDS: dict[Any, Any] = {
    "cantilever": _Cantilever,
    "cutting-table": _Table,
    "constant": _Constant,
    "path": _FromPath,
    "load-cell": _LoadCell,
    "together": _Together,
}


def read_process(path: str | Path) -> Process:
    """Return the process of a YAML file, whose `kind` is one of `KINDS`."""
    return parse_process(read_text(path), str(path))


def parse_process(text: str, source: str = "<text>") -> Process:
    """Return the process of a YAML text."""
    data, lines = parse_yaml(text, source)
    try:
        return _process(data)
    except BeamstiffError as error:
        path, message = error.problems[0] if isinstance(error, DescriptionError) else ((), str(error))
        name = "".join(f"{part}." for part in path)[:-1]
        raise BeamstiffError(f"{source}:{lines.at(path)}: {name + ': ' if name else ''}{message}") from None


def process_to_yaml(process: Process, head: str = "") -> str:
    """Return the text of a file that describes a process; `head`: its first lines, comments."""
    return head + "".join(f"{row}\n" for row in _rows(process))


def _rows(process: Process) -> list[str]:
    if isinstance(process, Together):
        rows = ["kind: together", "parts:"]
        for part in process.parts:
            first, *others = _rows(part)
            rows += [f"  - {first}", *(f"    {row}" for row in others)]
        return rows
    return list(rows_of(_fields(process)))


def _fields(process: Process) -> dict[str, Any]:
    match process:
        case Cantilever():
            sizes = {name: getattr(process, name) for name in ("length", "width", "thickness")}
            clamp = process.clamp
            return {
                "kind": "cantilever",
                **{name: _quantity(1e3 * value, "mm") for name, value in sizes.items()},
                "E": _quantity(1e-9 * process.modulus, "GPa"),
                "method": process.method,
                "friction": _number(process.friction),
                "clamp": {
                    "at": tuple(_quantity(1e3 * value, "mm") for value in clamp[:3, 3].tolist()),
                    **{axis: _numbers(clamp[:3, column]) for axis, column in (("x", 0), ("z", 2))},
                },
            }
        case CuttingTable():
            loads = zip(WRENCH, process.loads.T, strict=True)
            return {
                "kind": "cutting-table",
                "variable": process.variable,
                "values": _numbers(process.values),
                **{name: _numbers(values) for name, values in loads if values.any()},
                "frame": process.frame,
            }
        case LoadCell():
            turn = tuple(_quantity(value, "deg") for value in np.degrees(process.turn).tolist())
            return {"kind": "load-cell", "gain": _number(process.gain), "turn": turn}
        case Constant():
            loads = zip(WRENCH, process.value, strict=True)
            return {"kind": "constant", **{name: _number(value) for name, value in loads if value}}
        case _:
            return {"kind": "path"}


def _quantity(value: float, unit: str) -> str:
    return f"{value + 0.0:.{DIGITS}g} {unit}"


def _number(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") + 0.0


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(_number, values.tolist()))
