"""Process models from YAML: which one, its numbers with units, faults told by key and line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np

from beamstiff.compensation.process.cantilever import Cantilever, Method
from beamstiff.compensation.process.cutting import CuttingTable, TableFrame
from beamstiff.compensation.process.load import Constant, FromPath, Process, Together
from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.measure.table import WRENCH
from beamstiff.robot.yaml_text import Lines, parse_yaml
from beamstiff.se3 import Array, transform
from beamstiff.units import UNITS, number, quantity


class Keys:
    """The keys of a map in a YAML file, each read once; what is wrong is told with its line."""

    def __init__(self, data: Any, lines: Lines, source: str, path: tuple[str | int, ...] = ()) -> None:
        self._lines, self._source, self._path = lines, source, path
        if not isinstance(data, dict):
            self.fail("", f"found {shown(data)}, expected keys and values")
        self._data: Mapping[str, Any] = data
        self._known: list[str] = []

    def fail(self, key: str, message: str) -> NoReturn:
        """Raise an error at a key."""
        path = (*self._path, key) if key else self._path
        name = ".".join(map(str, path))
        raise BeamstiffError(f"{self._source}:{self._lines.at(path)}: {name + ': ' if name else ''}{message}")

    def has(self, key: str) -> bool:
        """Tell whether a key is there."""
        self._known.append(key)
        return key in self._data

    def value(self, key: str, default: Any = None) -> Any:
        """Return the value of a key as it is written."""
        if not self.has(key):
            if default is not None:
                return default
            self.fail(key, f"is missing{suggest(key, self._data)}")
        return self._data[key]

    def number(self, key: str, kind: str, least: float | None = None, default: float | None = None) -> float:
        """Return a quantity in SI, above a least one."""
        raw = self.value(key, default)
        try:
            result = quantity(raw, kind)
        except BeamstiffError as error:
            self.fail(key, str(error))
        if least is not None and result < least:
            self.fail(key, f"found {shown(raw)}, expected {least:g} or more")
        return result

    def numbers(self, key: str, read: Callable[[Any], float], count: int | None = None) -> Array:
        """Return a list of quantities in SI."""
        raw = self.value(key)
        if not isinstance(raw, list) or (count is not None and len(raw) != count) or not raw:
            self.fail(key, f"found {shown(raw)}, expected a list of {count or 'at least one'} numbers")
        try:
            return np.array([read(item) for item in raw])
        except BeamstiffError as error:
            self.fail(key, str(error))

    def one_of(self, key: str, choices: tuple[str, ...], default: str | None = None) -> str:
        """Return one of some words."""
        raw = self.value(key, default)
        if raw not in choices:
            hint = suggest(raw, choices)
            self.fail(key, f"found {shown(raw)}{hint}, expected one of {', '.join(choices)}")
        return str(raw)

    def below(self, key: str) -> Keys:
        """Return the keys of the map under a key."""
        return Keys(self.value(key), self._lines, self._source, (*self._path, key))

    def each(self, key: str) -> list[Keys]:
        """Return the keys of every map in the list under a key."""
        raw = self.value(key)
        if not isinstance(raw, list) or not raw:
            self.fail(key, f"found {shown(raw)}, expected a list")
        return [Keys(item, self._lines, self._source, (*self._path, key, at)) for at, item in enumerate(raw)]

    def end(self) -> None:
        """Refuse keys that nobody asked for."""
        for key in self._data:
            if key not in self._known:
                hint = suggest(key, self._known) or f"; known: {listed(self._known, 20)}"
                self.fail(key, f"unknown key{hint}")


def read_process(path: str | Path) -> Process:
    """Return the process of a YAML file.

    Parameters
    ----------
    path : str or pathlib.Path
        Its key `kind` is ``cantilever``, ``cutting-table``, ``constant``, ``path`` (the columns of the path)
        or ``together`` (of `parts`).
    """
    return parse_process(read_text(path), str(path))


def parse_process(text: str, source: str = "<text>") -> Process:
    """Return the process of a YAML text.

    Examples
    --------
    >>> parse_process("{kind: constant, fz: -920 N}").value
    (0.0, 0.0, -920.0, 0.0, 0.0, 0.0)
    """
    data, lines = parse_yaml(text, source)
    return _process(Keys(data, lines, source))


def _process(keys: Keys) -> Process:
    process = KINDS[keys.one_of("kind", tuple(KINDS))](keys)
    keys.end()
    return process


def _cantilever(keys: Keys) -> Process:
    clamp = keys.below("clamp")
    turn = clamp_rotation(clamp)
    at = clamp.numbers("at", _length, 3)
    clamp.end()
    return Cantilever(
        length=_positive(keys, "length", "length"),
        width=_positive(keys, "width", "length"),
        thickness=_positive(keys, "thickness", "length"),
        modulus=_positive(keys, "E", "modulus"),
        clamp=transform(turn, at),
        method=cast(Method, keys.one_of("method", ("incremental", "euler-bernoulli"), "incremental")),
        friction=keys.number("friction", "number", 0.0, 0.0) if keys.has("friction") else 0.0,
    )


def clamp_rotation(keys: Keys) -> Array:
    """Return the rotation (3, 3) of a frame whose axes x and z are given, z made square to x."""
    axes = []
    for key in ("x", "z"):
        axis = keys.numbers(key, number, 3)
        if not np.linalg.norm(axis) > 0:
            keys.fail(key, "found a zero vector, expected a direction")
        axes.append(axis / np.linalg.norm(axis))
    x, z = axes
    z = z - (z @ x) * x
    if np.linalg.norm(z) < 1e-6:
        keys.fail("z", "found the direction of x, expected one across it")
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _positive(keys: Keys, key: str, kind: str) -> float:
    value = keys.number(key, kind)
    if not value > 0:
        keys.fail(key, f"found {shown(keys.value(key))}, expected more than 0")
    return value


def _table(keys: Keys) -> Process:
    variable = str(keys.value("variable"))
    values = keys.numbers("values", _any_quantity)
    if len(values) < 2 or (np.diff(values) <= 0).any():
        keys.fail("values", "found values that do not rise, expected at least two, each above the one before")
    loads = np.zeros((len(values), 6))
    for at, name in enumerate(WRENCH):
        if keys.has(name):
            loads[:, at] = keys.numbers(name, _force if at < 3 else _moment, len(values))
    frame = keys.one_of("frame", ("base", "tool", "feed"), "base")
    return CuttingTable(variable, values, loads, cast(TableFrame, frame))


def _length(item: Any) -> float:
    return quantity(item, "length")


def _force(item: Any) -> float:
    return quantity(item, "force")


def _moment(item: Any) -> float:
    return quantity(item, "moment")


def _any_quantity(item: Any) -> float:
    """Return a quantity of whatever dimension in SI."""
    for kind in UNITS:
        try:
            return quantity(item, kind)
        except BeamstiffError:
            continue
    raise BeamstiffError(f"found {shown(item)}, expected a number with a unit such as 2 mm")


def _constant(keys: Keys) -> Process:
    return Constant(
        tuple(
            keys.number(name, "force" if at < 3 else "moment") if keys.has(name) else 0.0
            for at, name in enumerate(WRENCH)
        )
    )


def _together(keys: Keys) -> Process:
    return Together(tuple(_process(part) for part in keys.each("parts")))


def _from_path(keys: Keys) -> Process:  # noqa: ARG001 (as the others)
    return FromPath()


KINDS: dict[str, Callable[[Keys], Process]] = {
    "cantilever": _cantilever,
    "cutting-table": _table,
    "constant": _constant,
    "path": _from_path,
    "together": _together,
}
