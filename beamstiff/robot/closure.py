"""Loop closure: the passive variables that close all loops, at many poses at once.

Gauss-Newton from the declared guess with limited steps, so that it stays in the guess's assembly branch;
poses that did not close, or closed in another branch, are reached by continuation from a good pose nearby.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.assemblies import NEAR_GUESS, Closest, closest_assemblies, equally_near, geometry_key
from beamstiff.robot.branch import NEAR_SINGULAR, Assembly, assembly_at, margin, near_singular, scattered
from beamstiff.robot.continuation import close_in_branch, grid_of_starts, search_width
from beamstiff.robot.forward import body_of, screws_of
from beamstiff.robot.frames import Kinematics, all_values
from beamstiff.robot.loops import LoopSystem, equations_at, loop_equations, loop_system, recorded
from beamstiff.robot.newton import Mask, newton
from beamstiff.se3 import Array

HELD = 1e-6  # gap per motion, in machine sizes and rad, that no passive motion makes up for
FAR = np.radians(30.0)  # from the guesses, that the nearest assembly is worth a note; 1 rad is a machine size
CHOICE = "assembly: in the robot file, --assembly of a command"
FOLD = 0.1  # of the margin of the assembly's own posture: of a parallelogram at right angles, 6 deg
FASTEST = 1e4  # scaled passive variable by actuated ones: beyond it a posture is a dead centre
GRID = 512  # poses: for fewer it is not worth making a grid of starts
SCATTERED = 48  # starts where the guess does not lead to a closed posture


class Closure(NamedTuple):
    """Postures with the loops closed where they can be."""

    values: Array  # (P, V), rad or m: all variables; NaN for those that depend on a loop that is not closed
    closed: Mask  # (P,)
    reasons: tuple[str, ...]  # why a pose does not close, empty where it does


def close_loops(kinematics: Kinematics, q: Array, strict: bool = True, near: Array | None = None) -> Closure:
    """Return all variables at actuated ones (P, A), loops closed; an error if `strict` where they cannot.

    `near` (P, V): all variables where almost the same loops are closed at almost these poses, to start from.
    """
    if not kinematics.loops or len(q) == 0:
        values = all_values(kinematics, _with_passive(kinematics, q, 0.0))
        return Closure(values, np.ones(len(q), dtype=np.bool_), ("",) * len(q))
    if near is None and len(q) < GRID:  # robots that differ in stiffness close alike at the rows of a table
        kept = _closed_once(_Poses(_closure_key(kinematics, q), kinematics, q))
        found = Closure(kept.values.copy(), kept.closed.copy(), kept.reasons)
    else:
        found = _close(kinematics, q, near)
    if strict and not found.closed.all():
        raise BeamstiffError(found.reasons[int(np.argmin(found.closed))])
    return found


def _with_passive(kinematics: Kinematics, q: Array, passive: Array | float) -> Array:
    """Return the free variables (P, A + Q) at actuated ones (P, A), passive ones (Q,) alike at all poses."""
    joined = kinematics.coupling
    free = np.empty((len(q), len(joined.free)))
    free[:, : joined.actuated], free[:, joined.actuated :] = q, passive
    return free


@dataclass(frozen=True)
class _Poses:
    """Kinematics at some poses, by what their closure depends on."""

    key: tuple[object, ...]
    kinematics: Kinematics = field(compare=False)
    q: Array = field(compare=False)


def _closure_key(kinematics: Kinematics, q: Array) -> tuple[object, ...]:
    robot, one = kinematics.robot, kinematics.assembly
    names = tuple(loop.name for loop in kinematics.loops)
    taken = one and (one.free.tobytes(), one.jacobian.tobytes())
    return (*geometry_key(kinematics, declared_start(kinematics)), robot.assembly, names, taken, q.tobytes())


@lru_cache(maxsize=128)
def _closed_once(poses: _Poses) -> Closure:
    return _close(poses.kinematics, poses.q, None)


def _close(kinematics: Kinematics, q: Array, near: Array | None) -> Closure:
    """Return what `close_loops` does where there are loops, NaN where they do not close."""
    joined, poses, system = kinematics.coupling, len(q), loop_system(kinematics)
    free = _with_passive(kinematics, q, declared_start(kinematics)[joined.actuated :])
    assembly = kinematics.assembly or _assembly_near(system, free)
    if assembly is None:  # poses so singular that they have no branches
        passive = len(joined.free) - joined.actuated
        assembly = Assembly(free[0], np.zeros((system.rows[-1].stop, passive)), ())
    starts = (
        None if near is None else near[:, [joined.names.index(x) for x in joined.free[joined.actuated :]]]
    )
    if poses >= GRID:
        system = recorded(system)
        if starts is None and kinematics.assembly:
            starts = grid_of_starts(system, assembly).passive(q)
    free, gaps, closed, flipped = close_in_branch(system, assembly, free, starts)
    at_dead_centre = _at_dead_centre(system, free, closed)
    closed = closed & ~at_dead_centre
    reasons = [""] * poses
    for pose in np.flatnonzero(~closed):
        if at_dead_centre[pose]:
            to_passive = loop_equations(system, free[[pose]])[1][:, :, joined.actuated :]
            reasons[pose] = _undetermined(system, free[[pose]], to_passive, 0, int(pose))
        else:
            reasons[pose] = _reason(system, free[pose], gaps[pose], int(pose), bool(flipped[pose]))
    free[~closed, joined.actuated :] = np.nan
    values = all_values(kinematics, np.where(np.isnan(free), 0.0, free))
    depends = (joined.matrix[:, joined.actuated :] != 0.0).any(axis=1)
    values[np.ix_(~closed, depends)] = np.nan
    return Closure(values, closed, tuple(reasons))


def free_of(kinematics: Kinematics, values: Array) -> Array:
    """Return the free variables (P, A + Q) among all values (P, V)."""
    joined = kinematics.coupling
    return values[:, [joined.names.index(name) for name in joined.free]]


def near_fold(kinematics: Kinematics, values: Array) -> Mask:
    """Return at which closed postures (P, V) the loops are near to where two assemblies meet, (P,).

    Beyond such a fold, where a parallelogram is flat, the other assembly may close under the same name.
    """
    joined, assembly = kinematics.coupling, kinematics.assembly
    if assembly is None or not len(values):
        return np.zeros(len(values), dtype=np.bool_)
    free = free_of(kinematics, values)
    jacobian = loop_equations(loop_system(kinematics), free)[1][:, :, joined.actuated :]
    return np.asarray(margin(jacobian) < FOLD * margin(assembly.jacobian[None]))


def closure_rates(kinematics: Kinematics, values: Array, transforms: Array) -> Array:
    """Return how the passive variables follow the actuated ones, (P, Q, A): ``-pinv(J_p) J_a``."""
    joined = kinematics.coupling
    if not kinematics.loops or not len(values):
        return np.zeros((len(values), len(joined.free) - joined.actuated, joined.actuated))
    system = loop_system(kinematics)
    free = free_of(kinematics, values)
    bodies = {frame: body_of(transforms[:, frame]) for frame in system.frames}
    _, jacobian = equations_at(system, bodies, screws_of(kinematics, values, transforms, system.frames))
    to_actuated, to_passive = np.split(jacobian, [joined.actuated], axis=2)
    u, s, vt = np.linalg.svd(to_passive, full_matrices=False)
    singular = (s.min(axis=1, initial=np.inf) <= NEAR_SINGULAR * s.max(axis=1, initial=0.0)) & (
        s.shape[1] > 0
    )
    if singular.any():
        raise BeamstiffError(_undetermined(system, free, to_passive, int(np.argmax(singular))))
    rates = -np.swapaxes(vt, 1, 2) @ ((np.swapaxes(u, 1, 2) @ to_actuated) / s[:, :, None])
    kept_open = np.abs(to_actuated + to_passive @ rates)
    if kept_open.max(initial=0.0) > HELD:
        pose, row, column = np.unravel_index(np.argmax(kept_open), kept_open.shape)
        loop = next(loop for loop, part in zip(kinematics.loops, system.rows, strict=True) if row < part.stop)
        raise BeamstiffError(
            f"loop {loop.name!r} holds the actuated variable {joined.free[column]!r} at "
            f"{_where(system, free[pose])} (pose {pose}): too few of its variables are passive"
        )
    return np.asarray(rates * system.scale[joined.actuated :, None] / system.scale[: joined.actuated])


def assembled(kinematics: Kinematics) -> Kinematics:
    """Return the kinematics with the assembly that the robot names or its guesses mean, if any loop closes.

    An error where no loop determines a passive variable, no assembly has the name, or two are equally near to
    the guesses.
    """
    assembly, closest = _assembled_once(
        _Poses(_closure_key(kinematics, np.zeros(0)), kinematics, np.zeros(0))
    )
    return replace(kinematics, assembly=assembly, closest=closest) if closest else kinematics


@lru_cache(maxsize=128)
def _assembled_once(poses: _Poses) -> tuple[Assembly | None, tuple[Closest, ...]]:
    kinematics = poses.kinematics
    system, start, name = loop_system(kinematics), declared_start(kinematics), kinematics.robot.assembly
    _check_determined(system, start)
    closest = closest_assemblies(system, start, name)
    head = f"robot {kinematics.robot.name!r}"
    if name is not None and (not closest or closest[0].name != name):
        raise BeamstiffError(
            f"{head}: found assembly {name!r}, expected "
            + (
                f"one of {listed(one.name for one in closest)}"
                if closest
                else "none: no posture was found closed"
            )
        )
    if not closest:
        return None, closest
    if len(closest) > 1 and equally_near(*closest[:2]):
        told = "; ".join(assembly_text(kinematics, one) for one in closest)
        way = "" if name else f"name it ({CHOICE}), or "
        raise BeamstiffError(
            f"{head}: two ways to put its loops together are equally near to the guesses: {told}: {way}give "
            "guesses that are nearer to one of them, or limits that only one of them keeps"
        )
    return assembly_at(system, closest[0].free), closest


def every_assembly(kinematics: Kinematics) -> tuple[Closest, ...]:
    """Return all assemblies that were found within the limits, the nearest to the guesses first."""
    if not kinematics.loops:
        return ()
    return closest_assemblies(loop_system(kinematics), declared_start(kinematics), "")


def assembly_doubts(kinematics: Kinematics) -> tuple[str, ...]:
    """Return, one sentence each, why the assembly taken may not be the one meant; mostly nothing."""
    if not kinematics.loops or kinematics.robot.assembly is not None:
        return ()
    if not kinematics.closest:
        return (
            f"robot {kinematics.robot.name!r}: no assembly was found from the guesses: where the loops close "
            "they may do so in another than is meant; give nearer guesses",
        )
    taken, rivals = kinematics.closest[0], kinematics.closest[1:]
    head = f"robot {kinematics.robot.name!r}: the loops are put together at"
    if rivals and rivals[0].farthest < NEAR_GUESS:
        return (
            f"{head} {assembly_text(kinematics, taken)}; but another assembly is near the guesses too, at "
            f"{assembly_text(kinematics, rivals[0])}: look which is meant and name it ({CHOICE}), or give "
            "nearer guesses or limits",
        )
    if taken.farthest > FAR:
        return (
            f"{head} {assembly_text(kinematics, taken)}, far from the guesses: look whether this is the "
            f"assembly meant and name it ({CHOICE}), or give nearer guesses",
        )
    return ()


def assembly_text(kinematics: Kinematics, closest: Closest) -> str:
    """Return an assembly in words: name, passive variables there, and how far they are off their guesses."""
    joined, first = kinematics.coupling, kinematics.coupling.actuated
    names, found = joined.free[first:], closest.free[first:]
    lengths = kinematics.prismatic[[joined.names.index(name) for name in names]]
    off = np.abs(found - declared_start(kinematics)[first:])
    values = listed(
        (
            f"{name} = {value * 1e3:.4g} mm" if length else f"{name} = {np.degrees(value):.4g} deg"
            for name, value, length in zip(names, found, lengths, strict=True)
        ),
        most=6,
    )
    ways = [f"{np.degrees(off[~lengths].max()):.2g} deg"] if not lengths.all() else []
    ways += [f"{off[lengths].max() * 1e3:.2g} mm"] if lengths.any() else []
    return f"{values} (assembly {closest.name!r}, {' and '.join(ways)} off)"


def declared_start(kinematics: Kinematics) -> Array:
    """Return the declared guess of every free variable, (A + Q,): else the middle of its limits, or 0."""
    declared = {variable.name: variable for variable in kinematics.robot.variables}
    start = []
    for name in kinematics.coupling.free:
        variable = declared[name]
        if variable.limits is not None and "guess" not in variable.model_fields_set:
            start.append(0.5 * sum(variable.limits))
        else:
            start.append(variable.guess)
    return np.array(start, dtype=np.float64)


def _assembly_near(system: LoopSystem, free: Array) -> Assembly | None:
    """Return the assembly at that of some postures (P, A + Q) which closes nearest to where it starts.

    Where none closes from there, from starts all over the passive variables: a guess may be far off.
    """
    first = system.actuated
    few = free[np.unique(np.linspace(0, len(free) - 1, 32).astype(np.intp))]
    width = search_width(system)
    shifts = np.random.default_rng(0).uniform(-1.0, 1.0, (SCATTERED, free.shape[1] - first)) * width
    anywhere = np.repeat(few, SCATTERED, axis=0)
    anywhere[:, first:] += np.tile(shifts, (len(few), 1))
    for start, origin in ((free, free), (anywhere, np.repeat(few, SCATTERED, axis=0))):
        found, _, _, closed = newton(system, start)
        away = np.abs((found - origin)[:, first:] / system.scale[first:]).max(axis=1, initial=0.0)
        for pose in np.argsort(np.where(closed, away, np.inf))[: min(8, int(closed.sum()))]:
            assembly = assembly_at(system, found[pose])
            if assembly is not None:
                return assembly
    return None


def _at_dead_centre(system: LoopSystem, free: Array, closed: Mask) -> Mask:
    """Return which closed postures (P, A + Q) are too near a dead centre for what follows from them, (P,).

    There the drives move passive variables out of all proportion, by 1/s, s being the least singular value of
    ``J_p``, and rounding in the gaps does too: what follows is off by about ``1e-16 / s^2``. Where the drives
    do not cause the motion (a universal joint in line with its leg, a parallelogram at its change point), it
    is no dead centre.
    """
    first, at_dead_centre = system.actuated, closed.copy()
    jacobian = loop_equations(system, free[closed])[1]
    near = np.flatnonzero(near_singular(jacobian[:, :, first:]))
    at_dead_centre[closed] = False
    if len(near):
        u, s, _ = np.linalg.svd(jacobian[near, :, first:], full_matrices=False)
        driven = np.einsum("pm,pma->pa", u[:, :, -1], jacobian[near, :, :first])
        at_dead_centre[np.flatnonzero(closed)[near]] = np.linalg.norm(driven, axis=1) > FASTEST * s[:, -1]
    return at_dead_centre


def _reason(system: LoopSystem, free: Array, gaps: Array, pose: int, flipped: bool) -> str:
    kinematics = system.kinematics
    sizes = [float(np.linalg.norm(gaps[part])) for part in system.rows]
    worst = int(np.argmax(sizes))
    loop, part = kinematics.loops[worst], system.rows[worst]
    at = f"at {_where(system, free)} (pose {pose})"
    if flipped:
        return (
            f"loop {loop.name!r} cannot close {at} in the assembly branch of its guess, only in another one"
        )
    gap = f"{np.linalg.norm(gaps[part][:3]) * kinematics.size * 1e3:.4g} mm"
    if loop.constrain == "pose":
        gap += f" and {np.linalg.norm(gaps[part][3:]):.4g} rad"
    return f"loop {loop.name!r} cannot close {at}: {gap} remain between {loop.a!r} and {loop.b!r}"


def _where(system: LoopSystem, free: Array) -> str:
    joined = system.kinematics.coupling
    prismatic = dict(zip(joined.names, system.kinematics.prismatic, strict=True))
    return (
        listed(
            (
                f"{name} = {value:.6g} {'m' if prismatic[name] else 'rad'}"
                for name, value, moving in zip(joined.free, free, system.moving, strict=False)
                if moving
            ),
            most=12,
        )
        or "any pose"
    )


def _check_determined(system: LoopSystem, start: Array) -> None:
    """Refuse passive variables that no loop determines: they would stay at their guess unnoticed."""
    # anywhere: a rank that is missing in open loops is missing in closed ones too
    jacobian = loop_equations(system, scattered(system, start))[1][:, :, system.actuated :]
    passive = jacobian.shape[2]
    if np.linalg.matrix_rank(jacobian, rtol=1e-9).max() < passive:
        alone, _ = _moved_alone(system, jacobian[0], 1e-6)
        raise BeamstiffError(
            f"robot {system.kinematics.robot.name!r}: the passive variables {listed(alone)} are not "
            f"determined by its loops {listed(loop.name for loop in system.kinematics.loops)}: "
            "constrain more or lock some"
        )


def _moved_alone(system: LoopSystem, to_passive: Array, least: float) -> tuple[list[str], Array]:
    """Return the passive variables of the motion that moves J_p (M, Q) least, and their shares of it (Q,)."""
    motion = np.abs(np.linalg.svd(to_passive)[2][-1])
    names = system.kinematics.coupling.free[system.actuated :]
    return [name for name, share in zip(names, motion, strict=True) if share > least], motion


def _undetermined(
    system: LoopSystem, free: Array, to_passive: Array, at: int, pose: int | None = None
) -> str:
    """Say which passive variables can move by themselves, and in which loops; `at` of the rows, as `pose`."""
    pose = at if pose is None else pose
    names, motion = _moved_alone(system, to_passive[at], 1e-3)
    loops = [
        loop.name
        for loop, part in zip(system.kinematics.loops, system.rows, strict=True)
        if (np.abs(to_passive[at, part]) @ motion).max() > 1e-6
    ]
    where = f"loop {listed(map(repr, loops))}" if loops else "no loop"
    return (
        f"{where} leaves the passive variables {listed(names)} undetermined at "
        f"{_where(system, free[at])} (pose {pose}): a singular posture, or too few constraints"
    )
