"""The ways to put closed loops together, and which of them the guesses mean.

The guess says where the passive variables are, not at which posture of the drives. So every closed posture
within the limits counts, and the assembly is the one that comes nearest to the guess anywhere: many starts
are closed, and each is moved along its own assembly towards the guess, the actuated variables following as
far as they need to. Angles are counted without whole turns.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from beamstiff.robot.branch import Assembly, assembly_at, near_singular
from beamstiff.robot.continuation import continuation, search_width
from beamstiff.robot.forward import forward, node_positions
from beamstiff.robot.frames import MOTIONS, Kinematics, all_values
from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.robot.newton import LARGEST_SHIFT, LARGEST_STEP, Mask, newton
from beamstiff.se3 import Array

STARTS = 64  # a third of them at the guess itself, at drawn actuated variables
ENOUGH = 16  # closed postures: for fewer, as many starts again are tried, since platforms close rarely
MOST_ROUNDS = 8
CLOSING = 6  # steps of all variables together before the passive ones alone close the loops
STEPS = 40  # towards the guess
CORRECTING = 2  # steps of all variables together after each of them
LEAST_STEP = 0.01  # rad and machine sizes: below it a posture has arrived
EASE = 0.02  # weight of the actuated variables beside the passive ones: they follow, half a turn for 4 deg
NEAR_GUESS = np.radians(60.0)  # an assembly within it may have been meant by a guess that is 45 deg off
MUCH = 1.1  # an assembly whose distance is less than this times another's is as near
ROUNDING = 1e-6  # rad: two assemblies that both keep to the guesses exactly
CLOSED = 1e-3  # machine sizes and rad, on the way to the guess
ALIKE = 0.02  # rad and machine sizes: two ends of the way to the guess
SAME_PLACE = 1e-4  # machine sizes: nodes that coincide, postures that are one


@dataclass(frozen=True, eq=False)
class Closest:
    """An assembly where it comes nearest to the guess."""

    # a sign for each block of the closure equations that has a branch of its own, in the order of the passive
    # variables (`Assembly.patterns`); of several of the same signs all but the nearest have a number: ``+2``
    name: str
    free: Array  # (A + Q,), rad or m: actuated and passive variables there
    # rad: root sum of squares of what the variables are off the guess, the actuated ones (off the middle of
    # their limits) by `EASE` only; one machine size counts as 1 rad
    distance: float
    farthest: float  # rad: of the passive variable that is off most

    @property
    def signs(self) -> str:
        """The name without its number."""
        return self.name.rstrip("0123456789")


def equally_near(one: Closest, other: Closest) -> bool:
    """Return whether the guess does not decide between two assemblies."""
    near, far = sorted((one.distance, other.distance))
    return far < MUCH * near + ROUNDING


@dataclass(frozen=True)
class _Geometry:
    """A system and its guess, by what the search depends on: robots of one key share its result."""

    key: tuple[object, ...]
    system: LoopSystem = field(compare=False)
    guess: Array = field(compare=False)


def closest_assemblies(system: LoopSystem, guess: Array, name: str | None = None) -> tuple[Closest, ...]:
    """Return the assemblies where they come nearest to the guess (A + Q,), the nearest first, two at most.

    Two closed postures are one assembly where the one is reached from the other without passing a singular
    posture, along a straight line of the actuated variables; or where all nodes coincide, as with the two
    ways to write the angles of a universal joint. The second is left out where nobody would take it for the
    first: farther from the guess than `NEAR_GUESS`, and than the first by more than `MUCH`.

    With a name, the assembly called so comes first, and after it only what the guess does not tell from it
    although it has the same signs. Where none is called so, all there are: the name ``""`` asks for them.
    """
    near = _closest(_Geometry(geometry_key(system.kinematics, guess, ALIKE), system, guess), name)
    if near:  # a calibration goes through hundreds of geometries that are nearly one
        free, _, _, closed = newton(system, np.array([one.free for one in near]))
        moved = np.abs(free - [one.free for one in near]) / system.scale
        if closed.all() and moved.max() < 10.0 * ALIKE:
            return tuple(replace(one, free=here) for one, here in zip(near, free, strict=True))
    return _closest(_Geometry(geometry_key(system.kinematics, guess), system, guess), name)


def geometry_key(kinematics: Kinematics, guess: Array, alike: float = 0.0) -> tuple[object, ...]:
    """Return what closed loops depend on; geometries apart by some `alike` (rad, machine sizes) are one."""
    size = float(10.0 ** np.round(np.log10(kinematics.size), 1))
    lengths = np.array([size if kind == "shift" else 1.0 for _, kind, _ in MOTIONS])

    def rounded(values: Array, unit: Array | float) -> bytes:
        return np.round(values / (alike * unit)).tobytes() if alike else values.tobytes()

    ends = tuple(
        (loop.constrain, loop.frame_a, rounded(loop.at_a, size), loop.frame_b, rounded(loop.at_b, size))
        for loop in kinematics.loops
    )
    limits = tuple((item.name, item.limits) for item in kinematics.robot.variables)
    joined = kinematics.coupling
    return (
        rounded(kinematics.constants, lengths),
        rounded(kinematics.node_at, size),
        kinematics.node_frame.tobytes(),
        kinematics.coefficients.tobytes(),
        kinematics.parents.tobytes(),
        (
            joined.free,
            joined.matrix.tobytes(),
            rounded(joined.offset, np.where(kinematics.prismatic, size, 1.0)),
        ),
        (guess.tobytes(), limits, ends, alike),
    )


@lru_cache(maxsize=256)
def _closest(geometry: _Geometry, name: str | None) -> tuple[Closest, ...]:
    system, (postures, patterns, distance, farthest) = geometry.system, _nearest_postures(geometry)
    if not patterns:
        return ()
    near = (farthest < NEAR_GUESS) | (distance < MUCH * distance[0])
    near[0] = True
    left = np.arange(len(patterns) if name is not None else np.flatnonzero(near)[-1] + 1)
    found: list[Closest] = []
    named: list[Closest] = []
    while left.size and not (named and not equally_near(named[0], found[-1])):
        same = _same(system, postures[left[0]], postures[left])
        same[0] = True
        at, signs = int(left[0]), patterns[left[0]]
        rival = left[same & near[left]]
        if name is None and found and rival.size:
            at = int(rival[0])
        number = 1 + sum(one.signs == signs for one in found)
        called = f"{signs}{number}" if number > 1 else signs
        found.append(Closest(called, postures[at], float(distance[at]), float(farthest[at])))
        if name is None and len(found) > 1 and rival.size:
            return found[0], found[-1]
        named += [found[-1]] * (called == name)
        left = left[~same]
    if named:
        rivals = (one for one in found if one is not named[0] and one.signs == named[0].signs)
        return named[0], *(one for one in rivals if equally_near(one, named[0]))
    return tuple(found[:1] if name is None else found)


@lru_cache(maxsize=8)
def _nearest_postures(geometry: _Geometry) -> tuple[Array, list[str], Array, Array]:
    """Return closed postures (P, A + Q), as near to the guess as they came, the nearest first.

    With the signs of their blocks, and their `distance` and `farthest` (P,) as of `Closest`.
    """
    system, guess = geometry.system, geometry.guess
    low, high = _limits(system, guess)
    postures, signs, reference = _closed_postures(system, guess, low, high)
    if reference is None:
        return postures, [], np.zeros(0), np.zeros(0)
    postures = _towards(system, reference, signs, postures, guess, low, high)
    postures, _, jacobian, closed = newton(system, postures)
    postures[:, system.actuated :] = _unwound(system, postures, guess)
    keep = closed & (reference.signs(jacobian) == signs).all(axis=1) & ~near_singular(jacobian)
    keep &= ((postures >= low - 1e-9) & (postures <= high + 1e-9)).all(axis=1)
    postures, jacobian = postures[keep], jacobian[keep]
    away = np.abs(postures - guess) / system.scale
    off = away[:, system.actuated :]
    distance = np.hypot(
        np.linalg.norm(off, axis=1), EASE * np.linalg.norm(away[:, : system.actuated], axis=1)
    )
    order = np.argsort(distance, kind="stable")
    signed = np.concatenate([postures / system.scale, reference.signs(jacobian)], axis=1)
    order = order[_distinct(signed[order])]  # at a dead centre two assemblies are alike but for their signs
    farthest = off.max(axis=1, initial=0.0)
    return postures[order], reference.patterns(jacobian[order]), distance[order], farthest[order]


def _distinct(rows: Array) -> NDArray[np.intp]:
    """Return the first of rows (P, n) that are alike, in their order."""
    left, kept = np.arange(len(rows)), []
    while left.size:
        kept.append(left[0])
        left = left[np.abs(rows[left] - rows[left[0]]).max(axis=1) > ALIKE]
    return np.array(kept, dtype=np.intp)


def _limits(system: LoopSystem, guess: Array) -> tuple[Array, Array]:
    """Return the limits of the free variables, (A + Q,): the declared ones, else none."""
    declared = {item.name: item.limits for item in system.kinematics.robot.variables}
    box = [declared[name] or (-np.inf, np.inf) for name in system.kinematics.coupling.free]
    low, high = np.array(box, dtype=np.float64).T
    still = ~system.moving  # moves no loop
    low[: system.actuated][still] = high[: system.actuated][still] = guess[: system.actuated][still]
    return low, high


def _closed_postures(
    system: LoopSystem, guess: Array, low: Array, high: Array
) -> tuple[Array, Array, Assembly | None]:
    """Return closed postures (P, A + Q) all over the limits, the signs of their branches, the reference."""
    first, random = system.actuated, np.random.default_rng(0)
    wide = np.where(system.prismatic, system.scale, np.pi)[:first]
    from_, to = np.maximum(low[:first], guess[:first] - wide), np.minimum(high[:first], guess[:first] + wide)
    found: list[tuple[Array, Array]] = []
    while len(found) < MOST_ROUNDS and sum(len(postures) for postures, _ in found) < ENOUGH:
        starts = np.tile(guess, (STARTS, 1))
        starts[not found :, :first] = random.uniform(from_, to, (STARTS - (not found), first))
        shifts = random.uniform(-1.0, 1.0, (STARTS, len(guess) - first)) * search_width(system)
        shifts[: STARTS // 3] = 0.0
        starts[:, first:] += shifts
        starts = _drawn_together(system, starts, low, high, CLOSING)
        closing, _, jacobian, closed = newton(system, starts, iterations=30)
        good = closed & ~near_singular(jacobian)
        found.append((closing[good], jacobian[good]))
    postures, jacobian = (np.concatenate(parts) for parts in zip(*found, strict=True))
    reference = next((one for posture in postures if (one := assembly_at(system, posture)) is not None), None)
    if reference is None:
        return postures[:0], np.zeros((0, 0)), None
    return postures, reference.signs(jacobian), reference


def _towards(
    system: LoopSystem,
    reference: Assembly,
    signs: Array,
    postures: Array,
    guess: Array,
    low: Array,
    high: Array,
) -> Array:
    """Move closed postures towards the guess, each along its own assembly.

    Steps are halved where the branch would be left.
    """
    first, scale = system.actuated, system.scale
    postures, part = postures.copy(), np.ones(len(postures))
    gaps, jacobian = loop_equations(system, postures)
    active = np.arange(len(postures))
    for _ in range(STEPS):
        if not active.size:
            break
        here = postures[active]
        here[:, first:] = _unwound(system, here, guess)
        step = _step(system, here, guess - here, gaps[active], jacobian[active], low, high)
        step *= part[active, None]
        # all variables close it again: past a dead centre the passive ones alone cannot, close to it hardly
        trial = _drawn_together(system, np.clip(here + step * scale, low, high), low, high, CORRECTING)
        trial_gaps, trial_jacobian = loop_equations(system, trial)
        to_passive = trial_jacobian[:, :, first:]
        stays = (np.linalg.norm(trial_gaps, axis=1) < CLOSED) & ~near_singular(to_passive)
        stays &= (reference.signs(to_passive) == signs[active]).all(axis=1)
        taken = active[stays]
        postures[taken] = trial[stays]
        gaps[taken], jacobian[taken] = trial_gaps[stays], trial_jacobian[stays]
        part[active] = np.where(stays, np.minimum(1.5 * part[active], 1.0), 0.5 * part[active])
        active = active[(np.abs(step).max(axis=1, initial=0.0) > LEAST_STEP) & (part[active] > 1e-2)]
    return _drawn_together(system, postures, low, high, CLOSING)


def _drawn_together(system: LoopSystem, starts: Array, low: Array, high: Array, steps: int) -> Array:
    """Return starts nearer to closing, all variables moved for it, the actuated ones first."""
    starts = starts.copy()
    for _ in range(steps):
        gaps, jacobian = loop_equations(system, starts)
        step = _step(system, starts, np.zeros_like(starts), gaps, jacobian, low, high)
        starts = np.clip(starts + step * system.scale, low, high)
    return starts


def _step(
    system: LoopSystem, here: Array, wanted: Array, gaps: Array, jacobian: Array, low: Array, high: Array
) -> Array:
    """Return the limited step dx (P, A + Q), scaled: min ``|w (dx - wanted)|`` under ``J dx = -gaps``."""
    weight = np.where(np.arange(here.shape[1]) < system.actuated, EASE, 1.0)
    wanted = wanted / system.scale
    # a variable at its limit that wants to leave it stays
    held = ((here <= low) & (wanted < 0.0)) | ((here >= high) & (wanted > 0.0)) | (low == high)
    ease = np.where(held, 0.0, 1.0 / weight)
    rows = jacobian * ease[:, None, :]
    goal = np.where(held, 0.0, weight * wanted)
    square = rows @ rows.swapaxes(1, 2)
    ridge = 1e-9 * np.trace(square, axis1=1, axis2=2) + 1e-300
    square += ridge[:, None, None] * np.eye(square.shape[1])
    lack = (rows @ goal[:, :, None])[:, :, 0] + gaps
    pull = (rows.swapaxes(1, 2) @ np.linalg.solve(square, lack[:, :, None]))[:, :, 0]
    step = ease * (goal - pull)
    largest = np.where(system.prismatic, LARGEST_SHIFT, LARGEST_STEP)
    return np.asarray(step / np.maximum(1.0, np.abs(step / largest).max(axis=1, initial=0.0))[:, None])


def _unwound(system: LoopSystem, postures: Array, guess: Array) -> Array:
    """Return the passive variables (P, Q), the angles without whole turns from the guess."""
    first = system.actuated
    passive = postures[:, first:]
    turns = np.where(system.turning[first:], np.round((passive - guess[first:]) / (2 * np.pi)), 0.0)
    return passive - 2 * np.pi * turns


def _same(system: LoopSystem, one: Array, others: Array) -> Mask:
    """Return which closed postures (P, A + Q) belong to the assembly of the posture `one` (A + Q,), (P,)."""
    assembly = assembly_at(system, one)
    if assembly is None or not len(others):
        return np.zeros(len(others), dtype=np.bool_)
    if all(len(columns) <= 2 for _, columns in assembly.blocks):  # two ways each, as circles cut
        jacobian = loop_equations(system, others)[1][:, :, system.actuated :]
        return assembly.same_branch(jacobian)
    origin = np.repeat(one[None], len(others), axis=0)
    moved, arrived = continuation(system, assembly, origin, others[:, : system.actuated])
    same = np.zeros(len(others), dtype=np.bool_)
    here, there = _nodes(system, moved[arrived]), _nodes(system, others[arrived])
    apart = np.abs(here - there).max(axis=(1, 2), initial=0.0)
    same[arrived] = apart < SAME_PLACE * system.kinematics.size
    return same


def _nodes(system: LoopSystem, free: Array) -> Array:
    """Return where all nodes and the ends of the loops are, (P, N, 3)."""
    kinematics = system.kinematics
    transforms = forward(kinematics, all_values(kinematics, free))
    return np.concatenate(
        [node_positions(kinematics, transforms), transforms[:, list(system.frames)][..., :3, 3]], axis=1
    )
