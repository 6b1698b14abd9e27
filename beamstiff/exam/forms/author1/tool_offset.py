"""The wrench acts, or the reflector sits, beside the nominal TCP."""

from __future__ import annotations

import dataclasses

from beamstiff.exam.campaign import Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere
from beamstiff.exam.reality import Reality

AWAY = (5e-4, 0.3)  # m
# share that remains where absolute positions are measured, for which the tool is calibrated
CALIBRATED = 0.02


def draw(request: DrawRequest) -> dict[str, float]:
    """Return where the wrench acts (x, y, z) and the reflector sits (u, v, w), m, in the node's frame."""
    away, found = request.sized(*AWAY), dict.fromkeys("xyzuvw", 0.0)
    if request.form in ("wrench", "both"):
        found |= request.direction(away)
    if request.form in ("target", "both"):
        found |= request.direction(away, "uvw")
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the tool offset."""
    p = truth.parameters
    x, y, z = reality.lever
    u, v, w = reality.target
    return dataclasses.replace(
        reality,
        lever=(x + p["x"], y + p["y"], z + p["z"]),
        target=(u + p["u"], v + p["v"], w + p["w"]),
        marked=(CALIBRATED * p["u"], CALIBRATED * p["v"], CALIBRATED * p["w"]),
    )


EFFECT = Effect("tool-offset", ("wrench", "target", "both"), nowhere, draw, impose)
