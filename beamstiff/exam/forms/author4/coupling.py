"""Drives that act on one another: by the housing that both stand on, and by an idler that carries one way."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, turning_drives
from beamstiff.exam.forms.author4.by_form import Form, effect_of, rounded_ramp
from beamstiff.exam.laws import Curve, Situation, Stiffness
from beamstiff.exam.machine import Mesh, joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

ROUND = 2e-6  # rad


def pairs(robot: Robot) -> Sequence[str | None]:
    """Return the pairs of drives that follow one another."""
    names = turning_drives(robot)
    return [f"{a}+{b}" for a, b in pairwise(names)]


def _housing(request: DrawRequest) -> dict[str, float]:
    return {
        "compliance": request.sized(0.02, 0.8),
        "share": request.sign() * request.uniform(0.5, 1.2),
        "phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _idler(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": request.sized(0.03, 1.2),
        "ratio": request.sign() * request.uniform(0.4, 1.3),
        "side": request.sign(),
    }


def _impose(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    (first, a), (second, b) = (joints_of(machine.robot, name)[0] for name in names)
    k1, k2 = own_stiffness(machine.robot, first, a), own_stiffness(machine.robot, second, b)
    softer = min(k1, k2)
    if truth.form == "one-way-idler":
        k, side = softer * p["stiffness"], p["side"]

        def curve(strain: Array) -> tuple[Array, Array]:
            carried, slope = rounded_ramp(side * strain, ROUND)
            return side * k * (carried - 0.5 * ROUND), k * slope

        mesh = Mesh((first, a), (second, b), (1.0, p["ratio"]), Curve(curve))
        return reality.with_machine(machine.plus(meshes=(mesh,)))

    # both torques twist one housing, the second by the cosine of the angle between the axes: its compliance c
    # in series, (C + c u u^T)^-1 = K - K u u^T K c / (1 + c u^T K u)
    c = p["compliance"] / max(k1, k2)

    def leaning(situation: Situation) -> Array:
        return np.asarray(p["share"] * np.cos(situation.values[names[1]] - p["phase"]))

    def taken(situation: Situation) -> Array:
        return np.asarray(-c / (1.0 + c * (k1 + k2 * leaning(situation) ** 2)))

    mesh = Mesh((first, a), (second, b), (k1, lambda s: k2 * leaning(s)), Stiffness(taken))
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS = (
    effect_of(
        "joint-coupling",
        pairs,
        {"common-housing": Form(_housing, _impose), "one-way-idler": Form(_idler, _impose)},
    ),
)
