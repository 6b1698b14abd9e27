"""Joint values along a path: inverse geometry from each target to the next, in one branch.

Targets are solved in runs, all of a run from where the last one ended. Where the joints would have to jump,
the way there is walked in small steps; where that fails too, another configuration is looked for, and said to
be one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.posture import Arm, StatedPosture, arm_of
from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import Integers
from beamstiff.robot.frames import Kinematics
from beamstiff.robot.inverse import InverseResult, inverse_geometry
from beamstiff.robot.kinematics import pose_of, posture
from beamstiff.se3 import Array, transform, vector_from_rotation

JUMP = 0.6  # most that a joint may turn, rad, or travel, machine sizes, between neighbours of a path
LONGEST_RUN = 1024
WALK = 12  # steps between targets far apart
SEARCHED, RESTARTS = 256, 40  # targets at a time, starts each
FREELY = 10  # starts for a place alone, which many postures reach
TRIED = 48  # starts for the posture to begin with
POOL = 1000  # to choose these from where the posture is stated
TOLERANCE = 1e-9  # m, rad
NEARLY = 2e-7  # m, rad: where an arm is stretched, the last digits cost more steps than they are worth
AT_LIMIT = 1e-6
MOST = 200_000  # targets
NO_POSTURE = "no posture within the joints' ranges is"  # how the reason begins where a posture is misstated


@dataclass(frozen=True, eq=False)
class Followed:
    """Joint values of N targets."""

    q: Array  # (N, A), rad or m: of the closest approach where a target was not reached
    reached: NDArray[np.bool_]  # (N,) bool
    reasons: dict[int, str]  # of the targets that were not reached
    switched: Integers  # (S,) int: targets before which the joints have to jump


def six_freedoms(kinematics: Kinematics) -> bool:
    """Tell whether a robot can take every pose: a machine of fewer joints follows positions only."""
    return len(kinematics.robot.actuated) >= 6


def external_axes(kinematics: Kinematics, path: ToolPath) -> Array:
    """Return where a path says that joints stand, (N, A), rad or m; NaN: it does not.

    Its columns, and axes of a program beside the robot's, that are called as joints are external axes, where
    six others are left to reach its targets.

    Raises
    ------
    BeamstiffError
        When one is out of its joint's range.
    """
    every = kinematics.robot.actuated
    unit_of = {"angle": np.pi / 180.0, "length": 1e-3}  # of a program
    axes = {name.casefold(): values for name, values in path.external.items()}
    stated = {
        one.name: unit_of[one.kind] * axes[one.name.casefold()]
        for one in every
        if one.name.casefold() in axes
    }
    stated |= {one.name: path.columns[one.name] for one in every if one.name in path.columns}
    held = np.full((len(path), len(every)), np.nan)
    if len(every) - len(stated) < 6:
        return held
    for at, variable in enumerate(every):
        if variable.name in stated:
            held[:, at] = stated[variable.name]
            low, high = variable.limits or (-np.inf, np.inf)
            for row in np.flatnonzero((held[:, at] < low) | (held[:, at] > high)).tolist():
                unit = "rad" if variable.kind == "angle" else "m"
                raise BeamstiffError(
                    f"{path.place(row)}: {variable.name}: found {held[row, at]:.6g} {unit}, expected "
                    f"{low:.6g} to {high:.6g} {unit}: the robot file's limits; the header states the unit"
                )
    return held


def solve(
    kinematics: Kinematics, poses: Array, start: Array | None, restarts: int, held: Array | None = None
) -> InverseResult:
    """Return inverse geometry of poses (K, 4, 4); of their positions where the joints are fewer than six.

    `held` (K, A): as of `external_axes`.
    """
    targets = poses if six_freedoms(kinematics) else poses[:, :3, 3]
    found = inverse_geometry(
        kinematics, targets, start=start, tolerance=TOLERANCE, restarts=restarts, held=held
    )
    near = (found.position_error <= NEARLY) & (found.rotation_error <= NEARLY)
    return replace(found, reached=near)


def follow_path(machine: Machine, path: ToolPath, tool: Array, start: Array | None = None) -> Followed:
    """Return joint values that bring the tool to its poses (N, 4, 4), in the postures that the path states.

    `start`: as of `follow`; it goes before what the path states.
    """
    stated = path.stated_postures if start is None else ()
    arm = arm_of(machine.kinematics) if stated else None
    held = external_axes(machine.kinematics, path)
    return follow(machine.kinematics, machine.frames.node_poses(tool), start, arm, stated, path.joints, held)


def follow(
    kinematics: Kinematics,
    poses: Array,
    start: Array | None = None,
    arm: Arm | None = None,
    stated: Sequence[StatedPosture | None] = (),
    given: Array | None = None,
    held: Array | None = None,
) -> Followed:
    """Return joint values that bring the `tcp` node to the poses one after the other.

    `poses` (N, 4, 4): base frame, m. `start` (A,): a posture near the first target, which chooses the branch;
    rad or m. `stated` (N or 0): postures that the targets state, of the `arm`; they go before nearness.
    `given` (N, A): joint values of targets that state these; NaN elsewhere. `held` (N, A): as of
    `external_axes`; default none.
    """
    count, actuated = len(poses), len(kinematics.robot.actuated)
    held = np.full((count, actuated), np.nan) if held is None else held
    q, reached = np.zeros((count, actuated)), np.zeros(count, dtype=np.bool_)
    reasons: dict[int, str] = {}
    switched: list[int] = []
    anchor, run, row = start, 1, 0

    def fits(rows: Sequence[int], postures: Array) -> NDArray[np.bool_]:
        """Tell which postures are as their targets state."""
        result = np.ones(len(postures), dtype=np.bool_)
        if arm is None or not stated:
            return result
        wanted = [stated[at] for at in rows]
        for one in dict.fromkeys(wanted):
            if one is not None:
                mine = np.array([other == one for other in wanted])
                result[mine] = arm.fits(one, postures[mine])
        return result

    while row < count:
        some = slice(row, min(row + run, count))
        if given is not None and not np.isnan(given[row, 0]):
            q[row], reached[row], anchor = given[row], True, given[row]
            row += 1
            continue
        if anchor is not None:
            found = solve(kinematics, poses[some], anchor, 0, held[some])
            good = found.reached & _near(kinematics, np.vstack([anchor, found.q]))
            good &= fits(range(row, row + len(good)), found.q)
            if given is not None:
                good &= np.isnan(given[some, 0])
            done = len(good) if good.all() else int(np.argmin(good))
            q[row : row + done], reached[row : row + done] = found.q[:done], True
            if done:
                anchor, row = found.q[done - 1], row + done
                run = min(2 * run, LONGEST_RUN) if done == len(good) else max(1, done)
                continue
            if run > 1:
                run = 1
                continue
            walked = _walk(kinematics, anchor, poses[row], held[row])
            if walked is not None and fits([row], walked[None]).all():
                q[row], reached[row], anchor = walked, True, walked
                row += 1
                continue
        # whoever is out of reach has neighbours that are: they are looked for together
        some = slice(row, min(row + SEARCHED, count)) if row else slice(0, 1)
        found = solve(kinematics, poses[some], anchor, RESTARTS, held[some])
        lost = int(np.argmax(found.reached)) if found.reached.any() else len(found.reached)
        for at in range(lost):
            q[row + at], said = found.q[at], shortfall(kinematics, found, at)
            reasons[row + at] = said + _if_turned(kinematics, poses[row + at], held[row + at])
        row += lost
        if lost == 0:  # else the way there may be short again
            wanted = stated[row] if stated and arm is not None else None
            chosen = _convenient(kinematics, poses[row], found.q[0], anchor, arm, wanted, held[row])
            if arm is not None and wanted is not None and not len(chosen):
                q[row] = found.q[0]
                reasons[row] = f"{NO_POSTURE} {wanted.text}{_reachable(arm, poses[row], q[row], wanted)}"
                row += 1
                continue
            q[row], reached[row] = chosen, True
            if row and anchor is not None and wanted is None:
                switched.append(row)
            anchor = q[row]
            row += 1
    return Followed(q, reached, reasons, np.array(switched, dtype=np.int64))


def _convenient(
    kinematics: Kinematics,
    pose: Array,
    known: Array,
    near: Array | None,
    arm: Arm | None,
    stated: StatedPosture | None,
    held: Array,
) -> Array:
    """Return of many solutions at a pose the one nearest to a posture, or to the middle of the ranges.

    Where a posture is stated: of those that are as stated; nothing (0,) where none is.
    """
    low, high = _ranges(kinematics)
    count = TRIED if arm is None or stated is None else POOL
    starts = np.random.default_rng(0).uniform(low, high, (count, len(low)))
    if arm is not None and stated is not None:  # on its side of the singularities, whatever the turns
        mine = arm.fits(replace(stated, turns=()), starts)
        if not mine.any():
            return np.zeros(0)
        starts = starts[mine][:TRIED]
    q = _solutions(kinematics, pose, known, starts, held)
    if arm is not None and stated is not None:
        q = arm.turned(stated, q)
        inside = ((q >= low - AT_LIMIT) & (q <= high + AT_LIMIT)).all(axis=1)
        q = q[arm.fits(stated, q) & inside]
        if not len(q):
            return np.zeros(0)
    wanted = 0.5 * (low + high) if near is None else near
    off = np.sum(((q - wanted) / (high - low)) ** 2, axis=1)
    return np.asarray(q[int(np.argmin(off))])


def _solutions(
    kinematics: Kinematics, pose: Array, known: Array, starts: Array, held: Array | None = None
) -> Array:
    """Return joint values (S, A) at which a pose (4, 4) is reached from some starts, the `known` first."""
    found = solve(kinematics, np.repeat(pose[None], len(starts), axis=0), starts, 0, held)
    return np.vstack([known, found.q[found.reached]])


def _ranges(kinematics: Kinematics) -> tuple[Array, Array]:
    """Return the lowest and the highest joint values, (A,) each, rad or m."""
    limits = [variable.limits or (-np.pi, np.pi) for variable in kinematics.robot.actuated]
    low, high = np.array(limits).T
    return low, high


def _reachable(arm: Arm, pose: Array, known: Array, stated: StatedPosture) -> str:
    """Return, in words, in which configurations a pose (4, 4) is reachable that is not in the stated one.

    Those most like it, and that nearest the middle of the joints' ranges: programs state zeros that nobody
    chose.
    """
    kinematics = arm.kinematics
    low, high = _ranges(kinematics)
    starts = np.random.default_rng(0).uniform(low, high, (POOL, len(low)))
    mine = arm.fits(replace(stated, turns=()), starts)  # the sides as stated, and any
    starts = np.vstack([starts[mine][:TRIED], starts[:TRIED]])
    q = _solutions(kinematics, pose, known, starts)
    turned = arm.turned(stated, q)
    inside = (turned >= low - AT_LIMIT) & (turned <= high + AT_LIMIT)
    q = np.where(inside, turned, q)
    if not (said := arm.reachable_as(stated, q)) or stated.write is None:
        return ""
    easy = q[int(np.argmin((((q - 0.5 * (low + high)) / (high - low)) ** 2).sum(axis=1)))]
    own = stated.write(stated, arm.configuration(stated, easy))
    if own in said:
        return f"; reachable as {said}"
    values = zip(kinematics.robot.actuated, np.degrees(easy).tolist(), strict=True)
    chosen = ",".join(f"{one.name}={round(value)}deg" for one, value in values)
    return f"; reachable as {said}, or, nearest the middle of the joints' ranges, as {own} (--q {chosen})"


def shortfall(kinematics: Kinematics, found: InverseResult, row: int) -> str:
    """Return how far from a target the robot stays, and which joints are at their limits."""
    parts = []
    if found.position_error[row] > NEARLY:
        parts.append(f"{1e3 * found.position_error[row]:.3g} mm")
    if found.rotation_error[row] > NEARLY:
        parts.append(f"{np.degrees(found.rotation_error[row]):.3g} deg")
    held = [
        variable.name
        for variable, value in zip(kinematics.robot.actuated, found.q[row].tolist(), strict=True)
        if variable.limits is not None
        and (value <= variable.limits[0] + AT_LIMIT or value >= variable.limits[1] - AT_LIMIT)
    ]
    limits = f", {' and '.join(held)} at the limit" if held else ""
    return f"out of reach by {' and '.join(parts) or 'nothing that shows'}{limits}"


def _if_turned(kinematics: Kinematics, pose: Array, held: Array) -> str:
    """Return, in words, that a pose (4, 4) out of reach is one by its orientation; empty where it is not."""
    if not six_freedoms(kinematics):
        return ""
    near = inverse_geometry(kinematics, pose[:3, 3], tolerance=TOLERANCE, restarts=FREELY, held=held)
    by_turn = near.position_error[0] <= NEARLY
    return "; with another orientation the TCP reaches this place" if by_turn else ""


def _near(kinematics: Kinematics, q: Array) -> NDArray[np.bool_]:
    """Tell of every row but the first whether no joint jumps to it from the row before."""
    size = np.array([1.0 if v.kind == "angle" else kinematics.size for v in kinematics.robot.actuated])
    near: NDArray[np.bool_] = (np.abs(np.diff(q, axis=0)) / size).max(axis=1, initial=0.0) <= JUMP
    return near


def _walk(kinematics: Kinematics, start: Array, goal: Array, held: Array) -> Array | None:
    """Return joint values at a pose reached in small steps along the straight line, or None."""
    first = pose_of(kinematics, posture(kinematics, start), kinematics.robot.tcp)[0]
    q = start
    shares = np.linspace(0.0, 1.0, WALK + 1)[1:]
    for share, pose in zip(shares.tolist(), between(first[None], goal[None], shares), strict=True):
        found = solve(kinematics, pose[None], q, 0, start + share * (held - start))
        if not (found.reached.all() and _near(kinematics, np.vstack([q, found.q])).all()):
            return None
        q = found.q[0]
    return q


def between(first: Array, second: Array, share: Array) -> Array:
    """Return poses (K, 4, 4) a share (K,) of the way between poses: along the line, turned about one axis."""
    turn = first[:, :3, :3].swapaxes(1, 2) @ second[:, :3, :3]
    vector = share[:, None] * vector_from_rotation(turn)
    rotation = first[:, :3, :3] @ Rotation.from_rotvec(vector).as_matrix()
    position = first[:, :3, 3] + share[:, None] * (second[:, :3, 3] - first[:, :3, 3])
    return transform(rotation, position)


def resample(path: ToolPath, step: float = np.inf, angle: float = np.inf) -> ToolPath:
    """Return the path with targets put in between, evenly: along straight lines, turning about one axis.

    `step`, `angle`: largest distance, m, and turn, rad, from a target to the next. Returns ToolPath: the
    targets of old are all there. The others are called ``P1+1/4``, one of four parts of the way from P1 to
    its successor; loads and columns are interpolated linearly.
    """
    if not (step > 0 and angle > 0):
        raise BeamstiffError(f"found the steps {step:g} m and {angle:g} rad, expected positive ones")
    if len(path) < 2:
        return path
    poses = path.poses
    way = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turn = np.linalg.norm(vector_from_rotation(poses[:-1, :3, :3].swapaxes(1, 2) @ poses[1:, :3, :3]), axis=1)
    parts = np.maximum(1.0, np.ceil(np.maximum(way / step, turn / angle) - 1e-9))
    if parts.sum() >= MOST:
        raise BeamstiffError(
            f"{path.source}: found steps for {parts.sum():.0f} targets, expected {MOST} at most"
        )
    counts = parts.astype(np.int64)
    segment = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / counts[segment]
    new = between(poses[segment], poses[segment + 1], share)
    new[number == 0] = poses[:-1]

    def along(values: Array) -> Array:
        weight = share if values.ndim == 1 else share[:, None]
        inner = (1 - weight) * values[segment] + weight * values[segment + 1]
        return np.concatenate([inner, values[-1:]])

    names = [
        path.names[at] if part == 0 else f"{path.names[at]}+{part}/{counts[at]}"
        for at, part in zip(segment.tolist(), number.tolist(), strict=True)
    ]
    return replace(
        path,
        names=(*names, path.names[-1]),
        lines=np.concatenate([path.lines[segment], path.lines[-1:]]),
        poses=np.concatenate([new, poses[-1:]]),
        turns=np.concatenate([path.turns[segment], path.turns[-1:]]),
        wrench=None if path.wrench is None else along(path.wrench),
        columns={name: along(values) for name, values in path.columns.items()},
        external={name: along(values) for name, values in path.external.items()},
        stated_postures=tuple(
            path.stated_postures[at] if part == 0 else None
            for at, part in zip([*segment.tolist(), len(path) - 1], [*number.tolist(), 0], strict=True)
            if path.stated_postures
        ),
        joints=None,
        files=(),
    )
