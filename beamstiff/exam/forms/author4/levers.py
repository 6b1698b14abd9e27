"""Drives by screws and slides, whose stiffness follows the lever arm, and balancers across an axis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.exam.added_parts import axis_in_the_middle
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, at_joints, drives, in_the_middle, stroke, turning_drives
from beamstiff.exam.forms.author4.by_form import STEP, Form, beside, effect_of
from beamstiff.exam.laws import Forgetful, Memory, Situation, Stiffness
from beamstiff.exam.machine import Machine, joints_of, own_stiffness
from beamstiff.exam.reality import Reality

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


def _screw(request: DrawRequest) -> dict[str, float]:
    return {
        "crank": request.uniform(0.25, 0.6),
        "shaft": request.uniform(0.5, 3.0),
        "angle": request.uniform(1.2, 1.9),
        "swing": request.sized(0.1, 1.0),
    }


def _slotted(request: DrawRequest) -> dict[str, float]:
    return {"angle": request.uniform(-0.35, 0.35), "swing": request.sized(0.12, 1.0)}


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
        lambda k: Stiffness(lambda situation: k * relative(situation.values[variable]) / usual),
    )


@dataclass(frozen=True)
class Balancer(Forgetful):
    """A balancer's torque against the turning of its joint.

    `pull`: its force from the stretch over the crank's length, and the temperature over 20 degC.
    `torque`: where its joint is in the middle and its temperature 20 degC.
    """

    variable: str
    middle: float
    torque: float
    angle: float
    crank: float
    pull: Callable[[Any, Array], Any]
    changes: bool

    def torque_at(self, q: Any, warmth: Array) -> Any:
        """Return the torque at joint angles (P,)."""
        b = self.crank
        angle = self.angle + q - self.middle

        def long(at: Any) -> Any:
            return np.sqrt(1.0 + b**2 - 2.0 * b * np.cos(at))

        usual = np.sin(self.angle) / long(self.angle)
        stretch = (long(angle) - long(self.angle)) / b
        return self.torque * self.pull(stretch, warmth) * np.sin(angle) / long(angle) / usual

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return torque, slope and no memory."""
        warmth = (situation.temperature + DEGC) / ROOM
        found = self.torque_at(situation.values[self.variable] + strain + 1j * STEP, warmth)
        return found.real, found.imag / STEP, memory


def _gas(request: DrawRequest) -> dict[str, float]:
    return {
        "torque": request.sized(0.1, 2.5),
        "crank": request.uniform(0.2, 0.45),
        "angle": request.sign() * request.uniform(0.9, 2.2),
        "filled": request.uniform(0.1, 0.35),
        "power": request.uniform(1.0, 1.35),
    }


def _coils(request: DrawRequest) -> dict[str, float]:
    return {
        "torque": request.sized(0.1, 2.5),
        "crank": request.uniform(0.2, 0.45),
        "angle": request.sign() * request.uniform(0.9, 2.2),
        "rate": request.uniform(0.15, 0.45),
        "second_rate": request.uniform(0.5, 1.5),
        "second_from": request.uniform(-0.3, 0.3),
    }


def _heavy_side(machine: Machine, joint: str) -> float:
    """Return the sense in which what hangs on a joint would turn it, in the middle of its range."""
    axis, point = axis_in_the_middle(machine, joint)
    tool = in_the_middle(machine.robot).node(machine.node(machine.tcp))[0]
    return 1.0 if axis @ np.cross(tool - point, [0.0, 0.0, -1.0]) >= 0.0 else -1.0


def _balance(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)
    machine = reality.machine
    robot = machine.robot

    def pull(stretch: Any, warmth: Array) -> Any:
        if truth.form == "gas-and-heat":
            return warmth * (1.0 - p["filled"] * stretch) ** -p["power"]
        second = np.log1p(np.exp((stretch - p["second_from"]) / ROUND)) * ROUND
        return 1.0 + p["rate"] * stretch + p["second_rate"] * second

    for name, own in joints_of(robot, variable):
        torque = _heavy_side(machine, name) * p["torque"] * TORQUE * own_stiffness(robot, name, own)
        law = Balancer(
            variable,
            stroke(robot, variable)[0],
            torque,
            p["angle"],
            p["crank"],
            pull,
            truth.form == "gas-and-heat",
        )
        machine = beside(machine, name, own, law)
    return reality.with_machine(machine)


EFFECTS = (
    effect_of(
        "actuator-lever",
        drives,
        {"long-screw": Form(_screw, _lever), "slotted-lever": Form(_slotted, _lever)},
    ),
    effect_of(
        "gravity-compensator",
        turning_drives,
        {"gas-and-heat": Form(_gas, _balance), "nested-coils": Form(_coils, _balance)},
    ),
)
