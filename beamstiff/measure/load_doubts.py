"""Whether forces can be those that moved the tool; else another reading of their columns is named.

What loads move is fitted by springs: compliances of the drives, and of the tool along each axis of the base,
none negative, linear in the force. Columns that are swapped, reversed or in another unit leave several times
what the right ones do, whatever else is amiss: in 50 simulated campaigns with bearings, levers, play or drift
that the springs lack no wrong reading left less than 0.92 of what right columns leave.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from beamstiff.errors import BeamstiffError, UnusableError, listed
from beamstiff.measure.arrays import equal_rows
from beamstiff.measure.position_doubts import (
    BEYOND_NOISE,
    LOADED,
    POSTURES,
    Index,
    axes_in_words,
    comparable,
    laid_over,
    read_rows,
)
from beamstiff.measure.rows import evenly
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture, twist_jacobian
from beamstiff.robot.stiffness import stiffness_parameters
from beamstiff.se3 import Array

NEARER = 1 / 2  # of what the columns as they are leave, RMS, that another reading leaves where it is meant
SAME = 1.0 + 1e-6  # times as much: columns of zeros may be exchanged
MOST = 100  # rows that are fitted: more say no more
KILO = 1e3  # N in a kN
GUESSED = 100.0  # times softer, or stiffer, than in the robot file: guesses are off by ten, units by 1000
FORCES = ("fx", "fy", "fz")


def require_loads(table: Measurements, robot: Robot) -> None:
    """Refuse loads that all pull against what absolute positions of one posture did under them."""
    done = work_between(table, robot)
    if len(done) >= LOADED and (done < 0).all():
        raise UnusableError(
            f"{table.source}: between the loads of a posture the target moved against the load in all "
            f"{len(done)} rows that tell, which no elastic machine does: reverse the sign of the loads (they "
            "act on the tool, in base axes)"
        )


def work_between(table: Measurements, robot: Robot) -> Array:
    """Return what forces beyond the least of a posture would do of its absolute positions, N m, where sure.

    The measuring frame is turned as the robot lies over the positions; targets may sit beside the load.
    """
    if table.kind != "absolute":
        return np.zeros(0)
    rows, more, moved = _moved_by_loads(table, robot)
    done = (more[:, :3] * moved).sum(axis=1)
    std = np.linalg.norm(more[:, :3] * np.nan_to_num(table.sigma[rows, :3]), axis=1) * np.sqrt(2.0)
    return np.asarray(done[np.abs(done) > BEYOND_NOISE * std])


def load_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield that the forces may stand in other columns, signs or units; mostly nothing."""
    rows, more, moved = _moved_by_loads(table, robot)
    some = evenly(len(rows), MOST)
    rows, more, moved = rows[some], more[some], moved[some]
    if len(np.unique(table.q[rows], axis=0)) < POSTURES or not robot.actuated:
        return
    try:
        springs = _Springs(table, robot, rows)
    except BeamstiffError:  # the loops do not close
        return
    stated, whole = springs.left(more, moved), float(np.sqrt((moved**2).sum(axis=1).mean()))
    others = {
        how: springs.left(other, moved)
        for how, other in springs.readings(more)
        if not np.allclose(other, more)
    }
    least = SAME * min(others.values(), default=0.0)
    best = next((how for how, left in others.items() if left <= least), "")
    if best and others[best] < NEARER * min(stated, whole):
        yield (
            f"{table.source}: what the loads move fits springs with {best} ({1e3 * others[best]:.3g} mm RMS "
            f"left of {1e3 * whole:.3g} mm), not as the table has it ({1e3 * stated:.3g} mm): correct the "
            "columns (loads act on the tool, in base axes; displacements are loaded minus unloaded)"
        )
    elif stated < NEARER * whole:
        yield from _of_the_unit(table, robot, springs.as_described(more, robot), moved)


def _of_the_unit(table: Measurements, robot: Robot, described: Array, moved: Array) -> Iterator[str]:
    """Yield that the loads move the tool many times as far, or as little, as drives of the robot file let."""
    times = float((described * moved).sum()) / max(float((described**2).sum()), 1e-300)
    if described.any() and times > 0.0 and not 1.0 / GUESSED < times < GUESSED:
        there, said = ("kN", "N") if times > 1.0 else ("N", "kN")
        start = "If not, these drives are start values, and are fitted."
        otherwise = start if robot.unmeasured else "Or is the stiffness in the robot file a guess?"
        yield (
            f"{table.source}: the loads move the tool {times:.2g} times as far as the drives of robot "
            f"{robot.name!r} let them: are fx fy fz in {there}, and read in {said}? {otherwise}"
        )


class _Springs:
    """Springs between the loads of rows (M,) and what they move: drives, and the tool."""

    def __init__(self, table: Measurements, robot: Robot, rows: Index) -> None:
        kinematics = compile_kinematics(robot)
        q, number = np.unique(table.q[rows], axis=0, return_inverse=True)
        where, pose = posture(kinematics, q), number.reshape(-1)

        def at_each(names: NDArray[np.str_]) -> Array:
            found = {name: twist_jacobian(kinematics, where, name) for name in np.unique(names)}
            return np.array([found[name][at] for name, at in zip(names, pose.tolist(), strict=True)])

        self.moves = at_each(table.point[rows])[:, :3]  # (M, 3, A)
        self.takes = at_each(table.load_point[rows])  # (M, 6, A)
        loaded = {name: pose_of(kinematics, where, name) for name in np.unique(table.load_point[rows])}
        turned = [loaded[name][at] for name, at in zip(table.load_point[rows], pose.tolist(), strict=True)]
        self.tool = np.array(turned)[:, :3, :3]

    def left(self, wrench: Array, moved: Array) -> float:
        """Return what the best springs leave of `moved` (M, 3) under `wrench` (M, 6), RMS, m."""
        columns = np.concatenate([self._drives(wrench), wrench[:, :3, None] * np.eye(3)], axis=2)
        columns = columns.reshape(-1, columns.shape[2])
        size = np.linalg.norm(columns, axis=0)
        return float(nnls(columns / np.where(size > 0, size, 1.0), moved.ravel())[1] / np.sqrt(len(moved)))

    def as_described(self, wrench: Array, robot: Robot) -> Array:
        """Return what drives as stiff as in the robot file let `wrench` (M, 6) move, (M, 3), m."""
        known, names = stiffness_parameters(robot), [one.name for one in robot.actuated]
        soft = np.zeros(len(names))
        for joint in robot.joints:
            for at in (at for at, name in enumerate(names) if name == joint.variable):
                own = "axial" if robot.actuated[at].kind == "length" else "torsional"
                stiffness = known.get(f"{joint.name}.{own}", np.inf)
                soft[at] += 1.0 / stiffness if 0.0 < stiffness < RIGID else 0.0
        return np.asarray(self._drives(wrench) @ soft)

    def _drives(self, wrench: Array) -> Array:
        return np.asarray(self.moves * np.einsum("mka,mk->ma", self.takes, wrench)[:, None])

    def readings(self, wrench: Array) -> Iterator[tuple[str, Array]]:
        """Yield other ways to read the forces, in words, and the wrenches (M, 6)."""
        every = product(permutations(np.eye(3)), product((1.0, -1.0), repeat=3))
        turns = [np.array(order) * np.array(signs)[:, None] for order, signs in every]
        for turn in sorted(turns, key=np.trace, reverse=True):  # the fewest changes first
            yield axes_in_words(turn, FORCES), _with_forces(wrench, wrench[:, :3] @ turn.T)
        for some in (FORCES, *((name,) for name in FORCES)):
            for factor, unit in ((KILO, "kN, and read in N"), (1.0 / KILO, "N, and read in kN")):
                scale = np.where([name in some for name in FORCES], factor, 1.0)
                yield f"{' '.join(some)} in {unit}", _with_forces(wrench, wrench[:, :3] * scale)
        turned = np.einsum("mij,mj->mi", self.tool, wrench[:, :3])
        yield f"{listed(FORCES)} along the axes of the tool", _with_forces(wrench, turned)


def _with_forces(wrench: Array, forces: Array) -> Array:
    return np.concatenate([forces, wrench[:, 3:]], axis=1)


def _moved_by_loads(table: Measurements, robot: Robot) -> tuple[Index, Array, Array]:
    """Return rows (M,), how their wrench (M, 6) differs from the least of their posture, and what that moves.

    (M, 3), base axes, m. None where nothing says how the measuring frame is turned.
    """
    if table.kind == "displacement":
        known = ~np.isnan(table.displacement[:, :3]).any(axis=1) & table.by_tracker
        rows = np.flatnonzero(known & table.wrench.any(axis=1))
        return rows, table.wrench[rows], table.displacement[rows, :3]
    some, rows = comparable(table), read_rows(table)
    nothing = rows[:0], np.zeros((0, 6)), np.zeros((0, 3))
    if not len(some) or not table.wrench[:, :3].any():
        return nothing
    try:
        frame = laid_over(table, robot, some, table.q[some], table.position[some]).rotation
    except BeamstiffError:  # the loops do not close
        return nothing
    wrench = table.wrench[rows]
    state = equal_rows(np.column_stack([table.q[rows], np.unique(table.point[rows], return_inverse=True)[1]]))
    order = np.lexsort([np.linalg.norm(wrench[:, :3], axis=1), state])
    least = order[np.unique(state[order], return_index=True)[1]][state]
    moved = (table.position[rows] - table.position[rows[least]]) @ frame
    more = wrench - wrench[least]
    loaded = more.any(axis=1)
    return rows[loaded], more[loaded], moved[loaded]
