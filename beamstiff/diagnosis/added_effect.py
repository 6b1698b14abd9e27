"""A fitted effect as an entry of a robot's file."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from beamstiff.diagnosis.effects import EFFECTS, Normalisation, Shape
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.robot.parts import AddedEffect, AddedShape
from beamstiff.se3 import Array

# Rounding moves a value by no more than this part of its standard deviation: values that are hardly known by
# themselves may be known together, or beside a zero of the geometry, some ten thousand times better.
GUARD = 1e5
TWO_DIGITS = 20.0  # part of a standard deviation, to which it is told itself


WHOLE = 0.999  # weight from which on a shape counts in full
SMALL = {"rad": ("mrad", 1e3), "m": ("mm", 1e3)}  # units that people read, as the tables of a diagnosis


def added_effect(
    baseline: Baseline,
    effect: str,
    component: str | None,
    shapes: Sequence[tuple[Shape, float, Array, Array]],
    *,
    closes: float | None = None,
    absorbed: Mapping[str, float] | None = None,
) -> AddedEffect:
    """Return the entry of an effect: shapes with weights, parameters (c,) and standard deviations, SI.

    Of a single shape, 0 stands where noise made negative what cannot be; of several only the sum is meant.
    """
    parts = tuple(_added_shape(baseline, effect, component, *one, bounded=len(shapes) == 1) for one in shapes)
    source: Literal["positions", "displacements"] = "positions" if baseline.absolute else "displacements"
    entry = AddedEffect.model_construct(
        effect=effect, component=component, closes=closes, absorbed=absorbed or {}, found_from=source
    )
    return entry.with_shapes(parts)


def _added_shape(
    baseline: Baseline,
    effect: str,
    component: str | None,
    shape: Shape,
    weight: float,
    values: Array,
    std: Array,
    *,
    bounded: bool,
) -> AddedShape:
    if bounded:
        cannot = np.array([item.positive for item in shape.parameters])
        values = np.where(cannot, np.maximum(values, 0.0), values)
    told = [
        (item, value, spread)
        for item, value, spread in zip(shape.parameters, values.tolist(), std.tolist(), strict=True)
        if not item.posture_specific
    ]
    return AddedShape(
        shape=shape.name,
        weight=1.0 if weight >= WHOLE else weight,
        parameters={item.name: _with_unit(value, item.unit) for item, value, _ in told},
        std={item.name: _with_unit(spread, item.unit) for item, _, spread in told},
        scales=needed_scales(shape, EFFECTS[effect].scales(baseline, component)),
    )


def needed_scales(shape: Shape, scales: Normalisation) -> Normalisation:
    """Return those scales of an effect that the columns of a shape count against."""
    return {name: value for name, value in scales.items() if shape.against is None or name in shape.against}


def rounded(effect: AddedEffect) -> AddedEffect:
    """Return an entry with the digits that its standard deviations are worth, and scales with six."""
    return effect.with_shapes(tuple(map(_rounded_shape, effect.each)))


def _rounded_shape(effect: AddedShape) -> AddedShape:
    steps = {name: _number(value) for name, value in effect.std.items()}
    parameters = {
        name: _shortened(value, steps[name] / GUARD) if name in steps else value
        for name, value in effect.parameters.items()
    }
    std = {name: _shortened(value, steps[name] / TWO_DIGITS) for name, value in effect.std.items()}
    scales = {
        name: value if isinstance(value, tuple) else float(f"{value:.6g}")
        for name, value in effect.scales.items()
    }
    weight = float(f"{effect.weight:.4g}")
    return effect.model_copy(
        update={"parameters": parameters, "std": std, "scales": scales, "weight": weight}
    )


def _number(value: float | str) -> float:
    return float(value.split()[0]) if isinstance(value, str) else value


def _shortened(value: float | str, step: float) -> float | str:
    """Return a number, its unit behind it if it has one, to within a step of the same unit.

    >>> _shortened("8.6412e-07 rad/(N*m)", 1e-9), _shortened("1e-14 rad/(N*m)", 1e-9), _shortened(0.123, 0.01)
    ('8.64e-07 rad/(N*m)', '0.0 rad/(N*m)', 0.1)
    """
    exact = _number(value)
    tried = (0.0, *(float(f"{exact:.{digits}g}") for digits in range(1, 17)))
    short = next((found for found in tried if abs(found - exact) <= step), exact)
    return f"{short!r} {value.partition(' ')[2]}" if isinstance(value, str) else short


def _with_unit(value: float, unit: str) -> float | str:
    """Return a parameter with its unit where that can be read beside a number."""
    if unit[0].isalpha() and unit != "SI":
        unit, times = SMALL.get(unit, (unit, 1.0))
        return f"{value * times!r} {unit}"
    return value
