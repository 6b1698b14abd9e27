"""`bearing-tilt`: the joint gives way radially or in tilting, across its axis."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import by_compliance, component_of, joint_of

TILT = Quantity("tilting_compliance", "rad/(N*m)", 2e-7)
RADIAL = Quantity("radial_compliance", "m/N", 3e-9)
AXIAL = Quantity("axial_compliance", "m/N", 2e-9)


def _components(baseline: Baseline) -> list[str | None]:
    return [component_of(joint) for joint in baseline.nominal.joints if joint.name in baseline.places.joints]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    place = baseline.places.joints[joint_of(baseline, str(component)).name]
    tilt = by_compliance(baseline, place, [(4, 4), (5, 5)])
    radial = by_compliance(baseline, place, [(1, 1), (2, 2)])
    axial = by_compliance(baseline, place, [(0, 0)])
    by_axis = [by_compliance(baseline, place, [pair]) for pair in ((4, 4), (5, 5), (4, 5))]
    skew = Quantity("tilting_compliance_yz", "rad/(N*m)", 0.5 * TILT.size)
    two = (
        Quantity("tilting_compliance_y", "rad/(N*m)", TILT.size),
        Quantity("tilting_compliance_z", "rad/(N*m)", TILT.size),
    )
    return [
        Shape("tilt", tilt[..., None], (TILT,)),
        Shape("tilt and radial", np.stack([tilt, radial], -1), (TILT, RADIAL)),
        Shape("tilt by axis", np.stack(by_axis, -1), (*two, skew)),
        Shape("all", np.stack([*by_axis, radial, axial], -1), (*two, skew, RADIAL, AXIAL)),
    ]


EFFECT = Effect(
    name="bearing-tilt",
    family="structure",
    meaning="The bearing gives way radially or in tilting, across the joint's axis.",
    components=_components,
    shapes=_shapes,
    separation="a reflector on either side of the joint",
    look_alikes=("link-bending", "base-compliance"),
    sources="1e-7 to 5e-7 rad/(N m), engineering estimate",
)
