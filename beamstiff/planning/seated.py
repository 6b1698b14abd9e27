"""Postures in which the point meets an instrument: a ball its socket, a probe its plane.

Newton's method from postures at random: the shortest step in the joints that takes the point there.
"""

from collections.abc import Sequence

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.measure.instruments import Target
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.planning.poses import closed_posture, random_poses
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, twist_jacobian
from beamstiff.se3 import Array

STEPS = 40
THERE = 1e-9  # m
DRAWN = 20  # postures for one that gets there


def reached(one: Target, point: Array) -> tuple[Array, Array]:
    """Return how far points (n, 3) are off a set-up, (n, c), and the directions of that, (n, c, 3)."""
    off = point - np.array(one.place)
    if one.instrument == "socket":
        return off, np.broadcast_to(np.eye(3), (len(off), 3, 3))
    if one.normal is not None:
        normal = np.array(one.normal)
        return (off @ normal)[:, None], np.broadcast_to(normal, (len(off), 1, 3))
    size = np.linalg.norm(off, axis=1, keepdims=True)
    return size - (one.length or 0.0), (off / size)[:, None]


def seated_postures(robot: Robot, one: Target, count: int, seed: int, point: str = "") -> Array:
    """Return up to `count` postures (n, A) within the limits at which a point meets a set-up."""
    kinematics, node = compile_kinematics(robot), point or robot.tcp
    limits = [variable.limits or (-np.inf, np.inf) for variable in robot.actuated]
    low, high = np.array(limits).T
    q = random_poses(kinematics, DRAWN * count, np.random.default_rng(seed))
    for _ in range(STEPS):
        where, closed = closed_posture(kinematics, q)
        q = q[closed]
        off, toward = reached(one, where.node_positions[:, kinematics.node_index[node]])
        slopes = toward @ twist_jacobian(kinematics, where, node)[:, :3]
        q = q - np.clip((np.linalg.pinv(slopes, rcond=1e-6) @ off[..., None])[..., 0], -0.3, 0.3)
    where, closed = closed_posture(kinematics, q)
    q = q[closed]
    off, _ = reached(one, where.node_positions[:, kinematics.node_index[node]])
    good = (np.abs(off).max(axis=1) < THERE) & ((q >= low) & (q <= high)).all(axis=1)
    return np.asarray(q[good][:count])


def seated_rows(
    robot: Robot, targets: Sequence[Target], count: int, seed: int, point: str = ""
) -> Measurements:
    """Return rows at `count` postures of each set-up to fill in; BeamstiffError where one is out of reach."""
    each = [seated_postures(robot, one, count, seed + at, point) for at, one in enumerate(targets)]
    for one, found in zip(targets, each, strict=True):
        if not len(found):
            raise BeamstiffError(
                f"robot {robot.name!r}: {one.name}: found no posture where the point gets there"
            )
    names = np.repeat([one.name for one in targets], [len(found) for found in each])
    sockets = np.repeat([one.instrument == "socket" for one in targets], [len(found) for found in each])
    normals = [one.normal or (np.nan,) * 3 for one in targets]
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.concatenate(each),
        tcp=robot.tcp,
        position=np.where(sockets[:, None], 0.0, np.full((len(names), 3), np.nan)),
        point=np.full(len(names), point or robot.tcp),
        target=names,
        targets=targets,
        direction=np.repeat(np.array(normals), [len(found) for found in each], axis=0),
        source="<next>",
    )
