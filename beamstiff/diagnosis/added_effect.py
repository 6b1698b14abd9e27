"""A fitted effect as an entry of a robot's file."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects import EFFECTS, Normalisation, Shape
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array


def added_effect(
    baseline: Baseline,
    effect: str,
    component: str | None,
    shape: Shape,
    values: Array,
    *,
    bounded: bool = True,
    closes: float | None = None,
) -> AddedEffect:
    """Return the entry of a shape with its parameters (c,), SI, and the scales that it counts against.

    `bounded` puts 0 where noise made negative what cannot be; of several shapes only the sum is meant.
    """
    if bounded:
        cannot = np.array([item.positive for item in shape.parameters])
        values = np.where(cannot, np.maximum(values, 0.0), values)
    return AddedEffect(
        effect=effect,
        component=component,
        shape=shape.name,
        parameters={
            item.name: _written(value, item.unit)
            for item, value in zip(shape.parameters, values.tolist(), strict=True)
            if not item.posture_specific
        },
        scales=needed_scales(shape, EFFECTS[effect].scales(baseline, component)),
        closes=closes,
    )


def needed_scales(shape: Shape, scales: Normalisation) -> Normalisation:
    """Return those scales of an effect that the columns of a shape count against."""
    return {name: value for name, value in scales.items() if shape.against is None or name in shape.against}


def _written(value: float, unit: str) -> float | str:
    """Return a parameter with its unit where that can be read beside a number."""
    return f"{value!r} {unit}" if unit[0].isalpha() and unit != "SI" else value
