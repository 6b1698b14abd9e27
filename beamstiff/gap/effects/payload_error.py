"""`payload-error`: mass or centre of gravity of the tool or payload is wrong; seen in absolute positions."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.outside import tool_axes

MASS = 10.0  # kg
LEVER = 2.0  # kg m


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:  # noqa: ARG001
    axes = tool_axes(baseline)
    gravity = np.array(baseline.nominal.gravity)
    weight = np.zeros((len(baseline.rows), 6, 1))
    weight[:, :3, 0] = gravity
    lever = np.concatenate([np.zeros_like(axes), np.cross(axes, gravity[None, :, None], axis=1)], 1)
    heavier = baseline.response @ weight
    further = baseline.response @ lever
    mass = Quantity("mass", "kg", MASS)
    levers = tuple(Quantity(f"mass_times_{axis}", "kg*m", LEVER) for axis in "xyz")
    return [
        Shape("mass", heavier, (mass,)),
        Shape("centre of gravity", further, levers),
        Shape("mass and centre of gravity", np.concatenate([heavier, further], -1), (mass, *levers)),
    ]


EFFECT = Effect(
    name="payload-error",
    family="load",
    meaning="Mass or centre of gravity of the tool or payload is wrong.",
    components=lambda baseline: [None] if baseline.absolute and any(baseline.nominal.gravity) else [],
    shapes=_shapes,
    separation="weigh the tool; absolute positions with and without it",
    look_alikes=("joint-compliance", "load-error"),
    sources="up to 20 % of the payload, engineering estimate",
    place="payload",
)
