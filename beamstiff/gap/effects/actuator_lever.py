"""`actuator-lever`: stiffness about the axis follows a lever arm, and so the joint's angle.

A linear drive (ball screw, cylinder, tie rod) between points at distances a and b from the axis acts at the
lever ``h = a b sin(phi) / L``, ``L^2 = a^2 + b^2 - 2 a b cos(phi)``; its stiffness k_s gives
``k = k_s h^2`` about the axis, so the compliance follows 1/h^2 (seed 003, eqs 45 to 47).
"""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.drive_stiffness import PHASES, Following, scaled_torque
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, drive_compliance, drives, unit_of

RATIOS = (0.2, 0.5, 0.8)  # of the two arms
NEAR_DEAD = 0.35  # of its largest lever, below which nobody lets a screw work


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    if axis.joint.variable is None or not axis.turns:
        return []
    follow = Following(baseline, axis.joint.variable)
    compliance = drive_compliance(axis)
    unit = f"{unit_of(axis)}/(N*m)"
    columns = [
        scaled_torque(baseline, axis, follow.varying(wave))
        for wave in (np.cos, np.sin, lambda q: np.cos(2 * q), lambda q: np.sin(2 * q))
    ]
    names = ("cos_q", "sin_q", "cos_2q", "sin_2q")
    sizes = (0.3, 0.3, 0.15, 0.15)
    quantities = tuple(
        Quantity(f"compliance_{name}", unit, size * compliance)
        for name, size in zip(names, sizes, strict=True)
    )
    result = [
        Shape("first harmonic", np.stack(columns[:2], -1), quantities[:2], spread=5.0),
        Shape("two harmonics", np.stack(columns, -1), quantities, spread=5.0),
    ]
    cranks = []
    for ratio in RATIOS:
        for phase in PHASES:
            lever = _lever(follow.fitted + phase, ratio)
            if lever.min() > NEAR_DEAD * _lever(np.linspace(0, np.pi, 181), ratio).max():
                square = float((lever**2).mean())

                def factor(q: np.ndarray, ratio=ratio, phase=phase, square=square) -> np.ndarray:  # type: ignore[no-untyped-def]
                    return square / _lever(q + phase, ratio) ** 2

                column = scaled_torque(baseline, axis, follow.varying(factor))
                cranks.append((f"crank {ratio:g}, {np.degrees(phase):.0f} deg", column))
    gain = Quantity("mean_compliance", unit, compliance)
    return result + [
        Shape(name, column[..., None], (gain,), spread=3.0, weight=2.0 / len(cranks))
        for name, column in cranks
    ]


def _lever(angle: np.ndarray, ratio: float) -> np.ndarray:
    return np.asarray(ratio * np.abs(np.sin(angle)) / np.sqrt(1 + ratio**2 - 2 * ratio * np.cos(angle)))


EFFECT = Effect(
    name="actuator-lever",
    family="drive",
    meaning="The drive's stiffness about the axis follows its lever arm (ball screw, tie rod).",
    components=drives,
    shapes=_shapes,
    separation="the same torque at four angles of this joint; the drive's geometry from its drawing",
    look_alikes=("gravity-compensator", "tool-compliance"),
    sources="stiffness x1.2 to 3 over the stroke, engineering estimate",
)
