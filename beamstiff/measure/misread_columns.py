"""Whether columns of loads and joint values can be those that moved the tool; else another reading is named.

What loads move is fitted by springs (`measure.drive_springs`). Columns that are swapped, reversed or in
another unit leave several times what the right ones do, whatever else is amiss: in 85 simulated campaigns
with bearings, levers, play or drift that the springs lack, no wrong reading left less than 0.92 of what right
columns leave (0.88 where the robot has loops), and of 192 samples of 8 postures none is doubted. Joint values
of absolute positions are held against these instead (`measure.position_plausibility`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, compress, permutations, product

import numpy as np

from beamstiff.errors import BeamstiffError, UnusableError, listed
from beamstiff.measure.drive_springs import DriveSprings, springs_of
from beamstiff.measure.position_plausibility import REVERSIBLE, Index, axes_in_words
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

NEARER = 1 / 2  # of what the columns as they are leave, RMS, that another reading leaves where it is meant
SAME = 1.0 + 1e-6  # times as much: columns of zeros may be exchanged
# times as much, up to which another reading with as few mistakes may be the right one; where columns were
# misread on purpose, and the right reading was found, the next left 1.97 times as much or more
ALIKE = 1.5
SHOWS = 2.0  # times the noise, RMS, that columns as they are leave where misread ones are sure
KILO = 1e3  # N in a kN
FORCES = ("fx", "fy", "fz")
CORRECT = "columns (loads act on the tool, in base axes; displacements are loaded minus unloaded)"


@dataclass(frozen=True)
class Reading:
    """Another reading of some columns: in words, by how many mistakes, and what springs leave of it, m."""

    how: str
    mistakes: int
    left: float
    of_joints: bool = False


def require_columns(table: Measurements, robot: Robot) -> None:
    """Refuse displacements that fit springs far better if columns of loads or joints are read otherwise."""
    for sure, told in misread_columns(table, robot):
        if sure:
            raise UnusableError(told)


def misread_columns(table: Measurements, robot: Robot) -> Iterator[tuple[bool, str]]:
    """Yield whether it is sure that columns are misread, and a sentence that says how; mostly nothing.

    Sure are displacements alone that leave more than their noise and fit one reading only, of robots without
    loops: these may also be put together in another way, so that their joints are not tried.
    """
    if (fitting := springs_of(table, robot)) is None:
        return
    springs, rows, more, moved = fitting
    stated, whole = springs.left(more, moved), float(np.sqrt((moved**2).sum(axis=1).mean()))
    noise = float(np.sqrt((np.nan_to_num(table.sigma[rows, :3]) ** 2).sum(axis=1).mean()))
    shows = table.kind == "displacement" and stated > SHOWS * noise and not robot.loops
    others = list(_of_loads(springs, more, moved))
    others += _of_joints(table, robot, rows, more, moved) if shows else ()
    enough = NEARER * min(stated, whole)
    near = [one for one in others if one.left <= ALIKE * min(other.left for other in others)]
    found = sorted((one for one in near if one.left < enough), key=lambda one: (one.mistakes, one.left))
    if not found:
        return
    best = next(one for one in found if one.left <= SAME * found[0].left)
    like = [one for one in near if one.mistakes <= best.mistakes and one.left > SAME * best.left]
    said = " or ".join(one.how for one in (best, *sorted(like, key=lambda one: one.left)[:2]))
    correct = "joint columns, or the axes in the robot file" if best.of_joints else CORRECT
    yield (
        shows and not like and not robot.loops,
        f"{table.source}: what the loads move fits springs with {said} ({1e3 * best.left:.3g} mm RMS left of "
        f"{1e3 * whole:.3g} mm), not as the table has it ({1e3 * stated:.3g} mm): correct the {correct}",
    )


def _of_loads(springs: DriveSprings, wrench: Array, moved: Array) -> Iterator[Reading]:
    """Yield other ways to read the forces of wrenches (M, 6), each once, the fewest changes first."""
    seen = [wrench]
    for how, mistakes, forces in _forces(springs, wrench[:, :3]):
        other = np.concatenate([forces, wrench[:, 3:]], axis=1)
        if not any(np.allclose(other, one) for one in seen):
            seen.append(other)
            yield Reading(how, mistakes, springs.left(other, moved))


def _forces(springs: DriveSprings, forces: Array) -> Iterator[tuple[str, int, Array]]:
    for turn in turns():
        order = 3 - int(np.diag(turn).astype(np.bool_).sum())  # columns in another place
        back = int((turn.sum(axis=1) < 0).sum())
        mistakes = max(order - 1, 0) + (1 if back == len(FORCES) else back)
        yield axes_in_words(turn, FORCES), mistakes, forces @ turn.T
    for some in (FORCES, *((name,) for name in FORCES)):
        for factor, unit in ((KILO, "kN, and read in N"), (1.0 / KILO, "N, and read in kN")):
            scale = np.where([name in some for name in FORCES], factor, 1.0)
            yield f"{' '.join(some)} in {unit}", 1, forces * scale
    turned = np.einsum("mij,mj->mi", springs.tool, forces)
    yield f"{listed(FORCES)} along the axes of the tool", 1, turned


def turns() -> list[Array]:
    """Return the signed permutations (3, 3), the fewest changes first."""
    every = product(permutations(np.eye(3)), product((1.0, -1.0), repeat=3))
    found = [np.array(order) * np.array(signs)[:, None] for order, signs in every]
    return sorted(found, key=np.trace, reverse=True)


def _of_joints(
    table: Measurements, robot: Robot, rows: Index, wrench: Array, moved: Array
) -> Iterator[Reading]:
    """Yield other ways to read the joint values, where the loops close."""
    q = table.q[rows]
    for how, mistakes, other in _joint_values(robot, q):
        if np.allclose(other, q):
            continue
        try:
            left = DriveSprings(table, robot, rows, other).left(wrench, moved)
        except BeamstiffError:
            continue
        yield Reading(how, mistakes, left, of_joints=True)


def _joint_values(robot: Robot, q: Array) -> Iterator[tuple[str, int, Array]]:
    """Yield other ways to read joint values (M, A): in words, by how many mistakes, and as values."""
    names = [variable.name for variable in robot.actuated]
    angle = np.array([variable.kind == "angle" for variable in robot.actuated])
    yield "all angles in degrees, read in radians", 1, np.where(angle, np.radians(q), q)
    yield "all angles in radians, read in degrees", 1, np.where(angle, np.degrees(q), q)
    for back in product((False, True), repeat=len(names)):
        if sum(back) == 1 or (any(back) and len(names) <= REVERSIBLE):
            how = f"{listed(list(compress(names, back)))} reversed"
            yield how, sum(back), np.where(back, -q, q)
    for one, two in combinations(range(len(names)), 2):
        if angle[one] == angle[two]:
            other = q.copy()
            other[:, [one, two]] = q[:, [two, one]]
            yield f"{names[one]} and {names[two]} swapped", 1, other
