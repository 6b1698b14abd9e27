"""`hardening`: the drive's stiffness grows with its torque, as in harmonic drives and preloaded gears."""

from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term
from beamstiff.diagnosis.effects.torque_laws import (
    axis_at,
    by_law,
    by_power,
    drive_compliance,
    drives_and_rigid_ones,
    torque_scale,
    unit_of,
)
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

KNEES = (0.05, 0.1, 0.25, 0.5)  # of the largest torque: where the soft wind-up ends
FADES = (0.03, 0.05, 0.08, 0.12, 0.2)  # of the largest torque: over which a smooth one fades
SOFTER = 0.8  # compliance that ends there, over the drive's: K3 / K1 - 1


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    largest, unit = axis.typical, unit_of(axis)
    give = drive_compliance(axis) * largest
    scale = Quantity("softening_at_largest_torque", unit, 0.3 * give, positive=True)

    def cubic(torque: Array) -> Array:
        return -by_power(torque / largest, 3.0)

    def square(torque: Array) -> Array:
        return -by_power(torque / largest, 2.0)

    def knee(torque: Array, at: float) -> Array:
        return np.clip(torque / (at * largest), -1.0, 1.0)

    def fading(torque: Array, at: float) -> Array:
        return np.asarray(np.sign(torque) * -np.expm1(-np.abs(torque) / (at * largest)))

    def to_side(torque: Array, at: float, side: float) -> Array:
        return knee(side * np.maximum(side * torque, 0.0), at)

    def wound(law: Callable[[Array], Array], at: float, name: str = "extra_windup") -> Term:
        # what winds up until a knee goes by its torque: beyond a few times the drive's compliance it is play
        return by_law(baseline, axis, law), (Quantity(name, unit, SOFTER * at * give, positive=True),)

    knees = {at: partial(knee, at=at) for at in KNEES}
    several = [wound(law, at, f"extra_windup_{at:g}") for at, law in knees.items()]
    sided = [
        wound(partial(to_side, at=at, side=side), at, f"extra_windup_{at:g}_{name}")
        for at in KNEES
        for name, side in (("up", 1.0), ("down", -1.0))
    ]
    fades = {at: partial(fading, at=at) for at in FADES}
    return [
        Shape.of("cubic", (by_law(baseline, axis, cubic), (scale,)), prior_factor=5.0),
        Shape.of("square", (by_law(baseline, axis, square), (scale,)), prior_factor=5.0),
        *(Shape.of(f"knee at {at:g}", wound(law, at), prior_factor=4.0) for at, law in knees.items()),
        *(Shape.of(f"smooth, over {at:g}", wound(law, at), prior_factor=4.0) for at, law in fades.items()),
        Shape.of("several knees", *several, prior_factor=4.0),
        Shape.of("several knees, other ones to each side", *sided, prior_factor=4.0, weight=0.5),
    ]


EFFECT = Effect(
    name="hardening",
    family="drive",
    meaning="The drive is soft at small torque and stiffens as it grows.",
    components=drives_and_rigid_ones,
    shapes=_shapes,
    separation="apply three loads or more, in postures where this joint's torque has either sign",
    look_alikes=("backlash",),
    sources="K1:K3 = 0.53 to 0.6, T1:T2 = 0.28 (Harmonic Drive CHA)",
    scales=torque_scale,
)
