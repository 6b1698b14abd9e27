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
    found = [
        Shape("reciprocal", (one + other)[..., None], (shared,), spread=4.0),
        Shape("one way each", np.stack([one, other], -1), both, spread=4.0, weight=0.5),
    ]
    courses = {
        f"{wave}_{k}": law(baseline.joint_values[str(axis.joint.variable)])
        for k, axis in enumerate((first, second), start=1)
        if axis.turns
        for wave, law in (("cosine", np.cos), ("sine", np.sin))
    }
    if courses:
        columns = [one + other, *((one + other) * course[:, None] for course in courses.values())]
        waves = (Quantity(f"coupling_compliance_by_{name}", unit, 0.5 * size) for name in courses)
        found.append(Shape("by the angles", np.stack(columns, -1), (shared, *waves), spread=4.0, weight=0.5))
    return found


EFFECT = Effect(
    name="joint-coupling",
    family="drive",
    meaning="Torque on one axis turns another.",
    components=_components,
    shapes=_shapes,
    separation="torque on one of the two joints only",
    sources="5 to 50 % of the geometric mean of both compliances, engineering estimate",
)
