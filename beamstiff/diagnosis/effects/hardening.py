"""`hardening`: the drive's stiffness grows with its torque, as in harmonic drives and preloaded gears."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import (
    axis_at,
    by_law,
    drive_compliance,
    drives,
    torque_scale,
    unit_of,
)
from beamstiff.diagnosis.residual.baseline import Baseline

KNEES = (0.05, 0.1, 0.25, 0.5)  # of the largest torque: where the soft wind-up ends
FADES = (0.03, 0.05, 0.08, 0.12, 0.2)  # of the largest torque: over which a smooth one fades
SOFTER = 0.8  # compliance that ends there, over the drive's: K3 / K1 - 1


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    largest, unit = axis.typical, unit_of(axis)
    give = drive_compliance(axis) * largest
    scale = Quantity("softening_at_largest_torque", unit, 0.3 * give, positive=True)

    def soft(name: str, at: float) -> Quantity:
        # what winds up until a knee goes by its torque: beyond a few times the drive's compliance it is play
        return Quantity(name, unit, SOFTER * at * give, positive=True)

    def cubic(torque: np.ndarray) -> np.ndarray:
        return np.asarray(-((torque / largest) ** 3))

    def square(torque: np.ndarray) -> np.ndarray:
        return np.asarray(-(torque / largest) * np.abs(torque / largest))

    def knee(torque: np.ndarray, at: float) -> np.ndarray:
        return np.clip(torque / (at * largest), -1.0, 1.0)

    result = [
        Shape("cubic", by_law(baseline, axis, cubic)[..., None], (scale,), prior_factor=5.0),
        Shape("square", by_law(baseline, axis, square)[..., None], (scale,), prior_factor=5.0),
    ]
    windups = [by_law(baseline, axis, lambda torque, at=at: knee(torque, at)) for at in KNEES]  # type: ignore[misc]
    result += [
        Shape(f"knee at {at:g}", column[..., None], (soft("extra_windup", at),), prior_factor=4.0)
        for at, column in zip(KNEES, windups, strict=True)
    ]

    def fading(torque: np.ndarray, at: float) -> np.ndarray:
        return np.asarray(np.sign(torque) * -np.expm1(-np.abs(torque) / (at * largest)))

    result += [
        Shape(
            f"smooth, over {at:g}",
            by_law(baseline, axis, lambda torque, at=at: fading(torque, at))[..., None],  # type: ignore[misc]
            (soft("extra_windup", at),),
            prior_factor=4.0,
        )
        for at in FADES
    ]

    def to_side(torque: np.ndarray, at: float, side: float) -> np.ndarray:
        return knee(side * np.maximum(side * torque, 0.0), at)

    sided = [
        by_law(baseline, axis, lambda torque, at=at, side=side: to_side(torque, at, side))  # type: ignore[misc]
        for at in KNEES
        for side in (1.0, -1.0)
    ]
    sides = tuple(soft(f"extra_windup_{at:g}_{side}", at) for at in KNEES for side in ("up", "down"))
    several = tuple(soft(f"extra_windup_{at:g}", at) for at in KNEES)
    result.append(Shape("several knees", np.stack(windups, -1), several, prior_factor=4.0))
    result.append(
        Shape(
            "several knees, other ones to each side", np.stack(sided, -1), sides, prior_factor=4.0, weight=0.5
        )
    )
    return result


EFFECT = Effect(
    name="hardening",
    family="drive",
    meaning="The drive is soft at small torque and stiffens as it grows.",
    components=drives,
    shapes=_shapes,
    separation="apply four load levels in both directions of this joint's torque",
    look_alikes=("backlash",),
    sources="K1:K3 = 0.53 to 0.6, T1:T2 = 0.28 (Harmonic Drive CHA)",
    scales=torque_scale,
)
