"""Drives that grow stiffer with torque."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, turns
from beamstiff.exam.laws import Curve, Law, WindUp
from beamstiff.exam.reality import Reality

SOFTER = (0.85, 0.25)  # stiffness at no torque over that at much
BEND = (4e-5, 4e-4)  # rad: strain about which the stiffness changes


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness at no and at much torque, over the nominal one, and the strain between, rad."""
    softer = request.sized(*SOFTER)
    bend = request.log_uniform(*BEND) * (1.0 if turns(request.robot, request.component) else 0.1)
    found = {"soft": softer**0.6, "hard": softer**-0.4, "bend": bend}
    if request.form == "piecewise":
        found["middle"] = request.uniform(0.3, 0.7)  # of the way from soft to hard
        found["first"] = request.uniform(0.25, 0.4)  # first corner's torque over the second's
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a hardening drive."""
    return at_joints(truth, reality, lambda k: _law(truth, k))


def _law(truth: Truth, k: float) -> Law:
    p = truth.parameters
    soft, hard, T = k * p["soft"], k * p["hard"], k * p["bend"]

    def exponential(torque: Array) -> tuple[Array, Array]:
        fade = np.exp(-np.abs(torque) / T)
        more = 1.0 / soft - 1.0 / hard
        return torque / hard + np.sign(torque) * more * T * (1.0 - fade), 1.0 / hard + more * fade

    def piecewise(torque: Array) -> tuple[Array, Array]:
        middle = 1.0 / (soft + p["middle"] * (hard - soft))
        one, two = p["first"] * T, T
        size = np.abs(torque)
        strain = (
            np.minimum(size, one) / soft
            + np.clip(size - one, 0.0, two - one) * middle
            + np.maximum(size - two, 0.0) / hard
        )
        slope = np.where(size < one, 1.0 / soft, np.where(size < two, middle, 1.0 / hard))
        return np.sign(torque) * strain, slope

    if truth.form == "exponential":
        return WindUp(exponential, hard)
    if truth.form == "piecewise":
        return WindUp(piecewise, hard)
    scale = T / soft / np.sqrt(2.0 * np.log(hard / soft))  # tangent at T: soft sqrt(1 + 2 ln(hard / soft))

    def sinh(e: Array) -> tuple[Array, Array]:
        x = np.clip(e / scale, -6.0, 6.0)
        return soft * (scale * np.sinh(x) + (e - scale * x) * np.cosh(x)), soft * np.cosh(x)

    return Curve(sinh)


EFFECT = Effect("hardening", ("exponential", "piecewise", "sinh"), drives, draw, impose)
