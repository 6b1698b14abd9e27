"""Joints that the model holds stiff about their axis."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, turns
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


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness, SI, and from which strain on a second spring helps."""
    found = {"stiffness": request.sized(*(TURNING if turns(request.robot, request.component) else SLIDING))}
    if request.form == "helped":
        found |= {"from": request.log_uniform(1e-4, 1e-3), "more": request.uniform(0.2, 0.8)}
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


def _helped(e: Array, p: Mapping[str, float]) -> tuple[Array, Array]:
    k, far = p["stiffness"], np.abs(e) / p["from"]
    share = far**2 / (1.0 + far**2)
    return k * e * (1.0 + p["more"] * share), k * (1.0 + p["more"] * share * (1.0 + 2.0 / (1.0 + far**2)))


EFFECT = Effect("joint-compliance", ("plain", "helped"), places, draw, impose)
