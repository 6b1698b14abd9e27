"""Kinematics that differ from the nominal ones."""

from __future__ import annotations

import dataclasses

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.gap.exam.campaign import Truth
from beamstiff.gap.exam.effect import Asked, Effect, between, sign, stroke
from beamstiff.gap.exam.placing import place, skeleton_of
from beamstiff.gap.exam.reality import Reality
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS

ANGLE = (1e-5, 9e-3)  # rad: from what a calibration leaves to a wrong home position
LENGTH = (1e-5, 3e-3)  # m


def places(robot: Robot) -> list[str | None]:
    """Return the encoders, and of every frame its constant lengths and the angle between its axes."""
    found: list[str | None] = [variable.name for variable in robot.actuated]
    for name, _, parameters in skeleton_of(robot).frames:
        if not any(expression.coefficients for expression in parameters.values()):
            continue  # a mark on a link, not a joint's frame
        constant = [
            p for p, e in parameters.items() if not e.coefficients and FRAME_PARAMETERS[p] == "length"
        ]
        found += [f"{name}.{p}" for p in sorted({*constant, "alpha"})]
    return [name for name in found if _closes(robot, str(name))] if robot.loops else found


def _closes(robot: Robot, component: str) -> bool:
    """Return whether rigid loops still close with an error; others would bend the machine."""
    errors = {component: LENGTH[1] if _kind(robot, component) == "length" else ANGLE[1]}
    q = np.array([[stroke(robot, v.name)[0] for v in robot.actuated]])
    try:
        place(skeleton_of(robot, errors), q, errors)
    except BeamstiffError:
        return False
    return True


def draw(asked: Asked) -> dict[str, float]:
    """Return the error, rad or m; and of the frame's other kind one that comes with it."""
    kind = _kind(asked.robot, str(asked.component))
    found = {"error": sign(asked.rng) * between(asked.size, *(ANGLE if kind == "angle" else LENGTH))}
    if asked.form == "skewed" and "." in str(asked.component) and not asked.robot.loops:
        found["other"] = 0.1 * sign(asked.rng) * between(asked.size, *(LENGTH if kind == "angle" else ANGLE))
    return found


def _kind(robot: Robot, component: str) -> str:
    if "." in component:
        return FRAME_PARAMETERS[component.rsplit(".", 1)[1]]
    return next(v.kind for v in robot.variables if v.name == component)


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with wrong kinematics."""
    component, p = str(truth.component), truth.parameters
    geometry = dict(reality.geometry)
    geometry[component] = geometry.get(component, 0.0) + p["error"]
    if p.get("other"):
        frame, parameter = component.rsplit(".", 1)
        second = f"{frame}.{'d' if FRAME_PARAMETERS[parameter] == 'angle' else 'alpha'}"
        geometry[second] = geometry.get(second, 0.0) + p["other"]
    return dataclasses.replace(reality, geometry=geometry)


EFFECT = Effect("geometry-error", ("single", "skewed"), places, draw, impose)
