"""Friction in the drives: that of gears which grows with the load, and that of worms which differs by way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, at_joints, drives
from beamstiff.exam.forms.author4.by_form import Form, effect_of
from beamstiff.exam.laws import Friction, Law, fading
from beamstiff.exam.reality import Reality


@dataclass(frozen=True)
class MeshFriction(Friction):
    """Friction of seals, and of teeth in proportion to the torque that they carry: the loop is a bow tie.

    `reach`: strain over which the friction turns round.
    `share`: of the torque.
    """

    reach: float
    share: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state after a way, by Dahl's law."""
        return fading(state, way, self.reach)

    def largest(self, strain: Array, state: Array) -> tuple[Array, Array]:
        """Return the largest friction, and its growth."""
        most = self.friction + self.share * self.stiffness * np.abs(strain)
        return most, self.share * self.stiffness * np.sign(strain) * state


@dataclass(frozen=True)
class WormFriction(Friction):
    """Friction that is larger one way than the other, as of a worm that is driven back.

    `reach`: strain over which it turns round.
    `power`: over 1; by which it nears its largest force, slower than exponentially.
    `skew`: in (-1, 1): friction ``(1 + skew)`` forward, ``(1 - skew)`` back.
    """

    reach: float
    power: float
    skew: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state after a way: what is left of it obeys ``du/dx = -u^power / reach``."""
        n = self.power - 1.0
        start = np.maximum(1.0 - state, 1e-12)
        left = (start**-n + n * way / self.reach) ** (-1.0 / n)
        return 1.0 - left, left**self.power / self.reach

    def largest(self, strain: Array, state: Array) -> tuple[Array, float]:  # noqa: ARG002
        """Return the largest friction, which does not grow."""
        return self.friction * (1.0 + self.skew * np.sign(state)), 0.0


def _gear(request: DrawRequest) -> dict[str, float]:
    share = request.sized(0.01, 0.25)
    return {
        "share": share,
        "friction": share * request.log_uniform(3e-5, 4e-4),
        "reach": share * request.log_uniform(2e-4, 1e-3),  # the same teeth bend before they slide
        "arrived": request.uniform(-0.9, 0.9),
    }


def _worm(request: DrawRequest) -> dict[str, float]:
    friction = request.sized(8e-6, 2.5e-4)
    return {
        "friction": friction,
        "reach": friction * request.log_uniform(0.35, 2.0),  # the same teeth bend before they slide
        "power": request.uniform(1.2, 1.8),
        "skew": request.sign() * request.uniform(0.15, 0.5),
        "arrived": request.uniform(-0.9, 0.9),
    }


def _impose(truth: Truth, reality: Reality) -> Reality:
    p = dict(truth.parameters)
    friction = p.pop("friction")  # as the strain that it holds

    def law_of(k: float) -> Law:
        kind = MeshFriction if truth.form == "tooth-friction" else WormFriction
        return kind(stiffness=k, friction=k * friction, **p)

    return at_joints(truth, reality, law_of)


EFFECTS = (
    effect_of(
        "hysteresis",
        drives,
        {"tooth-friction": Form(_gear, _impose), "driven-back": Form(_worm, _impose)},
    ),
)
