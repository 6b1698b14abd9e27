"""A measuring frame that is turned or scaled against the base frame."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import turn, turned_by

ANGLE = (2e-3, 0.2)  # rad
REGISTERED = 0.01  # share that remains where the frame was fitted to absolute positions


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the rotation vector, rad; the scale, or how far the axes are from square."""
    angle = request.sized(*ANGLE)
    found = request.direction(angle)
    if request.form == "scaled":
        found["scale"] = angle * request.uniform(-0.3, 0.3)
    if request.form == "sheared":
        found |= {n: angle * request.uniform(-0.5, 0.5) for n in ("xy", "xz", "yz")}
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality read in a wrong frame."""
    p = truth.parameters

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:  # noqa: ARG001
        share = 1.0 if campaign.kind == "displacement" else REGISTERED
        shear = np.eye(3)
        for name, (i, j) in {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():
            shear[i, j] += share * p.get(name, 0.0)
        R = turn(share * vector(p))
        matrix = (1.0 + share * p.get("scale", 0.0)) * R @ shear
        turned = turn(values[:, 3:])
        turned = R @ turned @ R.T if campaign.kind == "displacement" else R @ turned
        return np.concatenate([values[:, :3] @ matrix.T, turned_by(turned)], axis=1)

    return reality.with_reading(read)


EFFECT = Effect("frame-misalignment", ("turned", "scaled", "sheared"), nowhere, draw, impose)
