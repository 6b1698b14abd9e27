"""`bearing-tilt`: the joint is compliant radially or in tilting, across its axis."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import (
    Effect,
    Normalisation,
    Quantity,
    Shape,
    Term,
    named,
    stated_scale,
)
from beamstiff.diagnosis.effects.torque_laws import (
    CONTACT,
    any_symmetric,
    by_compliance,
    component_of,
    joint_of,
    loaded_less_unloaded,
    most_of,
    softness,
    usual_stiffness,
)
from beamstiff.diagnosis.residual.baseline import Baseline, own_direction
from beamstiff.diagnosis.residual.internal_wrench import across
from beamstiff.diagnosis.residual.place import Place
from beamstiff.fem.beam_element import beam_axes
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Joint
from beamstiff.se3 import Array

TILT = 2e-7  # rad/(N m), of a heavy robot's
OF_DRIVE = 0.5  # the same over the compliance of the joint's own drive
RADIAL, AXIAL = 0.015, 0.01  # m^2, over the tilting compliance
SPREAD, REALISTIC = 30.0, 10.0  # from a wrist's to a press's; and of most
PRELOADS = {"": 0.0, ", with preload": 0.5}  # of the usual moment, up to which contacts give evenly
KNEES = (0.1, 0.2, 0.35, 0.6)  # of the usual moment, at which a preload may be lost: bearings give more then
RAYS = (0, 45, 90, 135)  # deg about the joint's axis, about which rolling contacts give
OFF = 0.05  # m along the axis, from the joint's frame to where its bearing tilts about


def _components(baseline: Baseline) -> list[str | None]:
    robot = baseline.nominal
    return [component_of(robot, joint) for joint in robot.joints]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    joint = joint_of(baseline, str(component))
    place = baseline.places.joints[joint.name]
    size, usual = _usual_tilt(baseline, str(component)), usual_moment(baseline, str(component))

    def column(*pairs: tuple[int, int]) -> Array:
        return by_compliance(baseline, place, *pairs)

    def alone(columns: Array, name: str, unit: str, large: float, positive: bool = True) -> Term:
        return columns, (Quantity(name, unit, large, positive),)

    tilt = alone(column((4, 4), (5, 5)), "tilting_compliance", "rad/(N*m)", size)
    radial = alone(column((1, 1), (2, 2)), "radial_compliance", "m/N", RADIAL * size)
    axial = alone(column((0, 0)), "axial_compliance", "m/N", AXIAL * size)
    radials = (
        np.stack([column((1, 1)), column((2, 2))], -1),
        named("radial_compliance", "m/N", RADIAL * size, "yz", positive=True),
    )
    # about a point that is off along the axis, forces across it tilt too
    across, along = column((1, 5)), column((2, 4))
    off = alone(across - along, "tilting_by_force", "rad/N", OFF * size, positive=False)
    offs = (np.stack([across, along], -1), named("tilting_by_force", "rad/N", OFF * size, "yz"))
    stiffening = alone(_stiffening(baseline, place, usual), "tilt_at_usual_moment", "rad", size * usual)
    rays = named("tilt_at_usual_moment_at", "rad", size * usual, [f"{at}_deg" for at in RAYS], positive=True)

    def by_ray(law: Callable[[Array], Array]) -> Term:
        return np.stack(_by_axis(baseline, place, usual, law), -1), rays

    tilts = _tilts(baseline, place, size)
    every = (tilts, radial, axial)
    turning = own_direction(baseline.nominal, joint.name) == "torsional"
    softening = "all, softening by axis as its preload is lost at"
    all_round = [
        Shape.of("tilt", tilt),
        Shape.of("tilt and radial", tilt, radial),
        Shape.of("tilt that stiffens", tilt, stiffening),
        Shape.of("tilt off its centre", tilt, radial, off),
    ]
    by_axis = [
        Shape.of("tilt by axis", tilts),
        Shape.of("all", *every),
        Shape.of("all, stiffening", *every, stiffening, weight=0.5),
        *(
            Shape.of(f"all, stiffening by axis{how}", *every, by_ray(_contact(preload)), weight=0.5)
            for how, preload in PRELOADS.items()
        ),
        *(
            Shape.of(f"{softening} {knee:g}", *every, by_ray(_unloaded(knee)), weight=0.5 / len(KNEES))
            for knee in KNEES
        ),
        Shape.of("all, off its centre", tilts, radials, axial, offs, weight=0.5),
        _any(baseline, place, size, turning, "any"),
    ]
    if joint.variable is not None and turning:
        seat = _seat(baseline, joint)
        of_seat = [
            Shape.of("tilt by axis of its seat", _tilts(baseline, seat, size), weight=0.5),
            _any(baseline, seat, size, turning, "any, by axis of its seat"),
        ]
        by_axis = [replace(one, turns=True) for one in by_axis] + [
            replace(one, turns=False) for one in of_seat
        ]
    counted = ("stiffen", "soften")  # against the usual moment
    return [
        replace(
            one,
            prior_factor=SPREAD,
            realistic=REALISTIC,
            against=None if any(how in one.name for how in counted) else (),
        )
        for one in (*all_round, *by_axis)
    ]


def _tilts(baseline: Baseline, place: Place, size: float) -> Term:
    """Return the tilts of a place about both axes across its own, and what couples them."""
    y, z = named("tilting_compliance", "rad/(N*m)", size, "yz", positive=True)
    yz = Quantity("tilting_compliance_yz", "rad/(N*m)", 0.5 * size, within=(y.name, z.name))
    columns = [by_compliance(baseline, place, pair) for pair in ((4, 4), (5, 5), (4, 5))]
    return np.stack(columns, -1), (y, z, yz)


def _seat(baseline: Baseline, joint: Joint) -> Place:
    """Return a joint's place in axes that do not turn with it, but stay with the part that carries it."""
    place, robot = baseline.places.joints[joint.name], baseline.nominal
    frames = {node.name: node.frame for node in robot.nodes}
    carrier = next((name for name in joint.nodes if frames[name] != joint.frame), joint.nodes[0])
    kinematics = compile_kinematics(robot)
    poses, number = np.unique(baseline.rows.q, axis=0, return_inverse=True)
    at = kinematics.node_frame[[node.name for node in robot.nodes].index(carrier)]
    part = posture(kinematics, poses).transforms[number.reshape(-1), at, :3, :3]
    axis = (part.swapaxes(-1, -2) @ place.turn[:, :, :1])[..., 0]
    turn = part @ beam_axes(axis, across(axis[0]))
    return place.along(turn).determined()


def _any(baseline: Baseline, place: Place, size: float, turning: bool, name: str) -> Shape:
    """Return any symmetric compliance in the five directions that are not the drive's: rollers at a slant."""
    own = np.array([AXIAL * size, RADIAL * size, RADIAL * size, size, size, size])
    sizes = 0.3 * np.sqrt(np.outer(own, own))
    sizes[:3, 3:] = sizes[3:, :3] = OFF * size
    np.fill_diagonal(sizes, own)
    driven = 3 if turning else 0
    sizes[driven], sizes[:, driven] = 0.0, 0.0
    return any_symmetric(baseline, place, sizes, name)


def _usual_tilt(baseline: Baseline, component: str) -> float:
    """Return a middling tilting compliance, rad/(N m): as soft as the joint's drive, or as the machine."""
    own = usual_stiffness(baseline, f"{joint_of(baseline, component).name}.torsional")
    return OF_DRIVE / own if FREE < own < RIGID else softness(baseline) * TILT


def usual_moment(baseline: Baseline, component: str) -> float:
    """Return the largest moment across the joint's axis from the loads of the rows that were fitted, N m."""
    load = most_of(baseline.fit.places.joints[joint_of(baseline, component).name])[:, 4:]
    return stated_scale(baseline, "moment") or float(np.linalg.norm(load, axis=1).max(initial=0.0)) or 1.0


def _stiffening(baseline: Baseline, place: Place, usual: float) -> Array:
    """Return the displacement (N, 6) of a tilt by the power 2/3 of the moment, as of rolling contacts."""

    def law(wrench: Array) -> Array:
        moment = wrench[:, 4:] / usual
        size = np.maximum(np.linalg.norm(moment, axis=1, keepdims=True), 1e-9)
        return np.concatenate([np.zeros((len(moment), 4)), moment * size ** (CONTACT - 1.0)], axis=1)

    result: Array = np.einsum(
        "nab,nb->na", place.shift, loaded_less_unloaded(baseline, place.load, place.dead, law)
    )
    return result


def _by_axis(baseline: Baseline, place: Place, usual: float, law: Callable[[Array], Array]) -> list[Array]:
    """Return the displacements (N, 6) of tilts by a law of the moment over the usual one.

    Each is about an axis across the joint's own.
    """
    found = []
    for angle in np.deg2rad(RAYS):
        about = np.array([0.0, 0.0, 0.0, 0.0, np.cos(angle), np.sin(angle)])

        def tilt(wrench: Array, about: Array = about) -> Array:
            return law(wrench @ about / usual)

        found.append(
            (place.shift @ about) * loaded_less_unloaded(baseline, place.load, place.dead, tilt)[:, None]
        )
    return found


def _contact(preload: float) -> Callable[[Array], Array]:
    """Return the law of contacts: in proportion up to about the preload, beyond by the power 2/3."""

    def law(moment: Array) -> Array:
        size = np.maximum(moment**2 + preload**2, 1e-18) / (1.0 + preload**2)
        return np.asarray(moment * size ** (0.5 * (CONTACT - 1.0)))

    return law


def _unloaded(knee: float) -> Callable[[Array], Array]:
    """Return the law of what gives besides where a preload is lost: one row of rollers carries alone."""

    def law(moment: Array) -> Array:
        return np.asarray(np.sign(moment) * np.maximum(np.abs(moment) - knee, 0.0) / (1.0 - knee))

    return law


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    return {"moment": usual_moment(baseline, str(component))}


EFFECT = Effect(
    name="bearing-tilt",
    family="structure",
    meaning="The bearing is compliant radially or in tilting, across the joint's axis.",
    components=_components,
    shapes=_shapes,
    separation="put a reflector on either side of the joint",
    look_alikes=("link-bending", "base-compliance"),
    sources="of a heavy robot 1e-7 to 5e-7 rad/(N m), as much as its drives; engineering estimate",
    scales=_normalisation,
)
