"""`backlash`: a dead zone in the drive, crossed where the torque changes sign; gravity may hide it."""

from __future__ import annotations

from functools import partial

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, by_law, drives, torque_scale, unit_of
from beamstiff.se3 import Array

WIDTHS = (0.005, 0.03, 0.1)  # of the largest torque, over which the flank is reached


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    largest = axis.typical
    unit = unit_of(axis)
    half = Quantity("half_width", unit, 2e-4 if axis.turns else 5e-5, positive=True)
    rest = Quantity("rest", unit, 0.5 * half.size)
    result, flanks = [], []
    for width in WIDTHS:

        def flank(torque: np.ndarray, soft: float = width * largest) -> np.ndarray:
            return np.tanh(torque / soft)

        odd = by_law(baseline, axis, flank)
        flanks.append(odd)
        # without torque the drive rests off the middle: the way to one flank is longer
        even = by_law(baseline, axis, lambda torque, flank=flank: -np.abs(flank(torque)))  # type: ignore[misc]
        result += [
            Shape(f"flank within {width:g}", odd[..., None], (half,), spread=6.0, weight=2.0),
            Shape(f"flank within {width:g}, off rest", np.stack([odd, even], -1), (half, rest), spread=6.0),
        ]
    halves = tuple(
        Quantity(f"half_width_{width:g}", unit, 0.5 * half.size, positive=True) for width in WIDTHS
    )
    result.append(Shape("flanks one after another", np.stack(flanks, -1), halves, spread=6.0))
    sided = [
        by_law(baseline, axis, partial(_one_side, side=side, soft=width * largest))
        for width in WIDTHS
        for side in (1.0, -1.0)
    ]
    sides = tuple(
        Quantity(f"width_{width:g}_{side}", unit, 0.5 * half.size, positive=True)
        for width in WIDTHS
        for side in ("up", "down")
    )
    result.append(
        Shape(
            "flanks one after another, other ones to each side",
            np.stack(sided, -1),
            sides,
            spread=6.0,
            weight=0.5,
        )
    )
    if axis.turns and axis.joint.variable is not None:  # wheels that are worn or off their centre
        angle = baseline.joint_values[axis.joint.variable]
        turning = [
            half,
            *(Quantity(f"half_width_{wave}", unit, 0.3 * half.size) for wave in ("cosine", "sine")),
        ]
        courses = (np.ones_like(angle), np.cos(angle), np.sin(angle))
        result += [
            Shape(
                f"flank within {width:g}, by the angle",
                np.stack([odd * course[:, None] for course in courses], -1),
                tuple(turning),
                spread=6.0,
                weight=0.5,
            )
            for width, odd in zip(WIDTHS, flanks, strict=True)
        ]
    return result


def _one_side(torque: Array, side: float, soft: float) -> Array:
    """Return the way to the flank on one side, none on the other."""
    return side * np.tanh(np.maximum(side * torque / soft, 0.0))


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
