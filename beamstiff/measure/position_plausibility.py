"""Whether joint values, assembly and axes can be those of the positions; else another reading is named.

Measured positions are known but for where the tracker stands, and where the reflector sits. Joint values read
with a wrong sign, from another zero, by a turn too many, in another unit or column, axes of a left-handed
frame, and loops put together in another way, put them off by the length of links; calibration seeks
millimetres from where the robot is said to stand, and would not come there.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, compress, permutations, product

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, UnusableError, listed
from beamstiff.measure.registration import RigidMotion, check_spread, lay_over
from beamstiff.measure.rows import concatenate, evenly
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
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
PLACED = 0.1  # of how far the positions scatter, that the robot may leave of them with its reflectors placed
SCALE = 5.0  # times as far apart, or as near, as they should be: wrong units make 10 or more
POSTURES = 8  # for fewer, one of many readings may fit by chance: a tracker's place alone takes two
REFLECTOR_ROUNDS = 10  # of laying the robot over the positions and placing its reflectors
REVERSIBLE = 6  # joints of which every selection may be reversed: 64 readings
HUGE = 30.0  # m, RMS: no robot arm reaches so far
MIRROR = np.array([1.0, 1.0, -1.0])
LENGTHS = {"mm": 1e-3, "inch": 0.0254, "m": 1.0}  # units that one of three columns may be in, by mistake
ALONG = 0.9  # cosine from which an axis of the tracker is along one of the base

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
    if moved > HUGE > read:
        raise UnusableError(
            f"robot {robot.name!r}: its points move by {moved:.3g} m (RMS) in the postures of "
            f"{table.source}: check the lengths in the robot file; in a URDF they are in m, and so are those "
            "without a unit"
        )
    large = max(moved, read) > AMISS * compile_kinematics(robot).size  # else of one posture
    unlike = large and read and not moved / SCALE < read < moved * SCALE  # one place is no reading yet
    # a reflector may sit far from where the robot file has it: its place makes up for no other unit
    if unlike and _left_by(table, robot, rows) > PLACED * read:
        raise UnusableError(
            f"{table.source}: x y z: the positions are {read:.3g} m apart (RMS from their mean), those of "
            f"robot {robot.name!r} in the same postures {moved:.3g} m: check the units; a column without one "
            "is in m, write for instance x [mm]"
        )


def position_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield why the joint values or the assembly may not be those of the positions; mostly nothing."""
    rows = comparable(table)
    if not len(rows):
        return
    if robot.loops:
        yield from _of_the_assembly(table, robot, rows)
    yield from (told for _, told in _misread(table, robot, rows))


def comparable(table: Measurements) -> Index:
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
    whole, *each = (_left_by(table, robot, _some_rows(table)) for table in (every, *tables))
    if AMISS * compile_kinematics(robot).size < whole < np.inf and max(each) < ANOTHER * whole:
        yield (
            f"the tables fit robot {robot.name!r} one by one (within {1e3 * max(each):.3g} mm), not all from "
            f"one place ({1e3 * whole:.3g} mm): where the robot, or the tracker, was moved between them, "
            "say --stations"
        )


def read_rows(table: Measurements) -> Index:
    """Return all rows with a position."""
    return np.flatnonzero(~np.isnan(table.position).any(axis=1) & table.by_tracker)


def _some_rows(table: Measurements) -> Index:
    """Return rows with a position, few enough to look at, from the whole table."""
    rows = read_rows(table)
    return rows[evenly(len(rows), ROWS)]


def _of_the_assembly(table: Measurements, robot: Robot, rows: Index) -> Iterator[str]:
    """Yield that loops put together in another way would bring the points to where they were read."""
    taken, left = "", {}
    kinematics = compile_kinematics(robot)
    if kinematics.closest:
        taken = kinematics.closest[0].name
    for one in every_assembly(kinematics):
        named = robot.model_copy(update={"assembly": one.name})
        left[one.name] = _left_by(table, named, rows)
    best = min(left, key=left.__getitem__, default=taken)
    if best != taken and left[best] < ANOTHER * left.get(taken, np.inf):
        yield (
            f"{table.source}: the positions fit the loops of robot {robot.name!r} put together as {best!r} "
            f"({1e3 * left[best]:.3g} mm), not as {taken!r} ({1e3 * left[taken]:.3g} mm), which was taken: "
            f"write assembly: {best!r} in the robot file, or --assembly={best}"
        )


def require_joints(table: Measurements, robot: Robot) -> None:
    """Refuse joint values that bring the points by far nearer to where they were if read in another way."""
    rows = comparable(table)
    if not len(rows):
        return
    for times, told in _misread(table, robot, rows):
        if times > SURELY:
            raise UnusableError(told)


def _misread(table: Measurements, robot: Robot, rows: Index) -> Iterator[tuple[float, str]]:
    """Yield how many times nearer another reading of joints or axes is, and a sentence; mostly nothing.

    With the reflectors placed as each reading would have them; else, where the robot file has them.
    """
    q = table.q[rows]
    if len(np.unique(q, axis=0)) < POSTURES:
        return
    apart = float(np.sqrt(table.position[rows].var(axis=0).sum()))
    for placed in (True, False):
        stated = _left_by(table, robot, rows, placed=placed)
        if not stated > AMISS * compile_kinematics(robot).size:
            continue
        left = {how: _left_by(table, robot, rows, other, placed) for how, other in _readings(robot, q)}
        scales = {**_in_other_units(), _mirrored(table, robot, rows): MIRROR}
        left |= {how: _left_by(table, robot, rows, q, placed, scale) for how, scale in scales.items()}
        best = min(left.values())
        if not best < ANOTHER * min(stated, apart):
            continue
        # what fits as well: a joint beside the tool may be turned instead of the tool
        like = sorted((one for one in left if left[one] * ANOTHER <= best), key=left.__getitem__)
        found = f"{1e3 * stated:.3g} mm" if np.isfinite(stated) else "the loops do not close"
        yield (
            stated / max(best, NEAR),
            f"{table.source}: the positions fit robot {robot.name!r} with {' or '.join(like[:3])} "
            f"({1e3 * best:.3g} mm), not as the table has it ({found}): correct the column, or the robot "
            "file",
        )
        return


def _readings(robot: Robot, q: Array) -> Iterator[tuple[str, Array]]:
    """Yield other ways to read joint values (P, A), in words and as values."""
    variables = robot.actuated
    names = [variable.name for variable in variables]
    angle = np.array([variable.kind == "angle" for variable in variables])
    yield "all angles in degrees, read in radians", np.where(angle, np.radians(q), q)
    yield "all angles in radians, read in degrees", np.where(angle, np.degrees(q), q)
    for back in product((False, True), repeat=len(names)):
        if sum(back) == 1 or (any(back) and len(names) <= REVERSIBLE):
            yield f"{listed(list(compress(names, back)))} reversed", np.where(back, -q, q)
    for at in np.flatnonzero(angle).tolist():
        others = {f"{turn:+d} deg": q[:, at] + np.radians(turn) for turn in (90, -90, 180, 360, -360)}
        within = np.mod(q[:, at], 2 * np.pi)
        others |= {
            "in degrees, read in radians": np.radians(q[:, at]),
            "in radians, read in degrees": np.degrees(q[:, at]),
            "counted from 0 to 360 deg": within,
            "counted from -180 to 180 deg": np.where(within > np.pi, within - 2 * np.pi, within),
        }
        for how, values in others.items():
            other = q.copy()
            other[:, at] = values
            yield f"{names[at]} {how}", other
    for one, two in combinations(range(len(variables)), 2):
        if variables[one].kind == variables[two].kind:
            other = q.copy()
            other[:, [one, two]] = q[:, [two, one]]
            yield f"{names[one]} and {names[two]} swapped", other


def _in_other_units() -> dict[str, Array]:
    """Return factors (3,) of x y z that one of them would need, in words."""
    units = list(permutations(LENGTHS, 2))
    return {
        f"{axis} in {own}, read in {taken}": np.where(np.eye(3)[at], LENGTHS[own] / LENGTHS[taken], 1.0)
        for at, axis in enumerate("xyz")
        for own, taken in units
    }


def _mirrored(table: Measurements, robot: Robot, rows: Index) -> str:
    """Return how x y z would be mirrored if they are, in words: which axes, where these are the base's."""
    try:
        found = laid_over(table, robot, rows, table.q[rows], MIRROR * table.position[rows])
    except BeamstiffError:
        return "x y z mirrored (two of them swapped?)"
    turn = (MIRROR[:, None] * found.rotation).T  # of what is read to base axes
    along = np.where(np.abs(turn) > ALONG, np.sign(turn), 0.0)
    which = f": {axes_in_words(along, tuple('xyz'))}" if np.abs(along).sum() == len(along) else ""
    swapped = "" if "swapped" in which else ", or two of x y z swapped"  # which a turned frame hides
    return f"x y z mirrored (a left-handed frame{which}{swapped})"


def axes_in_words(turn: Array, names: Sequence[str]) -> str:
    """Return, in words, a signed permutation (3, 3) of what columns hold to what they should.

    >>> axes_in_words(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), "xyz")
    'x and y swapped and z reversed'
    """
    columns = [names[at] for at in np.abs(turn).argmax(axis=1)]
    moved = [name for name, column in zip(names, columns, strict=True) if name != column]
    back = [name for name, row in zip(names, turn, strict=True) if row.sum() < 0.0]
    said = [f"{' and '.join(moved)} swapped"] if len(moved) == 2 else []
    said += [f"{' '.join(names)} in the columns {' '.join(columns)}"] if len(moved) > 2 else []
    said += [f"{listed(back)} reversed"] if back else []
    return " and ".join(said)


def _left_by(
    table: Measurements,
    robot: Robot,
    rows: Index,
    q: Array | None = None,
    placed: bool = True,
    scale: Array | float = 1.0,
) -> float:
    """Return the RMS distance, m, of the positions from those at q (P, A), laid over; inf: it is open.

    `q`: default those of the table. `placed`: see `laid_over`. `scale`: of x y z.
    """
    position, q = scale * table.position[rows], table.q[rows] if q is None else q
    try:
        return float(laid_over(table, robot, rows, q, position, placed).rms)
    except BeamstiffError:
        return np.inf


def laid_over(
    table: Measurements, robot: Robot, rows: Index, q: Array, position: Array, placed: bool = True
) -> RigidMotion:
    """Return the motion that lays the robot at q (P, A) over positions (P, 3).

    `placed`: with its reflectors where this fits best, motion and places in turn; those of few rows stay
    where the robot file has them.
    """
    kinematics = compile_kinematics(robot)
    where, point = posture(kinematics, q), table.point[rows]
    poses = {name: pose_of(kinematics, where, name) for name in np.unique(point).tolist()}
    pose = np.array([poses[name][row] for row, name in enumerate(point.tolist())])
    described = pose[:, :3, 3]
    check_spread(described, "points")
    free = [point == name for name in poses if placed and (point == name).sum() >= POSTURES]
    turned = [np.where(own[:, None, None], pose[:, :3, :3], 0.0) for own in free]
    columns = np.concatenate([np.zeros((len(rows), 3, 0)), *turned], axis=2)
    return lay_over(described, columns, position, REFLECTOR_ROUNDS)[0]


def _places(table: Measurements, robot: Robot, rows: Index, q: Array) -> Array:
    """Return where the robot has the points of rows (P,) at q (P, A): (P, 3), m."""
    kinematics = compile_kinematics(robot)
    places = posture(kinematics, q).node_positions
    at: Array = places[np.arange(len(rows)), [kinematics.node_index[name] for name in table.point[rows]]]
    return at
