"""What measured positions say of the columns of a table and of the loops of the robot.

Positions are known but for where the tracker stands. Joint values read with a wrong sign, from another zero,
by a turn too many or in another column, and loops put together in another way, put them off by the length of
links; calibration seeks millimetres from where the robot is said to stand, and would not come there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.registration import check_spread, fit_rigid_motion
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

Index = NDArray[np.intp]

# of what an assembly or a reading leaves, that another leaves where it is meant: wrong ones are off by links
ANOTHER = 1 / 3
AMISS = 0.01  # of the machine's size, below which positions are off by errors that calibration is for
ROWS = 24  # looked at: loops that do not close take their time
POSTURES = 8  # for fewer, one of many readings may fit by chance: a tracker's place alone takes two


def position_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield why the joint values or the assembly may not be those of the positions; mostly nothing."""
    rows = _some_rows(table)
    if table.kind != "absolute" or not len(rows):
        return
    if robot.loops:
        yield from _of_the_assembly(table, robot, rows)
    yield from _of_the_columns(table, robot, rows)


def stands_doubts(tables: Sequence[Measurements], robot: Robot) -> Iterator[str]:
    """Yield that each of several tables fits the robot, but not all from one stand; mostly nothing."""
    if len(tables) < 2 or any(table.kind != "absolute" for table in tables):
        return
    every = concatenate(tables)
    whole, *each = (
        _left_by(table, robot, rows := _some_rows(table), table.q[rows]) for table in (every, *tables)
    )
    if AMISS * compile_kinematics(robot).size < whole < np.inf and max(each) < ANOTHER * whole:
        yield (
            f"the tables fit robot {robot.name!r} one by one (within {1e3 * max(each):.3g} mm), not all from "
            f"one place ({1e3 * whole:.3g} mm): where the robot, or the tracker, was moved between them, "
            "say --stations"
        )


def _some_rows(table: Measurements) -> Index:
    """Return rows with a position, few enough to look at, from the whole table."""
    rows = np.flatnonzero(~np.isnan(table.position).any(axis=1))
    return rows[np.unique(np.linspace(0, len(rows) - 1, ROWS).astype(np.intp))] if len(rows) else rows


def _of_the_assembly(table: Measurements, robot: Robot, rows: Index) -> Iterator[str]:
    """Yield that loops put together in another way would bring the points to where they were read."""
    taken, left = "", {}
    kinematics = compile_kinematics(robot)
    if kinematics.closest:
        taken = kinematics.closest[0].name
    for one in every_assembly(kinematics):
        named = robot.model_copy(update={"assembly": one.name})
        left[one.name] = _left_by(table, named, rows, table.q[rows])
    best = min(left, key=left.__getitem__, default=taken)
    if best != taken and left[best] < ANOTHER * left.get(taken, np.inf):
        yield (
            f"{table.source}: the positions fit the loops of robot {robot.name!r} put together as {best!r} "
            f"({1e3 * left[best]:.3g} mm), not as {taken!r} ({1e3 * left[taken]:.3g} mm), which was taken: "
            f"write assembly: {best!r} in the robot file, or --assembly={best}"
        )


def _of_the_columns(table: Measurements, robot: Robot, rows: Index) -> Iterator[str]:
    """Yield that joint values read in another way would bring the points to where they were read."""
    q, kinematics = table.q[rows], compile_kinematics(robot)
    if len(np.unique(q, axis=0)) < POSTURES:
        return
    stated = _left_by(table, robot, rows, q)
    if not stated > AMISS * kinematics.size:
        return
    left = {how: _left_by(table, robot, rows, other) for how, other in _readings(robot, q)}
    best = min(left.values(), default=np.inf)
    if best < ANOTHER * stated:
        # what fits as well: a joint beside the tool may be turned instead of the tool
        like = sorted((one for one in left if left[one] * ANOTHER <= best), key=left.__getitem__)
        found = f"{1e3 * stated:.3g} mm" if np.isfinite(stated) else "the loops do not close"
        yield (
            f"{table.source}: the positions fit robot {robot.name!r} with {' or '.join(like[:3])} "
            f"({1e3 * best:.3g} mm), not as the table has it ({found}): correct the column, or the robot file"
        )


def _readings(robot: Robot, q: Array) -> Iterator[tuple[str, Array]]:
    """Yield other ways to read joint values (P, A), in words and as values."""
    variables = robot.actuated
    for at, variable in enumerate(variables):
        others = {"reversed": -q[:, at]}
        if variable.kind == "angle":
            others |= {f"{turn:+d} deg": q[:, at] + np.radians(turn) for turn in (90, -90, 180, 360, -360)}
            within = np.mod(q[:, at], 2 * np.pi)
            others |= {
                "counted from 0 to 360 deg": within,
                "counted from -180 to 180 deg": np.where(within > np.pi, within - 2 * np.pi, within),
            }
        for how, values in others.items():
            other = q.copy()
            other[:, at] = values
            yield f"{variable.name} {how}", other
    for one, two in combinations(range(len(variables)), 2):
        if variables[one].kind == variables[two].kind:
            other = q.copy()
            other[:, [one, two]] = q[:, [two, one]]
            yield f"{variables[one].name} and {variables[two].name} swapped", other


def _left_by(table: Measurements, robot: Robot, rows: Index, q: Array) -> float:
    """Return the RMS distance, m, of the positions from those at q (P, A), laid over; inf: it is open."""
    try:
        kinematics = compile_kinematics(robot)
        places = posture(kinematics, q).node_positions
        at = places[np.arange(len(rows)), [kinematics.node_index[name] for name in table.point[rows]]]
        check_spread(at, "points")
        return float(fit_rigid_motion(at, table.position[rows]).rms)
    except BeamstiffError:
        return np.inf
