"""Drives by screws and slides, whose stiffness follows the lever arm, and balancers across an axis."""

from typing import Any

import numpy as np

from beamstiff.exam.added_parts import axis_in_the_middle
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import in_the_middle, stroke
from beamstiff.exam.draws import evenly, signed, sized
from beamstiff.exam.effect import at_joints, form
from beamstiff.exam.forms.author4.scales import beside
from beamstiff.exam.laws import Curved, Situation, posed, varying
from beamstiff.exam.machine import Machine, joints_of, own_stiffness
from beamstiff.exam.parameters import Draw
from beamstiff.exam.reality import Reality

STEP = 1e-30  # of complex steps
ROOM = 293.15  # K
DEGC = 273.15
ROUND = 0.05  # of a balancer's crank: where its second coil comes in
TORQUE = 6e-4  # rad: what the drive would give under the usual balancer
SWING = 0.85  # rad: of a slotted lever to either side


def screw(angle: Array, crank: float, shaft: float) -> Array:
    """Return the stiffness of a screw's drive about its joint, up to a factor; the frame's arm is 1 long.

    Nut and bearings are in series with the free length of the shaft, of which it has more where the screw is
    longer: `shaft`, its compliance over theirs at length 1.
    """
    long = np.sqrt(1.0 + crank**2 - 2.0 * crank * np.cos(angle))
    arm = crank * np.sin(angle) / long
    return np.asarray(arm**2 / (1.0 + shaft * long))


def slotted(angle: Array) -> Array:
    """Return the stiffness of a pin on a slide in a lever's slot, about the lever's joint, up to a factor.

    The pin goes straight past the joint: by ``tan(angle)``, so that the way per angle grows to either side.
    """
    return np.asarray(np.cos(angle) ** -4)


def _lever(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)
    middle, half = stroke(reality.machine.robot, variable)

    def relative(q: Array) -> Array:
        way = np.clip((q - middle) / half, -1.05, 1.05)
        if truth.form == "slotted-lever":
            most = min(SWING - abs(p["angle"]), half)
            return slotted(p["angle"] + p["swing"] * most * way)
        most = min(p["angle"] - 0.45, 2.7 - p["angle"], half)
        return screw(p["angle"] + p["swing"] * most * way, p["crank"], p["shaft"])

    usual = float(relative(np.array([middle]))[0])
    return at_joints(
        truth,
        reality,
        lambda k: varying(lambda situation: k * relative(situation.values[variable]) / usual),
    )


def _heavy_side(machine: Machine, joint: str) -> float:
    """Return the sense in which what hangs on a joint would turn it, in the middle of its range."""
    axis, point = axis_in_the_middle(machine, joint)
    tool = in_the_middle(machine.robot).node(machine.node(machine.tcp))[0]
    return 1.0 if axis @ np.cross(tool - point, [0.0, 0.0, -1.0]) >= 0.0 else -1.0


def _balance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a balancer's torque against the turning of its joint.

    It is `torque` where the joint is in the middle and the temperature 20 degC; the pull follows the stretch
    over the crank's length.
    """
    p, variable, machine = truth.parameters, str(truth.component), reality.machine
    robot, heats = machine.robot, truth.form == "gas-and-heat"
    middle = stroke(robot, variable)[0]

    def pull(stretch: Any, warmth: Array) -> Any:
        if heats:
            return warmth * (1.0 - p["filled"] * stretch) ** -p["power"]
        second = np.log1p(np.exp((stretch - p["second_from"]) / ROUND)) * ROUND
        return 1.0 + p["rate"] * stretch + p["second_rate"] * second

    def long(at: Any) -> Any:
        return np.sqrt(1.0 + p["crank"] ** 2 - 2.0 * p["crank"] * np.cos(at))

    usual = np.sin(p["angle"]) / long(p["angle"])

    def curve(strain: Array, situation: Situation, torque: float) -> Curved:
        warmth = (situation.temperature + DEGC) / ROOM
        angle = p["angle"] + (situation.values[variable] + strain + 1j * STEP) - middle
        stretch = (long(angle) - long(p["angle"])) / p["crank"]
        found = torque * pull(stretch, warmth) * np.sin(angle) / long(angle) / usual
        return found.real, found.imag / STEP

    for name, own in joints_of(robot, variable):
        torque = _heavy_side(machine, name) * p["torque"] * TORQUE * own_stiffness(robot, name, own)
        law = posed(lambda e, situation, torque=torque: curve(e, situation, torque), heats)  # type: ignore[misc]
        machine = beside(machine, name, own, law)
    return reality.with_machine(machine)


_CRANK: dict[str, Draw] = {
    "torque": sized(0.1, 2.5), "crank": evenly(0.2, 0.45), "angle": signed(evenly(0.9, 2.2))
}  # fmt: skip
FORMS = (
    form("actuator-lever", "long-screw", _lever,
         crank=evenly(0.25, 0.6), shaft=evenly(0.5, 3.0), angle=evenly(1.2, 1.9), swing=sized(0.1, 1.0)),
    form("actuator-lever", "slotted-lever", _lever, angle=evenly(-0.35, 0.35), swing=sized(0.12, 1.0)),
    form("gravity-compensator", "gas-and-heat", _balance, **_CRANK,
         filled=evenly(0.1, 0.35), power=evenly(1.0, 1.35)),
    form("gravity-compensator", "nested-coils", _balance, **_CRANK,
         rate=evenly(0.15, 0.45), second_rate=evenly(0.5, 1.5), second_from=evenly(-0.3, 0.3)),
)  # fmt: skip
