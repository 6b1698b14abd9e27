"""`joint-coupling`: torque on one axis turns another, as in wrists with shared gears.

What couples them, a rod or a hose beside both, may do so by a lever that follows their angles.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term, named
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, counted, drive_compliance, drives, joint_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array


def _components(baseline: Baseline) -> list[str | None]:
    order: list[str | None] = [variable.name for variable in baseline.nominal.variables]
    found = [(str(name), joint_of(baseline, str(name)).variable) for name in drives(baseline)]
    found = sorted((one for one in found if one[1] in order), key=lambda one: order.index(one[1]))
    return [f"{a}+{b}" for (a, of_a), (b, of_b) in combinations(found, 2) if of_a != of_b]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axes = dict(enumerate((axis_at(baseline, name) for name in str(component).split("+")), start=1))
    first, second = axes.values()
    one = first.shift * counted(baseline, second)[:, None]
    other = second.shift * counted(baseline, first)[:, None]
    size = 0.2 * float(np.sqrt(drive_compliance(first) * drive_compliance(second)))
    unit = "rad/(N*m)" if first.turns and second.turns else "SI"
    shared = (one + other, (Quantity("coupling_compliance", unit, size),))
    both = (np.stack([one, other], -1), named("coupling_compliance", unit, size, ("first", "second")))
    found = [
        Shape.of("reciprocal", shared, prior_factor=4.0),
        Shape.of("one way each", both, prior_factor=4.0, weight=0.5),
    ]
    angles = {k: baseline.joint_values[str(axis.joint.variable)] for k, axis in axes.items() if axis.turns}
    turns = {k: {"cosine": np.cos(angle), "sine": np.sin(angle)} for k, angle in angles.items()}
    # what is wound up goes on where waves come back: wrists turn twice
    winds = {k: {"turn": angle / np.pi, "turn_squared": (angle / np.pi) ** 2} for k, angle in angles.items()}

    def followed(term: Term, k: int, courses: Mapping[str, Array]) -> list[Term]:
        """Return a term that follows the courses (N,) of an angle, each by half of it."""
        column, (quantity,) = term
        half = replace(quantity, size=0.5 * quantity.size)
        return [
            (column * course[:, None], (replace(half, name=f"{quantity.name}_by_{way}_{k}"),))
            for way, course in courses.items()
        ]

    if turns:
        parts = [part for k, courses in turns.items() for part in followed(shared, k, courses)]
        found.append(Shape.of("by the angles", shared, *parts, prior_factor=4.0, weight=0.5))
    ways = {"a rod across both, by angle": turns, "a cable across both, wound up by angle": winds}
    for name, every in ways.items():
        for k, courses in every.items():  # what is across both is a spring beside each as well
            parts = followed(shared, k, courses)
            for at, axis in axes.items():
                own = Quantity(f"compliance_{at}", _unit(axis), 0.2 * drive_compliance(axis))
                parts += followed((axis.shift * counted(baseline, axis)[:, None], (own,)), k, courses)
            found.append(Shape.of(f"{name} {k}", shared, *parts, prior_factor=4.0, weight=0.5))
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
