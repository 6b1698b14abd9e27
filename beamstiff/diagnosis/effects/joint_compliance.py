"""`joint-compliance`: the model holds the joint rigid about its axis, but it gives way."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import axis_at, by_law, component_of, torque_scale
from beamstiff.diagnosis.residual.baseline import Baseline, own_direction
from beamstiff.robot.fields import RIGID

SECTOR = 20.0  # deg, half a sector
SECTORS = tuple(range(-180, 180, 30))


def _components(baseline: Baseline) -> list[str | None]:
    robot = baseline.nominal
    return [
        component_of(robot, joint)
        for joint in robot.joints
        if getattr(joint.stiffness, own_direction(robot, joint.name)) == RIGID
    ]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    unit, size = ("rad/(N*m)", 4e-7) if axis.turns else ("m/N", 5e-9)
    compliance = Quantity("compliance", unit, size, positive=True)
    linear = by_law(baseline, axis, lambda torque: torque)

    def grown(torque: np.ndarray) -> np.ndarray:
        return np.asarray(-torque * np.abs(torque) / (axis.typical + np.abs(torque)))

    def contact(torque: np.ndarray) -> np.ndarray:
        return np.asarray(axis.typical * np.sign(torque) * np.abs(torque / axis.typical) ** (2.0 / 3.0))

    less = by_law(baseline, axis, grown)
    any_law = [linear, less, by_law(baseline, axis, contact), by_law(baseline, axis, np.abs)]
    parts = ("compliance_lost_at_much_torque", "compliance_at_contacts", "compliance_by_side")
    others = tuple(Quantity(part, unit, 0.5 * size) for part in parts)
    stiffer = Quantity("compliance_lost_at_much_torque", unit, 0.5 * size, positive=True)
    found = [
        Shape("linear", linear[..., None], (compliance,), prior_factor=30.0),
        Shape(
            "stiffening", np.stack([linear, less], -1), (compliance, stiffer), prior_factor=30.0, weight=0.5
        ),
        Shape("any law", np.stack(any_law, -1), (compliance, *others), prior_factor=30.0, weight=0.5),
    ]
    if axis.turns and axis.joint.variable is not None:  # what carries it changes with the posture
        angle = baseline.joint_values[axis.joint.variable]
        courses = [wave(k * angle) for k in (1, 2) for wave in (np.cos, np.sin)]
        by_angle = np.stack([linear, *(linear * course[:, None] for course in courses)], -1)
        names = [f"compliance_by_{wave}_{k}" for k in ("q", "2q") for wave in ("cosine", "sine")]
        waves = tuple(Quantity(name, unit, 0.3 * size) for name in names)
        found.append(Shape("by its angle", by_angle, (compliance, *waves), prior_factor=30.0, weight=0.5))
        # worn or stiff sectors
        bumps = np.exp((np.cos(angle[:, None] - np.deg2rad(SECTORS)) - 1.0) / np.deg2rad(SECTOR) ** 2)
        near = np.concatenate([linear[..., None], linear[..., None] * bumps[:, None]], -1)
        sectors = tuple(Quantity(f"compliance_near_{at}_deg", unit, 0.5 * size) for at in SECTORS)
        found.append(Shape("by sectors", near, (compliance, *sectors), prior_factor=30.0, weight=0.5))
    return found


EFFECT = Effect(
    name="joint-compliance",
    family="structure",
    meaning="The model has the joint rigid about its axis, but it deforms under load or weight.",
    components=_components,
    shapes=_shapes,
    separation="load about this joint's axis alone, read the joint's motor encoder and the link behind it",
    look_alikes=("link-bending", "bearing-tilt"),
    sources="drives of industrial robots 3e5 to 1e7 N m/rad (seed 000, Table 6; 001, Table 2)",
    scales=torque_scale,
)
