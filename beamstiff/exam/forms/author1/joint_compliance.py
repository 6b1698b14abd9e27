"""Joints that the model holds stiff about their axis."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import Asked, Effect, between, turns
from beamstiff.exam.laws import Curve
from beamstiff.exam.machine import joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

TURNING = (3e7, 3e5)  # N m/rad
SLIDING = (1e9, 3e7)  # N/m


def places(robot: Robot) -> list[str | None]:
    """Return the joints that are rigid in their own direction."""
    names = dict.fromkeys(joint.variable or joint.name for joint in robot.joints)
    return [n for n in names if all(own_stiffness(robot, *j) == math.inf for j in joints_of(robot, n))]


def draw(asked: Asked) -> dict[str, float]:
    """Return the stiffness, SI, and from which strain on a second spring helps."""
    found = {"stiffness": between(asked.size, *(TURNING if turns(asked.robot, asked.component) else SLIDING))}
    if asked.form == "helped":
        found |= {
            "from": between(float(asked.rng.uniform()), 1e-4, 1e-3),
            "more": float(asked.rng.uniform(0.2, 0.8)),
        }
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the joint elastic."""
    p, machine = truth.parameters, reality.machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        hinge = machine.hinge(name)
        k = hinge.stiffness.copy()
        k[own] = p["stiffness"]
        machine = machine.with_hinge(dataclasses.replace(hinge, stiffness=k))
        if truth.form == "helped":
            machine = machine.with_law(name, own, Curve(lambda e: _helped(e, p)))
    return reality.with_machine(machine)


def _helped(e: Array, p: object) -> tuple[Array, Array]:
    v: dict[str, float] = dict(p)  # type: ignore[call-overload]
    k, far = v["stiffness"], np.abs(e) / v["from"]
    share = far**2 / (1.0 + far**2)
    return k * e * (1.0 + v["more"] * share), k * (1.0 + v["more"] * share * (1.0 + 2.0 / (1.0 + far**2)))


EFFECT = Effect("joint-compliance", ("plain", "helped"), places, draw, impose)
