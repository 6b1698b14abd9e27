"""States that could be measured next: load cycles at postures, and where else a reflector could sit."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.instruments import turned_rows
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.planning.candidates import candidate_poses, force_loads, inside
from beamstiff.planning.moving import nearest_next
from beamstiff.planning.obstacles import clear
from beamstiff.planning.poses import closed_posture, joint_ranges, random_poses, rounded_postures
from beamstiff.planning.seated import seated_rows
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

POSES, MANY = 24, 400  # postures to choose from, of so many drawn
CHOICE, LOADS = 4, 4  # where each is loaded once: postures for each row of a batch, and loads in each
NEAR = 0.15  # of the machine's size: as far from where the tool was seen it is likely to be seen as well
MOST_WAYS, LIKE = 6, 0.94  # directions of loads; cosine from which two directions are one
# shares of the largest load: a cycle shows history and reversal, and positions need the unloaded reading too
STEPS: tuple[float, ...] = (0.5, 1.0, 0.5, -0.5, -1.0)
ABSOLUTE: tuple[float, ...] = (0.0, 0.5, 1.0, -0.5, -1.0)
# where positions were read under loads of one size alone, there is one weight
ONE_WEIGHT: tuple[float, ...] = (0.0, 1.0, 0.0, -1.0, 0.0)
ONE_WAY = {
    STEPS: (0.5, 1.0, 0.5, 1.0, 0.5),
    ABSOLUTE: (0.0, 0.5, 1.0, 0.5, 0.0),
    ONE_WEIGHT: (0.0, 1.0, 0.0, 1.0, 0.0),
}  # as many rows
SAME_SIZE = 0.02  # of the largest load: as far from it a load may be and is the same
UNLOADED: tuple[float, ...] = (0.0,)
LOAD = 500.0  # N, where no force was applied so far
UNREAD = 1e6  # m: noise of a component that an instrument does not read
APART = 1e-3  # m: nodes nearer than this are one place for a reflector


def load_cycles(
    baseline: Baseline, seed: int, single: bool = False
) -> tuple[Measurements, NDArray[np.intp], NDArray[np.intp]]:
    """Return states at postures within the limits, nothing measured, the cycle and the posture of each.

    A cycle is loaded along one direction of the table's forces, up to the largest of them, and the other way
    only where the table has forces that way; `single`: each load is a cycle by itself. Where the table has
    absolute positions and no loads, it is one unloaded reading, at a posture that was not measured yet where
    there is one.
    """
    rows, robot = baseline.rows, baseline.nominal
    loads = (np.abs(rows.wrench).max(axis=1) > 0).any()
    rng = np.random.default_rng(seed)
    known, new = _postures(baseline, rng, max(POSES, CHOICE * (rows.batch or 0) if single else 0))
    if baseline.absolute and not loads:
        q, ways = new if len(new) else known, [(np.zeros(3), UNLOADED)]
    else:
        q, ways = np.concatenate([known[: POSES // 2], new]), _ways(rows, baseline.absolute)
    largest = float(np.linalg.norm(rows.wrench[:, :3], axis=1).max(initial=0.0)) or LOAD
    largest = float(f"{largest:.3g}")
    if baseline.absolute and rows.targets and not rows.by_tracker.any():
        return _seated(baseline, POSES // len(rows.targets) + 1, seed)
    if single:
        ways = [(along, tuple(dict.fromkeys(shares))) for along, shares in ways]
    force = np.array([largest * share * along for along, shares in ways for share in shares])
    force = force.round(2 - int(np.floor(np.log10(largest))))  # digits that a load cell shows
    steps = np.tile([len(shares) for _, shares in ways], len(q))
    of = np.repeat(np.arange(len(q)), len(force))
    cycle = np.arange(len(of)) if single else np.repeat(np.arange(len(steps)), steps)
    proposed = empty_rows(
        rows,
        robot.tcp,
        q[of],
        np.tile(np.hstack([force, np.zeros_like(force)]), (len(q), 1)) + 0.0,  # no -0
        pose=cycle,
        step=np.zeros(len(of)) if single else np.concatenate([np.arange(count) for count in steps]),
        time=60.0 * np.arange(len(of)),
    )
    if single and len(force) > LOADS:  # all loads in a few postures would tell less than these in many
        chosen = rng.random((len(q), len(force))).argsort(axis=1)[:, :LOADS]
        kept = np.sort(chosen + len(force) * np.arange(len(q))[:, None], axis=1).ravel()
        proposed, of, cycle = subset(proposed, kept), of[kept], np.arange(kept.size)
    if not rows.targets or rows.by_tracker.any():
        return proposed, cycle, of
    every, direction = _read_along(rows)  # each state is read by every gauge that the table has
    number = np.repeat(np.arange(len(proposed)), len(every))
    read = replace(
        subset(proposed, number),
        target=np.tile(every, len(proposed)),
        direction=np.tile(direction, (len(proposed), 1)),
        targets=rows.targets,
    )
    return read, cycle[number], of[number]


def _ways(rows: Measurements, absolute: bool) -> list[tuple[Array, tuple[float, ...]]]:
    """Return the directions (3,) in which the table's forces pull, and the shares of the largest along each.

    Two opposite ones are one, with negative shares; without forces the axes of the base are taken, and where
    it is stated in which directions loads may pull, these.
    """
    size = np.linalg.norm(rows.wrench[:, :3], axis=1)
    units = rows.wrench[size > 0.0, :3] / size[size > 0.0, None]
    each, often = (one[::-1] for one in np.unique(units.round(2), axis=0, return_counts=True))
    found: list[Array] = []
    stated = force_loads(1.0, rows.directions)[:, :3]
    for along in stated if len(stated) else each[np.argsort(-often, kind="stable")]:
        if all(along @ other < LIKE for other in found):
            found.append(along / np.linalg.norm(along))
    if not found or len(found) > MOST_WAYS:  # none, or any
        found = [*np.eye(3), *-np.eye(3)]
    steps, ways = ABSOLUTE if absolute else STEPS, list[tuple[Array, tuple[float, ...]]]()
    if absolute and len(units) and size[size > 0.0].min() >= (1.0 - SAME_SIZE) * size.max():
        steps = ONE_WEIGHT
    for at, along in enumerate(found):
        if any(along @ other < -LIKE for other in found[:at]):
            continue
        both = any(along @ other < -LIKE for other in found[at + 1 :])
        ways.append((along, steps if both else ONE_WAY[steps]))
    return ways


def _read_along(rows: Measurements) -> tuple[NDArray[np.str_], Array]:
    """Return the names of the gauges of a table (k,), and the directions that they read along (k, 3)."""
    known = [one for one in rows.targets if one.normal is not None]
    if not known:
        raise BeamstiffError("what a ball bar reads next follows from where it is set up")
    return np.array([one.name for one in known]), np.array([one.normal for one in known])


def _seated(
    baseline: Baseline, count: int, seed: int
) -> tuple[Measurements, NDArray[np.intp], NDArray[np.intp]]:
    """Return unloaded states in which the point meets each set-up of the table, each a cycle of its own."""
    rows = baseline.rows
    found = seated_rows(baseline.robot, rows.targets, count, seed, most_often(rows.point))
    position = posture(compile_kinematics(baseline.robot), found.q).node_positions
    node = compile_kinematics(baseline.robot).node_index[str(found.point[0])]
    found = turned_rows(found, np.eye(3), np.zeros(3), position[:, node])
    number = np.arange(len(found))
    time: Array = np.asarray(60.0 * number)
    return replace(found, time=time, units=rows.units), number, number


def noise_of(rows: Measurements, noise: Array) -> Array:
    """Return the noise (R, 3) of what rows read, `noise` (3,) of a position; `UNREAD` where they do not."""
    result: Array = np.tile(noise, (len(rows), 1))
    result[np.isfinite(rows.direction).all(axis=1)] = [noise[0], UNREAD, UNREAD]
    return result


def short_way(q: Array) -> NDArray[np.intp]:
    """Return an order of states (R, A) in which the joint that has most to move has little, (R,).

    From the first on to the nearest posture that is left; states of one posture stay as they are.
    """
    postures, of = np.unique(q, axis=0, return_inverse=True)
    rank = np.argsort(nearest_next(postures, int(of.ravel()[0])))
    return np.argsort(rank[of.ravel()], kind="stable")


def most_often(names: NDArray[np.str_]) -> str:
    """Return the name of a node that stands most often among some (N,)."""
    each, often = np.unique(names, return_counts=True)
    return str(each[np.argmax(often)])


def empty_rows(like: Measurements, tcp: str, q: Array, wrench: Array, **columns: object) -> Measurements:
    """Return states (R, A) under wrenches (R, 6), of the kind of a table, nothing measured.

    They act where most of the table's loads do; where it has none, at the TCP.
    """
    kind = "position" if like.kind == "absolute" else "displacement"
    nothing = np.full((len(q), 3 if kind == "position" else 6), np.nan)
    acts = like.load_point[like.wrench.any(axis=1)]
    where = most_often(acts) if acts.size else tcp
    more: dict[str, Any] = {kind: nothing, "load_point": np.full(len(q), where), **columns}
    return make_measurements(list(like.variables), q, tcp=tcp, wrench=wrench, source="<next>", **more)


def reflector_nodes(baseline: Baseline) -> tuple[str, ...]:
    """Return the nodes where a second reflector could sit: not at the TCP, and of those at one place one."""
    robot, q = baseline.nominal, np.unique(baseline.rows.q, axis=0)
    kinematics = compile_kinematics(robot)
    at = closed_posture(kinematics, q)[0].node_positions
    found = [robot.tcp]
    for node in robot.nodes:
        off = (
            at[:, [kinematics.node_index[name] for name in found]] - at[:, [kinematics.node_index[node.name]]]
        )
        if np.abs(off).max(axis=(0, 2)).min() >= APART:
            found.append(node.name)
    return tuple(found[1:])


def within_measured(robot: Robot, q: Array) -> Robot:
    """Return the robot with the range of measured postures (n, A) as limits of joints that state none."""
    ends = dict(zip((one.name for one in robot.actuated), zip(q.min(0), q.max(0), strict=True), strict=True))
    limited = [
        one if one.limits or one.name not in ends else one.model_copy(update={"limits": ends[one.name]})
        for one in robot.variables
    ]
    return robot.model_copy(update={"variables": tuple(limited)})


def _few_turns(robot: Robot, q: Array, known: Array) -> Array:
    """Return postures (n, A) with joints turned back by full turns to where they were measured, in `known`.

    Nothing is turned where variables are coupled: a full turn of one may be none of another.
    """
    if any(one.equals is not None for one in robot.variables):
        return q
    turns = [one.kind == "angle" for one in robot.actuated]
    middle = 0.5 * (known.min(axis=0) + known.max(axis=0))
    back = q - 2.0 * np.pi * np.round((q - middle) / (2.0 * np.pi))
    lower, upper = joint_ranges(robot)
    return np.where((back >= lower) & (back <= upper) & turns, back, q)


def _postures(baseline: Baseline, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Return postures (n, A) that were measured, and `count` others where the tool can be measured, it seems.

    The others lie in the region that the rows state; otherwise near where the tool was seen: nothing else
    tells of the floor, the pedestal and what the tracker sees. Joints without limits keep to their measured
    range: nothing else tells of cables and neighbours.
    """
    rows = baseline.rows
    known = np.unique(rows.q, axis=0)
    robot = within_measured(baseline.nominal, known)
    kinematics = compile_kinematics(robot)
    tcp = kinematics.node_index[robot.tcp]
    seen = closed_posture(kinematics, known)[0].node_positions[:, tcp]
    if rows.region is not None:
        known = known[inside(rows.region, seen)]
        others = candidate_poses(kinematics, count, int(rng.integers(1 << 31)), rows.region)
    else:
        others = random_poses(kinematics, MANY, rng)
    others = _few_turns(robot, others, known) if len(known) else others
    others = rounded_postures(robot, others, rows.units)
    where, closed = closed_posture(kinematics, others)
    free = clear(kinematics, where.node_positions)
    others, at = others[closed][free], where.node_positions[free, tcp]
    if rows.region is not None:
        others = others[inside(rows.region, at)]
    else:
        far = np.linalg.norm(at[:, None] - seen[None], axis=2).min(axis=1)
        others = others[far <= NEAR * kinematics.size]
    return known[rng.permutation(len(known))], others[:count]
