"""`base-compliance`: the pedestal or the floor under the machine is compliant."""

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import (
    by_compliance,
    by_contacts,
    compliance_terms,
    coupling_term,
    load_scales,
    softness,
)
from beamstiff.diagnosis.residual.baseline import Baseline

ROTATION = 5e-8  # rad/(N m)
TRANSLATION = 5e-9  # m/N
COUPLING = 1e-8  # 1/N: a centre of rotation some decimetres below


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    place = baseline.places.base
    soft = float(np.sqrt(softness(baseline)))  # a small robot may stand on the floor of a large one
    rotation, translation, coupling = soft * ROTATION, soft * TRANSLATION, soft * COUPLING
    turning, skewed, sliding, slanted = compliance_terms(baseline, place, rotation, translation)
    below = [(0, 1), (1, 0)]
    others = [(a, b) for a in range(3) for b in range(3) if (a, b) not in below]
    coupled = [coupling_term(baseline, place, *pair, coupling) for pair in below]
    rest = [coupling_term(baseline, place, *pair, 0.5 * coupling) for pair in others]
    tilt = Quantity("tilting_compliance", "rad/(N*m)", rotation, positive=True)
    scales = load_scales(baseline, baseline.fit.places.base)
    contacts = by_contacts(baseline, place, scales, rotation, translation)
    every = (turning, sliding, *coupled, skewed, slanted, *rest)
    found = [
        Shape.of("tilt", (by_compliance(baseline, place, (3, 3), (4, 4)), (tilt,))),
        Shape.of("rotation", turning),
        Shape.of("soil", turning, sliding, *coupled),
        Shape.of("all", *every),
        Shape.of("rotation that stiffens", turning, contacts[0], weight=0.5),
        Shape.of("all, stiffening", *every, *contacts, weight=0.5),
    ]
    return [replace(one, against=None if "stiffen" in one.name else ()) for one in found]


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    return {**load_scales(baseline, baseline.fit.places.base)}


EFFECT = Effect(
    name="base-compliance",
    family="structure",
    meaning="The pedestal or the floor under the machine is compliant.",
    components=lambda baseline: [None],
    shapes=_shapes,
    separation="turn the first joint by 90 degrees under the same load; put a reflector on the pedestal",
    look_alikes=("bearing-tilt",),
    sources="1e-8 to 2e-7 rad/(N m), engineering estimate",
    scales=_normalisation,
    place="base",
)
