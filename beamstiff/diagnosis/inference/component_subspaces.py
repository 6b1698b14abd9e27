"""What every place could do at most: laws of their own, whatever their form.

A structure's place may follow any symmetric 6x6 compliance, yield more to one side than to the other and
more or less the more it is loaded. A drive's slip may be any curve of its torque, and may follow its angle,
its history and the time. `where` looks for the gap among these laws; a cause with a name has to explain it
better than they do.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.drive_stiffness import Following
from beamstiff.diagnosis.effects.external import POSTURES, by_posture, clock
from beamstiff.diagnosis.effects.hysteresis import BEGINNINGS, FEW, held_shares
from beamstiff.diagnosis.effects.torque_laws import (
    Axis,
    any_compliance,
    axis_at,
    by_law,
    by_slips,
    component_of,
    counted,
    drives,
    loaded_less_unloaded,
)
from beamstiff.diagnosis.inference.external_friction import lagging, slipping
from beamstiff.diagnosis.inference.library import Library
from beamstiff.diagnosis.inference.tool_ground_spring import held_tool, stopped, tethered
from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline
from beamstiff.diagnosis.residual.place import Place
from beamstiff.diagnosis.residual.whitened import LARGE, Whitened
from beamstiff.measure.arrays import places_of_each
from beamstiff.se3 import Array

KNEES = (0.02, 0.1, 0.25, 0.5)  # of the largest torque: where the free torque curve can bend
STEEP = 4.0  # how fast a place goes from one side to the other, over its usual load
TURN = 0.4  # rad or m over which a drive's stiffness may change with its angle
FADES = (1.0, 3.0, 10.0)  # usual times from state to state, over which a drive may remember its torque
ANGLES = 60  # about which it may change where rows are many
MODES = 16  # of a place's law
DIGITS = 12  # of shares of the largest torque: what is less is rounding
ABSORBED = 1e-6  # share of a column that the fit leaves, below which it leaves nothing
TETHERED = "is held by something that acts as a spring to the floor, a hose or a cable"
STOPPED = "comes up against something that stands still"
PLAY = "has play"
OPENING = "opens to one side, as where bolts are loose"
HINGES = 8  # evenly in half a turn, about which a foot may open: what lies between is a sum of two
ONE_SIDED = "stays softer to one side, whatever its torque"
CHANGING = "changes its stiffness with the time"
CREEPING = "creeps"
SOFTENING = "softens the more it carries"
GIVING = (0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.45)  # of the largest torque, beyond which it may
UNSTEADY = "has another compliance in every posture"
ASTRAY = "stands off otherwise in every posture"
SLIPPING = "slips against friction, so that what it does depends on the load history"
STICKING = "stick or drag behind what moves, as gauges do"
READINGS = "readings"
INSIDE = ("structure", "drive")  # families of effects whose places have laws of their own here


@dataclass(frozen=True, eq=False)
class ComponentSubspace:
    """Everything that a place could do.

    `place`: a joint's component, a link, ``base`` or ``tool``; outside the machine a frame, ``load`` and the
        like.
    `modes`: (n, m) array; its main modes, whitened, less what the fit absorbs; all together have mean square
        1.
    `inside`: whether it is a compliant place of the machine.
    `unmodelled`: dict of str to (n, k) array; main modes of what no effect of the library is, by what the
        place would do: play of the structure, friction at base and tool, a tether or a stop; of a drive what
        softens, stays softer to one side, changes with the time or from posture to posture, or creeps; of
        readings that they stick. Few enough each to be seen where all that the place could do is too much.
    """

    place: str
    modes: Array
    inside: bool = True
    unmodelled: Mapping[str, Array] = field(default_factory=dict)


def component_subspaces(baseline: Baseline, library: Library, white: Whitened) -> list[ComponentSubspace]:
    """Return the free laws of the structure's places, of the drives, and of all that is outside the machine.

    Of what is outside, all shapes of the library together count as free.
    """
    places, found = baseline.places, []
    for name, at in structure_places(baseline):
        compliance, bent, play = _of_structure(baseline, at)
        unmodelled = {PLAY: _modes(white, (play,))}
        if at is places.base or at is places.flange:
            unmodelled[SLIPPING] = _modes(white, (slipping(baseline, at),))
        if at is places.flange:
            held = held_tool(baseline)
            unmodelled[TETHERED] = _modes(white, tethered(baseline, held, white))
            unmodelled[STOPPED] = _modes(white, (stopped(held),))
        found.append(ComponentSubspace(name, _modes(white, (compliance, bent)), unmodelled=unmodelled))
    for drive in map(str, drives(baseline)):
        others = {does: law() for does, law in unmodelled_of_drive(baseline, drive).items()}
        unmodelled = {does: _modes(white, (law,)) for does, law in others.items()}
        softer = white.whiten_moved(softening_of(baseline, drive))
        if _softens(white, softer):
            unmodelled[SOFTENING] = _main(white, [softer])
        each = _by_posture(baseline, drive)
        unmodelled |= {does: _main(white, [white.whiten_moved(law)], POSTURES) for does, law in each.items()}
        found.append(
            ComponentSubspace(
                drive, _modes(white, (*_of_drive(baseline, drive), *others.values())), unmodelled=unmodelled
            )
        )
    outside: dict[str, list[Array]] = {READINGS: []}
    for one in library.hypotheses:
        if EFFECTS[one.effect].family not in INSIDE:
            lasting = [not item.posture_specific for item in one.shape.parameters]
            for place in one.places:
                outside.setdefault(place, []).append(one.columns[:, lasting])
    for place, columns in outside.items():
        stuck = {STICKING: _modes(white, (lagging(baseline),))} if place == READINGS else {}
        found.append(ComponentSubspace(place, _main(white, columns), inside=False, unmodelled=stuck))
    found = [
        replace(law, unmodelled={does: m for does, m in law.unmodelled.items() if m.shape[1]})
        for law in found
    ]
    return [law for law in found if law.modes.shape[1] or law.unmodelled]


def structure_places(baseline: Baseline) -> list[tuple[str, Place]]:
    """Return the places of the structure by name: joints, links, base and tool."""
    places, robot = baseline.places, baseline.nominal
    joints = [(component_of(robot, joint), places.joints[joint.name]) for joint in robot.joints]
    links = [(name, link) for name, link in places.links.items() if name not in places.standing]
    return [*joints, *links, ("base", places.base), ("tool", places.flange)]


def modes_of(laws: Sequence[ComponentSubspace], places: Collection[str], values: int) -> Array:
    """Return the modes (n, m) of some places, n whitened values, together of mean square 1; none is m = 0."""
    own = [law.modes for law in laws if law.place in places and law.modes.shape[1]]
    result: Array = np.concatenate([np.zeros((values, 0)), *own], axis=1) / np.sqrt(max(len(own), 1))
    return result


def _modes(white: Whitened, groups: Iterable[Array]) -> Array:
    """Return the main modes of kinds of freedom (N, 6, c), each with as much variance as the others."""
    return _main(white, [white.whiten_moved(group) for group in groups])


def _main(white: Whitened, groups: Sequence[Array], most: int = MODES) -> Array:
    """Return the main modes of groups of whitened columns (n, c); (n, 0) where the fit leaves none."""
    parts = []
    for whole in groups:
        columns = white.project_out(whole)
        size, before = np.linalg.norm(columns, axis=0), np.linalg.norm(whole, axis=0)
        # a column that is small beside the others of its kind moves nothing but by rounding
        kept = size > np.maximum(ABSORBED * before, ROUNDING * before.max(initial=0.0))
        if kept.any():
            parts.append(columns[:, kept] / size[kept] / np.sqrt(kept.sum()))
    if not parts:
        return np.zeros((white.gap.size, 0))
    whole = np.concatenate(parts, axis=1)
    # by the eigenvectors of the small side: LAPACK's quick singular values fail now and then on such columns
    _, vectors = np.linalg.eigh(whole.T @ whole)
    main = whole @ vectors[:, ::-1][:, : min(most, len(whole))]
    result: Array = main * np.sqrt(len(main)) / np.linalg.norm(main)
    return result


def _of_structure(baseline: Baseline, place: Place) -> tuple[Array, Array, Array]:
    """Return what any compliance (N, 6, 21), any bent law (N, 6, 18) and play (N, 6, 6) could do."""
    one_sided, grown = _bent(baseline, place, np.abs), _bent(baseline, place, lambda q: q * np.abs(q))
    sudden = play_of(baseline, place)
    return any_compliance(baseline, place), np.concatenate([one_sided, grown, sudden], -1), sudden


def play_of(baseline: Baseline, place: Place) -> Array:
    """Return what play of a place of the structure could do, (N, 6, 6)."""
    return _bent(baseline, place, lambda q: np.tanh(STEEP * q))


def opening_of(baseline: Baseline) -> Array:
    """Return how the base turns about hinges in the plane of its foot, and lifts, (N, 6, 16).

    Under moments to one side, and to the other: as where bolts are loose, and the foot turns about its edge.
    """
    place, angles = baseline.places.base, np.linspace(0.0, np.pi, HINGES, endpoint=False)
    hinges = np.stack([np.cos(angles), np.sin(angles)])
    moment, dead = place.load[:, 3:5] @ hinges, place.dead[:, 3:5] @ hinges
    turned, lifted = place.shift[:, :, 3:5] @ hinges, np.tile(place.shift[:, :, 2:3], HINGES)
    columns = []
    for side in (1.0, -1.0):
        slip = loaded_less_unloaded(baseline, side * moment, side * dead, partial(np.maximum, 0.0))[:, None]
        columns += [side * turned * slip, lifted * slip]
    return np.concatenate(columns, axis=-1)


def _bent(baseline: Baseline, place: Place, law: Callable[[Array], Array]) -> Array:
    """Return what a law of each of the six loads over its usual size does, (N, 6, 6)."""
    usual = np.sqrt((place.load**2).mean(axis=0) + (place.dead**2).mean(axis=0))
    usual = np.where(usual > 0, usual, 1.0)
    slips = loaded_less_unloaded(baseline, place.load, place.dead, lambda load: law(load / usual))
    return place.shift * slips[:, None]


def _of_drive(baseline: Baseline, name: str) -> list[Array]:
    """Return the laws (N, 6, c) with a name that a drive could follow."""
    axis = axis_at(baseline, name)
    torque = counted(baseline, axis) / axis.typical

    def bent(torque: Array, at: float, side: float) -> Array:
        return np.clip(side * torque / (at * axis.typical), 0.0, 1.0)

    bends = [by_law(baseline, axis, partial(bent, at=at, side=side)) for at in KNEES for side in (1.0, -1.0)]
    named = [np.stack(bends, -1)]
    if axis.joint.variable is not None:
        follow = Following(baseline, axis.joint.variable)
        at = follow.fitted
        if len(baseline.rows) > LARGE:  # as many angles as rows would tell no more of so smooth a law
            at = np.quantile(follow.angle, np.linspace(0.0, 1.0, ANGLES))
        near = np.exp(-0.5 * ((follow.angle[:, None] - at) / TURN) ** 2)
        grown = torque * np.abs(torque)
        named += [by_slips(axis.shift, course[:, None] * near) for course in (torque, grown)]
    begun = [(ways, wound) for _, ways, wound in BEGINNINGS if len(ways) <= FEW]
    held = [held_shares(baseline, axis, ways, wound) for ways, wound in begun]
    friction = np.concatenate([one.reshape(len(one), -1) for one in held], axis=1)
    if baseline.absolute:  # held alike everywhere it is an encoder's zero
        friction = np.round(friction - friction.mean(axis=0), DIGITS)
    return [*named, by_slips(axis.shift, friction)]


def unmodelled_of_drive(baseline: Baseline, name: str) -> dict[str, Callable[[], Array]]:
    """Return the laws without a name that a drive could follow, whichever sign; each finds its (N, 6, c)."""
    axis, time = axis_at(baseline, name), clock(baseline)

    def changing() -> Array:
        torque = counted(baseline, axis) / axis.typical
        return by_slips(axis.shift, torque[:, None] * np.stack([time, time**2], -1))

    return {
        ONE_SIDED: lambda: np.stack([by_law(baseline, axis, law) for law in (np.abs, np.square)], -1),
        CHANGING: changing,
        CREEPING: lambda: by_slips(axis.shift, _remembered(baseline, axis, time)),
    }


def softening_of(baseline: Baseline, name: str) -> Array:
    """Return what a drive yields more beyond each torque at which it may begin to, (N, 6, m)."""
    axis = axis_at(baseline, name)

    def beyond(torque: Array, at: float) -> Array:
        return np.sign(torque) * np.maximum(np.abs(torque) - at * axis.typical, 0.0)

    return np.stack([by_law(baseline, axis, partial(beyond, at=at)) for at in GIVING], -1)


def _softens(white: Whitened, columns: Array) -> bool:
    """Return whether the gap shows a drive that softens: one that hardens has the same laws backwards."""
    left = white.project_out(columns)
    size = np.linalg.norm(left, axis=0)
    kept = size > ABSORBED * np.linalg.norm(columns, axis=0)
    if not kept.any():
        return False
    factor = np.linalg.lstsq(
        left[:, kept] / size[kept], white.project_out(white.gap[:, None])[:, 0], rcond=1e-3
    )[0]
    return bool((1.0 - np.array(GIVING)[kept]) @ (factor / size[kept]) > 0)


def _by_posture(baseline: Baseline, name: str) -> dict[str, Array]:
    """Return what a drive could do that is another in every posture, (N, 6, postures); see `by_posture`."""
    axis, there = axis_at(baseline, name), by_posture(baseline)
    if not there.shape[1]:
        return {}
    torque = counted(baseline, axis) / axis.typical
    gains = {UNSTEADY: by_slips(axis.shift, torque[:, None] * there)}
    return gains | ({ASTRAY: by_slips(axis.shift, there.astype(np.float64))} if baseline.absolute else {})


def _remembered(baseline: Baseline, axis: Axis, time: Array) -> Array:
    """Return the torques over the largest, of load and of weight, as memories of them fade, (N, m).

    Since the first state of a pose, at which the weight's torque is another than before, too; what the weight
    does shows only where most poses were read more than once.
    """
    rows = baseline.rows
    torque = np.stack([axis.load, axis.dead], -1) / axis.typical
    if np.median(np.unique(rows.pose, return_counts=True)[1]) < 2:
        torque = torque[:, :1]
    rates = np.tile(np.reciprocal(FADES), (torque.shape[1], 1)).T
    result = np.zeros((len(rows), *rates.shape))
    poses = [at[np.argsort(time[at], kind="stable")] for at in places_of_each(rows.pose)]
    steps = np.concatenate([np.diff(time[at]) for at in poses])
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    for at in poses:
        held = np.zeros_like(rates)
        passed = np.diff(time[at], prepend=time[at[0]] - usual) / usual
        for row, lasted in zip(at, passed, strict=True):
            keep = np.exp(-lasted * rates)
            held = keep * held + (1.0 - keep) * torque[row]
            result[row] = held
    return result.reshape(len(rows), -1)
