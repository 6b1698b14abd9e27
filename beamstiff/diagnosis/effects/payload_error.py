"""`payload-error`: mass or centre of gravity of the tool or payload is wrong; seen in absolute positions."""

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, named
from beamstiff.diagnosis.effects.external import each_by_each, shift_alone, tool_axes, turn_alone
from beamstiff.diagnosis.residual.baseline import Baseline, nominal_pose, tcp_response
from beamstiff.robot.description import Robot
from beamstiff.robot.graph import joined
from beamstiff.se3 import Array

MASS = 10.0  # kg
MASS_MOMENT = 2.0  # kg m
PULL = 50.0  # N
STRETCH = 50.0  # N/m


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axes = tool_axes(baseline)
    base = np.broadcast_to(np.eye(3), axes.shape)
    gravity = np.array(baseline.nominal.gravity)
    down = gravity / (np.linalg.norm(gravity) or 1.0)

    def off(shifts: Array) -> Array:
        """Return the wrench of the weight of 1 kg (N, 6, c) where its centre shifts (N, 3, c)."""
        return turn_alone(np.cross(shifts, gravity[None, :, None], axis=1))

    weight = shift_alone(np.broadcast_to(gravity[:, None], (len(axes), 3, 1)))
    tcp = np.full(len(baseline.rows), baseline.nominal.tcp)
    held = replace(baseline.rows, point=tcp)  # whatever point is read
    place = nominal_pose(baseline.nominal, held)[0]
    further = off(axes)
    mass = (weight, (Quantity("mass", "kg", MASS, least=-_carried(baseline.nominal)),))
    centre = (further, named("mass_times", "kg*m", MASS_MOMENT))
    shifts = tuple(Quantity(f"mass_times_{a}_by_{b}", "kg*m", MASS_MOMENT) for a in "xyz" for b in "xyz")
    swung = (off(each_by_each(axes, np.broadcast_to(down, (len(axes), 3)))), shifts)
    pull = (shift_alone(base), named("pull", "N", PULL))
    pull_tool = (shift_alone(axes), named("pull_tool", "N", PULL))
    springs = tuple(Quantity(f"pull_{a}_by_{b}", "N/m", STRETCH) for a in "xyz" for b in "xyz")
    drawn = (shift_alone(each_by_each(base, place)), springs)
    drawing = "something that pulls the more the further it is drawn"
    wrenches = [
        Shape("mass", mass[0] + further @ _centre(baseline.nominal)[:, None], mass[1]),
        Shape.of("centre of gravity", centre),
        Shape.of("mass and centre of gravity", mass, centre),
        Shape.of("something loose", mass, centre, swung, weight=0.5),
        Shape.of("something that pulls, as hoses do", centre, pull, pull_tool, weight=0.5),
        Shape.of(drawing, centre, pull, drawn, weight=0.5),  # more mass is a pull along gravity
    ]
    response = tcp_response(baseline)
    return [shape.displacing(response) for shape in wrenches]


def _carried(robot: Robot) -> float:
    """Return the mass that hangs on the TCP, no joint between, kg."""
    held = joined(robot, robot.tcp)
    return sum(mass.mass for mass in robot.masses if mass.node in held)


def _centre(robot: Robot) -> Array:
    """Return where the payload that is described has its centre, in the frame of the TCP, m, (3,)."""
    carried = [mass for mass in robot.masses if mass.node == robot.tcp]
    kilograms = sum(mass.mass for mass in carried)
    if not kilograms:
        return np.zeros(3)
    return sum((mass.mass * np.array(mass.at) for mass in carried), np.zeros(3)) / kilograms


EFFECT = Effect(
    name="payload-error",
    family="load",
    meaning="Mass or centre of gravity of the tool or payload is wrong, or a hose pulls at it.",
    components=lambda baseline: [None] if baseline.absolute and any(baseline.nominal.gravity) else [],
    shapes=_shapes,
    separation="weigh the tool, or measure the same postures without it; check the masses of the links too",
    look_alikes=("joint-compliance", "load-error"),
    sources="up to 20 % of the payload, engineering estimate",
    place="payload",
)
