"""Third forms of friction in a drive: that of the loaded teeth, and of a hub that slips in its clamp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, turns
from beamstiff.exam.laws import Friction, Memory, Remembering, Situation
from beamstiff.exam.reality import Reality

RUBBING = (0.04, 0.45)  # friction over the torque that passes: from a good gear to a worm
PRESSED = 0.2  # of the strain where motion turns round, that its way is longer by
SOFTER = (0.06, 1.2)  # what a slipping hub gives, over what the rest of the drive gives


def _draw(request: DrawRequest) -> dict[str, float]:
    scale = 1.0 if turns(request.robot, request.component) else 0.1
    found = {"arrived": request.uniform(-0.9, 0.9)}  # friction left over from the move to the pose
    if request.form == "teeth":
        return found | {
            "rubbing": request.sized(*RUBBING),
            "seals": scale * request.log_uniform(2e-6, 2e-5),  # torque over the stiffness
            "slip": scale * request.log_uniform(4e-5, 2e-4),
        }
    return found | {
        "softer": request.sized(*SOFTER),
        "breaks": scale * request.log_uniform(2e-5, 1.5e-4),  # torque over the stiffness
    }


def _impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with friction in the drive.

    ``teeth``: friction of the loaded flanks is a share of the torque that passes them, so that the loop is
    narrow where the load is small and opens with it. The loss factor of gears and screws in any textbook; the
    way over which it turns round is an engineering estimate.

    ``clamped``: a hub is held on its shaft by a shrink disc; above the disc's torque it slips until its key
    or bolts, which are elastic, hold it, and it stays where it went. Known from the design of clamped hubs;
    the sizes are an engineering estimate.
    """
    p = truth.parameters
    if truth.form == "teeth":
        return at_joints(
            truth, reality, lambda k: Teeth(k, k * p["seals"], p["arrived"], p["rubbing"], p["slip"])
        )
    return at_joints(truth, reality, lambda k: Clamped(k, k / p["softer"], k * p["breaks"], p["arrived"]))


@dataclass(frozen=True)
class Teeth(Friction):
    """A spring with friction that is a share of its force, and some more, and turns round over a way.

    The friction's state runs to the way of motion exponentially, as Dahl's with exponent 1. The way is longer
    where the teeth were pressed harder, as slip of contacts after Mindlin is.
    """

    rubbing: float
    slip: float

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:  # noqa: ARG002
        """Return force, tangent and the friction after."""
        before, held = memory
        slip = self.slip + PRESSED * np.abs(before)
        way = np.where(strain >= before, 1.0, -1.0)
        short = (way - held) * np.exp(-np.abs(strain - before) / slip)
        now = way - short
        size = np.hypot(strain, self.slip)
        most = self.friction + self.rubbing * self.stiffness * size
        growing = self.rubbing * self.stiffness * strain / size
        force = self.stiffness * strain + most * now
        return force, self.stiffness + growing * now + most * np.abs(short) / slip, (strain, now)


@dataclass(frozen=True)
class Clamped(Remembering):
    """A spring behind a slider, beside which a second spring holds what has slipped."""

    stiffness: float
    key: float
    breaks: float
    arrived: float

    def start(self, situation: Situation) -> Memory:
        """Return what has slipped, and the slider's force there, after the move to the pose."""
        # at rest no torque passes: the key's spring and the slider hold one another
        return (np.full(len(situation.time), 0.0), np.full(len(situation.time), self.arrived * self.breaks))

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:  # noqa: ARG002
        """Return force, tangent and the slip after."""
        slipped, locked = memory
        # the key is relaxed where the slip is locked / key behind its place
        tried = self.stiffness * (strain - slipped) - self.key * slipped + locked
        beyond = tried - np.clip(tried, -self.breaks, self.breaks)
        now = slipped + beyond / (self.stiffness + self.key)
        slope = np.where(beyond == 0.0, 1.0, self.key / (self.stiffness + self.key)) * self.stiffness
        return self.stiffness * (strain - now), slope, (now, locked)


EFFECTS: tuple[Effect, ...] = (Effect("hysteresis", ("teeth", "clamped"), drives, _draw, _impose),)
