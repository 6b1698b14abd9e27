"""`joint-compliance`: the model holds the joint rigid about its axis, but it gives way."""

from __future__ import annotations

from beamstiff.gap.baseline import Baseline, own_direction
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, by_law, component_of
from beamstiff.robot.fields import RIGID


def _components(baseline: Baseline) -> list[str | None]:
    robot = baseline.nominal
    return [
        component_of(joint)
        for joint in robot.joints
        if joint.name in baseline.places.joints
        and getattr(joint.stiffness, own_direction(robot, joint.name)) == RIGID
    ]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    unit, size = ("rad/(N*m)", 4e-7) if axis.turns else ("m/N", 5e-9)
    columns = by_law(baseline, axis, lambda torque: torque)[..., None]
    return [Shape("linear", columns, (Quantity("compliance", unit, size),), spread=30.0)]


EFFECT = Effect(
    name="joint-compliance",
    family="structure",
    meaning="The model holds the joint rigid about its axis, but it gives way under load or weight.",
    components=_components,
    shapes=_shapes,
    separation="load about this joint's axis alone, read the joint's motor encoder and the link behind it",
    look_alikes=("link-bending", "bearing-tilt"),
    sources="drives of industrial robots 3e5 to 1e7 N m/rad (seed 000, Table 6; 001, Table 2)",
)
