"""A reflector, or the tool that carries it, that slips while it is measured, and stays there."""

from __future__ import annotations

import dataclasses

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, vector
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

AWAY = (5e-5, 1e-2)  # m


def places(robot: Robot) -> list[str | None]:
    """Return the reflectors, nodes that nothing but a rigid stalk holds; else the TCP, written None."""
    ends = [name for part in robot.rigids for name in part.nodes]
    ends += [name for part in (*robot.beams, *robot.joints, *robot.struts) for name in part.nodes]  # type: ignore[attr-defined]
    stalks = {part.nodes[1] for part in robot.rigids}
    found = [name for name in dict.fromkeys(ends) if ends.count(name) == 1 and name in stalks]
    return [name for name in found if name != robot.tcp] or [None]


def draw(request: DrawRequest) -> dict[str, float]:
    """Return when it slips, as a share of the rows, and by how much in the tool's frame, m."""
    again = request.uniform(0.0, 0.5) if request.form == "twice" else 0.0
    return {"when": request.uniform(0.2, 0.8), "again": again} | request.direction(request.sized(*AWAY))


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the slip; of a second one the way is the same."""
    p, point = truth.parameters, truth.component or reality.machine.tcp
    frame = reality.machine.node(point).frame

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        if campaign.kind != "absolute":
            return values
        row = np.argsort(np.lexsort((campaign.step, campaign.time))) / len(values)
        again = p["when"] + 0.5 * (1.0 - p["when"])
        share = (campaign.point == point) * ((row >= p["when"]) + p["again"] * (row >= again))
        moved = placed.rotations[frame] @ vector(p) * share[:, None]
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return reality.with_reading(read)


def came_to_rest(truth: Truth) -> Truth:
    """Return the slip as a later campaign finds it: where it ended."""
    p = truth.parameters
    end = {**p, **{name: p[name] * (1.0 + p["again"]) for name in "xyz"}, "when": 0.0, "again": 0.0}
    return dataclasses.replace(truth, parameters=end)


EFFECT = Effect("target-slip", ("once", "twice"), places, draw, impose)
