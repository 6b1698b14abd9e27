"""Further forms of friction in a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.laws import Friction, Memory, Remembering, Situation
from beamstiff.exam.reality import Reality

SLIDERS = 5


def _draw(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_friction(request)
    found["arrived"] = request.uniform(-0.9, 0.9)  # friction left over from the move to the pose
    if request.form == "maxwell-slip":
        found["ratio"] = request.uniform(1.8, 3.5)  # of a slider's yield strain to the one before
        found["fall"] = request.uniform(0.3, 1.2)  # power by which later ones are softer
    return found


def _impose(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    if truth.form == "dahl":
        return at_joints(truth, reality, lambda k: Dahl(k, k * p["friction"], p["arrived"], p["sliding"]))
    return at_joints(
        truth,
        reality,
        lambda k: MaxwellSlip(k, k * p["friction"], p["sliding"], p["ratio"], p["fall"], p["arrived"]),
    )


@dataclass(frozen=True)
class Dahl(Friction):
    """Dahl's friction with exponent 2, integrated in closed form along each step.

    ``dz/de = (1 - z sign(de))^2 / e_slip``, beside a spring (P. R. Dahl, A solid friction model, 1968).
    """

    sliding: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope after a way."""
        slip = self.friction * (1.0 - self.sliding) / (self.stiffness * self.sliding)
        short = 1.0 - state  # of sliding freely
        short = short / (1.0 + short * way / slip)
        return 1.0 - short, short**2 / slip


@dataclass(frozen=True)
class MaxwellSlip(Remembering):
    """A few sliders beside a spring, each behind a spring of its own, whose yield strains grow by a ratio.

    The generalised Maxwell slip's elements without its sliding dynamics (Al-Bender, Lampaert and Swevers,
    2005). Later ones are softer; together they hold the friction torque.
    """

    stiffness: float
    friction: float
    sliding: float
    ratio: float
    fall: float
    arrived: float

    def start(self, situation: Situation) -> Memory:
        """Return strain and the sliders' forces after the move to the pose."""
        poses = len(situation.time)
        return np.zeros(poses), np.tile(self.arrived * self._sliders()[1], (poses, 1))

    def _sliders(self) -> tuple[Array, Array]:
        """Return the stiffness and the largest force of every slider."""
        yields = self.ratio ** np.arange(SLIDERS)
        k = yields**-self.fall
        k = k * self.stiffness * self.sliding / ((1.0 - self.sliding) * k.sum())
        most = k * yields
        return k, most * self.friction / most.sum()

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:  # noqa: ARG002
        """Return force, tangent and the sliders after."""
        before, held = memory
        k, most = self._sliders()
        tried = held + k * (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        return self.stiffness * strain + now.sum(axis=1), self.stiffness + sticking @ k, (strain, now)


EFFECTS = (Effect("hysteresis", ("dahl", "maxwell-slip"), drives, _draw, _impose),)
