"""Bearings that are compliant across the joint's axis."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, slender
from beamstiff.exam.laws import Curve
from beamstiff.exam.machine import Hinge, joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

Curved = tuple[Array, Array]
TILT = (4e-8, 6e-7)  # rad/(N m)
RADIAL = 4e-2  # m^2: radial compliance over tilting compliance, of rollers on a ring of 0.3 m


def places(robot: Robot) -> list[str | None]:
    """Return all joints."""
    return list(dict.fromkeys(joint.variable or joint.name for joint in robot.joints))


def draw(request: DrawRequest) -> dict[str, float]:
    """Return compliances: tilting rad/(N m), radial and axial m/N; and how the bearing sits."""
    joints = joints_of(request.robot, str(request.component))
    own = [own_stiffness(request.robot, *joint) for joint in joints]
    drive = min(own)
    # a wrist's bearings are smaller, as its drives are
    softest = TILT[1] * slender(request.robot) if drive in (0.0, math.inf) else max(TILT[1], 1.0 / drive)
    tilt = request.sized(TILT[0], softest)
    radial = tilt * RADIAL * request.uniform(0.3, 1.0)
    found = {
        "tilt": tilt,
        "other": request.uniform(0.5, 1.0),
        "radial": radial,
        "axial": radial * request.uniform(0.5, 1.0),
        "turned": request.uniform(0.0, math.pi),
    }
    if request.form == "off-centre":
        found["offset"] = 0.0 if math.inf in own else request.uniform(-0.15, 0.15)
    if request.form == "contact":
        found["strain"] = 2e3 * tilt * request.uniform(0.5, 2.0)
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with soft bearings."""
    machine, p = reality.machine, truth.parameters
    added = np.array([p["axial"], p["radial"], p["radial"], 0.0, p["tilt"], p["tilt"] * p["other"]])
    for name, own in joints_of(machine.robot, str(truth.component)):
        hinge = machine.hinge(name)
        c, s = math.cos(p["turned"]), math.sin(p["turned"])
        axes = hinge.axes @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        k = hinge.stiffness.copy()
        others = [d for d in range(6) if d != own and k.ndim == 1 and k[d] > 0.0 and added[d] > 0.0]
        k[others] = 1.0 / (added[others] + 1.0 / k[others])
        hinge = dataclasses.replace(hinge, axes=axes, stiffness=k)
        if p.get("offset", 0.0):
            hinge = dataclasses.replace(hinge, stiffness=_moved(hinge, p["offset"]))
        if "strain" in p:
            stiffer = {d: Curve(_contact(float(k[d]), p["strain"])) for d in others if d >= 4}
            hinge = dataclasses.replace(hinge, laws={**hinge.laws, **stiffer})
        machine = machine.with_hinge(hinge)
    return reality.with_machine(machine)


def with_tilting(truth: Truth, reality: Reality, curve: Callable[[Array, float], Curved]) -> Reality:
    """Return the reality with soft bearings whose tilting follows a curve of the strain and the stiffness."""
    machine = impose(truth, reality).machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        for d in (4, 5):
            k = float(machine.hinge(name).stiffness[d])
            if d != own and 0.0 < k < math.inf:
                machine = machine.with_law(name, d, Curve(lambda e, k=k: curve(e, k)))  # type: ignore[misc]
    return reality.with_machine(machine)


def _moved(hinge: Hinge, offset: float) -> Array:
    """Return the stiffness of springs that sit `offset` along the axis from the joint's node."""
    k = np.where(np.isinf(hinge.stiffness), 1e12, hinge.stiffness)  # a full matrix knows no rigid ones
    X = np.eye(6)
    X[1, 5], X[2, 4] = offset, -offset  # displacement at the springs: t + r x (offset, 0, 0)
    moved: Array = X.T @ np.diag(k) @ X
    return moved


def _contact(k: float, strain: float):  # type: ignore[no-untyped-def]
    """Stiffer under load, as rolling contacts are."""

    def curve(e: Array) -> tuple[Array, Array]:
        root = np.sqrt(1.0 + (e / strain) ** 2)
        return 0.7 * k * e * root, 0.7 * k * (root + (e / strain) ** 2 / root)

    return curve


EFFECT = Effect("bearing-tilt", ("anisotropic", "off-centre", "contact"), places, draw, impose)
