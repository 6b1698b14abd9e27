"""Kinematics and payload that differ from the model's, and joint angles that err without a torque."""

import dataclasses

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import turning_drives
from beamstiff.exam.draws import PHASE, SIGN, always, evenly, sized, whole
from beamstiff.exam.effect import Change, Reality, Seen, built, form, reading
from beamstiff.exam.machine import Machine, stroke
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters, vector
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS, Mass

ANGLE = (1e-5, 9e-3)  # rad: from what a calibration leaves to a wrong home position
LENGTH = (1e-5, 3e-3)  # m
STEP = 1e-6  # m or rad, of derivatives
POSES = 16
SAME = 1e-3  # share of an error's effect that another leaves of it, below which they are the same
MASS = (1.5, 60.0)  # kg
AWAY = (8e-3, 0.25)  # m
AMPLITUDE = (2e-5, 2e-3)  # rad


def geometry_places(robot: Robot) -> list[str | None]:
    """Return the encoders, and of every frame its constant lengths and the angle between its axes.

    Not those that positions cannot distinguish from one another, a turned measuring frame or an offset tool.
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
    turned = np.stack([np.cross(unit, at).reshape(-1) for unit in np.eye(3)], axis=-1)
    offset = axes.reshape(-1, 3)
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
    errors = {component: LENGTH[1] if kind_of(robot, component) == "length" else ANGLE[1]}
    q = np.array([[stroke(robot, v.name)[0] for v in robot.actuated]])
    try:
        place(skeleton_of(robot, errors), q, errors)
    except BeamstiffError:
        return False
    return True


def draw_geometry(request: DrawRequest) -> dict[str, float]:
    """Return the error, rad or m; and of the frame's other kind one that comes with it."""
    kind = kind_of(request.robot, str(request.component))
    found = {"error": request.sign() * request.sized(*(ANGLE if kind == "angle" else LENGTH))}
    if request.form == "skewed" and "." in str(request.component) and not request.robot.loops:
        found["other"] = 0.1 * request.sign() * request.sized(*(LENGTH if kind == "angle" else ANGLE))
    return found


def kind_of(robot: Robot, component: str) -> str:
    """Return whether the error of an encoder, or of a frame's parameter, is an angle or a length."""
    if "." in component:
        return FRAME_PARAMETERS[component.rsplit(".", 1)[1]]
    return next(v.kind for v in robot.variables if v.name == component)


def _geometry(truth: Truth, reality: Reality) -> Reality:
    component, p = str(truth.component), truth.parameters
    errors = {component: p["error"]}
    if p.get("other"):
        frame, parameter = component.rsplit(".", 1)
        errors[f"{frame}.{'d' if FRAME_PARAMETERS[parameter] == 'angle' else 'alpha'}"] = p["other"]
    return reality.with_errors(errors)


def _draw_payload(request: DrawRequest) -> dict[str, float]:
    """Return the mass that the model lacks, kg, and how far its centre is off, m, in the TCP's frame."""
    payload = sum(mass.mass for mass in request.robot.masses if mass.node == request.robot.tcp)
    more = request.sized(*MASS) * request.sign() if request.form != "centre" else 0.0
    if more < -0.8 * payload:
        more = -more
    away = request.sized(*AWAY) if request.form == "centre" and payload else 0.0
    if request.form == "centre" and not payload:
        more = request.sized(*MASS)
    if request.form == "both" or (request.form == "centre" and not payload):
        away = request.uniform(0.03, 0.15)
    return {"mass": more} | request.direction(away)


def _payload(p: Parameters, machine: Machine, _: str) -> Machine:
    carried = [mass for mass in machine.masses if mass.node == machine.tcp]
    rest = [mass for mass in machine.masses if mass.node != machine.tcp]
    kilograms = sum(mass.mass for mass in carried)
    centre = sum((mass.mass * np.array(mass.at) for mass in carried), np.zeros(3)) / (kilograms or 1.0)
    payload = Mass(node=machine.tcp, mass=kilograms + p["mass"], at=tuple((centre + vector(p)).tolist()))
    return dataclasses.replace(machine, masses=(*rest, payload))


def turning_axes(robot: Robot) -> list[str | None]:
    """Return the revolute axes of a serial robot; in a loop the error would bend the machine."""
    every = [v.name for v in robot.actuated if v.type == "revolute"]
    return [] if robot.loops else [*every] if turning_drives(robot) else []


def _curve(p: Parameters, seen: Seen, angle: Array) -> Array:
    first = np.sin(p["order"] * angle + p["phase"])
    second = p["second"] * np.cos((p["order"] + 1.0) * angle + 2.0 * p["phase"])
    return np.asarray(p["amplitude"] * (first + second))


def _approach(play: bool) -> Change:
    """Return where in its play the joint stands: dragged along, or at the end by which it came."""

    def error(p: Parameters, seen: Seen, angle: Array) -> Array:
        order = np.lexsort((seen.campaign.step, seen.campaign.time))
        result, at, before = np.empty(len(angle)), p["first"] * p["half"], angle[order[0]]
        for row in order:
            moved = angle[row] - before
            dragged = float(np.clip(at - moved, -p["half"], p["half"]))
            at = dragged if play or moved == 0.0 else -np.sign(moved) * p["half"]
            result[row], before = p["way"] * at, angle[row]
        return result

    return error


def _turned(error: Change) -> Change:
    """Return the readings turned about a joint's axis by an error, rad, from the joint's angles (N,)."""

    def change(p: Parameters, seen: Seen, values: Array) -> Array:
        if not seen.absolute:  # the same before the load and under it
            return values
        variable, rotations = str(seen.component), seen.placed.rotations
        frames = skeleton_of(seen.machine.robot).frames
        frame = next(
            n for n, _, found in frames if "theta" in found and variable in found["theta"].coefficients
        )
        by = error(p, seen, seen.placed.values[variable])[:, None]
        axis, arm = rotations[frame][:, :, 2], values[:, :3] - seen.placed.origins[frame]
        across = np.cross(axis, arm)
        moved = np.sin(by) * across + (1.0 - np.cos(by)) * np.cross(axis, across)
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return change


_ORDER: dict[str, Draw] = {"amplitude": sized(*AMPLITUDE), "order": whole(1, 5), "phase": PHASE}
_HALF: dict[str, Draw] = {"half": sized(*AMPLITUDE), "first": SIGN, "way": SIGN}
FORMS = (
    form("geometry-error", "single", _geometry, draw_geometry),
    form("geometry-error", "skewed", _geometry, draw_geometry),
    *(built("payload-error", name, _payload, _draw_payload) for name in ("mass", "centre", "both")),
    reading("angle-curve", "order", _turned(_curve), **_ORDER, second=always(0.0)),
    reading("angle-curve", "two-orders", _turned(_curve), **_ORDER, second=evenly(0.3, 0.7)),
    reading("approach-direction", "flank", _turned(_approach(False)), **_HALF),
    reading("approach-direction", "play", _turned(_approach(True)), **_HALF),
)  # fmt: skip
