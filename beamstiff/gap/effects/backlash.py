"""`backlash`: a dead zone in the drive, crossed where the torque changes sign; gravity may hide it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Scales, Shape, stated_scale
from beamstiff.gap.effects.laws import axis_at, by_law, drives, torque_scale, unit_of
from beamstiff.se3 import Array

WIDTHS = (0.005, 0.03, 0.1)  # of the largest torque, over which the flank is reached
BETWEEN = (0.02, 0.05, 0.07, 0.15)  # further widths, of a drive that rests off the middle
STRAIGHT = (0.03, 0.05, 0.07, 0.1, 0.15)  # widths over which a soft stage is wound up to its stop
SIDES = ("up", "down")
RARELY = 0.3  # weight of each further width
WAVES = {"cosine": np.cos, "sine": np.sin}


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    unit = unit_of(axis)
    half = Quantity("half_width", unit, 2e-4 if axis.turns else 5e-5, positive=True)
    way = replace(half, size=0.5 * half.size)

    def to_sides(law: Callable[..., Array], width: float) -> list[Array]:
        soft = width * axis.typical
        return [by_law(baseline, axis, partial(law, side=side, soft=soft)) for side in (1.0, -1.0)]

    def off_rest(name: str, both: Sequence[Array], weight: float = 1.0) -> Shape:
        # without torque the drive rests off the middle: the way to one flank is longer
        ways = tuple(replace(half, name=f"width_{side}") for side in SIDES)
        return Shape(f"{name}, off rest", np.stack(both, -1), ways, spread=6.0, weight=weight)

    sided = [to_sides(_one_side, width) for width in WIDTHS]
    flanks = [up + down for up, down in sided]
    result = []
    for width, odd, both in zip(WIDTHS, flanks, sided, strict=True):
        name = f"flank within {width:g}"
        result += [Shape(name, odd[..., None], (half,), spread=6.0, weight=2.0), off_rest(name, both)]
    result += [off_rest(f"flank within {at:g}", to_sides(_one_side, at), RARELY) for at in BETWEEN]
    result += [off_rest(f"straight flank within {at:g}", to_sides(_straight, at), RARELY) for at in STRAIGHT]
    halves = tuple(replace(way, name=f"half_width_{width:g}") for width in WIDTHS)
    result.append(Shape("flanks one after another", np.stack(flanks, -1), halves, spread=6.0))
    sides = tuple(replace(way, name=f"width_{width:g}_{side}") for width in WIDTHS for side in SIDES)
    result.append(
        Shape(
            "flanks one after another, other ones to each side",
            np.stack([one for both in sided for one in both], -1),
            sides,
            spread=6.0,
            weight=0.5,
        )
    )
    if axis.turns and axis.joint.variable is not None:  # wheels that are worn or off their centre
        angle, usual = baseline.joint_values[axis.joint.variable], _usual_course(baseline, str(component))
        # about its mean: that is what must not be negative, as the drive gives way along its torque
        courses = [np.ones_like(angle), *(course(angle) - usual[name] for name, course in WAVES.items())]
        wave = replace(half, size=0.3 * half.size, positive=False)
        turning = (half, *(replace(wave, name=f"half_width_{name}") for name in WAVES))
        result += [
            Shape(
                f"flank within {width:g}, by the angle",
                np.stack([odd * course[:, None] for course in courses], -1),
                turning,
                spread=6.0,
                weight=0.5,
                against=("torque", *WAVES),
            )
            for width, odd in zip(WIDTHS, flanks, strict=True)
        ]
    return [replace(one, against=one.against or ("torque",)) for one in result]


def _one_side(torque: Array, side: float, soft: float) -> Array:
    """Return the way to the flank on one side, none on the other."""
    return side * np.tanh(np.maximum(side * torque / soft, 0.0))


def _straight(torque: Array, side: float, soft: float) -> Array:
    """Return the way to the flank on one side, by a spring that is wound up to its stop."""
    return side * np.clip(side * torque / soft, 0.0, 1.0)


def _usual_course(baseline: Baseline, component: str) -> dict[str, float]:
    """Return the mean cosine and sine of the joint's angle in the rows that were fitted, if it turns."""
    axis = axis_at(baseline, component)
    if not axis.turns or axis.joint.variable is None:
        return {}
    angle, result = baseline.fit.joint_values[axis.joint.variable], {}
    for name, course in WAVES.items():
        stated = stated_scale(baseline, name)
        result[name] = float(course(angle).mean()) if stated is None else stated
    return result


def _scales(baseline: Baseline, component: str | None) -> Scales:
    return torque_scale(baseline, component) | _usual_course(baseline, str(component))


EFFECT = Effect(
    name="backlash",
    family="drive",
    meaning="The drive has a dead zone that is crossed where its torque changes sign.",
    components=drives,
    shapes=_shapes,
    separation="fine load steps through zero torque of this joint, in both directions",
    look_alikes=("hardening", "hysteresis"),
    sources="lost motion below 1 arcmin (Harmonic Drive CHA); worn gears a few",
    scales=_scales,
)
