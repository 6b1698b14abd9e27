"""`joint-compliance`: the model holds the joint rigid about its axis, but it is compliant.

Without a component: all such joints at once, each with a compliance of its own, as under the weight of the
links. That is one cause and not several, where positions show the sum of them better than each.
"""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, by_law, component_of, torque_scale
from beamstiff.diagnosis.residual.baseline import Baseline, own_direction
from beamstiff.robot.fields import RIGID

SECTOR = 20.0  # deg, half a sector
SECTORS = tuple(range(-180, 180, 30))


def _rigid_drives(baseline: Baseline) -> list[str]:
    robot = baseline.nominal
    return [
        component_of(robot, joint)
        for joint in robot.joints
        if getattr(joint.stiffness, own_direction(robot, joint.name)) == RIGID
    ]


def _components(baseline: Baseline) -> list[str | None]:
    found = _rigid_drives(baseline)
    every = [None] if baseline.absolute and len(found) > 1 else []
    return [*found, *every]


def _compliance(axis: Axis, name: str) -> Quantity:
    unit, size = ("rad/(N*m)", 4e-7) if axis.turns else ("m/N", 5e-9)
    return Quantity(name, unit, size, positive=True)


def _all_drives(baseline: Baseline) -> Shape:
    names = _rigid_drives(baseline)
    axes = [axis_at(baseline, name) for name in names]
    columns = np.stack([by_law(baseline, axis, lambda torque: torque) for axis in axes], -1)
    compliances = [_compliance(axis, f"compliance_{name}") for axis, name in zip(axes, names, strict=True)]
    return Shape("all drives, linear", columns, tuple(compliances), prior_factor=30.0)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    if component is None:
        return [_all_drives(baseline)]
    axis = axis_at(baseline, component)
    compliance = _compliance(axis, "compliance")
    unit, size = compliance.unit, compliance.size
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


def _scales(baseline: Baseline, component: str | None) -> Normalisation:
    return {} if component is None else torque_scale(baseline, component)


EFFECT = Effect(
    name="joint-compliance",
    family="structure",
    meaning="The model has the joint rigid about its axis, but it deforms under load or weight.",
    components=_components,
    shapes=_shapes,
    separation="load this joint's axis alone; read its motor encoder and the link behind it",
    look_alikes=("link-bending", "bearing-tilt"),
    sources="drives of industrial robots 3e5 to 1e7 N m/rad (seed 000, Table 6; 001, Table 2)",
    scales=_scales,
    place="drives",
)
