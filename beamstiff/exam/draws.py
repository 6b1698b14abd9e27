"""How the parameters of effects are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender, turns
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


@dataclass(frozen=True)
class DrawRequest:
    """What is to be drawn: the parameters of a form at a component, of a size in [0, 1]."""

    rng: np.random.Generator
    robot: Robot
    component: str | None
    form: str
    size: float

    @property
    def place(self) -> str:
        """The component's name."""
        return str(self.component)

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
        v = self.rng.standard_normal(3)
        return named(length * (v / np.linalg.norm(v)), names)

    def drawn(self, *draws: Draw, **by_name: Draw) -> dict[str, float]:
        """Return parameters, drawn in this order."""
        found: dict[str, float] = {}
        for draw in draws:
            found |= draw(self)
        return found | {name: float(draw(self)) for name, draw in by_name.items()}


def sized(low: float, high: float) -> Draw:
    """Draw the value at the wanted size from low to high, evenly by ratio."""
    return lambda request: between(request.size, low, high)


def evenly(low: float, high: float) -> Draw:
    """Draw a number between two."""
    return lambda request: request.uniform(low, high)


def by_ratio(low: float, high: float) -> Draw:
    """Draw a number between two, evenly by ratio."""
    return lambda request: between(float(request.rng.uniform()), low, high)


def whole(low: int, high: int) -> Draw:
    """Draw a whole number from low to below high."""
    return lambda request: float(request.rng.integers(low, high))


def signed(draw: Draw) -> Draw:
    """Draw a sign, then the number that has it."""
    return lambda request: request.sign() * draw(request)


def at_joint(draw: Draw) -> Draw:
    """Draw a strain of the component: m where it slides, a tenth of the radians."""
    return lambda request: draw(request) * (1.0 if turns(request.robot, request.component) else 0.1)


def each(**by_name: Draw) -> Draw:
    """Draw parameters by their names, in this order."""
    return lambda request: request.drawn(**by_name)


def always(value: float) -> Draw:
    """Draw the same value always."""
    return lambda request: value


def direction(length: Draw | None = None, names: Sequence[str] = "xyz") -> Draw:
    """Draw a vector in a direction drawn evenly, by its components; of length 1 by default."""
    return lambda request: request.direction(1.0 if length is None else length(request), names)


SIGN: Draw = DrawRequest.sign
PHASE = evenly(0.0, 2.0 * np.pi)
SEED = whole(0, 2**31)


def by_reach(draw: Draw) -> Draw:
    """Draw a length that is smaller on a small robot."""
    return lambda request: draw(request) / np.sqrt(slender(request.robot))


def softer(draw: Draw) -> Draw:
    """Draw a compliance that is larger on a small robot."""
    return lambda request: draw(request) * slender(request.robot)
