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
from beamstiff.diagnosis.residual.place import Place
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array

ROTATION = 2e-6  # rad/(N m)
TRANSLATION = 2e-8  # m/N
COUPLING = 2e-7  # 1/N: an elastic centre a decimetre behind the TCP
SPREAD, REALISTIC = 10.0, 5.0
LAWS = ("by axis, stiffening", "by axis, softening", "on three")  # shapes that count against the largest load
SAME, NEAR = 1e-6, 0.02  # m: of a place that turns with the tool, and of one that is no other than the TCP
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
    seat = _about_last_joint(baseline, place)
    seated = [] if seat is None else [compliance_terms(baseline, seat, rotation, translation)[0]]
    found = [
        *(Shape.of("about the last joint, by axis", turning) for turning in seated),
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
        on_seats, paid = (by_seats(baseline, place, seats), ways), 0.5 / choices()
        found.append(Shape.of("on three seats", *centred, on_seats, weight=paid, data_selected=True))
    return [
        replace(
            one, prior_factor=SPREAD, realistic=REALISTIC, against=None if one.name.startswith(LAWS) else ()
        )
        for one in found
    ]


def _about_last_joint(baseline: Baseline, place: Place) -> Place | None:
    """Return what the tool's place carries, and moves, about the last joint: where a flange or cell tilts.

    None where the tool does not turn with it, or its TCP is there.
    """
    robot, q = baseline.nominal, baseline.rows.q[[0, -1]]
    if not robot.joints:
        return None
    kinematics = compile_kinematics(robot)
    at = posture(kinematics, q)
    tip, joint = (pose_of(kinematics, at, name) for name in (robot.tcp, robot.joints[-1].nodes[1]))
    behind = np.einsum("nji,nj->ni", tip[:, :3, :3], joint[:, :3, 3] - tip[:, :3, 3])
    if np.ptp(behind, axis=0).max() > SAME or np.linalg.norm(behind[0]) < NEAR:
        return None
    lever = np.cross(behind[0], np.eye(3)).T  # of what it is crossed with

    def about(wrench: Array) -> Array:
        return np.concatenate([wrench[:, :3], wrench[:, 3:] - wrench[:, :3] @ lever.T], axis=1)

    turned = place.shift[:, :, 3:] + place.shift[:, :, :3] @ lever
    shift = np.concatenate([place.shift[:, :, :3], turned], axis=-1)
    return replace(place, load=about(place.load), dead=about(place.dead), shift=shift)


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
