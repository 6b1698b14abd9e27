"""What the effects share: the torque about a joint's axis, slips that follow a law of it, axes of places."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.effects.effect import (
    Normalisation,
    Quantities,
    Quantity,
    Shape,
    Term,
    named,
    stated_scale,
)
from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline, own_direction
from beamstiff.diagnosis.residual.place import Place
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.parts import Joint
from beamstiff.se3 import Array

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
PAIRS = tuple((i, j) for i in range(6) for j in range(i, 6))  # of directions, of a symmetric compliance
HEAVY = 8e6  # N m/rad, the stiffest drive of a robot of 2.7 m reach (seed 001, Table 2: 6.6e6 and more)

CONTACT, SEAM = 2.0 / 3.0, 3.0  # powers of the load by which places give that stiffen, and that soften


@dataclass(frozen=True)
class Axis:
    """A joint's own direction under the rows.

    `load`, `dead`: (N,) arrays, N m or N; torque (force) about it from the row's load and from the dead
        weight.
    `shift`: (N, 6) array; displacement of the row's point per slip about it.
    `stiffness`, `usual`: as the robot was given, and as realistic sizes count it (`usual_stiffness`); inf is
        rigid.
    `turns`: about the axis; else along it.
    `typical`: largest torque of the rows that were fitted, from loads and dead weight, or 1 where there is
        none.
    """

    joint: Joint
    load: Array
    dead: Array
    shift: Array
    stiffness: float
    usual: float
    turns: bool
    typical: float


def component_of(robot: Robot, joint: Joint) -> str:
    """Return the name by which a joint is a component: its variable, if no other has it, else its own."""
    alone = [other.variable for other in robot.joints].count(joint.variable) == 1
    return joint.variable if joint.variable is not None and alone else joint.name


def joint_of(baseline: Baseline, component: str) -> Joint:
    """Return the joint of a component."""
    robot = baseline.nominal
    return next(joint for joint in robot.joints if component_of(robot, joint) == component)


def axis_at(baseline: Baseline, component: str) -> Axis:
    """Return a joint's own direction."""
    joint = joint_of(baseline, component)
    kind = own_direction(baseline.nominal, joint.name)
    at = 3 if kind == "torsional" else 0
    place = baseline.places.joints[joint.name]
    largest = stated_scale(baseline, "torque")
    if largest is None:
        largest = _largest(baseline.fit.places.joints[joint.name], at)
    carries = _largest(place, at) > 0
    return Axis(
        joint=joint,
        load=place.load[:, at] * carries,
        dead=place.dead[:, at] * carries,
        shift=place.shift[:, :, at],
        stiffness=float(getattr(joint.stiffness, kind)),
        usual=usual_stiffness(baseline, f"{joint.name}.{kind}"),
        turns=kind == "torsional",
        typical=largest or 1.0,
    )


def _largest(place: Place, at: int) -> float:
    """Return the largest entry of a place's wrenches; 0 where it is nothing but the rounding of others."""
    every = most_of(place)
    largest = float(np.abs(every[:, at]).max(initial=0.0))
    return largest if largest > ROUNDING * float(np.linalg.norm(every, axis=1).max(initial=0.0)) else 0.0


def most_of(place: Place) -> Array:
    """Return all wrenches (2 N, 6) that a place passes, loaded and unloaded: laws act on both."""
    return np.concatenate([place.load + place.dead, place.dead])


def torque_scale(baseline: Baseline, component: str | None) -> Normalisation:
    """Return the scale of the effects that count torques against the largest one."""
    return {"torque": axis_at(baseline, str(component)).typical}


def drives(baseline: Baseline) -> list[str | None]:
    """Return the components whose own direction has a finite stiffness: drives, springs."""
    return [*components_where(baseline, lambda joint, value: FREE < value < RIGID)]


def drives_and_rigid_ones(baseline: Baseline) -> list[str | None]:
    """Return `drives`, and those that are rigid in the file: their gears have play whatever it says."""
    return [
        *components_where(
            baseline, lambda joint, value: value > FREE and (value < RIGID or joint.variable is not None)
        )
    ]


def components_where(baseline: Baseline, wanted: Callable[[Joint, float], bool]) -> list[str]:
    """Return the components of joints that are wanted, by the stiffness along their own direction."""
    robot = baseline.nominal
    own = ((joint, getattr(joint.stiffness, own_direction(robot, joint.name))) for joint in robot.joints)
    return [component_of(robot, joint) for joint, value in own if wanted(joint, value)]


def by_law(baseline: Baseline, axis: Axis, law: Callable[[Array], Array]) -> Array:
    """Return the displacement (N, 6) of a slip that follows a law of the torque.

    Displacements are loaded less unloaded, and the dead weight acts in both.
    """
    return axis.shift * loaded_less_unloaded(baseline, axis.load, axis.dead, law)[:, None]


def by_slips(shift: Array, slips: Array) -> Array:
    """Return the displacements (N, 6, c) of slips (N, c), of a shift (N, 6) per unit."""
    return shift[:, :, None] * slips[:, None]


def loaded_less_unloaded(
    baseline: Baseline, load: Array, dead: Array, law: Callable[[Array], Array]
) -> Array:
    """Return the slip (N, ...) of a law; in displacements loaded less unloaded."""
    slip = law(load + dead)
    return slip if baseline.absolute else slip - law(dead)


def counted(baseline: Baseline, at: Axis | Place) -> Array:
    """Return the torques or wrenches (N, ...) that rows show: in displacements those of the loads alone."""
    return at.load + at.dead if baseline.absolute else at.load


def by_compliance(baseline: Baseline, place: Place, *pairs: tuple[int, int]) -> Array:
    """Return the displacement (N, 6) of unit symmetric compliances of a place: pairs of directions, 0..5."""
    passed = counted(baseline, place)
    slip = np.zeros_like(passed)
    for a, b in pairs:
        slip[:, a] += passed[:, b]
        if a != b:
            slip[:, b] += passed[:, a]
    return np.asarray(np.einsum("nab,nb->na", place.shift, slip))


def compliance_terms(
    baseline: Baseline, place: Place, rotation: float, translation: float
) -> tuple[Term, Term, Term, Term]:
    """Return the entries of a place's compliance: rotations, their couplings, translations, theirs.

    Three each, (xx, yy, zz) or (xy, xz, yz), of realistic sizes `rotation`, rad/(N m), and `translation`,
    m/N; couplings are 0.3 of these.
    """

    def own(name: str, unit: str, size: float, at: int) -> Term:
        columns = [by_compliance(baseline, place, (at + k, at + k)) for k in range(3)]
        return np.stack(columns, -1), named(name, unit, size, positive=True)

    def coupled(name: str, unit: str, size: float, at: int) -> Term:
        columns = [by_compliance(baseline, place, (at + i, at + j)) for i, j in ((0, 1), (0, 2), (1, 2))]
        return np.stack(columns, -1), tuple(
            Quantity(f"{name}_{a}{b}", unit, 0.3 * size, within=(f"{name}_{a}", f"{name}_{b}"))
            for a, b in ("xy", "xz", "yz")
        )

    turning = ("rotational_compliance", "rad/(N*m)", rotation, 3)
    sliding = ("translational_compliance", "m/N", translation, 0)
    return own(*turning), coupled(*turning), own(*sliding), coupled(*sliding)


def coupling_term(baseline: Baseline, place: Place, a: int, b: int, size: float) -> Term:
    """Return the entry that couples the slide along one axis with the rotation about another, 1/N."""
    pair = (f"translational_compliance_{'xyz'[a]}", f"rotational_compliance_{'xyz'[b]}")
    quantity = Quantity(f"coupling_{'xyz'[a]}_r{'xyz'[b]}", "1/N", size, within=pair)
    return by_compliance(baseline, place, (a, 3 + b)), (quantity,)


def any_compliance(baseline: Baseline, place: Place) -> Array:
    """Return the displacements (N, 6, 21) of all unit symmetric compliances of a place."""
    return np.stack([by_compliance(baseline, place, pair) for pair in PAIRS], -1)


def any_symmetric(baseline: Baseline, place: Place, sizes: Array, name: str) -> Shape:
    """Return the shape of any symmetric compliance of a place, of realistic sizes (6, 6); 0 is held."""
    pairs = [pair for pair in PAIRS if sizes[pair] > 0]
    columns = np.stack([by_compliance(baseline, place, pair) for pair in pairs], -1)
    units = ("m/N", "rad/N", "rad/(N*m)")

    def name_of(i: int, j: int) -> str:
        return f"compliance_{DIRECTIONS[i]}_{DIRECTIONS[j]}"

    quantities = tuple(
        Quantity(
            name_of(i, j),
            units[(i > 2) + (j > 2)],
            float(sizes[i, j]),
            positive=i == j,
            within=None if i == j else (name_of(i, i), name_of(j, j)),
        )
        for i, j in pairs
    )
    return Shape(name, columns, quantities, weight=0.5)


def by_side(baseline: Baseline, place: Place, at: int) -> Array:
    """Return the displacement (N, 6) of a place that gives to either side of a direction, 0..5, as to one.

    Beside a compliance it makes one side softer than the other: a seam that opens, a foot that lifts.
    """
    slip = loaded_less_unloaded(baseline, place.load[:, at], place.dead[:, at], np.abs)
    return place.shift[:, :, at] * slip[:, None]


def load_scales(baseline: Baseline, fitted: Place) -> dict[str, float]:
    """Return the largest force and moment of the rows that were fitted, N and N m, weight included."""
    sizes = [np.linalg.norm(most_of(fitted)[:, part], axis=1) for part in (slice(3), slice(3, 6))]
    return {
        name: stated_scale(baseline, name) or float(size.max(initial=0.0)) or 1.0
        for name, size in zip(("force", "moment"), sizes, strict=True)
    }


def by_power(share: Array, power: float) -> Array:
    """Return the slip under a share of the largest load that was fitted, by a power of it; odd.

    Powers above 1 go on along their tangent beyond that load, where nobody has seen how the place gives.
    """
    size = np.abs(share)
    seen = np.minimum(size, 1.0) if power > 1.0 else size
    return np.asarray(np.sign(share) * (seen**power + power * (size - seen)))


def by_contacts(
    baseline: Baseline,
    place: Place,
    scales: Mapping[str, float],
    rotation: float,
    translation: float,
    power: float = CONTACT,
) -> tuple[Term, Term]:
    """Return how a place that stiffens or softens displaces the rows: its rotations, its translations.

    Its slip goes by the power 2/3 of the load, as that of contacts does, or by the third power, as where a
    preload is used up and a seam opens (`SEAM`); the parameters are what it comes to under the largest load
    (`load_scales`), usually that of the compliances given.
    """
    how = "at_contacts" if power == CONTACT else "of_seams"

    def term(at: int, scale: float, quantities: Quantities) -> Term:
        def law(load: Array) -> Array:
            return by_power(load / scale, power)

        own = slice(at, at + 3)
        slip = loaded_less_unloaded(baseline, place.load[:, own], place.dead[:, own], law)
        return place.shift[:, :, own] * slip[:, None], quantities

    moment, force = scales["moment"], scales["force"]
    return (
        term(3, moment, named(f"rotation_{how}", "rad", rotation * moment, positive=True)),
        term(0, force, named(f"translation_{how}", "m", translation * force, positive=True)),
    )


def drive_compliance(axis: Axis) -> float:
    """Return the compliance of a drive as realistic sizes count it; of rigid ones a middling value."""
    middling = 3e-7 if axis.turns else 3e-9
    return 1.0 / axis.usual if FREE < axis.usual < RIGID else middling


def usual_stiffness(baseline: Baseline, name: str) -> float:
    """Return a drive's stiffness by which realistic sizes go: the file's, as much off as most drives are.

    Start values may be guesses, and what is fitted may have taken up the cause that is sought: the median
    change of the turning drives, which neither one guess nor one such fit moves, corrects the file's value.
    """
    return (baseline.given or baseline.nominal).parameter(name) * change_of_drives(baseline)


def change_of_drives(baseline: Baseline) -> float:
    """Return the median of fitted over given stiffness of the turning drives; 1 of fewer than three.

    A cause may bend the fit of a drive or two.
    """
    given, fitted = turning_drives(baseline.given or baseline.nominal), turning_drives(baseline.robot)
    changes = [fitted[name] / value for name, value in given.items() if name in fitted]
    return float(np.median(changes)) if len(changes) > 2 else 1.0


def softness(baseline: Baseline) -> float:
    """Return how soft a machine is over a heavy robot, by its stiffest turning drive; 1 where there is none.

    Realistic sizes of compliances are those of a heavy robot times this: what is usual of a small arm would
    not be believed of a large one.
    """
    drives = turning_drives(baseline.given or baseline.nominal)
    return HEAVY / (max(drives.values()) * change_of_drives(baseline)) if drives else 1.0


def turning_drives(robot: Robot) -> dict[str, float]:
    """Return the finite stiffness of a robot's turning drives, N m/rad, by its name."""
    own = {
        f"{joint.name}.torsional": joint.stiffness.torsional
        for joint in robot.joints
        if joint.variable is not None and own_direction(robot, joint.name) == "torsional"
    }
    return {name: value for name, value in own.items() if FREE < value < RIGID}


def unit_of(axis: Axis) -> str:
    """Return the unit of a slip: rad, or m."""
    return "rad" if axis.turns else "m"
