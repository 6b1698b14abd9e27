"""Planar loops: what leads out of their plane is left to the play of the bearings.

A loop that is closed as a point (``constrain: position``) closes with axes that are quite parallel alone:
an estimate of its geometry could tilt none of them. Closed in its plane (``constrain: plane``) it closes all
the same, as machines do.
"""

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import listed
from beamstiff.robot.closure import HELD, close_loops, free_of
from beamstiff.robot.description import Robot
from beamstiff.robot.forward import chain_to
from beamstiff.robot.frames import Kinematics, all_values
from beamstiff.robot.kinematics import Posture, compile_kinematics, posture_at
from beamstiff.robot.loops import loop_equations, loop_system
from beamstiff.se3 import Array, skew

POSTURES = 8  # that show whether a loop is planar
PARALLEL = np.cos(np.radians(5.0))  # errors of axes are far smaller; sliders lie across the normal


def closed_in_plane(robot: Robot, q: Array) -> tuple[Robot, tuple[str, ...]]:
    """Return the robot with its planar loops closed in their planes, and the names of those that were not.

    Planar are loops in which no variable moves the ends apart along the z axis of the first, at joint
    readings `q` (P, A), rad or m.
    """
    if not any(loop.constrain == "position" for loop in robot.loops):
        return robot, ()
    kinematics = compile_kinematics(robot)
    few = q[np.unique(np.linspace(0, len(q) - 1, POSTURES).astype(np.intp))]
    values, closed, _ = close_loops(kinematics, few, strict=False)
    if not closed.any():
        return robot, ()
    system = loop_system(kinematics)
    _, rates = loop_equations(system, free_of(kinematics, values[closed]))
    planar = [
        loop.name
        for loop, rows in zip(kinematics.loops, system.rows, strict=True)
        if loop.constrain == "position" and np.abs(rates[:, rows][:, 2]).max() < HELD
    ]
    loops = tuple(
        loop.model_copy(update={"constrain": "plane"}) if loop.name in planar else loop
        for loop in robot.loops
    )
    return robot.model_copy(update={"loops": loops}), tuple(planar)


def closed_as_described(robot: Robot, described: Robot, q: Array) -> Robot:
    """Return the robot with its loops closed as they were described, if at readings q (P, A) they do."""
    same = robot.model_copy(update={"loops": described.loops})
    return same if close_loops(compile_kinematics(same), q, strict=False).closed.all() else robot


def note_of(robot: Robot, loops: tuple[str, ...]) -> tuple[str, ...]:
    """Return what to say of loops that the robot closes in their planes and its file does not."""
    own = [loop.name for loop in robot.loops if loop.name in loops and loop.constrain == "plane"]
    if not own:
        return ()
    return (
        f"{listed(own)}: closed in the plane alone (constrain: plane), so that axes that are not quite "
        "parallel can be found",
    )


def bearings_in_plane(kinematics: Kinematics, frames: NDArray[np.int64], axes: Array) -> NDArray[np.int64]:
    """Return the frame whose z axis is the normal of the plane loop that each joint is a bearing of, (J,).

    -1: of none. `frames` (J,) of the joints, `axes` (J, 3) in these.
    """
    normal = np.full(len(frames), -1, dtype=np.int64)
    if kinematics.assembly is None or all(loop.constrain != "plane" for loop in kinematics.loops):
        return normal
    values = all_values(kinematics, kinematics.assembly.free[None])
    rotations = posture_at(kinematics, values).transforms[0, :, :3, :3]
    seen = (rotations[frames] @ axes[:, :, None])[:, :, 0]
    bodies: nx.Graph[int] = nx.Graph()
    for loop in kinematics.loops:
        if loop.constrain == "plane":
            a, b = (chain_to(kinematics, frame) for frame in (loop.frame_a, loop.frame_b))
            nx.add_star(bodies, [max({*a} & {*b}), *({*a} ^ {*b})])
            bodies.nodes[loop.frame_a]["normal"] = True
    # loops that share a body have one normal: bearings of two directions would lock it
    for group in nx.connected_components(bodies):
        end = min(frame for frame in group if bodies.nodes[frame])
        along = np.abs(seen @ rotations[end, :, 2]) > PARALLEL
        normal[along & np.isin(frames, list(group))] = end
    return normal


def in_plane(rotation: Array, normal: Array) -> Array:
    """Return rotations (P, J, 3, 3), turned so that their first axes lie along normals (P, J, 3), either way.

    Bearings that are rigid across their axes would lock a loop whose axes are not quite parallel; real ones
    have the play for it.
    """
    axis = rotation[..., 0]
    normal = normal * np.sign((axis * normal).sum(axis=-1, keepdims=True))
    turn = skew(np.cross(axis, normal))
    cosine = (axis * normal).sum(axis=-1)[..., None, None]
    return np.asarray((np.eye(3) + turn + turn @ turn / (1.0 + cosine)) @ rotation)


def joint_gaps(kinematics: Kinematics, where: Posture, nodes: NDArray[np.int64]) -> Array:
    """Return how far pairs of nodes (J, 2) are apart, (P, J), m; of those that close a plane loop, in it."""
    gap = where.node_positions[:, nodes[:, 1]] - where.node_positions[:, nodes[:, 0]]
    frames = np.sort(kinematics.node_frame[nodes], axis=1)
    for loop in kinematics.loops:
        if loop.constrain == "plane":
            own = np.flatnonzero((frames == sorted((loop.frame_a, loop.frame_b))).all(axis=1))
            normal = where.transforms[:, None, loop.frame_a, :3, 2]
            gap[:, own] -= (gap[:, own] * normal).sum(axis=-1, keepdims=True) * normal
    return np.asarray(np.linalg.norm(gap, axis=-1))
