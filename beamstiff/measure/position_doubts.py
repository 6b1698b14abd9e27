"""Whether joint values, assembly and loads can be those of the positions; else another reading is named.

Measured positions are known but for where the tracker stands. Joint values read with a wrong sign, from
another zero, by a turn too many or in another column, and loops put together in another way, put them off by
the length of links; calibration seeks millimetres from where the robot is said to stand, and would not come
there.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, UnusableError
from beamstiff.measure.arrays import equal_rows
from beamstiff.measure.registration import check_spread, fit_rigid_motion
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

BEYOND_NOISE = 3.0  # standard deviations of a row's work, beyond which its sign is sure
SEVERAL = 3  # rows
# of what an assembly or a reading leaves, that another leaves where it is meant: wrong ones are off by links
ANOTHER = 1 / 3
AMISS = 0.01  # of the machine's size, below which positions are off by errors that calibration is for
ROWS = 24  # looked at: loops that do not close take their time
LOADED = 10  # rows: a target beside the load may in some postures move against it
SURELY = 10.0  # times nearer: no geometry that a calibration finds is off by so much, and like that
NEAR = 1e-6  # m, of what is left: nearer is rounding
SCALE = 5.0  # times as far apart, or as near, as they should be: wrong units make 10 or more
POSTURES = 8  # for fewer, one of many readings may fit by chance: a tracker's place alone takes two

Index = NDArray[np.intp]


def require_scale(table: Measurements, robot: Robot) -> None:
    """Refuse positions much farther apart, or nearer together, than the robot's in the same postures."""
    rows = _some_rows(table)
    if table.kind != "absolute" or len(rows) < SEVERAL:
        return
    try:
        at = _places(table, robot, rows, table.q[rows])
    except BeamstiffError:  # the loops do not close
        return
    moved, read = (
        float(np.sqrt(((one - one.mean(axis=0)) ** 2).sum(axis=1).mean()))
        for one in (at, table.position[rows])
    )
    large = max(moved, read) > AMISS * compile_kinematics(robot).size  # else of one posture
    if large and read and not moved / SCALE < read < moved * SCALE:  # one place in all rows is no reading yet
        raise UnusableError(
            f"{table.source}: x y z: the positions are {read:.3g} m apart (RMS from their mean), those of "
            f"robot {robot.name!r} in the same postures {moved:.3g} m: check the units; a column without one "
            "is in m, write for instance x [mm]"
        )


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
    some = _comparable(table)
    if not len(some) or not table.wrench[:, :3].any():
        return np.zeros(0)
    try:
        frame = fit_rigid_motion(_places(table, robot, some, table.q[some]), table.position[some]).rotation
    except BeamstiffError:  # the loops do not close
        return np.zeros(0)
    rows = _read_rows(table)
    force = table.wrench[rows, :3]
    state = equal_rows(np.column_stack([table.q[rows], np.unique(table.point[rows], return_inverse=True)[1]]))
    order = np.lexsort([np.linalg.norm(force, axis=1), state])
    least = order[np.unique(state[order], return_index=True)[1]][state]
    more, moved = force - force[least], (table.position[rows] - table.position[rows[least]]) @ frame
    done = (more * moved).sum(axis=1)
    std = np.linalg.norm(more * np.nan_to_num(table.sigma[rows, :3]), axis=1) * np.sqrt(2.0)
    return np.asarray(done[np.abs(done) > BEYOND_NOISE * std])


def position_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield why the joint values or the assembly may not be those of the positions; mostly nothing."""
    rows = _comparable(table)
    if not len(rows):
        return
    if robot.loops:
        yield from _of_the_assembly(table, robot, rows)
    yield from (told for _, told in _misread(table, robot, rows))


def _comparable(table: Measurements) -> Index:
    """Return some rows whose absolute positions say how others lie over them; none where none do."""
    rows = _some_rows(table)
    unusable = table.kind != "absolute" or not len(rows) or _on_a_line(table.position[rows])
    return rows[:0] if unusable else rows


def _on_a_line(position: Array) -> bool:
    """Return whether points (N, 3) are too few, or on one line: nothing says how others lie over them."""
    try:
        check_spread(position, "points")
    except BeamstiffError:
        return True
    return False


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


def _read_rows(table: Measurements) -> Index:
    """Return all rows with a position."""
    return np.flatnonzero(~np.isnan(table.position).any(axis=1) & table.by_tracker)


def _some_rows(table: Measurements) -> Index:
    """Return rows with a position, few enough to look at, from the whole table."""
    rows = _read_rows(table)
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


def require_joints(table: Measurements, robot: Robot) -> None:
    """Refuse joint values that bring the points by far nearer to where they were if read in another way."""
    rows = _comparable(table)
    if not len(rows):
        return
    for times, told in _misread(table, robot, rows):
        if times > SURELY:
            raise UnusableError(told)


def _misread(table: Measurements, robot: Robot, rows: Index) -> Iterator[tuple[float, str]]:
    """Yield how many times nearer another reading of the joint values is, and a sentence; mostly nothing."""
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
            stated / max(best, NEAR),
            f"{table.source}: the positions fit robot {robot.name!r} with {' or '.join(like[:3])} "
            f"({1e3 * best:.3g} mm), not as the table has it ({found}): correct the column, or the robot "
            "file",
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
        at = _places(table, robot, rows, q)
        check_spread(at, "points")
        return float(fit_rigid_motion(at, table.position[rows]).rms)
    except BeamstiffError:
        return np.inf


def _places(table: Measurements, robot: Robot, rows: Index, q: Array) -> Array:
    """Return where the robot has the points of rows (P,) at q (P, A): (P, 3), m."""
    kinematics = compile_kinematics(robot)
    places = posture(kinematics, q).node_positions
    at: Array = places[np.arange(len(rows)), [kinematics.node_index[name] for name in table.point[rows]]]
    return at
