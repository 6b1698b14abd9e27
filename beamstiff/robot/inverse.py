"""Inverse geometry: actuated values that bring a node to a target, numerically, for many targets at once.

Levenberg and Marquardt's damped Gauss-Newton within the limits, passive variables following with their loops
closed, from the most promising of many seeded starts. A target that was not reached is said to be so.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.robot.closure import close_loops, free_of
from beamstiff.robot.forward import chain_to, place, twists_at
from beamstiff.robot.frames import Kinematics, all_values
from beamstiff.robot.kinematics import actuated_values, node_at, pose_of, posture_at
from beamstiff.robot.loops import LoopSystem, loop_equations, loop_system, rotation_vector_rate
from beamstiff.robot.newton import LARGEST_STEP, least_squares, newton
from beamstiff.se3 import Array, vector_from_rotation

POOL = 256  # starts to choose from
ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class InverseResult:
    """What inverse geometry found for P targets."""

    q: Array  # (P, A), rad or m: actuated variables of the closest approach, within their limits
    reached: NDArray[np.bool_]  # (P,): whether both errors are within the tolerance
    position_error: Array  # (P,), m
    rotation_error: Array  # (P,), rad: zero where only positions were asked for


@dataclass(frozen=True, eq=False)
class _Task:
    """A node to bring to targets: P rotations or none, P positions, lower and upper limits (P, A)."""

    kinematics: Kinematics
    system: LoopSystem
    node: int
    positions: Array
    rotations: Array | None
    lower: Array
    upper: Array


def inverse_geometry(
    kinematics: Kinematics,
    targets: ArrayLike,
    node: str | None = None,
    start: ArrayLike | None = None,
    seed: int = 0,
    tolerance: float = 1e-9,
    restarts: int = 120,
    held: ArrayLike | None = None,
) -> InverseResult:
    """Return actuated values that bring a node to the targets, within the limits of the actuated variables.

    Parameters
    ----------
    kinematics : Kinematics
    targets : (P, 4, 4) or (P, 3) array
        Poses of the node (orientation of its frame, position of the node) or positions only, base frame, m.
        A single (4, 4) or (3,) will do.
    node : str, optional
        Default the TCP.
    start : (A,) or (P, A) array, optional
        Where to start from first: of several solutions, the one nearby is found. rad or m.
    seed : int
        Of the random starts.
    tolerance : float
        What counts as reached, m and rad.
    restarts : int
        How many more starts a target gets that was not reached from the first.
    held : (A,) or (P, A) array, optional
        Values that actuated variables stay at; NaN: free. rad or m.

    Returns
    -------
    InverseResult

    Raises
    ------
    BeamstiffError
        When the targets are not poses or positions, or there is no such node.

    Examples
    --------
    >>> from beamstiff.robot.description import Robot
    >>> from beamstiff.robot.kinematics import compile_kinematics
    >>> from beamstiff.robot.parts import Frame, Node, Variable
    >>> arm = Robot(
    ...     name="arm",
    ...     variables=[Variable(name=name, type="revolute") for name in ("q1", "q2")],
    ...     frames=[Frame(name="f1", theta="q1"), Frame(name="f2", parent="f1", d=1.0, theta="q2")],
    ...     nodes=[Node(name="hand", frame="f2", at=(1.0, 0, 0))],
    ...     fixed=["hand"],
    ...     tcp="hand",
    ... )
    >>> result = inverse_geometry(compile_kinematics(arm), [[1.0, 1.0, 0.0], [3.0, 0.0, 0.0]])
    >>> result.reached, result.position_error.round(9)
    (array([ True, False]), array([0., 1.]))
    """
    positions, rotations = _targets(targets)
    robot = kinematics.robot
    lower = np.array([-np.inf if v.limits is None else v.limits[0] for v in robot.actuated])
    upper = np.array([np.inf if v.limits is None else v.limits[1] for v in robot.actuated])
    fixed = np.broadcast_to(np.nan if held is None else np.asarray(held), (len(positions), len(lower)))
    free, any_held = np.isnan(fixed), not np.isnan(fixed).all()
    lower, upper = np.where(free, lower, fixed), np.where(free, upper, fixed)
    at = node_at(kinematics, robot.tcp if node is None else node)
    task = _Task(kinematics, loop_system(kinematics), at, positions, rotations, lower, upper)
    unlimited = replace(task, lower=np.where(free, -np.inf, fixed), upper=np.where(free, np.inf, fixed))
    poses, actuated = lower.shape
    if not poses:
        return _result(task, np.zeros((0, actuated)), tolerance)

    @cache
    def pooled() -> tuple[Array, NDArray[np.intp]]:
        pool = _pool(task, seed)  # of closed loops, which take their time: made when first asked for
        return pool, _most_promising(task, pool, restarts + 1, seed)

    def promising(rows: NDArray[np.intp], attempt: int) -> Array:
        pool, order = pooled()
        begin = pool[order[rows, attempt]]
        if not any_held:
            return np.asarray(begin)
        q = np.where(free[rows], begin[:, :actuated], fixed[rows])
        return free_of(kinematics, close_loops(kinematics, q, strict=False).values)

    if start is None:
        first = promising(np.arange(poses), 0)
    else:
        given = actuated_values(robot, start)
        if len(given) not in (1, poses):
            raise BeamstiffError(f"found {len(given)} starts for {poses} targets, expected one or as many")
        some = slice(None) if any_held else slice(1)  # one start needs its loops closed once
        given = np.clip(given, lower[some], upper[some])
        closed = close_loops(kinematics, given, strict=False)
        values = free_of(kinematics, closed.values)
        first = np.broadcast_to(values, (poses, values.shape[1])).copy()
        open_ = np.flatnonzero(~np.broadcast_to(closed.closed, poses))
        if open_.size:
            first[open_] = promising(open_, 0)
    best, cost = first.copy(), np.full(poses, np.inf)
    result = _result(task, best[:, :actuated], tolerance)
    for attempt in range(restarts + 1):
        todo = np.flatnonzero(~result.reached)
        if not todo.size or not actuated:
            break
        begin = promising(todo, attempt) if attempt else first[todo]
        if attempt % 2 and not kinematics.loops:  # a limit in the way is passed a turn later
            begin = _turned_within(task, todo, _approach(unlimited, todo, begin, tolerance, patient=False)[0])
        found, found_cost = _approach(task, todo, begin, tolerance, patient=False)
        better = found_cost < cost[todo]
        best[todo[better]], cost[todo[better]] = found[better], found_cost[better]
        result = _result(task, best[:, :actuated], tolerance)
    todo = np.flatnonzero(~result.reached)
    if todo.size and actuated:  # out of reach: as close as it gets
        best[todo], _ = _approach(task, todo, best[todo], tolerance, patient=True)
        result = _result(task, best[:, :actuated], tolerance)
    return result


def _targets(targets: ArrayLike) -> tuple[Array, Array | None]:
    try:
        array = np.asarray(targets, dtype=np.float64)
    except (TypeError, ValueError):
        raise BeamstiffError(f"targets: found {str(targets)[:60]!r}, expected numbers") from None
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if not np.isfinite(array).all():
        raise BeamstiffError("targets: found values that are not finite")
    if array.ndim == 2 and array.shape[1] == 3:
        return array, None
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        raise BeamstiffError(
            f"targets: found shape {array.shape}, expected (P, 4, 4) transforms or (P, 3) positions"
        )
    rotations = array[:, :3, :3]
    wrong = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2)) > 1e-6
    wrong |= (np.linalg.det(rotations) < 0) | (np.abs(array[:, 3] - [0, 0, 0, 1]).max(axis=1) > 1e-9)
    if wrong.any():
        raise BeamstiffError(
            f"targets: pose {np.argmax(wrong)} is no rigid transform, expected a right-handed rotation and a "
            "last row 0 0 0 1"
        )
    return array[:, :3, 3], rotations


def _pool(task: _Task, seed: int) -> Array:
    """Return closed postures (K, A + Q) all over the limits, to start from."""
    kinematics, actuated = task.kinematics, task.lower.shape[1]
    reach = np.where(task.system.prismatic[:actuated], kinematics.size, np.pi)
    low = np.where(np.isfinite(task.lower), task.lower, -reach).min(axis=0)
    high = np.where(np.isfinite(task.upper), task.upper, reach).max(axis=0)
    random = np.random.default_rng(seed)
    q = np.concatenate([0.5 * (low + high)[None], random.uniform(low, high, (POOL, actuated))])
    values, closed, reasons = close_loops(kinematics, q, strict=False)
    if not closed.any():
        raise BeamstiffError(f"no posture within the limits closes its loops, for instance: {reasons[0]}")
    return free_of(kinematics, values)[closed]


def _most_promising(task: _Task, pool: Array, count: int, seed: int) -> NDArray[np.intp]:
    """Return which of the pool to start from for every target, (P, count): first the closest, then any."""
    at = pose_of(task.kinematics, posture_at(task.kinematics, all_values(task.kinematics, pool)), _name(task))
    away = ((task.positions[:, None] - at[None, :, :3, 3]) ** 2).sum(axis=2) / task.kinematics.size**2
    if task.rotations is not None:
        # |R - S|^2 = 6 - 2 trace(R^T S)
        away += 6.0 - 2.0 * task.rotations.reshape(-1, 9) @ at[:, :3, :3].reshape(-1, 9).T
    near = np.argsort(away, axis=1, kind="stable")[:, : (count + 1) // 2]
    anywhere = np.random.default_rng([seed, 1]).integers(len(pool), size=count - near.shape[1])
    return np.concatenate([near, np.broadcast_to(anywhere, (len(near), len(anywhere)))], axis=1)


def _turned_within(task: _Task, which: NDArray[np.intp], free: Array) -> Array:
    """Return values (K, A) with whole turns taken off the revolute variables, within the limits."""
    lower, upper = task.lower[which], task.upper[which]
    limited = np.isfinite(lower) & np.isfinite(upper)
    middle = 0.5 * (np.where(limited, lower, 0.0) + np.where(limited, upper, 0.0))
    turns = np.where(task.system.prismatic[: lower.shape[1]], 0.0, np.round((free - middle) / (2 * np.pi)))
    return np.clip(free - 2 * np.pi * turns, lower, upper)


def _name(task: _Task) -> str:
    return task.kinematics.node_names[task.node]


def _result(task: _Task, q: Array, tolerance: float) -> InverseResult:
    """Judge values by the same forward geometry that everyone uses, loops closed anew."""
    values, closed, _ = close_loops(task.kinematics, q, strict=False)
    at = pose_of(task.kinematics, posture_at(task.kinematics, values), _name(task))
    position_error = np.full(len(q), np.inf)
    rotation_error = np.where(closed, 0.0, np.inf)
    position_error[closed] = np.linalg.norm((at[:, :3, 3] - task.positions)[closed], axis=1)
    if task.rotations is not None:
        turn = (task.rotations @ np.swapaxes(at[:, :3, :3], 1, 2))[closed]
        rotation_error[closed] = np.linalg.norm(vector_from_rotation(turn), axis=1)
    reached = (position_error <= tolerance) & (rotation_error <= tolerance)
    return InverseResult(q, reached, position_error, rotation_error)


def _approach(
    task: _Task, which: NDArray[np.intp], start: Array, tolerance: float, patient: bool
) -> tuple[Array, Array]:
    """Levenberg-Marquardt from closed postures (K, A + Q): the closest ones and their squared errors.

    Unless `patient`, what comes closer but slowly is given up: another start will do better.
    """
    system, actuated = task.system, task.lower.shape[1]
    scale, free = system.scale, start.copy()
    error, jacobian, rates, _ = _errors(task, which, free)
    cost = (error**2).sum(axis=1)
    damping = np.full(len(free), 1e-2)
    enough = (1e-3 * min(tolerance, tolerance / task.kinematics.size)) ** 2
    active = np.flatnonzero(cost > enough)
    earlier = cost.copy()
    for iteration in range(ITERATIONS):
        if not active.size:
            break
        q, lower, upper = free[active, :actuated], task.lower[which[active]], task.upper[which[active]]
        gradient = (np.swapaxes(jacobian[active], 1, 2) @ error[active][:, :, None])[:, :, 0]
        # a variable at its limit stays there while the error pulls it out
        held = ((q <= lower) & (gradient < 0)) | ((q >= upper) & (gradient > 0)) | (lower == upper)
        j = np.where(held[:, None], 0.0, jacobian[active])
        normal = np.swapaxes(j, 1, 2) @ j
        # damping that fades with the error (Sugihara 2011) keeps the end quadratic, near singularities too
        weight = damping[active] * cost[active] + 1e-15 * (1.0 + np.trace(normal, axis1=1, axis2=2))
        normal += weight[:, None, None] * np.eye(actuated)
        step = np.linalg.solve(normal, np.where(held, 0.0, gradient)[:, :, None])[:, :, 0]
        step /= np.maximum(1.0, np.abs(step).max(axis=1) / (2 * LARGEST_STEP))[:, None]
        trial = free[active]
        trial[:, :actuated] = np.clip(q + step * scale[:actuated], lower, upper)
        moved = (trial[:, :actuated] - q) / scale[:actuated]
        fine = np.ones(len(active), dtype=np.bool_)
        if task.kinematics.loops:
            trial[:, actuated:] += (rates[active] @ moved[:, :, None])[:, :, 0] * scale[actuated:]
            trial, _, _, fine = newton(system, trial, iterations=8)
        new_error, new_jacobian, new_rates, same = _errors(task, which[active], trial)
        new_cost = (new_error**2).sum(axis=1)
        fine &= same & (new_cost < cost[active])
        taken = active[fine]
        free[taken], error[taken], cost[taken] = trial[fine], new_error[fine], new_cost[fine]
        jacobian[taken], rates[taken] = new_jacobian[fine], new_rates[fine]
        damping[active] = np.where(fine, np.maximum(0.2 * damping[active], 1e-9), 8.0 * damping[active])
        at_rest = np.abs(moved).max(axis=1) < 1e-14
        going = (cost[active] > enough) & (damping[active] < 1e12) & ~at_rest
        if not patient and iteration % 6 == 5:
            going &= cost[active] < 0.7 * earlier[active]
            earlier[active] = cost[active]
        active = active[going]
    return free, cost


def _errors(
    task: _Task, which: NDArray[np.intp], free: Array
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return errors, minus their derivative by the actuated variables, passive rates, and who is in branch.

    (K, 3 or 6), (K, 3 or 6, A), (K, Q, A), (K,); lengths in machine sizes, prismatic variables likewise.
    """
    kinematics, system, actuated = task.kinematics, task.system, task.lower.shape[1]
    chain = chain_to(kinematics, int(kinematics.node_frame[task.node]))
    bodies, screws = place(kinematics, all_values(kinematics, free), chain)
    point = bodies[-1].origin + np.tensordot(kinematics.node_at[task.node], bodies[-1].axes, 1)
    directions = kinematics.coupling.matrix * system.scale
    twists = np.moveaxis(twists_at(kinematics, screws, point, directions), -1, 0)
    passive = free.shape[1] - actuated
    rates, same = np.zeros((len(free), passive, actuated)), np.ones(len(free), dtype=np.bool_)
    if kinematics.loops:
        _, loops = loop_equations(system, free)
        to_passive = loops[:, :, actuated:]
        for column in np.flatnonzero(system.moving):
            rates[:, :, column] = -least_squares(to_passive, loops[:, :, column])
        if kinematics.assembly is not None:
            same = kinematics.assembly.same_branch(to_passive)
    moved = twists[:, :, :actuated] + twists[:, :, actuated:] @ rates
    size = kinematics.size
    error, jacobian = (task.positions[which] - point.T) / size, moved[:, :3] / size
    if task.rotations is not None:
        away = vector_from_rotation(task.rotations[which] @ bodies[-1].axes.transpose(2, 0, 1))
        error = np.concatenate([error, away], axis=1)
        jacobian = np.concatenate([jacobian, rotation_vector_rate(-away) @ moved[:, 3:]], axis=1)
    return error, jacobian, rates, same
