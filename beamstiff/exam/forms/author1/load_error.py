"""Loads that are not what the table says."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import turn

GAIN = (0.008, 0.25)
ANGLE = (4e-3, 0.2)  # rad


def draw(request: DrawRequest) -> dict[str, float]:
    """Return by how much the load is misread."""
    if request.form == "direction":
        return request.direction(request.sized(*ANGLE))
    gain = request.sized(*GAIN)
    if request.form == "sensor":
        error = request.rng.standard_normal((3, 3))
        error -= np.eye(3) * np.trace(error) / 3.0  # an equal gain of all would be a softer machine
        error *= gain / np.linalg.norm(error, 2)
        return {f"{a}{b}": float(error[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz")}
    if request.form == "quadratic":
        return {"gain": gain * request.sign(), "reference": 1500.0}
    return {"gain": gain}


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with loads misread."""
    p = truth.parameters

    def along(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:  # noqa: ARG001
        turned = turn(vector(p))
        return np.concatenate([wrench[:, :3] @ turned.T, wrench[:, 3:] @ turned.T], axis=1)

    def sensor(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        error = np.array([[p[f"{a}{b}"] for b in "xyz"] for a in "xyz"])
        frames = {node.name: node.frame for node in reality.machine.nodes}
        axes = np.stack([placed.rotations[frames[n]][row] for row, n in enumerate(campaign.load_point)])
        wrong = axes @ error @ np.swapaxes(axes, -1, -2)
        more = [(wrong @ part[..., None])[..., 0] for part in (wrench[:, :3], wrench[:, 3:])]
        return np.asarray(wrench + np.concatenate(more, axis=1))

    def quadratic(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:  # noqa: ARG001
        size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
        return np.asarray(wrench * (1.0 + p["gain"] * size / p["reference"]))

    def pulley(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:  # noqa: ARG001
        return wrench * (1.0 - p["gain"] * _growing(campaign, wrench))[:, None]

    change = {"direction": along, "sensor": sensor, "quadratic": quadratic, "pulley": pulley}[truth.form]
    return reality.with_load(change)


def _growing(campaign: SimulatedCampaign, wrench: Array) -> Array:
    """Return 1 where the load grew since the state before in its pose, -1 where it shrank, (N,)."""
    size = np.linalg.norm(wrench, axis=1)
    growing = np.ones(len(size))
    order = np.lexsort((campaign.step, campaign.pose))
    last: dict[int, tuple[int, float, float, float]] = {}
    for row in order:  # rows, not states: a few hundred cheap steps
        pose, step = int(campaign.pose[row]), int(campaign.step[row])
        known = last.get(pose)
        if known is None:
            last[pose] = (step, size[row], 0.0, 1.0)
            continue
        before = known[1] if known[0] != step else known[2]
        way = known[3] if size[row] == before else float(np.sign(size[row] - before))
        growing[row] = way
        last[pose] = (step, size[row], before, way)
    return growing


EFFECT = Effect("load-error", ("direction", "sensor", "quadratic", "pulley"), nowhere, draw, impose)
