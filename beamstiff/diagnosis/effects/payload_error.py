"""`payload-error`: mass or centre of gravity of the tool or payload is wrong; seen in absolute positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.external import each_by_each, tool_axes
from beamstiff.diagnosis.residual.baseline import Baseline, nominal_pose, tcp_response
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

MASS = 10.0  # kg
MASS_MOMENT = 2.0  # kg m
PULL = 50.0  # N
STRETCH = 50.0  # N/m


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axes, response = tool_axes(baseline), tcp_response(baseline)
    gravity = np.array(baseline.nominal.gravity)
    weight = np.zeros((len(baseline.rows), 6, 1))
    weight[:, :3, 0] = gravity
    lever = np.concatenate([np.zeros_like(axes), np.cross(axes, gravity[None, :, None], axis=1)], 1)
    heavier = response @ weight
    further = response @ lever
    down = gravity / (np.linalg.norm(gravity) or 1.0)
    shifted = each_by_each(axes, np.broadcast_to(down, (len(axes), 3)))
    swung = np.concatenate([np.zeros_like(shifted), np.cross(shifted, gravity[None, :, None], axis=1)], 1)
    base = np.broadcast_to(np.eye(3), axes.shape)
    pulled = [response @ np.concatenate([frame, np.zeros_like(frame)], 1) for frame in (base, axes)]
    tcp = np.full(len(baseline.rows), baseline.nominal.tcp)
    held = replace(baseline.rows, point=tcp)  # whatever point is read
    place = nominal_pose(baseline.nominal, held)[0]
    drawn = each_by_each(base, place)
    drawn = response @ np.concatenate([drawn, np.zeros_like(drawn)], 1)
    springs = tuple(Quantity(f"pull_{a}_by_{b}", "N/m", STRETCH) for a in "xyz" for b in "xyz")
    shifts = tuple(Quantity(f"mass_times_{a}_by_{b}", "kg*m", MASS_MOMENT) for a in "xyz" for b in "xyz")
    pulls = tuple(Quantity(f"pull_{where}{axis}", "N", PULL) for where in ("", "tool_") for axis in "xyz")
    mass = Quantity("mass", "kg", MASS)
    levers = tuple(Quantity(f"mass_times_{axis}", "kg*m", MASS_MOMENT) for axis in "xyz")
    return [
        Shape("mass", heavier + further @ _centre(baseline.nominal)[:, None], (mass,)),
        Shape("centre of gravity", further, levers),
        Shape("mass and centre of gravity", np.concatenate([heavier, further], -1), (mass, *levers)),
        Shape(
            "something loose",
            np.concatenate([heavier, further, response @ swung], -1),
            (mass, *levers, *shifts),
            weight=0.5,
        ),
        Shape(
            "something that pulls, as hoses do",
            np.concatenate([further, *pulled], -1),
            (*levers, *pulls),
            weight=0.5,
        ),
        Shape(
            "something that pulls the more the further it is drawn",
            np.concatenate([heavier, further, pulled[0], drawn], -1),
            (mass, *levers, *pulls[:3], *springs),
            weight=0.5,
        ),
    ]


def _centre(robot: Robot) -> Array:
    """Return where the payload that is described has its centre, in the frame of the TCP, m, (3,)."""
    carried = [mass for mass in robot.masses if mass.node == robot.tcp]
    kilograms = sum(mass.mass for mass in carried)
    if not kilograms:
        return np.zeros(3)
    result: Array = sum((mass.mass * np.array(mass.at) for mass in carried), np.zeros(3)) / kilograms
    return result


EFFECT = Effect(
    name="payload-error",
    family="load",
    meaning="Mass or centre of gravity of the tool or payload is wrong.",
    components=lambda baseline: [None] if baseline.absolute and any(baseline.nominal.gravity) else [],
    shapes=_shapes,
    separation="weigh the tool; measure absolute positions with and without it",
    look_alikes=("joint-compliance", "load-error"),
    sources="up to 20 % of the payload, engineering estimate",
    place="payload",
)
