"""The third author's effects for tests: drawn and imposed by themselves, registered or not."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect
from beamstiff.exam.forms import author3
from beamstiff.exam.machine import machine_of
from beamstiff.exam.reality import Reality
from beamstiff.exam.simulate import readings
from beamstiff.robot.description import Robot
from tests.exam.campaigns import arm, campaign_of

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in (*author3.EFFECTS, *author3.OUTSIDE)}
FORMS = [(effect.name, form) for effect in EFFECTS.values() for form in effect.forms]


def drawn(
    robot: Robot, effect: str, component: str | None, form: str, seed: int = 0, size: float = 0.7
) -> Truth:
    asked = DrawRequest(np.random.default_rng(seed), robot, component, form, size)
    return Truth(effect, component, form, EFFECTS[effect].draw(asked))


def read(robot: Robot, campaign: SimulatedCampaign, *truths: Truth) -> Array:
    """Return the noise-free readings (N, 6) of a machine with some effects."""
    reality = Reality(machine_of(robot))
    for truth in truths:
        reality = EFFECTS[truth.effect].impose(truth, reality)
    return readings(reality, campaign)


def more(robot: Robot, campaign: SimulatedCampaign, truth: Truth) -> Array:
    """Return what an effect adds to the readings."""
    return read(robot, campaign, truth) - read(robot, campaign)


def pushed(wrench: Any, *truths: Truth, q: float = 0.0, robot: Robot | None = None, **other: Any) -> Array:
    """Return what one load, or a sequence of loads (S, 6), makes the arm read."""
    robot = robot or arm()
    loads = np.atleast_2d(np.asarray(wrench, float))
    found = read(robot, campaign_of(robot, [[q]], loads, **other), *truths)
    return found[0] if np.ndim(wrench) == 1 else found


def wound(truth: Truth, torque: Any, q: float = 0.0, robot: Robot | None = None) -> Array:
    """Return the rotation about the vertical, rad, that torques (S,) at the arm's tip make."""
    loads = np.zeros((len(np.atleast_1d(torque)), 6))
    loads[:, 5] = torque
    return np.asarray(pushed(loads, truth, q=q, robot=robot)[:, 5])
