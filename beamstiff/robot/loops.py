"""The closure equations of a robot's loops: how far each is from closed, and how that changes.

The rows of a loop are written in the frame of its end `a`, and placed from the last frame that all loops
share, so they do not know where the machine stands. They are divided by the size of the machine; orientations
(rotation vectors) stand beside them as they are. Prismatic variables are likewise counted in machine sizes.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from beamstiff.expression_graph.expression import Recorder
from beamstiff.expression_graph.graph import ExpressionGraph, compile_graph
from beamstiff.robot.forward import Body, Screw, chain_to, place, twists_at
from beamstiff.robot.frames import MOTIONS, Kinematics, all_values
from beamstiff.se3 import Array, skew, vector_from_rotation

ROWS = {"position": 3, "plane": 2, "pose": 6}


@dataclass(frozen=True, eq=False)
class LoopSystem:
    """All loops of a robot together."""

    kinematics: Kinematics
    frames: tuple[int, ...]  # frames between the ends of the loops, the last one that all share first
    rows: tuple[slice, ...]  # rows of each loop
    prismatic: NDArray[np.bool_]  # (A + Q,): which free variables are lengths
    turning: NDArray[np.bool_]  # (A + Q,): which come to the same after a whole turn
    scale: Array  # (A + Q,): one rad, or one machine size, for each free variable
    actuated: int  # number of actuated variables A; the passive ones stand behind them
    moving: NDArray[np.bool_]  # (A,): which actuated variables move the loops at all
    program: ExpressionGraph | None = None  # the equations, for many poses: see `symbolic_stiffness`


@lru_cache(maxsize=32)
def loop_system(kinematics: Kinematics) -> LoopSystem:
    """Return the closure equations of a robot, compiled."""
    frames = _frames_between(kinematics)
    joined = kinematics.coupling
    ends = np.cumsum([0, *(ROWS[loop.constrain] for loop in kinematics.loops)])
    prismatic = kinematics.prismatic[[joined.names.index(name) for name in joined.free]]
    driving = np.abs(kinematics.coefficients[list(frames[1:])]).sum(axis=(0, 1)) @ np.abs(joined.matrix)
    return LoopSystem(
        kinematics=kinematics,
        frames=frames,
        rows=tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends)),
        prismatic=prismatic,
        turning=~prismatic & _whole_turns(kinematics),
        scale=np.where(prismatic, kinematics.size, 1.0),
        actuated=joined.actuated,
        moving=driving[: joined.actuated] > 0.0,
    )


def _whole_turns(kinematics: Kinematics) -> NDArray[np.bool_]:
    """Return which free variables move angles alone, each by a whole multiple, (A + Q,)."""
    angles = np.array([kind == "turn" for _, kind, _ in MOTIONS])
    by_free = kinematics.coefficients @ kinematics.coupling.matrix
    whole = np.abs(by_free - np.round(by_free)) < 1e-12
    return np.asarray(np.where(angles[:, None], whole, by_free == 0.0).all(axis=(0, 1)))


@lru_cache(maxsize=32)
def recorded(system: LoopSystem) -> LoopSystem:
    """Return the same system with its equations as a program, if they are of sums and products alone."""
    if any(loop.constrain == "pose" for loop in system.kinematics.loops):
        return system  # rotation vectors have branches
    recorder = Recorder()
    free = recorder.inputs(len(system.scale))
    gaps, jacobian = loop_equations(system, free[None])
    program = compile_graph(recorder, len(free), [*gaps.ravel(), *jacobian.ravel()])
    return replace(system, program=program)


def _frames_between(kinematics: Kinematics) -> tuple[int, ...]:
    """Return the frames on the ways from the last common frame to all ends, parents first."""
    ways = [
        chain_to(kinematics, frame) for loop in kinematics.loops for frame in (loop.frame_a, loop.frame_b)
    ]
    if not ways:
        return (0,)
    shared = 0
    while all(len(way) > shared + 1 and way[shared + 1] == ways[0][shared + 1] for way in ways):
        shared += 1
    # frames are numbered parents first
    return tuple(sorted({frame for way in ways for frame in way[shared:]}))


def loop_equations(system: LoopSystem, free: Array) -> tuple[Array, Array]:
    """Return how far the loops are from closed (P, M), with derivatives by all free variables (P, M, A + Q).

    In machine sizes and rad, the derivative per `system.scale` of the variable; `free` is (P, A + Q), rad or
    m.
    """
    if system.program is not None:
        rows = system.program.run(free.T)
        gaps = np.ascontiguousarray(rows[: system.rows[-1].stop].T)
        jacobian = np.ascontiguousarray(rows[system.rows[-1].stop :].T)
        return gaps, jacobian.reshape(len(free), system.rows[-1].stop, free.shape[1])
    bodies, screws = place(system.kinematics, all_values(system.kinematics, free), system.frames)
    return equations_at(system, dict(zip(system.frames, bodies, strict=True)), screws)


def equations_at(
    system: LoopSystem, bodies: Mapping[int, Body], screws: Sequence[Screw]
) -> tuple[Array, Array]:
    """Return what `loop_equations` does, where the frames and screws between the ends are known already."""
    kinematics, rows = system.kinematics, system.rows
    directions = kinematics.coupling.matrix * system.scale
    poses = bodies[system.frames[0]].origin.shape[1]
    kind = np.result_type(*(item for body in bodies.values() for item in body))
    gaps = np.empty((rows[-1].stop, poses), dtype=kind)
    jacobian = np.empty((rows[-1].stop, directions.shape[1], poses), dtype=kind)
    for loop, part in zip(kinematics.loops, rows, strict=True):
        a, b = bodies[loop.frame_a], bodies[loop.frame_b]
        end = b.origin + np.tensordot(loop.at_b, b.axes, 1)
        # b as seen from a, at the point of a that lies where the end of b is
        way_a, way_b = chain_to(kinematics, loop.frame_a), chain_to(kinematics, loop.frame_b)
        relative = twists_at(
            kinematics,
            [screw for screw in screws if screw.frame in way_b and screw.frame not in way_a],
            end,
            directions,
            backward=[screw for screw in screws if screw.frame in way_a and screw.frame not in way_b],
        )
        gap = (_into(a, end - a.origin) - loop.at_a[:, None]) / kinematics.size
        rate = _into(a, relative[:3]) / kinematics.size
        if loop.constrain == "pose":
            turn = np.array([_into(a, axis) for axis in b.axes])  # (axis of b, component in a, P)
            angle = vector_from_rotation(turn.transpose(2, 1, 0))
            turning = np.moveaxis(_into(a, relative[3:]), -1, 0)
            gap = np.concatenate([gap, angle.T])
            rate = np.concatenate([rate, np.moveaxis(rotation_vector_rate(angle) @ turning, 0, -1)])
        gaps[part], jacobian[part] = gap[: ROWS[loop.constrain]], rate[: ROWS[loop.constrain]]
    return np.ascontiguousarray(gaps.T), np.ascontiguousarray(np.moveaxis(jacobian, -1, 0))


def _into(body: Body, vectors: Array) -> Array:
    """Return vectors (3, ..., P) in the frame of a body."""
    x, y, z = (axis.reshape(3, *(1,) * (vectors.ndim - 2), -1) for axis in body.axes)
    return np.array([(x * vectors).sum(axis=0), (y * vectors).sum(axis=0), (z * vectors).sum(axis=0)])


def rotation_vector_rate(vector: Array) -> Array:
    """Return G with ``d(vector)/dt = G w`` for a rotation vector (..., 3) turning at w, fixed frame.

    The inverse left Jacobian of SO(3): ``1 - S/2 + (1/t^2 - cot(t/2)/(2t)) S^2`` (Chirikjian 2012, 10.86).
    """
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    safe = np.maximum(angle, 1e-3)
    # the series where the closed form would cancel
    factor = np.where(angle < 1e-2, 1 / 12 + angle**2 / 720, 1 / safe**2 - 1 / (2 * safe * np.tan(safe / 2)))
    s = skew(vector)
    return np.asarray(np.eye(3) - 0.5 * s + factor * (s @ s))
