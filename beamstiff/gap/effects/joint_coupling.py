"""`joint-coupling`: torque on one axis turns another, as in wrists with shared gears.

What couples them, a rod or a hose beside both, may do so by a lever that follows their angles.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, drive_compliance, drives


def _components(baseline: Baseline) -> list[str | None]:
    order = [variable.name for variable in baseline.nominal.variables]
    names = [str(name) for name in drives(baseline) if name in order]
    names.sort(key=order.index)
    return [f"{a}+{b}" for a, b in combinations(names, 2)]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    first, second = (axis_at(baseline, name) for name in str(component).split("+"))

    def torque(axis: object) -> np.ndarray:
        load, dead = axis.load, axis.dead  # type: ignore[attr-defined]
        return np.asarray(load + dead if baseline.absolute else load)

    one = first.shift * torque(second)[:, None]
    other = second.shift * torque(first)[:, None]
    size = 0.2 * float(np.sqrt(drive_compliance(first) * drive_compliance(second)))
    unit = "rad/(N*m)" if first.turns and second.turns else "SI"
    shared = Quantity("coupling_compliance", unit, size)
    both = (
        Quantity("coupling_compliance_first", unit, size),
        Quantity("coupling_compliance_second", unit, size),
    )
    angles = [baseline.joint_values[str(axis.joint.variable)] for axis in (first, second) if axis.turns]
    courses = [wave(angle) for angle in angles for wave in (np.cos, np.sin)]
    by_angles = np.stack(
        [(one + other) * course[:, None] for course in (1.0 + 0.0 * one[:, 0], *courses)], -1
    )
    waves = tuple(
        Quantity(f"coupling_compliance_by_{wave}_{k}", unit, 0.5 * size)
        for k, _ in enumerate(angles, start=1)
        for wave in ("cosine", "sine")
    )
    return [
        Shape("by the angles", by_angles, (shared, *waves), spread=4.0, weight=0.5),
        Shape("reciprocal", (one + other)[..., None], (shared,), spread=4.0),
        Shape("one way each", np.stack([one, other], -1), both, spread=4.0, weight=0.5),
    ]


EFFECT = Effect(
    name="joint-coupling",
    family="drive",
    meaning="Torque on one axis turns another.",
    components=_components,
    shapes=_shapes,
    separation="torque on one of the two joints only",
    sources="5 to 50 % of the geometric mean of both compliances, engineering estimate",
)
