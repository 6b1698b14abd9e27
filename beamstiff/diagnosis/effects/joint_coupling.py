"""`joint-coupling`: torque on one axis turns another, as in wrists with shared gears.

What couples them, a rod or a hose beside both, may do so by a lever that follows their angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, drive_compliance, drives, joint_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array


def _components(baseline: Baseline) -> list[str | None]:
    order: list[str | None] = [variable.name for variable in baseline.nominal.variables]
    found = [(str(name), joint_of(baseline, str(name)).variable) for name in drives(baseline)]
    found = sorted((one for one in found if one[1] in order), key=lambda one: order.index(one[1]))
    return [f"{a}+{b}" for (a, of_a), (b, of_b) in combinations(found, 2) if of_a != of_b]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    first, second = (axis_at(baseline, name) for name in str(component).split("+"))

    def torque(axis: Axis) -> Array:
        return axis.load + axis.dead if baseline.absolute else axis.load

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
        Shape("reciprocal", (one + other)[..., None], (shared,), prior_factor=4.0),
        Shape("one way each", np.stack([one, other], -1), both, prior_factor=4.0, weight=0.5),
    ]
    angles = {
        k: baseline.joint_values[str(axis.joint.variable)]
        for k, axis in enumerate((first, second), start=1)
        if axis.turns
    }
    turns = {k: {"cosine": np.cos(angle), "sine": np.sin(angle)} for k, angle in angles.items()}
    # what is wound up goes on where waves come back: wrists turn twice
    winds = {k: {"turn": angle / np.pi, "turn_squared": (angle / np.pi) ** 2} for k, angle in angles.items()}
    cross = one + other

    def followed(
        column: Array, name: str, large: float, by: Mapping[int, Mapping[str, Array]], of: str
    ) -> list[tuple[Array, Quantity]]:
        return [
            (column * course[:, None], Quantity(f"{name}_by_{way}_{k}", of, 0.5 * large))
            for k, courses in by.items()
            for way, course in courses.items()
        ]

    def shape(name: str, parts: list[tuple[Array, Quantity]]) -> Shape:
        columns, quantities = np.stack([part for part, _ in parts], -1), tuple(part for _, part in parts)
        return Shape(name, columns, quantities, prior_factor=4.0, weight=0.5)

    if turns:
        parts = followed(cross, "coupling_compliance", size, turns, unit)
        found.append(shape("by the angles", [(cross, shared), *parts]))
    ways = {"a rod across both, by angle": turns, "a cable across both, wound up by angle": winds}
    for name, every in ways.items():
        for k, courses in every.items():  # what is across both is a spring beside each as well
            parts = followed(cross, "coupling_compliance", size, {k: courses}, unit)
            for at, axis in enumerate((first, second), start=1):
                own, large = axis.shift * torque(axis)[:, None], 0.2 * drive_compliance(axis)
                parts += followed(own, f"compliance_{at}", large, {k: courses}, _unit(axis))
            found.append(shape(f"{name} {k}", [(cross, shared), *parts]))
    return found


def _unit(axis: Axis) -> str:
    return "rad/(N*m)" if axis.turns else "m/N"


EFFECT = Effect(
    name="joint-coupling",
    family="drive",
    meaning="Torque on one axis turns another.",
    components=_components,
    shapes=_shapes,
    separation="apply a torque to one of the two joints only",
    sources="5 to 50 % of the geometric mean of both compliances, engineering estimate",
    places_of=lambda component: tuple(component.split("+")),
)
