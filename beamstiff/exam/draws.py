"""Draws of the parameters of effects, of one or of several by their names."""

import math
from collections.abc import Sequence

import numpy as np

from beamstiff.exam.components import slender, turns
from beamstiff.exam.parameters import Draw, DrawRequest, between


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


def product(*draws: Draw) -> Draw:
    """Draw numbers, in this order, and multiply them."""
    return lambda request: math.prod(draw(request) for draw in draws)


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


def around(away: Draw, names: Sequence[str] = "uv") -> Draw:
    """Draw a place (x, y) that far from the origin, to a side drawn evenly."""

    def draw(request: DrawRequest) -> dict[str, float]:
        angle, far = request.uniform(0.0, 2.0 * np.pi), away(request)
        return dict(zip(names, (float(far * np.cos(angle)), float(far * np.sin(angle))), strict=True))

    return draw


SIGN: Draw = DrawRequest.sign
PHASE = evenly(0.0, 2.0 * np.pi)
SEED = whole(0, 2**31)


def by_reach(draw: Draw) -> Draw:
    """Draw a length that is smaller on a small robot."""
    return lambda request: draw(request) / np.sqrt(slender(request.robot))


def softer(draw: Draw) -> Draw:
    """Draw a compliance that is larger on a small robot."""
    return lambda request: draw(request) * slender(request.robot)
