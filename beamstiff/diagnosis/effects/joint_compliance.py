"""`joint-compliance`: the model holds the joint rigid about its axis, but it is compliant.

Without a component: all such joints at once, each with a compliance of its own, as under the weight of the
links. That is one cause and not several, where positions show the sum of them better than each.
"""

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, Term, named
from beamstiff.diagnosis.effects.torque_laws import (
    Axis,
    axis_at,
    by_law,
    components_where,
    softness,
    torque_scale,
)
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.robot.fields import RIGID

SECTOR = 20.0  # deg, half a sector
SECTORS = tuple(range(-180, 180, 30))
# deg, two sectors: over less, a compliance that follows the angle may be of any size beside its zero
TRAVEL = 60.0


def _rigid_drives(baseline: Baseline) -> list[str]:
    return components_where(baseline, lambda joint, value: value == RIGID)


def _components(baseline: Baseline) -> list[str | None]:
    found = _rigid_drives(baseline)
    return [*found, *([None] if len(found) > 1 else [])]


def _linear(baseline: Baseline, axis: Axis, name: str) -> Term:
    # of a heavy robot; a small one's drives are softer, as those are that the file knows
    unit, size = ("rad/(N*m)", 4e-7 * softness(baseline)) if axis.turns else ("m/N", 5e-9)
    return by_law(baseline, axis, lambda torque: torque), (Quantity(name, unit, size, positive=True),)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    if component is None:
        every = [
            _linear(baseline, axis_at(baseline, name), f"compliance_{name}")
            for name in _rigid_drives(baseline)
        ]
        return [Shape.of("all drives, linear", *every, prior_factor=30.0)]
    axis = axis_at(baseline, component)
    linear = _linear(baseline, axis, "compliance")
    column, (compliance,) = linear
    unit, size = compliance.unit, compliance.size

    def grown(torque: np.ndarray) -> np.ndarray:
        return np.asarray(-torque * np.abs(torque) / (axis.typical + np.abs(torque)))

    def contact(torque: np.ndarray) -> np.ndarray:
        return np.asarray(axis.typical * np.sign(torque) * np.abs(torque / axis.typical) ** (2.0 / 3.0))

    less = by_law(baseline, axis, grown)
    others = np.stack([less, by_law(baseline, axis, contact), by_law(baseline, axis, np.abs)], -1)
    parts = named("compliance", unit, 0.5 * size, ("lost_at_much_torque", "at_contacts", "by_side"))
    stiffer = (replace(parts[0], positive=True),)
    found = [
        Shape.of("linear", linear, prior_factor=30.0),
        Shape.of("stiffening", linear, (less, stiffer), prior_factor=30.0, weight=0.5),
        Shape.of("any law", linear, (others, parts), prior_factor=30.0, weight=0.5),
    ]
    variable = axis.joint.variable
    if not axis.turns or variable is None:
        return found
    stated, travelled = baseline.stated is not None, np.ptp(baseline.fit.joint_values[variable])
    if stated or travelled >= np.deg2rad(TRAVEL):  # what carries it changes with the posture
        angle = baseline.joint_values[variable]
        courses = [wave(k * angle) for k in (1, 2) for wave in (np.cos, np.sin)]
        names = [f"{wave}_{k}" for k in ("q", "2q") for wave in ("cosine", "sine")]
        by_angle = column[..., None] * np.stack(courses, -1)[:, None]
        waves = (by_angle, named("compliance_by", unit, 0.3 * size, names))
        found.append(Shape.of("by its angle", linear, waves, prior_factor=30.0, weight=0.5))
        # worn or stiff sectors
        bumps = np.exp((np.cos(angle[:, None] - np.deg2rad(SECTORS)) - 1.0) / np.deg2rad(SECTOR) ** 2)
        places = named("compliance_near", unit, 0.5 * size, [f"{at}_deg" for at in SECTORS])
        sectors = (column[..., None] * bumps[:, None], places)
        found.append(Shape.of("by sectors", linear, sectors, prior_factor=30.0, weight=0.5))
    return found


def _scales(baseline: Baseline, component: str | None) -> Normalisation:
    return {} if component is None else torque_scale(baseline, component)


EFFECT = Effect(
    name="joint-compliance",
    family="structure",
    meaning="The joint is rigid about its axis in the model, but deforms under load or weight.",
    components=_components,
    shapes=_shapes,
    separation="hang the same weight at two distances from this joint's axis; read a reflector on the link "
    "behind it, and an encoder behind its gear if there is one",
    look_alikes=("link-bending", "bearing-tilt"),
    sources="drives of industrial robots 3e5 to 1e7 N m/rad (seed 000, Table 6; 001, Table 2)",
    scales=_scales,
    place="drives",
)
