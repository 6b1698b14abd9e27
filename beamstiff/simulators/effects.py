"""Effects of a robot as elements of its bodies: springs in series, stops, friction, balancers.

A compliance that the load winds up in proportion is the same 6 x 6 matrix in every posture, seen from the
body where it sits. That is what it is recognised by, whatever effect it is of; hinges and slides stand for
it. What goes by the torque of a drive becomes springs with stops (a knee, backlash), a cubic spring, or
springs that rub, `theta = T/k - a S_r(T)/k`: those of the stop operator S_r, beside friction r.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect, AddedShape, Beam, Mass, Rigid
from beamstiff.se3 import Array, displacement_transport, rotate_screw, transform
from beamstiff.simulators.bodies import BodyJoint, Tendon, free_name
from beamstiff.simulators.joints import Assembly
from beamstiff.units import unit_size, with_unit

ROUNDING = 1e-6  # of a compliance: what is less is none
FLANK = 1.15  # torque at which a straight flank ends, over the width of one that bends like tanh
BALANCER_ARM = (
    0.25  # m: from an axis to where its balancer is hooked on; only its stiffness times this counts
)


def add_effects(made: Assembly) -> None:
    """Add the effects of a robot to its bodies; what has no counterpart is listed."""
    for effect in (one for several in made.machine.robot.effects for one in _by_shape(several)):
        try:
            added = _drive_law(made, effect) or _compliance(made, effect)
        except BeamstiffError as error:
            made.lost.append(f"effect {effect.label}: {error}")
            continue
        if not added:
            made.lost.append(f"effect {effect.label} ({effect.shape}) has no counterpart")


def _by_shape(effect: AddedEffect) -> Iterator[AddedEffect]:
    """Yield an effect for each of its shapes: what springs in series add is their sum."""
    for shape in effect.each:
        size = {name: shape.weight * value for name, value in _numbers(shape).items()}
        one = AddedShape(shape=shape.shape, parameters=size, scales=shape.scales)
        yield effect.with_shapes((one,))


def bare(robot: Robot) -> Robot:
    """Return a robot with the masses that its payload errors add."""
    masses = list(robot.masses)
    for effect in robot.effects:
        parameters = _numbers(effect)
        known = {"mass"} <= set(parameters) <= {"mass", *_LEVERS}
        if effect.effect == "payload-error" and known:
            mass = parameters["mass"]
            x, y, z = (parameters.get(name, 0.0) / mass for name in _LEVERS)
            masses.append(Mass(node=robot.tcp, mass=mass, at=(x, y, z)))
    return robot.model_copy(update={"masses": tuple(masses)})


_LEVERS = ("mass_times_x", "mass_times_y", "mass_times_z")


def _numbers(effect: AddedEffect | AddedShape) -> dict[str, float]:
    """Return an effect's parameters, SI."""
    numbers = {}
    for name, value in effect.parameters.items():
        magnitude, unit = with_unit(value) if isinstance(value, str) else (value, "1")
        numbers[name] = magnitude * unit_size(unit)
    return numbers


# -- compliances


def _compliance(made: Assembly, effect: AddedEffect) -> bool:
    """Add an effect that is one compliance in every posture, seen from its body; return whether it is."""
    robot = made.machine.robot
    alone = robot.model_copy(update={"effects": (effect,)})
    q = made.machine.where.values[
        :, [made.machine.kinematics.coupling.names.index(v.name) for v in robot.actuated]
    ]
    few = q[:3]
    at_tcp = _added(alone, few, 1.0)
    if np.abs(_added(alone, few, 0.1) - at_tcp).max() > 1e-6 * np.abs(at_tcp).max():
        return False
    node, frame = _seat(made, effect)
    kinematics, where = made.machine.kinematics, made.machine.where
    turned = where.transforms[: len(few), kinematics.frame_index[frame], :3, :3]
    places = where.node_positions[: len(few)]
    arm = places[:, kinematics.node_index[robot.tcp]] - places[:, kinematics.node_index[node]]
    to_seat = rotate_screw(turned).swapaxes(-1, -2) @ displacement_transport(-arm)
    local = to_seat @ at_tcp @ to_seat.swapaxes(-1, -2)
    size = np.abs(local).max()
    if size == 0.0 or np.ptp(local, axis=0).max() > 1e-5 * size:
        return False
    if effect.effect == "tool-compliance":
        body, placed = made.of_node[node]
        body = made.body(effect.effect, body, placed)
        made.of_node[node] = body, np.eye(4)
    body, placed = made.of_node[node]
    own = placed @ made.machine.relative(made.nodes[node].frame, frame)[0]
    own[:3, 3] = made.point(node, placed)
    springs = [*springs_of(local[0], own, effect.label)]
    if not springs:
        return False
    for spring in springs:
        made.join(body, spring)
    return True


def _added(robot: Robot, q: Array, size: float) -> Array:
    """Return the compliance (P, 6, 6) at the TCP that effects add at postures (P, A)."""
    names, wrench = [variable.name for variable in robot.actuated], np.tile(size * np.eye(6), (len(q), 1))
    rows = make_measurements(
        names, np.repeat(q, 6, axis=0), tcp=robot.tcp, wrench=wrench, displacement=np.zeros_like(wrench)
    )
    moved = effects_displacement(robot, rows).reshape(len(q), 6, 6) / size
    return moved.swapaxes(-1, -2)


def _seat(made: Assembly, effect: AddedEffect) -> tuple[str, str]:
    """Return the node at which an effect sits, and the frame that its axes turn with."""
    robot = made.machine.robot
    if effect.effect == "base-compliance":
        return robot.fixed[0], "base"
    for joint in robot.joints:
        if effect.component in (joint.name, joint.variable) and effect.component is not None:
            return joint.nodes[1], joint.frame
    links: list[Rigid | Beam] = [*robot.rigids, *robot.beams]
    for link in links:
        if link.name == effect.component:
            return link.nodes[1], made.nodes[link.nodes[1]].frame
    return robot.tcp, made.nodes[robot.tcp].frame


def springs_of(compliance: Array, frame: Array, name: str) -> Iterator[BodyJoint]:
    """Yield slides and hinges that are a compliance (6, 6) in a frame (4, 4) of a body.

    Hinges about the principal axes of its rotations, through the points about which a moment turns it; slides
    for what of its translations is left (Schur complement). A moment that shifts along its own axis, a screw,
    no hinge does: that part is left out.
    """
    values, axes = np.linalg.eigh(compliance[3:, 3:])
    rotations, points = [], []
    turning = compliance[:3, 3:] @ axes  # what moments about the axes shift
    left = compliance[:3, :3].copy()
    smallest = ROUNDING * max(values.max(), 1e-300)
    for at in range(3):
        if values[at] <= smallest:
            continue
        axis = axes[:, at]
        shift = turning[:, at] / values[at]  # of the frame's origin, a unit of turn
        shift = shift - axis * (axis @ shift)
        points.append(np.cross(axis, shift))  # axis x (origin - point) = shift
        rotations.append((axis, values[at]))
        left -= values[at] * np.outer(shift, shift)
    sizes, ways = np.linalg.eigh((left + left.T) / 2)
    least = max(ROUNDING * float(np.abs(compliance[:3, :3]).max()), 1e-9 * float(values.max()), 1e-300)
    for at in range(3):
        if sizes[at] > least:
            axis = frame[:3, :3] @ ways[:, at]
            yield BodyJoint(
                f"{name}.slide.{at + 1}", "slide", frame[:3, 3], axis, "spring", 1.0 / float(sizes[at])
            )
    for at, ((axis, value), point) in enumerate(zip(rotations, points, strict=True)):
        place = frame[:3, :3] @ point + frame[:3, 3]
        turn = frame[:3, :3] @ axis
        yield BodyJoint(f"{name}.turn.{at + 1}", "hinge", place, turn, "spring", 1.0 / float(value))


# -- laws of drives


def _drive_law(made: Assembly, effect: AddedEffect) -> bool:
    """Add an effect that follows the torque or the angle of a drive; return whether it is one."""
    found = _spring(made, effect)
    if found is None:
        return False
    body, spring = found
    parameters, torque = _numbers(effect), effect.scales.get("torque")
    k, label, shape = spring.stiffness, effect.label, effect.shape or ""
    stops: list[tuple[float, float]] = []  # half width, and torque at which it is reached
    if effect.effect == "gravity-compensator":
        return _balancer(made, effect, body, spring, parameters)
    if not isinstance(torque, float):
        return False
    if effect.effect == "backlash" and (match := re.fullmatch(r"flank within ([\d.]+)", shape)):
        stops = [(parameters["half_width"], FLANK * float(match[1]) * torque)]
    elif effect.effect == "backlash" and shape == "flanks one after another":
        halves = {float(name.rpartition("_")[2]): value for name, value in parameters.items()}
        stops = [(value, FLANK * width * torque) for width, value in halves.items()]
    elif effect.effect == "hardening" and (match := re.fullmatch(r"knee at ([\d.]+)", shape)):
        stops = [(parameters["extra_windup"], float(match[1]) * torque)]
    elif effect.effect == "hardening" and shape == "several knees":
        stops = [(value, float(name.rpartition("_")[2]) * torque) for name, value in parameters.items()]
    elif effect.effect == "hardening" and shape == "cubic":
        # T/k - s (T/L)^3 turned round, least squares over the torques that it was fitted to
        loads = torque * np.linspace(0.0, 1.0, 201)
        wound = loads / k - parameters["softening_at_largest_torque"] * (loads / torque) ** 3
        first, third = np.linalg.lstsq(np.stack([wound, wound**3], -1), loads, rcond=None)[0]
        _exchange(made, body, spring, [replace(spring, stiffness=float(first), cubic=float(third))])
        return True
    elif effect.effect == "hysteresis" and (match := re.fullmatch(r"friction ([\d.]+)", shape)):
        limit = float(match[1]) * torque
        share = parameters["held_windup"] * k / torque
        if not 0.0 < share < 1.0:
            raise BeamstiffError(f"friction holds {share:.2g} of the drive's wind-up, expected less than all")
        rubbing = replace(spring, name=f"{label}.rubs", stiffness=k / share, friction=limit)
        _exchange(made, body, spring, [replace(spring, stiffness=k / (1.0 - share)), rubbing])
        return True
    if not stops:
        return False
    added = [
        replace(spring, name=f"{label}.stop", stiffness=full / width, deadband=width)
        for width, full in stops
        if width > 0.0
    ]
    _exchange(made, body, spring, [spring, *added])
    return bool(added)


def _spring(made: Assembly, effect: AddedEffect) -> tuple[int, BodyJoint] | None:
    """Return the spring of the drive that an effect is of, and its body."""
    robot = made.machine.robot
    for joint in robot.joints:
        if effect.component is not None and effect.component in (joint.name, joint.variable):
            for number, body in enumerate(made.bodies):
                for one in body.joints:
                    if (
                        one.name in (f"{joint.name}.torsional", f"{joint.name}.axial")
                        and 0 < one.stiffness < math.inf
                    ):
                        return number, one
    return None


def _exchange(made: Assembly, body: int, old: BodyJoint, new: list[BodyJoint]) -> None:
    """Put joints in the place of one."""
    joints = made.bodies[body].joints
    at = joints.index(old)
    named = [
        one if one.name == old.name else replace(one, name=free_name(one.name, made.joint_names))
        for one in new
    ]
    joints[at : at + 1] = named


def _balancer(
    made: Assembly, effect: AddedEffect, body: int, spring: BodyJoint, parameters: dict[str, float]
) -> bool:
    """Add a spring balancer across an axis as a tendon: ``L^2 = a^2 + r^2 + 2 a r cos(q - q_0)``."""
    match = re.fullmatch(r"spring ([\d.]+), free ([\d.]+), ([-\d.]+) deg", effect.shape or "")
    own = made.bodies[body]
    drive = next((joint for joint in own.joints if joint.role == "drive"), None)
    if match is None or drive is None or drive.kind != "hinge":
        return False
    ratio, free, phase = float(match[1]), float(match[2]), math.radians(float(match[3]))
    around = np.linspace(0.0, 2 * np.pi, 721)
    length = np.sqrt(1 + ratio**2 + 2 * ratio * np.cos(around))
    first = -ratio * np.sin(around) / length
    stretch = length - free * (1 - ratio)
    torque = stretch * first  # U' for k_s a^2 = 1
    curve = first**2 + stretch * (-ratio * np.cos(around) - first**2) / length  # U''
    pulls = parameters.get("largest_torque", 0.0) / float(np.abs(torque).max())
    size = parameters.get("largest_stiffness", 0.0) / float(np.abs(curve).max()) + pulls
    curve, torque = size * curve, size * torque
    angles, counts = (np.atleast_1d(effect.scales.get(key, 0.0)) for key in ("angles", "counts"))
    if not counts.any() or size <= 0.0:
        return False
    # the drive's stiffness in the file holds what the balancer adds on average
    usual = float(np.average(np.interp(angles - phase, around, curve, period=2 * np.pi), weights=counts))
    k, q = spring.stiffness - usual, made.machine.value(drive.name)

    def pull(turn: float) -> float:
        return float(np.interp(q + turn - phase, around, torque, period=2 * np.pi))

    # the drive winds up by what the effect says of its torque, in this posture: what remains is taken back
    share = pulls / size
    rest = (pull(-share * pull(0.0) / k) - share * pull(0.0)) / k
    wound = replace(spring, stiffness=k, rest=rest * float(np.sign(drive.axis @ spring.axis)))
    made.bodies[body].joints[own.joints.index(spring)] = wound
    made.varies = True
    made.lost.append(
        f"{effect.label}: torque right at {drive.name} = {q:.4g} rad alone, over all angles it turns "
        f"the drive by {abs(1 - share) * np.ptp(torque) / k:.2g} rad too much"
    )
    axis = drive.axis / np.linalg.norm(drive.axis)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    turned = math.cos(phase) * side + math.sin(phase) * np.cross(axis, side)
    arm, label = BALANCER_ARM, effect.label
    at = own.placed @ np.append(drive.at - arm * turned, 1.0)
    start = made.site(f"{label} base", own.parent, transform(np.eye(3), at[:3]))
    end = made.site(f"{label} link", body, transform(np.eye(3), drive.at + ratio * arm * side))
    made.tendons.append(Tendon(label, (start, end), size / arm**2, free * (1 - ratio) * arm))
    return True
