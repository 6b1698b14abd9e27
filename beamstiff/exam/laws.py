"""What a constitutive law of the simulated machine is, and the plain linear one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from beamstiff.exam.campaign import Array

Memory = tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Situation:
    """What a law may depend on besides its strain; P states.

    `values`: mapping of str to (P,) array, rad or m; all joint variables.
    `time`: (P,) array, s; since the start of the campaign.
    `temperature`: (P,) array, degC.
    `lasted`: (P,) array, s; since the state before.
    """

    values: Mapping[str, Array]
    time: Array
    temperature: Array
    lasted: Array

    def at(self, rows: Any) -> Situation:
        """Return the situation of some of the states."""
        values = {name: value[rows] for name, value in self.values.items()}
        return Situation(values, self.time[rows], self.temperature[rows], self.lasted[rows])

    def value(self, name: str, default: float = 0.0) -> Array:
        """Return a variable, (P,); a default for what is no variable, as a joint that is fixed."""
        return self.values.get(name, np.full(len(self.time), default))


class Law(Protocol):
    """Force against strain in one direction of a joint, or along a spring.

    ``remembers`` says whether the answer depends on the states before; ``changes`` whether it depends on time
    or temperature.
    """

    @property
    def remembers(self) -> bool: ...  # noqa: D102

    @property
    def changes(self) -> bool: ...  # noqa: D102

    def start(self, situation: Situation) -> Memory:
        """Return the memory of the machine at rest in a new pose."""
        ...

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent stiffness, (P,) each, and the memory after, from the strain (P,)."""
        ...


class Forgetful:
    """Base of laws that depend on the strain and the pose alone."""

    remembers = False
    changes = False

    def start(self, situation: Situation) -> Memory:
        """Return no memory."""
        return ()


class Remembering:
    """Base of laws whose answer depends on the states before."""

    remembers = True
    changes = False


@dataclass(frozen=True)
class Friction(Remembering):
    """Base of a spring with friction beside it, whose state runs after the motion from -1 to 1.

    `friction`: its largest force.
    `arrived`: its state after the move to the pose.
    """

    stiffness: float
    friction: float
    arrived: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope by the way, (P,) each, after a way from a state along the motion."""
        raise NotImplementedError

    def largest(self, strain: Array, state: Array) -> tuple[Array | float, Array | float]:
        """Return the largest friction after a strain, and by how much friction at a state grows with it."""
        return self.friction, 0.0

    def start(self, situation: Situation) -> Memory:
        """Return strain and state after the move to the pose."""
        poses = len(situation.time)
        return np.zeros(poses), np.full(poses, self.arrived)

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent, and strain and state after."""
        before, held = memory
        sign = np.where(strain >= before, 1.0, -1.0)
        state, slope = self.run(sign * held, np.abs(strain - before))
        most, growing = self.largest(strain, sign * state)
        force = self.stiffness * strain + most * (sign * state)
        return force, self.stiffness + most * slope + growing, (strain, sign * state)


def fading(state: Array, way: Array, reach: float) -> tuple[Array, Array]:
    """Return a friction's state and its slope after a way: it nears 1 exponentially (Dahl, exponent 1)."""
    left = (1.0 - state) * np.exp(-way / reach)
    return 1.0 - left, left / reach


@dataclass(frozen=True)
class Stiffness(Forgetful):
    """A spring whose stiffness (and force at rest) depends on the situation.

    `stiffness`: (P,) array from the situation, SI.
    `preload`: force at the rest length, (P,).
    """

    stiffness: Callable[[Situation], Array]
    preload: Callable[[Situation], Array] | None = None
    changes: bool = False

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, stiffness and no memory."""
        k = self.stiffness(situation)
        force = k * strain
        if self.preload is not None:
            force = force + self.preload(situation)
        return force, k, memory


@dataclass(frozen=True)
class Curve(Forgetful):
    """A spring given by its force curve.

    `curve`: force and its slope, (P,) each, from the strain (P,).
    """

    curve: Callable[[Array], tuple[Array, Array]]

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, slope and no memory."""
        force, slope = self.curve(strain)
        return force, slope, memory


@dataclass(frozen=True)
class WindUp(Forgetful):
    """A spring given by its wind-up: strain as a growing function of the force, inverted by Newton's method.

    `wind_up`: strain and its slope (compliance), (P,) each, from the force (P,).
    `stiffest`: upper bound of the stiffness; the search starts there.
    """

    wind_up: Callable[[Array], tuple[Array, Array]]
    stiffest: float

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, stiffness and no memory."""
        # the curve is monotone: bracket the force, then Newton kept inside the bracket
        bound = 2.0 * self.stiffest * np.abs(strain) + 1e-9
        low, high = -bound, bound
        force = np.zeros_like(strain)
        for _ in range(60):
            wound, slope = self.wind_up(force)
            gap = wound - strain
            low, high = np.where(gap < 0.0, force, low), np.where(gap > 0.0, force, high)
            step = force - gap / slope
            inside = (step > low) & (step < high)
            new = np.where(gap == 0.0, force, np.where(inside, step, 0.5 * (low + high)))
            done = np.abs(new - force) <= 1e-13 * bound
            force = new
            if done.all():
                break
        return force, 1.0 / self.wind_up(force)[1], memory
