"""The parameters of an effect's form, and what is asked of those who draw them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.robot.description import Robot

Parameters = Mapping[str, float]
Draw = Callable[["DrawRequest"], Any]  # a number, or several by their names


def between(size: float, low: float, high: float) -> float:
    """Return the value at `size` in [0, 1] of the way from low to high, evenly by ratio."""
    return float(low * (high / low) ** size)


def named(vector: Array, names: Sequence[str] = "xyz") -> dict[str, float]:
    """Return a vector (3,) as parameters."""
    return dict(zip(names, map(float, vector), strict=True))


def vector(parameters: Parameters, names: Sequence[str] = "xyz") -> Array:
    """Return the vector (3,) of parameters by these names."""
    return np.array([parameters[name] for name in names])


def unit_vector(rng: np.random.Generator) -> Array:
    """Return a vector (3,) of length 1 in a direction drawn evenly."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


@dataclass(frozen=True)
class DrawRequest:
    """What is to be drawn: the parameters of a form at a component, of a size in [0, 1]."""

    rng: np.random.Generator
    robot: Robot
    component: str | None
    form: str
    size: float

    def sized(self, low: float, high: float) -> float:
        """Return the value at the wanted size from low to high, evenly by ratio."""
        return between(self.size, low, high)

    def uniform(self, low: float, high: float) -> float:
        """Return a number drawn evenly between two."""
        return float(self.rng.uniform(low, high))

    def sign(self) -> float:
        """Return 1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def direction(self, length: float = 1.0, names: Sequence[str] = "xyz") -> dict[str, float]:
        """Return a vector of that length in a direction drawn evenly, by the names of its components."""
        return named(length * unit_vector(self.rng), names)

    def drawn(self, *draws: Draw, **by_name: Draw) -> dict[str, float]:
        """Return parameters, drawn in this order."""
        found: dict[str, float] = {}
        for draw in draws:
            found |= draw(self)
        return found | {name: float(draw(self)) for name, draw in by_name.items()}
