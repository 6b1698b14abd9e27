"""`backlash`: a dead zone in the drive, crossed where the torque changes sign; gravity may hide it."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, by_law, drives, torque_scale, unit_of

WIDTHS = (0.005, 0.03, 0.1)  # of the largest torque, over which the flank is reached


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    largest = axis.typical
    unit = unit_of(axis)
    half = Quantity("half_width", unit, 2e-4 if axis.turns else 5e-5)
    return [
        Shape(
            f"flank within {width:g}",
            by_law(baseline, axis, lambda torque, soft=width * largest: np.tanh(torque / soft))[..., None],  # type: ignore[misc]
            (half,),
            spread=6.0,
        )
        for width in WIDTHS
    ]


EFFECT = Effect(
    name="backlash",
    family="drive",
    meaning="The drive has a dead zone that is crossed where its torque changes sign.",
    components=drives,
    shapes=_shapes,
    separation="fine load steps through zero torque of this joint, in both directions",
    look_alikes=("hardening", "hysteresis"),
    sources="lost motion below 1 arcmin (Harmonic Drive CHA); worn gears a few",
    scales=torque_scale,
)
