"""Where the simulated machine's frames and nodes are before it deforms: frames walked, loops closed.

A frame of Khalil and Kleinfinger is ``Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Ry(beta) Tz(r)``. Loops are
closed by Newton's method with derivatives by complex steps, from the declared guess in the middle of the
limits along a straight way to each pose, which keeps the assembly branch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import Expression, parse_expression
from beamstiff.robot.parts import FRAME_PARAMETERS, Node

ORDER = ("gamma", "b", "alpha", "d", "theta", "beta", "r")
AXIS = {"gamma": 2, "b": 2, "alpha": 0, "d": 0, "theta": 2, "beta": 1, "r": 2}
STEP = 1e-30
CLOSED = 1e-13
WAY = 8

Numbers = NDArray[Any]  # real, or complex for derivatives
Place = tuple[Numbers, Numbers]  # rotation (P, 3, 3) and origin (P, 3)


@dataclass(frozen=True, eq=False)
class Placed:
    """A machine at P poses before it deforms."""

    values: Mapping[str, Array]  # (P,) each, rad or m; all joint variables
    rotations: Mapping[str, Array]  # (P, 3, 3) each; axes of every frame in the base frame
    origins: Mapping[str, Array]  # (P, 3) each, m

    def node(self, node: Node) -> Array:
        """Return the position of a node, (P, 3), m."""
        return np.asarray(self.origins[node.frame] + self.rotations[node.frame] @ np.array(node.at))


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The frames of a robot as expressions, with the errors that the true machine has."""

    robot: Robot
    # name, parent and parameters but those that are zero; parents first
    frames: tuple[tuple[str, str, Mapping[str, Expression]], ...]
    equals: Mapping[str, Expression]  # coupled variables


def skeleton_of(robot: Robot, errors: Mapping[str, float] | None = None) -> Skeleton:
    """Return the skeleton, with errors added to frame parameters by name (``f3.d``), rad or m."""
    errors = errors or {}
    kinds = {v.name: v.kind for v in robot.variables}
    frames, known, waiting = [], {"base"}, list(robot.frames)
    while waiting:
        frame = next(f for f in waiting if f.parent in known)
        waiting.remove(frame)
        known.add(frame.name)
        parameters = {}
        for name in ORDER:
            found = parse_expression(getattr(frame, name), FRAME_PARAMETERS[name], kinds)
            wrong = errors.get(f"{frame.name}.{name}", 0.0)
            if found.constant + wrong or found.coefficients:
                parameters[name] = Expression(found.constant + wrong, found.coefficients)
        frames.append((frame.name, frame.parent, parameters))
    equals = {
        v.name: parse_expression(v.equals, v.kind, kinds) for v in robot.variables if v.equals is not None
    }
    return Skeleton(robot, tuple(frames), equals)


def place(skeleton: Skeleton, q: Array, offsets: Mapping[str, float] | None = None) -> Placed:
    """Return the machine at drive readings (P, A), with encoder offsets added and all loops closed.

    Raises BeamstiffError when a loop does not close.
    """
    robot = skeleton.robot
    names = [v.name for v in robot.actuated]
    driven = {name: q[:, at] + (offsets or {}).get(name, 0.0) for at, name in enumerate(names)}
    if robot.loops:
        driven = _closed(skeleton, driven)
    values = _all(skeleton, driven)
    places = _walk(skeleton, values)
    return Placed(values, {n: p[0] for n, p in places.items()}, {n: p[1] for n, p in places.items()})


def _all(skeleton: Skeleton, values: Mapping[str, Numbers]) -> dict[str, Numbers]:
    known = dict(values)
    waiting = dict(skeleton.equals)
    while waiting:
        name = next(n for n, e in waiting.items() if all(c in known for c in e.coefficients))
        known[name] = _value(waiting.pop(name), known)
    return known


def _value(expression: Expression, values: Mapping[str, Numbers]) -> Any:
    total: Any = expression.constant
    for name, coefficient in expression.coefficients.items():
        total = total + coefficient * values[name]
    return total


def _walk(skeleton: Skeleton, values: Mapping[str, Numbers]) -> dict[str, Place]:
    some = next(iter(values.values())) if values else np.zeros(1)
    poses, kind = len(some), np.result_type(some, np.float64)
    columns = [np.tile(np.eye(3, dtype=kind)[i], (poses, 1)) for i in range(3)]
    walked: dict[str, tuple[list[Numbers], Numbers]] = {"base": (columns, np.zeros((poses, 3), dtype=kind))}
    for name, parent, parameters in skeleton.frames:
        axes, origin = list(walked[parent][0]), walked[parent][1]
        for parameter in ORDER:
            if parameter not in parameters:
                continue
            amount = np.broadcast_to(_value(parameters[parameter], values), (poses,))[:, None]
            i = AXIS[parameter]
            if FRAME_PARAMETERS[parameter] == "length":
                origin = origin + amount * axes[i]
            else:
                j, k = (i + 1) % 3, (i + 2) % 3
                c, s = np.cos(amount), np.sin(amount)
                axes[j], axes[k] = axes[j] * c + axes[k] * s, axes[k] * c - axes[j] * s
        walked[name] = (axes, origin)
    return {name: (np.stack(axes, axis=-1), origin) for name, (axes, origin) in walked.items()}


def _closed(skeleton: Skeleton, driven: dict[str, Array]) -> dict[str, Array]:
    """Return the values with the passive variables that close all loops."""
    passive = [v for v in skeleton.robot.variables if v.passive]
    poses = len(next(iter(driven.values())))
    middle = {
        v.name: np.full(poses, 0.5 * sum(v.limits) if v.limits else 0.0) for v in skeleton.robot.actuated
    }
    guess = np.tile([v.guess for v in passive], (poses, 1))
    names = [v.name for v in passive]
    found, gap = _newton(skeleton, names, middle, guess, 60)
    if gap.max() > CLOSED:  # the middle is out of reach: straight from the guess
        found, gap = _newton(skeleton, names, driven, guess, 60)
    else:
        for part in np.arange(1, WAY + 1) / WAY:
            there = {n: (1 - part) * middle[n] + part * driven[n] for n in driven}
            found, gap = _newton(skeleton, names, there, found, 30 if part == 1.0 else 4)
    if gap.max() > CLOSED:
        worst = int(gap.argmax())
        raise BeamstiffError(
            f"{skeleton.robot.name}: the true machine's loops stay {gap[worst]:.3g} m open at pose {worst}"
        )
    return driven | {name: np.asarray(found[:, at], dtype=np.float64) for at, name in enumerate(names)}


def _newton(
    skeleton: Skeleton, names: list[str], driven: Mapping[str, Array], passive: Array, most: int
) -> tuple[Array, Array]:
    count, poses = len(names), len(passive)
    steps = np.concatenate([np.zeros((1, count)), STEP * np.eye(count)])  # the gap itself, then its columns
    stalled = False
    for left in range(most, -1, -1):
        tried = (passive[None] + 1j * steps[:, None]).reshape(-1, count)
        values: dict[str, Numbers] = {name: np.tile(v, count + 1) for name, v in driven.items()}
        values |= {name: tried[:, at] for at, name in enumerate(names)}
        gaps = _gaps(skeleton, _all(skeleton, values)).reshape(count + 1, poses, -1)
        gap = gaps[0].real
        size = np.abs(gap).max(axis=1)
        if left == 0 or stalled or size.max() < 0.1 * CLOSED:
            break
        jacobian = np.moveaxis(gaps[1:].imag / STEP, 0, -1)
        change = -(np.linalg.pinv(jacobian, rcond=1e-9) @ gap[..., None])[..., 0]
        largest = np.abs(change).max(axis=1, keepdims=True)
        passive = passive + change * np.minimum(1.0, 0.3 / np.maximum(largest, 1e-300))
        stalled = bool(largest.max() < 1e-15)
    return passive, size


def _gaps(skeleton: Skeleton, values: Mapping[str, Numbers]) -> Numbers:
    robot, places = skeleton.robot, _walk(skeleton, values)
    nodes = {node.name: node for node in robot.nodes}

    def end(name: str) -> Place:
        if name in places:
            return places[name]
        axes, origin = places[nodes[name].frame]
        return axes, origin + axes @ np.array(nodes[name].at)

    gaps = []
    for loop in robot.loops:
        (axes, a), (other, b) = end(loop.a), end(loop.b)
        between = np.einsum("pji,pj->pi", axes, b - a)
        gaps.append(between[:, :2] if loop.constrain == "plane" else between)
        if loop.constrain == "pose":
            relative = np.einsum("pji,pjk->pik", axes, other)
            skew = [relative[:, k, j] - relative[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))]
            gaps.append(0.5 * np.stack(skew, axis=-1))
    return np.concatenate(gaps, axis=1)
