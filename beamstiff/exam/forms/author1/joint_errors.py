"""Errors of a joint's angle that no torque makes: they follow the angle, or how the joint came there."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, turning_drives
from beamstiff.exam.placing import Placed, skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

AMPLITUDE = (2e-5, 2e-3)  # rad
ALONE = "order"  # form of one order; the other one has a second order beside it


def places(robot: Robot) -> list[str | None]:
    """Return the revolute axes of a serial robot; in a loop the error would bend the machine."""
    every = [v.name for v in robot.actuated if v.type == "revolute"]
    return [] if robot.loops else [*every] if turning_drives(robot) else []


def _draw_curve(request: DrawRequest) -> dict[str, float]:
    found = {"amplitude": request.sized(*AMPLITUDE), "order": request.integer(1, 5)}
    found["phase"] = request.uniform(0.0, 2 * np.pi)
    found["second"] = 0.0 if request.form == ALONE else request.uniform(0.3, 0.7)
    return found


def _curve(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)

    def error(campaign: SimulatedCampaign, angle: Array) -> Array:  # noqa: ARG001
        first = np.sin(p["order"] * angle + p["phase"])
        second = p["second"] * np.cos((p["order"] + 1.0) * angle + 2.0 * p["phase"])
        return np.asarray(p["amplitude"] * (first + second))

    return _turned(reality, variable, error)


def _draw_approach(request: DrawRequest) -> dict[str, float]:
    return {"half": request.sized(*AMPLITUDE), "first": request.sign(), "way": request.sign()}


def _approach(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)

    def error(campaign: SimulatedCampaign, angle: Array) -> Array:
        """Return where in its play the joint stands: dragged along, or at the end by which it came."""
        order = np.lexsort((campaign.step, campaign.time))
        result, at, before = np.empty(len(angle)), p["first"] * p["half"], angle[order[0]]
        for row in order:
            moved = angle[row] - before
            dragged = float(np.clip(at - moved, -p["half"], p["half"]))
            at = dragged if truth.form == "play" or moved == 0.0 else -np.sign(moved) * p["half"]
            result[row], before = p["way"] * at, angle[row]
        return result

    return _turned(reality, variable, error)


def _turned(reality: Reality, variable: str, error) -> Reality:  # type: ignore[no-untyped-def]
    """Return the reality whose readings are turned about a joint's axis by an error, rad."""
    frames = skeleton_of(reality.machine.robot).frames
    frame = next(n for n, _, p in frames if "theta" in p and variable in p["theta"].coefficients)

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        if campaign.kind != "absolute":  # the same before the load and under it
            return values
        by = error(campaign, placed.values[variable])[:, None]
        axis = placed.rotations[frame][:, :, 2]
        arm = values[:, :3] - placed.origins[frame]
        across = np.cross(axis, arm)
        moved = np.sin(by) * across + (1.0 - np.cos(by)) * np.cross(axis, across)
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return reality.with_reading(read)


EFFECTS = (
    Effect("angle-curve", (ALONE, "two-orders"), places, _draw_curve, _curve),
    Effect("approach-direction", ("flank", "play"), places, _draw_approach, _approach),
)
