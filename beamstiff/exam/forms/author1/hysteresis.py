"""Friction in a drive: the answer depends on the load history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, turns
from beamstiff.exam.laws import Friction, Law, Memory, Remembering, Situation
from beamstiff.exam.reality import Reality

LOST = (3e-5, 5e-4)  # rad: friction torque over stiffness; m / 10 for slides
SLIDERS = 10


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the friction torque over the stiffness, rad, and how much of the stiffness at first slides."""
    found = {
        "friction": request.sized(*LOST) * (1.0 if turns(request.robot, request.component) else 0.1),
        "sliding": request.uniform(0.35, 0.7),
    }
    if request.form == "bouc-wen":
        found["arrived"] = request.uniform(-0.9, 0.9)  # friction left over from the move to the pose
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with friction in the drive."""
    p = truth.parameters

    def law(k: float) -> Law:
        if truth.form == "iwan":
            return Iwan(k, k * p["friction"], p["sliding"])
        return BoucWen(k, k * p["friction"], p["arrived"], p["sliding"])

    return at_joints(truth, reality, law)


@dataclass(frozen=True)
class Iwan(Remembering):
    """Sliders beside a spring, each with a spring of its own, that slip at evenly spaced strains."""

    stiffness: float
    friction: float
    sliding: float

    def start(self, situation: Situation) -> Memory:
        """Return strain and sliders at rest."""
        poses = len(situation.time)
        return np.zeros(poses), np.zeros((poses, SLIDERS))

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:  # noqa: ARG002
        """Return force, tangent and the sliders after."""
        before, held = memory
        k = self.stiffness * self.sliding / (1.0 - self.sliding) / SLIDERS
        even = (np.arange(SLIDERS) + 0.5) / SLIDERS
        most = 2.0 * even * self.friction / (SLIDERS * k)  # together they hold the friction torque
        tried = held + (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        force = self.stiffness * strain + k * now.sum(axis=1)
        return force, self.stiffness + k * sticking.sum(axis=1), (strain, now)


@dataclass(frozen=True)
class BoucWen(Friction):
    """Bouc and Wen's friction with exponent 1, integrated in closed form along each step.

    ``dz = (1 - (1 + sign(de z))/2 |z|) de / e_slip``: linear while unloading, exponential while loading.
    """

    sliding: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope after a way."""
        slip = self.friction * (1.0 - self.sliding) / (self.stiffness * self.sliding)
        go, back = way / slip, np.minimum(state, 0.0)
        left = np.maximum(go + back, 0.0)  # of the way, after what was held has been given back
        loading = 1.0 - (1.0 - np.maximum(state, 0.0)) * np.exp(-left)
        unloading = go < -back
        return np.where(unloading, state + go, loading), np.where(unloading, 1.0, 1.0 - loading) / slip


EFFECT = Effect("hysteresis", ("iwan", "bouc-wen"), drives, draw, impose)
