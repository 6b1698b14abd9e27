"""Kinematics and payload that differ from the model's, and joint angles that err without a torque."""

import dataclasses

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, stroke, turning_drives, vector
from beamstiff.exam.placing import Placed, place, skeleton_of
from beamstiff.exam.reality import Reality
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
ALONE = "order"  # form of one order; the other one has a second order beside it


def geometry_places(robot: Robot) -> list[str | None]:
    """Return the encoders, and of every frame its constant lengths and the angle between its axes.

    Excluded are those that absolute positions cannot distinguish from another of them, from a turned
    measuring frame or from an offset of the tool: with any of these names a diagnosis would be right.
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


def draw_geometry(request: DrawRequest) -> dict[str, float]:
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


def _geometry(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with wrong kinematics."""
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


def _payload(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with another payload."""
    p, machine = truth.parameters, reality.machine
    away = vector(p)
    carried = [mass for mass in machine.masses if mass.node == machine.tcp]
    rest = [mass for mass in machine.masses if mass.node != machine.tcp]
    kilograms = sum(mass.mass for mass in carried)
    centre = sum((mass.mass * np.array(mass.at) for mass in carried), np.zeros(3)) / (kilograms or 1.0)
    at = tuple(map(float, centre + away))
    payload = Mass(node=machine.tcp, mass=kilograms + p["mass"], at=at)  # type: ignore[arg-type]
    return reality.with_machine(dataclasses.replace(machine, masses=(*rest, payload)))


def turning_axes(robot: Robot) -> list[str | None]:
    """Return the revolute axes of a serial robot; in a loop the error would bend the machine."""
    every = [v.name for v in robot.actuated if v.type == "revolute"]
    return [] if robot.loops else [*every] if turning_drives(robot) else []


def _draw_curve(request: DrawRequest) -> dict[str, float]:
    found = {"amplitude": request.sized(*AMPLITUDE), "order": request.integer(1, 5)}
    found["phase"] = request.uniform(0.0, 2 * np.pi)
    found["second"] = 0.0 if request.form == ALONE else request.uniform(0.3, 0.7)
    return found


def _curve(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)

    def error(campaign: SimulatedCampaign, angle: Array) -> Array:
        first = np.sin(p["order"] * angle + p["phase"])
        second = p["second"] * np.cos((p["order"] + 1.0) * angle + 2.0 * p["phase"])
        return np.asarray(p["amplitude"] * (first + second))

    return _turned(reality, variable, error)


def _draw_approach(request: DrawRequest) -> dict[str, float]:
    return {"half": request.sized(*AMPLITUDE), "first": request.sign(), "way": request.sign()}


def _approach(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)

    def error(campaign: SimulatedCampaign, angle: Array) -> Array:
        """Return where in its play the joint stands: dragged along, or at the end by which it came."""
        order = np.lexsort((campaign.step, campaign.time))
        result, at, before = np.empty(len(angle)), p["first"] * p["half"], angle[order[0]]
        for row in order:
            moved = angle[row] - before
            dragged = float(np.clip(at - moved, -p["half"], p["half"]))
            at = dragged if truth.form == "play" or moved == 0.0 else -np.sign(moved) * p["half"]
            result[row], before = p["way"] * at, angle[row]
        return result

    return _turned(reality, variable, error)


def _turned(reality: Reality, variable: str, error) -> Reality:  # type: ignore[no-untyped-def]
    """Return the reality whose readings are turned about a joint's axis by an error, rad."""
    frames = skeleton_of(reality.machine.robot).frames
    frame = next(n for n, _, p in frames if "theta" in p and variable in p["theta"].coefficients)

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        if campaign.kind != "absolute":  # the same before the load and under it
            return values
        by = error(campaign, placed.values[variable])[:, None]
        axis = placed.rotations[frame][:, :, 2]
        arm = values[:, :3] - placed.origins[frame]
        across = np.cross(axis, arm)
        moved = np.sin(by) * across + (1.0 - np.cos(by)) * np.cross(axis, across)
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return reality.with_reading(read)


EFFECTS: tuple[Effect, ...] = (
    Effect("geometry-error", ("single", "skewed"), geometry_places, draw_geometry, _geometry),
    Effect("payload-error", ("mass", "centre", "both"), nowhere, _draw_payload, _payload),
)
# in the table since the exam of crowded machines, which alone draws them: others keep their cases
LATER: tuple[Effect, ...] = (
    Effect("angle-curve", (ALONE, "two-orders"), turning_axes, _draw_curve, _curve),
    Effect("approach-direction", ("flank", "play"), turning_axes, _draw_approach, _approach),
)
