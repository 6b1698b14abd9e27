"""`tool-compliance`: flange, force sensor or gripper between the last joint and the TCP are compliant."""

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.effects.three_point_mount import NAMES, by_seats, choices, seat_scales, seats_of
from beamstiff.diagnosis.effects.torque_laws import (
    SEAM,
    by_compliance,
    by_contacts,
    by_side,
    compliance_terms,
    coupling_term,
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
    place, scales = baseline.places.flange, load_scales(baseline, baseline.fit.places.flange)

    def column(*pairs: tuple[int, int]) -> np.ndarray:
        return by_compliance(baseline, place, *pairs)

    soft = softness(baseline)
    rotation, translation, coupling = soft * ROTATION, soft * TRANSLATION, soft * COUPLING
    turning, skewed, sliding, slanted = compliance_terms(baseline, place, rotation, translation)
    coupled = [coupling_term(baseline, place, a, b, coupling) for a in range(3) for b in range(3)]
    (forward, lever), (aside, _) = coupled[1], coupled[3]
    even = Quantity("rotational_compliance", "rad/(N*m)", rotation, positive=True)
    slide = Quantity("translational_compliance", "m/N", translation, positive=True)
    tilt = replace(even, name="tilting_compliance")
    # flanges and cells are round mostly
    turn_across, slide_across = column((3, 3), (4, 4)), column((0, 0), (1, 1))
    turned, slid = ((columns[..., 2], quantities[2:]) for columns, quantities in (turning, sliding))

    def behind(distance: float) -> np.ndarray:
        return turn_across + distance * (forward - aside) + distance**2 * slide_across

    by_axis = (turning, sliding)
    sides = [replace(one, name=f"{one.name}_by_side", positive=False) for _, own in by_axis for one in own]
    sided = np.stack([by_side(baseline, place, at) for at in (3, 4, 5, 0, 1, 2)], -1)
    contacts = by_contacts(baseline, place, scales, rotation, translation)
    seams = by_contacts(baseline, place, scales, rotation, translation, SEAM)
    turns = (column((3, 3), (4, 4), (5, 5)), (even,))
    slides = (column((0, 0), (1, 1), (2, 2)), (slide,))
    round_terms = ((turn_across, (tilt,)), turned, (slide_across, (slide,)), slid, (forward - aside, lever))
    centred = (*by_axis, coupled[1], coupled[3])
    found = [
        Shape.of("rotation", turns),
        Shape.of("rotation and translation", turns, slides),
        *(Shape.of(f"about a centre {at:g} m behind", (behind(at), (tilt,)), turned) for at in CENTRES),
        Shape.of("by axis", *by_axis),
        Shape.of("by axis, about a centre behind", *centred),
        Shape.of("round", *round_terms),
        Shape.of("by axis, softer to one side", *by_axis, (sided, tuple(sides)), weight=0.5),
        Shape.of("by axis, stiffening", *by_axis, *contacts, weight=0.5),
        Shape.of("by axis, softening as a seam that opens", *by_axis, *seams, weight=0.5),
        Shape.of("all", *by_axis, skewed, slanted, *coupled),
    ]
    if (seats := seats_of(baseline)) is not None:
        tilted = rotation * 1.5 * seats.radius * seats.force
        sizes = (("tilt", "rad", tilted), ("lift", "m", tilted * seats.radius))
        ways = tuple(Quantity(f"{what}_{name}", unit, size) for name in NAMES for what, unit, size in sizes)
        seated, paid = (by_seats(baseline, place, seats), ways), 0.5 / choices()
        found.append(Shape.of("on three seats", *centred, seated, weight=paid, data_selected=True))
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
