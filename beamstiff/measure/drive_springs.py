"""What loads move, fitted by springs: of the drives, and of the tool along each axis of the base.

Compliances, none negative, linear in the force: a fit of milliseconds, which needs no start values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import equal_rows
from beamstiff.measure.position_plausibility import POSTURES, Index, comparable, laid_over, read_rows
from beamstiff.measure.rows import evenly
from beamstiff.measure.table import Measurements
from beamstiff.non_negative import non_negative
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture, twist_jacobian
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

MOST = 100  # rows that are fitted: more say no more


class DriveSprings:
    """Springs between the loads of rows (M,) and what they move, at joint values (M, A): drives, and tool."""

    def __init__(self, table: Measurements, robot: Robot, rows: Index, values: Array) -> None:
        kinematics = compile_kinematics(robot)
        q, number = np.unique(values, axis=0, return_inverse=True)
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
        return float(
            non_negative(columns / np.where(size > 0, size, 1.0), moved.ravel())[1] / np.sqrt(len(moved))
        )

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


def springs_of(table: Measurements, robot: Robot) -> tuple[DriveSprings, Index, Array, Array] | None:
    """Return springs, and some rows (M,), wrenches (M, 6) and what they move (M, 3), as `moved_by_loads`.

    None of a robot without drives, of too few postures, or where the loops do not close.
    """
    rows, more, moved = moved_by_loads(table, robot)
    some = evenly(len(rows), MOST)
    rows, more, moved = rows[some], more[some], moved[some]
    if len(np.unique(table.q[rows], axis=0)) < POSTURES or not robot.actuated:
        return None
    try:
        return DriveSprings(table, robot, rows, table.q[rows]), rows, more, moved
    except BeamstiffError:
        return None


def moved_by_loads(table: Measurements, robot: Robot) -> tuple[Index, Array, Array]:
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
