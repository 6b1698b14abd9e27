"""Kinematics that differ from the nominal ones."""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Truth
from beamstiff.exam.effect import DrawRequest, Effect, stroke
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS

ANGLE = (1e-5, 9e-3)  # rad: from what a calibration leaves to a wrong home position
LENGTH = (1e-5, 3e-3)  # m
STEP = 1e-6  # m or rad, of derivatives
POSES = 16
SAME = 1e-3  # share of an error's effect that another leaves of it, below which they are the same


def places(robot: Robot) -> list[str | None]:
    """Return the encoders, and of every frame its constant lengths and the angle between its axes.

    Left out are those that absolute positions cannot tell from another of them, from a turned measuring frame
    or from an offset of the tool: with any of these names a diagnosis would be right.
    """
    found = [variable.name for variable in robot.actuated]
    for name, _, parameters in skeleton_of(robot).frames:
        if not any(expression.coefficients for expression in parameters.values()):
            continue  # a mark on a link, not a joint's frame
        constant = [
            p for p, e in parameters.items() if not e.coefficients and FRAME_PARAMETERS[p] == "length"
        ]
        found += [f"{name}.{p}" for p in sorted({*constant, "alpha"})]
    if robot.loops:
        found = [name for name in found if _closes(robot, name)]
    return list(_told_apart(robot, found))


def _told_apart(robot: Robot, names: list[str]) -> list[str]:
    rng = np.random.default_rng(0)
    ranges = [stroke(robot, v.name) for v in robot.actuated]
    middle, half = np.array(ranges).T
    q = middle + 0.7 * half * rng.uniform(-1.0, 1.0, (POSES, len(ranges)))
    tcp = next(node for node in robot.nodes if node.name == robot.tcp)
    try:
        placed = place(skeleton_of(robot), q)
    except BeamstiffError:  # a pose that the loops cannot reach: all stay
        return names
    at, axes = placed.node(tcp), placed.rotations[tcp.frame]
    columns = {}
    for name in names:
        errors = {name: STEP}
        moved = place(skeleton_of(robot, {k: v for k, v in errors.items() if "." in k}), q, errors)
        columns[name] = ((moved.node(tcp) - at) / STEP).reshape(-1)
    turned = np.stack([np.cross(np.eye(3)[i], at).reshape(-1) for i in range(3)], axis=-1)
    offset = np.stack([axes[:, :, i].reshape(-1) for i in range(3)], axis=-1)
    apart = []
    for name, column in columns.items():
        size = float(np.linalg.norm(column))
        others = [turned, offset, *(c[:, None] for other, c in columns.items() if other != name)]
        left = (column - b @ np.linalg.lstsq(b, column, rcond=1e-9)[0] for b in others)
        if size > SAME and all(np.linalg.norm(rest) > SAME * size for rest in left):
            apart.append(name)
    return apart or names


def _closes(robot: Robot, component: str) -> bool:
    """Return whether rigid loops still close with an error; others would bend the machine."""
    errors = {component: LENGTH[1] if _kind(robot, component) == "length" else ANGLE[1]}
    q = np.array([[stroke(robot, v.name)[0] for v in robot.actuated]])
    try:
        place(skeleton_of(robot, errors), q, errors)
    except BeamstiffError:
        return False
    return True


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the error, rad or m; and of the frame's other kind one that comes with it."""
    kind = _kind(request.robot, str(request.component))
    found = {"error": request.sign() * request.sized(*(ANGLE if kind == "angle" else LENGTH))}
    if request.form == "skewed" and "." in str(request.component) and not request.robot.loops:
        found["other"] = 0.1 * request.sign() * request.sized(*(LENGTH if kind == "angle" else ANGLE))
    return found


def _kind(robot: Robot, component: str) -> str:
    if "." in component:
        return FRAME_PARAMETERS[component.rsplit(".", 1)[1]]
    return next(v.kind for v in robot.variables if v.name == component)


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with wrong kinematics."""
    component, p = str(truth.component), truth.parameters
    errors = {component: p["error"]}
    if p.get("other"):
        frame, parameter = component.rsplit(".", 1)
        errors[f"{frame}.{'d' if FRAME_PARAMETERS[parameter] == 'angle' else 'alpha'}"] = p["other"]
    return reality.with_errors(errors)


EFFECT = Effect("geometry-error", ("single", "skewed"), places, draw, impose)
