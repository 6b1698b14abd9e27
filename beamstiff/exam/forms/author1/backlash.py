"""Play in a drive."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, turns
from beamstiff.exam.laws import Curve, Law, WindUp
from beamstiff.exam.reality import Reality

HALF = (3e-5, 5e-4)  # rad: half the lost motion; m / 10 for slides


def draw(request: DrawRequest) -> dict[str, float]:
    """Return half the play, rad; where in it the drive rests; what stiffness is left in it."""
    found = {
        "half": request.sized(*HALF) * (1.0 if turns(request.robot, request.component) else 0.1),
        "left": request.uniform(0.01, 0.04),
    }
    if request.form == "sharp":
        found["rest"] = request.uniform(-0.8, 0.8)
    if request.form == "stages":
        found["share"] = request.uniform(0.4, 0.8)
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with play in the drive."""
    return at_joints(truth, reality, lambda k: _law(truth, k))


def _law(truth: Truth, k: float) -> Law:
    p = truth.parameters
    h, left = p["half"], p["left"]
    if truth.form == "sharp":
        return Curve(lambda e: _between_flanks(e, k, h, left, p["rest"] * h))
    crossing = 2.0 * left * k * h  # torque that crosses the play
    stages = [(1.0, 1.0)] if truth.form == "smooth" else [(p["share"], 0.5), (1.0 - p["share"], 2.5)]

    def wind_up(torque: Array) -> tuple[Array, Array]:
        strain, slope = torque / k, np.full_like(torque, 1.0 / k)
        for share, harder in stages:
            x = torque / (harder * crossing)
            root = np.sqrt(1.0 + x**2)
            strain = strain + share * h * x / root
            slope = slope + share * h / (harder * crossing * root**3)
        return strain, slope

    return WindUp(wind_up, k)


def _between_flanks(e: Array, k: float, h: float, left: float, rest: float) -> tuple[Array, Array]:
    """Two flanks at +-h about the middle of the play, from which the drive rests by `rest` where unloaded."""

    def force(x: Array) -> tuple[Array, Array]:
        s, ds = left * k * x, np.full_like(x, left * k)
        for side in (1.0, -1.0):
            z = side * x - h
            root = np.sqrt(z**2 + (0.02 * h) ** 2)
            s = s + side * (1.0 - left) * k * 0.5 * (z + root)
            ds = ds + (1.0 - left) * k * 0.5 * (1.0 + z / root)
        return s, ds

    s, ds = force(e + rest)
    return s - force(np.array([rest]))[0], ds


EFFECT = Effect("backlash", ("sharp", "smooth", "stages"), drives, draw, impose)
