"""`base-compliance`: the pedestal or the floor under the machine is compliant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.effects.torque_laws import (
    by_compliance,
    by_contacts,
    compliance_quantities,
    coupling_quantity,
    load_scales,
    softness,
)
from beamstiff.diagnosis.residual.baseline import Baseline

ROTATION = 5e-8  # rad/(N m)
TRANSLATION = 5e-9  # m/N
COUPLING = 1e-8  # 1/N: a centre of rotation some decimetres below


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    place = baseline.places.base

    def column(*pairs: tuple[int, int]) -> np.ndarray:
        return by_compliance(baseline, place, list(pairs))

    soft = float(np.sqrt(softness(baseline)))  # a small robot may stand on the floor of a large one
    rotation, translation, coupling = soft * ROTATION, soft * TRANSLATION, soft * COUPLING
    tilt = Quantity("tilting_compliance", "rad/(N*m)", rotation, positive=True)
    rotations, skews, slides, slants = compliance_quantities(rotation, translation)
    couplings = (coupling_quantity(0, 1, coupling), coupling_quantity(1, 0, coupling))
    others = tuple(
        coupling_quantity(a, b, 0.5 * coupling)
        for a in range(3)
        for b in range(3)
        if (a, b) not in ((0, 1), (1, 0))
    )
    turning = [column((3, 3)), column((4, 4)), column((5, 5))]
    sliding = [column((0, 0)), column((1, 1)), column((2, 2))]
    coupled = [column((0, 4)), column((1, 3))]
    skewed = [column((3, 4)), column((3, 5)), column((4, 5))]
    slanted = [column((0, 1)), column((0, 2)), column((1, 2))]
    rest = [column((a, 3 + b)) for a in range(3) for b in range(3) if (a, b) not in ((0, 1), (1, 0))]
    contacts, stiffening = by_contacts(
        baseline, place, load_scales(baseline, baseline.fit.places.base), rotation, translation
    )
    found = [
        Shape("tilt", column((3, 3), (4, 4))[..., None], (tilt,)),
        Shape("rotation", np.stack(turning, -1), rotations),
        Shape("soil", np.stack([*turning, *sliding, *coupled], -1), (*rotations, *slides, *couplings)),
        Shape(
            "all",
            np.stack([*turning, *sliding, *coupled, *skewed, *slanted, *rest], -1),
            (*rotations, *slides, *couplings, *skews, *slants, *others),
        ),
        Shape(
            "rotation that stiffens",
            np.stack([*turning, *contacts[:3]], -1),
            (*rotations, *stiffening[:3]),
            weight=0.5,
        ),
        Shape(
            "all, stiffening",
            np.stack([*turning, *sliding, *coupled, *skewed, *slanted, *rest, *contacts], -1),
            (*rotations, *slides, *couplings, *skews, *slants, *others, *stiffening),
            weight=0.5,
        ),
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
