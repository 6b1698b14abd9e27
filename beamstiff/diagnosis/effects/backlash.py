"""`backlash`: a dead zone in the drive, crossed where the torque changes sign; gravity may hide it.

Of half width h and torque t, crossed within a share w of the largest torque T, it turns the joint by
``h tanh(t / (w T))``, or straight, as a soft stage that is wound up to its stop, by
``h clip(t / (w T), -1, 1)``; a drive that rests off the middle has another h on either side.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, stated_scale
from beamstiff.diagnosis.effects.torque_laws import (
    axis_at,
    by_law,
    drive_compliance,
    drives_and_rigid_ones,
    torque_scale,
    unit_of,
)
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

WIDTHS = (0.005, 0.03, 0.1)  # of the largest torque, over which the flank is reached
BETWEEN = (0.02, 0.05, 0.07, 0.15)  # further widths, of a drive that rests off the middle
STRAIGHT = (0.03, 0.05, 0.07, 0.1, 0.15)  # widths over which a soft stage is wound up to its stop
LEAST, MOST = 3e-5, 1.2e-3  # rad, of a half width
SLIDE = 0.25  # m/rad, of the same where the drive is a slide
FEW_TIMES = 3.0  # range of half widths at least
SOFT = 4.0  # compliance within the play over the drive's, at least: less is a soft wind-up
SIDES = ("up", "down")
RARELY = 0.3  # weight of each further width
WAVES = {"cosine": np.cos, "sine": np.sin}


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    unit, turns = unit_of(axis), 1.0 if axis.turns else SLIDE
    give = drive_compliance(axis) * axis.typical
    half = Quantity("half_width", unit, float(np.sqrt(LEAST * MOST)) * turns, positive=True)

    def sized(width: float) -> tuple[Quantity, float]:
        """Return a half width that is crossed by a share of the largest torque, and its spread."""
        least = max(LEAST * turns, SOFT * width * give)
        most = max(MOST * turns, FEW_TIMES * least)
        return replace(half, size=float(np.sqrt(least * most))), float(np.sqrt(most / least))

    def to_sides(law: Callable[..., Array], width: float) -> list[Array]:
        soft = width * axis.typical
        return [by_law(baseline, axis, partial(law, side=side, soft=soft)) for side in (1.0, -1.0)]

    def off_rest(kind: str, both: list[Array], width: float, weight: float = 1.0) -> Shape:
        # without torque the drive rests off the middle: the way to one flank is longer
        one, spread = sized(width)
        ways = tuple(replace(one, name=f"width_{side}") for side in SIDES)
        name = f"{kind} within {width:g}, asymmetric"
        return Shape(name, np.stack(both, -1), ways, prior_factor=spread, weight=weight)

    sided = {width: to_sides(_one_side, width) for width in WIDTHS}
    flanks = {width: up + down for width, (up, down) in sided.items()}
    result = []
    for width, both in sided.items():
        one, spread = sized(width)
        odd = (flanks[width], (one,))
        result += [
            Shape.of(f"flank within {width:g}", odd, prior_factor=spread, weight=2.0),
            off_rest("flank", both, width),
        ]
    result += [off_rest("flank", to_sides(_one_side, width), width, RARELY) for width in BETWEEN]
    result += [off_rest("straight flank", to_sides(_straight, width), width, RARELY) for width in STRAIGHT]
    way = replace(half, size=0.5 * half.size)
    several = [(flank, (replace(way, name=f"half_width_{width:g}"),)) for width, flank in flanks.items()]
    sides = [
        (flank, (replace(way, name=f"width_{width:g}_{side}"),))
        for width, both in sided.items()
        for side, flank in zip(SIDES, both, strict=True)
    ]
    name = "flanks one after another"
    result += [
        Shape.of(name, *several, prior_factor=6.0, weight=0.5),
        Shape.of(f"{name}, other ones to each side", *sides, prior_factor=6.0, weight=0.5),
    ]
    if axis.turns and axis.joint.variable is not None:  # wheels that are worn or off their centre
        angle, usual = baseline.joint_values[axis.joint.variable], _usual_course(baseline, str(component))
        # about its mean: that is what must not be negative, as the drive moves along its torque
        courses = {name: course(angle) - usual[name] for name, course in WAVES.items()}
        for width, flank in flanks.items():
            one, spread = sized(width)
            wave = replace(one, size=0.3 * one.size, positive=False)
            waves = [
                (flank * course[:, None], (replace(wave, name=f"half_width_{name}"),))
                for name, course in courses.items()
            ]
            result.append(
                Shape.of(
                    f"flank within {width:g}, by the angle",
                    (flank, (one,)),
                    *waves,
                    prior_factor=spread,
                    weight=0.5,
                    against=("torque", *WAVES),
                )
            )
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


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    return torque_scale(baseline, component) | _usual_course(baseline, str(component))


EFFECT = Effect(
    name="backlash",
    family="drive",
    meaning="The drive has a dead zone that is crossed where its torque changes sign.",
    components=drives_and_rigid_ones,
    shapes=_shapes,
    separation="change the load in fine steps until this joint's torque changes sign, in both directions",
    look_alikes=("hardening", "hysteresis"),
    sources="lost motion below 1 arcmin (Harmonic Drive CHA); worn gears a few",
    scales=_normalisation,
)
