"""Path correction by fake poses: commands ``P' = P - dP`` that bring the real robot to its targets.

At the solution the tool is where it should be, and so the process load is that at the target: the correction
needs no equilibrium. What happens without it, or with a command that is not quite right, does: there the load
follows the tool and the tool the load.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.follow import external_axes, follow_path, shortfall, six_freedoms, solve
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath, difference
from beamstiff.compensation.process.load import Process, Together
from beamstiff.compensation.taught_base import TaughtBase, taught_base
from beamstiff.diagnosis.effects.approach_direction import approach_of
from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import Integers
from beamstiff.robot.kinematics import pose_of, posture, twist_jacobian
from beamstiff.se3 import Array, rotation_from_vector, skew

CLOSE, ENOUGH = 1e-8, 4e-7  # m and rad: what remains of the error; at most, beside a singular posture
PARTLY = 0.1  # of the error: what the best command may leave where none is exact, since the machine jumps
ROUNDS = 40
SETTLED = 1e-10  # m and rad
GEOMETRY, DEFORMATION, EFFECTS = "geometry", "weight_and_load", "effects"  # that an error comes from
LONGEST_STEP = 3.0  # of the error that it is to take away
FREE = 1e-6  # of the largest velocity: a direction in which the tool moves


@dataclass(frozen=True, eq=False)
class Correction:
    """A path, where the tool would go without and with correction, and the commands; N targets."""

    path: ToolPath  # in the base frame, as programmed
    # (N, 4, 4): where the real tool is meant to be; with `taught` where it is without load, with a base that
    # the robot taught where the workpiece stands, else as programmed
    targets: Array
    # before, after: (N, 6): error of the tool ``[p - p_t, rotation vector of R R_t^T]``, base frame, m and
    # rad. NaN where the robot cannot follow
    before: Array
    after: Array
    # (N, 4, 4): poses of the tool to send the controller to, base frame; the target's own where it is not
    # corrected
    commands: Array
    q: Array  # (N, A): joint values of the controller at these
    wrench: Array  # (N, 6): process load at the targets, on the tool's tip
    turned: NDArray[np.bool_]  # (N,) bool: whether the orientation is corrected too
    reasons: dict[int, str]  # targets that are not corrected
    switched: Integers  # (S,) int: targets before which the joints have to jump
    rounds: int  # of the iteration
    q_before: Array  # (N, A): joint values of the controller at the poses as programmed
    # targets that no command is exact for, and the error (6,) of the best, m and rad: a machine that jumps
    partly: dict[int, Array] = field(default_factory=dict)
    taught_base: TaughtBase | None = None  # where the real robot taught it; None: measured otherwise

    @property
    def corrected(self) -> NDArray[np.bool_]:
        """(N,) bool array: which targets have a command of their own."""
        mask = np.ones(len(self.path), dtype=np.bool_)
        mask[list(self.reasons)] = False
        return mask

    def without(self, rows: list[int], reason: str) -> Self:
        """Return the correction with some targets left as they are, for a reason."""
        commands = self.commands.copy()
        commands[rows] = self.path.poses[rows]
        reasons = dict(sorted((self.reasons | dict.fromkeys(rows, reason)).items()))
        return replace(self, commands=commands, reasons=reasons)


def correct_path(
    machine: Machine,
    path: ToolPath,
    load: Process | None = None,
    *,
    start: Array | None = None,
    taught: bool = False,
    positions_only: bool = False,
    base_taught: Array | None = None,
) -> Correction:
    """Return the commands that bring the real tool to its targets under load.

    `path`: in the base frame (`Frames.to_base`). `load`: default: none. `start` (A,): a posture near the
    first target, to choose the branch in place of the postures that the path states; default, where it states
    none: where the robot was measured. `taught`: the targets were taught on the unloaded robot: it reaches
    them as they are, only what the load does is corrected. `positions_only`: leave the orientations of the
    commands as they are. So it is for robots of fewer than six joints. `base_taught` (3, 3): points of the
    frame of the path, m, by which the real robot taught it, in the orientation of the nearest target: the
    workpiece stands where its unloaded tool was then.
    """
    load = load or Together()
    whole = six_freedoms(machine.kinematics)
    if whole and not path.stated:
        raise BeamstiffError(
            f"{path.source}: found no orientations, expected columns a, b, c (a rotation vector, or as a "
            "line '# orientation: KUKA ABC' before the header says), qw to qz, or i, j, k: the postures of "
            f"{machine.controller.name!r} follow from them"
        )
    if not whole and not np.allclose(machine.frames.tool, np.eye(4)):
        raise BeamstiffError(
            f"robot {machine.controller.name!r} has fewer than six joints: its tool has to be its TCP, found "
            "another"
        )
    turned = path.turns & (whole and not positions_only)
    if start is None and not any(path.stated_postures):
        start = machine.measured
    first = follow_path(machine, path, path.poses, start)
    rows = np.flatnonzero(first.reached)
    if not whole and rows.size:  # then orientations are what they are
        path = _as_they_are(machine, path, first.q, rows)
    reasons, partly, count = dict(first.reasons), dict[int, Array](), len(path)
    before, after, wrench = np.full((count, 6), np.nan), np.full((count, 6), np.nan), np.zeros((count, 6))
    commands, q, targets, rounds = path.poses.copy(), first.q.copy(), path.poses.copy(), 0
    base: TaughtBase | None = None
    if rows.size:
        some, approached = path.at(rows), approach_of(first.q[rows])
        held = external_axes(machine.kinematics, some)
        if taught:
            targets[rows] = _unloaded(machine, first.q[rows], some.poses, approached)
        if base_taught is not None:
            reached = partial(_unloaded, machine)
            base = taught_base(machine, base_taught, some.poses, first.q[rows], reached, held)
            targets[rows] = base.motion @ some.poses
        meant, load_at = targets[rows], _load_at(load, some, targets[rows])
        before[rows] = difference(settled(machine, first.q[rows], load_at, meant, approached), meant)
        wrench[rows] = load_at(meant)
        start_at = _Start(some.poses, first.q[rows], turned[rows], held, approached)
        found = _commands(machine, meant, wrench[rows], start_at)
        commands[rows], q[rows], rounds = found.poses, found.q, found.rounds
        for row, reason in found.reasons.items():
            reasons[int(rows[row])] = reason
        partly = {int(rows[row]): left for row, left in found.partly.items()}
        after[rows] = difference(settled(machine, q[rows], load_at, meant, approached), meant)
    return Correction(
        path=path,
        targets=targets,
        before=before,
        after=after,
        commands=commands,
        q=q,
        wrench=wrench,
        turned=turned,
        reasons=dict(sorted(reasons.items())),
        switched=first.switched,
        rounds=rounds,
        q_before=first.q,
        partly=partly,
        taught_base=base,
    )


def base_errors(machine: Machine, correction: Correction) -> Array:
    """Return what a base has in it that the robot itself taught on the path, (N, 3), m; NaN: nothing follows.

    The small motion of a workpiece as a body that is nearest to the errors without process load.
    """
    errors = np.full((len(correction.path), 3), np.nan)
    rows = np.flatnonzero(~np.isnan(correction.before[:, 0]))
    if rows.size:
        meant = correction.targets[rows]
        q = correction.q_before[rows]
        moved = difference(_unloaded(machine, q, meant, approach_of(q)), meant)[:, :3]
        turns = -skew(meant[:, :3, 3] - meant[:, :3, 3].mean(axis=0))
        motions = np.concatenate([np.tile(np.eye(3), (rows.size, 1, 1)), turns], axis=2).reshape(-1, 6)
        errors[rows] = (motions @ np.linalg.lstsq(motions, moved.ravel(), rcond=None)[0]).reshape(-1, 3)
    return errors


def error_parts(
    machine: Machine, correction: Correction, load: Process | None = None, taught: bool = False
) -> dict[str, Array]:
    """Return what the errors of a path as programmed come from: parts (N, 6) that sum to them, m and rad.

    One is added to the other: the geometry of the real robot; how weight and load deform it; its effects. Of
    targets that were `taught` the load's share of these alone. Where the robot taught the base, each with the
    base that a robot of this kind taught. NaN where the robot cannot follow.
    """
    rows = np.flatnonzero(~np.isnan(correction.before[:, 0]))
    robot = machine.real.model_copy(update={"effects": ()})
    bare, q, meant = replace(machine, actual=robot), correction.q_before[rows], correction.targets[rows]
    if not rows.size:
        return {}
    path, base = correction.path.at(rows), correction.taught_base
    stiff = meant
    if base is not None:
        stiff = base.motion_to(machine.undeformed(base.q)[:, :3, 3]) @ path.poses
        meant = base.motion_to(_unloaded(bare, base.q, base.poses)[:, :3, 3]) @ path.poses
    load_at = _load_at(load or Together(), path, meant)
    first = difference(_unloaded(bare, q, meant) if taught else machine.undeformed(q), stiff)
    deformed = difference(settled(bare, q, load_at, meant), meant) - first  # `bare` has no lost motion
    parts = {} if taught else {GEOMETRY: first}
    parts[DEFORMATION] = deformed
    if machine.real.effects:
        parts[EFFECTS] = correction.before[rows] - deformed - parts.get(GEOMETRY, 0.0)
    result = {name: np.full((len(correction.path), 6), np.nan) for name in parts}
    for name, values in parts.items():
        result[name][rows] = values
    return result


def errors_of(
    machine: Machine, correction: Correction, commands: Array, load: Process | None = None
) -> Array:
    """Return the error (N, 6) of the real tool for commands (N, 4, 4), such as those read back from a file.

    Where the robot cannot follow: NaN.
    """
    load = load or Together()
    held = external_axes(machine.kinematics, correction.path)
    found = solve(machine.kinematics, machine.frames.node_poses(commands), correction.q, 0, held)
    rows = np.flatnonzero(found.reached & ~np.isnan(correction.before[:, 0]))
    errors = np.full((len(commands), 6), np.nan)
    if rows.size:
        meant = correction.targets[rows]
        load_at = _load_at(load, correction.path.at(rows), meant)
        approached = approach_of(correction.q_before[rows])
        errors[rows] = difference(settled(machine, found.q[rows], load_at, meant, approached), meant)
    return errors


def _as_they_are(machine: Machine, path: ToolPath, q: Array, rows: NDArray[np.intp]) -> ToolPath:
    """Return the path with the orientations that the controller's robot has at its targets."""
    poses = path.poses.copy()
    at = pose_of(machine.kinematics, posture(machine.kinematics, q[rows]), machine.controller.tcp)
    poses[rows, :3, :3] = at[:, :3, :3]
    return path.moved_to(poses)


def shown_error(error: Array) -> str:
    """Return the size of an error (6,), m and rad, as people read it."""
    far, turned = np.linalg.norm(error[:3]), np.linalg.norm(error[3:])
    return f"{1e3 * far:.3g} mm and {np.degrees(turned):.3g} deg"


@dataclass(frozen=True, eq=False)
class _Commands:
    poses: Array
    q: Array
    reasons: dict[int, str]
    rounds: int
    partly: dict[int, Array]


@dataclass(frozen=True, eq=False)
class _Start:
    """Commands to begin with: poses (N, 4, 4), joint values (N, A); what of these may change.

    `held` (N, A): as of `external_axes`. `approached` (N, A): directions in which the joints last moved on
    the path as programmed: corrections are far smaller than its motions.
    """

    poses: Array
    q: Array
    turned: NDArray[np.bool_]
    held: Array
    approached: Array


def _commands(machine: Machine, targets: Array, wrench: Array, start: _Start) -> _Commands:
    """Iterate ``P' = P - dP`` for all targets at once, until the real tool is at them.

    Beside a singular posture a little of the command turns the joints, and so the error, far: there the steps
    need Broyden's method, of which the first is ``-dP``. The best command of all rounds is kept.
    """
    commands, q = start.poses.copy(), start.q.copy()
    best, best_q, least = commands.copy(), q.copy(), np.full(len(targets), np.inf)
    rest = np.zeros((len(targets), 6))
    whole = least
    reasons: dict[int, str] = {}
    left = np.arange(len(targets))
    error, step = np.zeros((len(targets), 6)), np.zeros((len(targets), 6))
    inverse = np.tile(np.eye(6), (len(targets), 1, 1))
    for count in range(1, ROUNDS + 1):
        reached = machine.displaced(
            machine.undeformed(q[left]),
            machine.moved(q[left], wrench[left], targets[left], start.approached[left]),
        )
        old = error[left]
        error[left] = difference(reached, targets[left])
        error[~start.turned, 3:] = 0.0
        error[left, :3] = _possible(machine, q[left], error[left, :3])
        if count > 1:
            inverse[left] = _secant(inverse[left], step[left], error[left] - old)
        size = np.abs(error[left]).max(axis=1, initial=0.0)
        better = left[size < least[left]]
        best[better], best_q[better], rest[better] = commands[better], q[better], error[better]
        least[left] = np.minimum(size, least[left])
        whole = size if count == 1 else whole
        left = left[size > CLOSE]
        if not left.size:
            break
        step[left] = _steps(inverse[left], error[left])
        commands[left, :3, 3] += step[left, :3]
        commands[left, :3, :3] = rotation_from_vector(step[left, 3:]) @ commands[left, :3, :3]
        poses = machine.frames.node_poses(commands[left])
        found = solve(machine.kinematics, poses, q[left], 0, start.held[left])
        q[left] = found.q
        for at in np.flatnonzero(~found.reached).tolist():
            row = int(left[at])
            if least[row] > ENOUGH:  # else it was good enough already
                reasons[row] = f"its correction is {shortfall(machine.kinematics, found, at)}"
        left = left[found.reached]
        if not left.size:
            break
    partly: dict[int, Array] = {}
    for row in left[least[left] > ENOUGH].tolist():
        if least[row] <= PARTLY * whole[row]:
            partly[row] = rest[row]
        else:
            reasons[row] = f"no command found: {shown_error(rest[row])} remain"
    for row in reasons:
        best[row], best_q[row] = start.poses[row], start.q[row]
    return _Commands(best, best_q, reasons, count, partly)


def _steps(inverse: Array, error: Array) -> Array:
    """Return the steps (K, 6) that take errors (K, 6) away; less where they would be far longer."""
    step: Array = -np.einsum("nij,nj->ni", inverse, error)
    most = LONGEST_STEP * np.abs(error).max(axis=1, keepdims=True)
    result: Array = step * np.minimum(1.0, most / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
    return result


def _secant(inverse: Array, step: Array, change: Array) -> Array:
    """Return approximate inverse derivatives (K, 6, 6) that explain a change (K, 6) by its step (K, 6)."""
    back = np.einsum("nij,nj->ni", inverse, change)
    row = np.einsum("ni,nij->nj", step, inverse)
    size = np.einsum("ni,ni->n", step, back)
    usable = np.abs(size) > 1e-30
    scale = np.where(usable, 1.0 / np.where(usable, size, 1.0), 0.0)
    return np.asarray(inverse + scale[:, None, None] * (step - back)[:, :, None] * row[:, None, :])


def _possible(machine: Machine, q: Array, errors: Array) -> Array:
    """Return the part of errors (N, 3) along which the tool moves: in its plane for a planar robot."""
    if six_freedoms(machine.kinematics):
        return errors
    kinematics = machine.kinematics
    jacobian = twist_jacobian(kinematics, posture(kinematics, q), machine.controller.tcp)[:, :3]
    left, size, _ = np.linalg.svd(jacobian, full_matrices=False)
    moving = size > FREE * size[:, :1]
    return np.asarray(np.einsum("nij,nj,nkj,nk->ni", left, moving, left, errors))


def _load_at(load: Process, path: ToolPath, targets: Array) -> Callable[[Array], Array]:
    """Return the load (N, 6) of poses (N, 4, 4) of the real tool.

    What a process knows of places is in the coordinates of the program: a tool at its target is where the
    program says, though the robot that was taught it stands elsewhere by its own errors.
    """
    if np.array_equal(path.poses, targets):
        return lambda poses: load.wrench(poses, path)

    def shifted(poses: Array) -> Array:
        seen = poses.copy()
        seen[:, :3, 3] += path.poses[:, :3, 3] - targets[:, :3, 3]
        turn = targets[:, :3, :3].swapaxes(1, 2) @ path.poses[:, :3, :3]
        seen[:, :3, :3] = poses[:, :3, :3] @ turn
        return load.wrench(seen, path)

    return shifted


def _unloaded(machine: Machine, q: Array, near: Array, approached: Array | None = None) -> Array:
    """Return the poses (N, 4, 4) of the real tool without process load, for joint values (N, A)."""
    still = np.zeros((len(q), 6))
    return settled(machine, q, lambda _: still, near, approached)


def settled(
    machine: Machine,
    q: Array,
    load: Callable[[Array], Array],
    near: Array,
    approached: Array | None = None,
) -> Array:
    """Return the poses (N, 4, 4) at which load and displacement agree, for joint values (N, A), from `near`.

    `approached`: as of `Machine.moved`.

    Broyden's method on ``x = moved(q, load(x))``, all targets at once; its first step is the fixed point's.
    """
    undeformed = machine.undeformed(q)
    x = machine.moved(q, load(near), near, approached)
    inverse = np.broadcast_to(-np.eye(6), (len(q), 6, 6)).copy()
    gap: Array | None = None
    step = np.zeros_like(x)
    for _ in range(ROUNDS):
        at = machine.displaced(undeformed, x)
        new_gap = machine.moved(q, load(at), at, approached) - x
        if np.abs(new_gap).max() < SETTLED:
            return at
        if gap is not None:
            inverse = _secant(inverse, step, new_gap - gap)
        step = -np.einsum("nij,nj->ni", inverse, new_gap)
        x, gap = x + step, new_gap
    worst = int(np.argmax(np.abs(new_gap).max(axis=1)))
    raise BeamstiffError(
        f"no equilibrium of process load and robot, worst at target {worst + 1} within reach: the load "
        "grows faster than the robot resists"
    )
