"""`tool-compliance`: flange, force sensor or gripper between the last joint and the TCP are compliant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.effects.three_point_mount import NAMES, by_seats, choices, seat_scales, seats_of
from beamstiff.diagnosis.effects.torque_laws import (
    SEAM,
    by_compliance,
    by_contacts,
    by_side,
    compliance_quantities,
    coupling_quantity,
    load_scales,
    softness,
)
from beamstiff.diagnosis.residual.baseline import Baseline

ROTATION = 2e-6  # rad/(N m)
TRANSLATION = 2e-8  # m/N
COUPLING = 2e-7  # 1/N: an elastic centre a decimetre behind the TCP
SPREAD, REALISTIC = 10.0, 5.0
LAWS = ("by axis, stiffening", "by axis, softening", "on three")  # shapes that count against the largest load
CENTRES = (0.05, 0.1, 0.2)  # m along the tool's axis z, at which it tilts


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    place = baseline.places.flange

    def column(*pairs: tuple[int, int]) -> np.ndarray:
        return by_compliance(baseline, place, list(pairs))

    soft = softness(baseline)
    rotation, translation, coupling = soft * ROTATION, soft * TRANSLATION, soft * COUPLING
    even = Quantity("rotational_compliance", "rad/(N*m)", rotation, positive=True)
    rotations, skews, slides, slants = compliance_quantities(rotation, translation)
    couplings = tuple(coupling_quantity(a, b, coupling) for a in range(3) for b in range(3))
    turning = [column((3, 3)), column((4, 4)), column((5, 5))]
    sliding = [column((0, 0)), column((1, 1)), column((2, 2))]
    skewed = [column((3, 4)), column((3, 5)), column((4, 5))]
    slanted = [column((0, 1)), column((0, 2)), column((1, 2))]
    coupled = [column((a, 3 + b)) for a in range(3) for b in range(3)]
    tilt = Quantity("tilting_compliance", "rad/(N*m)", rotation, positive=True)
    behind = [
        np.stack(
            [
                column((3, 3), (4, 4))
                + distance * (column((0, 4)) - column((1, 3)))
                + distance**2 * column((0, 0), (1, 1)),
                turning[2],
            ],
            -1,
        )
        for distance in CENTRES
    ]
    sided = [by_side(baseline, place, at) for at in (3, 4, 5, 0, 1, 2)]
    sides = tuple(replace(one, name=f"{one.name}_by_side", positive=False) for one in (*rotations, *slides))
    contacts, stiffening = by_contacts(
        baseline, place, load_scales(baseline, baseline.fit.places.flange), rotation, translation
    )
    seams, softening = by_contacts(
        baseline, place, load_scales(baseline, baseline.fit.places.flange), rotation, translation, SEAM
    )
    slide = Quantity("translational_compliance", "m/N", translation, positive=True)
    both = [column((3, 3), (4, 4), (5, 5)), column((0, 0), (1, 1), (2, 2))]
    # flanges and cells are round mostly
    turn_across, slide_across = column((3, 3), (4, 4)), column((0, 0), (1, 1))
    found = [
        Shape("rotation", both[0][..., None], (even,)),
        Shape("rotation and translation", np.stack(both, -1), (even, slide)),
        *(
            Shape(f"about a centre {distance:g} m behind", columns, (tilt, rotations[2]))
            for distance, columns in zip(CENTRES, behind, strict=True)
        ),
        Shape("by axis", np.stack([*turning, *sliding], -1), (*rotations, *slides)),
        Shape(
            "by axis, about a centre behind",
            np.stack([*turning, *sliding, coupled[1], coupled[3]], -1),
            (*rotations, *slides, couplings[1], couplings[3]),
        ),
        Shape(
            "round",
            np.stack([turn_across, turning[2], slide_across, sliding[2], coupled[1] - coupled[3]], -1),
            (tilt, rotations[2], slide, slides[2], couplings[1]),
        ),
        Shape(
            "by axis, softer to one side",
            np.stack([*turning, *sliding, *sided], -1),
            (*rotations, *slides, *sides),
            weight=0.5,
        ),
        Shape(
            "by axis, stiffening",
            np.stack([*turning, *sliding, *contacts], -1),
            (*rotations, *slides, *stiffening),
            weight=0.5,
        ),
        Shape(
            "by axis, softening as a seam that opens",
            np.stack([*turning, *sliding, *seams], -1),
            (*rotations, *slides, *softening),
            weight=0.5,
        ),
        Shape(
            "all",
            np.stack([*turning, *sliding, *skewed, *slanted, *coupled], -1),
            (*rotations, *slides, *skews, *slants, *couplings),
        ),
    ]
    if (seats := seats_of(baseline)) is not None:
        tilted = rotation * 1.5 * seats.radius * seats.force
        sizes = (("tilt", "rad", tilted), ("lift", "m", tilted * seats.radius))
        ways = tuple(Quantity(f"{what}_{name}", unit, size) for name in NAMES for what, unit, size in sizes)
        columns = np.stack([*turning, *sliding, coupled[1], coupled[3]], -1)
        found.append(
            Shape(
                "on three seats",
                np.concatenate([columns, by_seats(baseline, place, seats)], -1),
                (*rotations, *slides, couplings[1], couplings[3], *ways),
                weight=0.5 / choices(),
                data_selected=True,
            )
        )
    return [
        replace(
            one, prior_factor=SPREAD, realistic=REALISTIC, against=None if one.name.startswith(LAWS) else ()
        )
        for one in found
    ]


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    return load_scales(baseline, baseline.fit.places.flange) | seat_scales(baseline)


EFFECT = Effect(
    name="tool-compliance",
    family="structure",
    meaning="The flange, force sensor or gripper between the last joint and the TCP is compliant.",
    components=lambda baseline: [None],
    shapes=_shapes,
    separation="put reflectors on flange and tool; apply a pure moment to the tool",
    look_alikes=("actuator-lever", "tool-offset"),
    sources="of a heavy robot 5e-7 to 1e-5 rad/(N m), engineering estimate",
    scales=_normalisation,
    place="tool",
)
