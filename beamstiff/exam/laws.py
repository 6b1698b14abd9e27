"""Constitutive laws of the simulated machine: springs, curves, wind-up, friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.exam.campaign import Array

Memory = tuple[Array, ...]
Curved = tuple[Array, Array]  # a value and its slope, (P,) each


@dataclass(frozen=True, eq=False)
class Situation:
    """What a law may depend on besides its strain; P states."""

    values: Mapping[str, Array]  # (P,) each, rad or m; all joint variables
    time: Array  # (P,): s; since the start of the campaign
    temperature: Array  # (P,): degC
    lasted: Array  # (P,): s; since the state before

    def value(self, name: str, default: float = 0.0) -> Array:
        """Return a variable, (P,); a default for what is no variable, as a joint that is fixed."""
        return self.values.get(name, np.full(len(self.time), default))


@dataclass(frozen=True, eq=False)
class Law:
    """Force against strain in one direction of a joint, or along a spring."""

    # force and tangent stiffness, (P,) each, and the memory after, from the strain (P,) and the memory
    respond: Callable[[Array, Situation, Memory], tuple[Array, Array, Memory]]
    start: Callable[[int], Memory] = lambda poses: ()  # memory of the machine at rest in so many new poses
    changes: bool = False  # whether the answer depends on time or temperature

    @property
    def remembers(self) -> bool:
        """Whether the answer depends on the states before."""
        return bool(self.start(0))


def posed(curve: Callable[[Array, Situation], Curved], changes: bool = False) -> Law:
    """Return a spring from its force and slope, (P,) each, at a strain (P,) in a situation."""
    return Law(lambda strain, situation, memory: (*curve(strain, situation), memory), changes=changes)


def curved(curve: Callable[[Array], Curved]) -> Law:
    """Return a spring from its force and slope, (P,) each, at a strain (P,)."""
    return posed(lambda strain, _: curve(strain))


def varying(stiffness: Callable[[Situation], Array], changes: bool = False) -> Law:
    """Return a spring from its stiffness, (P,), in a situation."""

    def curve(strain: Array, situation: Situation) -> Curved:
        k = stiffness(situation)
        return k * strain, k

    return posed(curve, changes)


def winding(wind_up: Callable[[Array], Curved], stiffest: float) -> Law:
    """Return a spring from its strain, a growing function of the force, and its compliance, (P,) each.

    Inverted by Newton's method. `stiffest`: upper bound of the stiffness; the search starts there.
    """

    def curve(strain: Array) -> Curved:
        # the curve is monotone: bracket the force, then Newton kept inside the bracket
        bound = 2.0 * stiffest * np.abs(strain) + 1e-9
        low, high = -bound, bound
        force = np.zeros_like(strain)
        for _ in range(60):
            wound, slope = wind_up(force)
            gap = wound - strain
            low, high = np.where(gap < 0.0, force, low), np.where(gap > 0.0, force, high)
            step = force - gap / slope
            inside = (step > low) & (step < high)
            new = np.where(gap == 0.0, force, np.where(inside, step, 0.5 * (low + high)))
            done = np.abs(new - force) <= 1e-13 * bound
            force = new
            if done.all():
                break
        return force, 1.0 / wind_up(force)[1]

    return curved(curve)


def rubbing(
    stiffness: float,
    friction: float,
    arrived: float,
    run: Callable[[Array, Array], Curved],
    largest: Callable[[Array, Array], tuple[Any, Any]] | None = None,
) -> Law:
    """Return a spring with friction beside it, `arrived` in a state that runs with the motion from -1 to 1.

    `run`: state and its slope by the way, (P,) each, after a way from a state along the motion.
    `largest`: where not constant: the largest friction after a strain, and how friction grows with it.
    """

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        before, held = memory
        sign = np.where(strain >= before, 1.0, -1.0)
        state, slope = run(sign * held, np.abs(strain - before))
        most, growing = (friction, 0.0) if largest is None else largest(strain, sign * state)
        force = stiffness * strain + most * (sign * state)
        return force, stiffness + most * slope + growing, (strain, sign * state)

    return Law(respond, lambda poses: (np.zeros(poses), np.full(poses, arrived)))


def fading(state: Array, way: Array, reach: float) -> Curved:
    """Return a friction's state and its slope after a way: it nears 1 exponentially (Dahl, exponent 1)."""
    left = (1.0 - state) * np.exp(-way / reach)
    return 1.0 - left, left / reach


def ramp(x: Array, width: Array | float) -> Curved:
    """Return a ramp that is 0 for x < 0 and x for x > 0, rounded over a width, and its slope."""
    root = np.sqrt(x**2 + width**2)
    return 0.5 * (x + root), 0.5 * (1.0 + x / root)
