"""Forward geometry: where the frames are, and the twist that each joint variable gives them.

A frame is the product of seven elementary motions (Khalil and Kleinfinger 1986; Hayati's `beta` for
near-parallel axes)::

    rot(z, gamma) trans(z, b) rot(x, alpha) trans(x, d) rot(z, theta) rot(y, beta) trans(z, r)

Each of them moves along or about one axis of the frame reached so far: a screw. Positions, orientations and
twists all follow from one walk along the chain, looping over frames only. Inside, the pose is the last axis,
so that every operation runs over all poses at a stretch; and with expressions
(`expression_graph`) in place of the values of one pose the walk writes itself down.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from beamstiff.robot.frames import MOTIONS, Kinematics
from beamstiff.se3 import Array

ROUNDING = 1e-15


class Body(NamedTuple):
    """Where a frame is: its axes (axis, component, P) and its origin (3, P), m."""

    axes: Array
    origin: Array


class Screw(NamedTuple):
    """A motion that variables drive: its axis (3, P) through a point (3, P)."""

    frame: int
    motion: int
    axis: Array
    point: Array


def forward(kinematics: Kinematics, values: Array) -> Array:
    """Return the transform base <- frame of every frame, (P, F + 1, 4, 4), for all variables (P, V).

    In the orders of ``frame_names`` and ``coupling.names``; loops are not closed here.
    """
    bodies, _ = place(kinematics, values, range(len(kinematics.frame_names)))
    transforms = np.zeros((len(values), len(bodies), 4, 4))
    for at, body in enumerate(bodies):
        transforms[:, at, :3, :3] = body.axes.transpose(2, 1, 0)
        transforms[:, at, :3, 3] = body.origin.T
    transforms[..., 3, 3] = 1.0
    return transforms


def node_positions(kinematics: Kinematics, transforms: Array) -> Array:
    """Return where every node is in the base frame, (P, N, 3), m, from the transforms of the frames."""
    at = transforms[:, kinematics.node_frame]
    return (at[..., :3, :3] @ kinematics.node_at[:, :, None])[..., 0] + at[..., :3, 3]


def chain_to(kinematics: Kinematics, frame: int) -> list[int]:
    """Return the frames from the base to a frame, both included."""
    chain = [frame]
    while chain[-1] != 0:
        chain.append(int(kinematics.parents[chain[-1]]))
    return chain[::-1]


def place(kinematics: Kinematics, values: Array, frames: Sequence[int]) -> tuple[list[Body], list[Screw]]:
    """Return where frames are, seen from the first, and the screws that move them; parents come before."""
    poses = len(values)
    bodies = {frames[0]: Body(np.broadcast_to(np.eye(3)[:, :, None], (3, 3, poses)), np.zeros((3, poses)))}
    screws: list[Screw] = []
    for frame in frames[1:]:
        bodies[frame], driven = _walk(kinematics, frame, values, bodies[int(kinematics.parents[frame])])
        screws += driven
    return [bodies[frame] for frame in frames], screws


def screws_of(kinematics: Kinematics, values: Array, transforms: Array, frames: Sequence[int]) -> list[Screw]:
    """Return the screws that move frames after the first, where all transforms (P, F + 1, 4, 4) are known."""
    screws: list[Screw] = []
    for frame in frames[1:]:
        if kinematics.coefficients[frame].any():
            screws += _walk(kinematics, frame, values, body_of(transforms[:, kinematics.parents[frame]]))[1]
    return screws


def body_of(transforms: Array) -> Body:
    """Return transforms (P, 4, 4) as a body."""
    return Body(
        np.ascontiguousarray(transforms[:, :3, :3].transpose(2, 1, 0)),
        np.ascontiguousarray(transforms[:, :3, 3].T),
    )


def _walk(kinematics: Kinematics, frame: int, values: Array, above: Body) -> tuple[Body, list[Screw]]:
    """Go through the motions of a frame, starting at its parent."""
    axes, point = list(above.axes), above.origin
    driven: list[Screw] = []
    for number, kind, axis, constant, used, coefficients in kinematics.motions[frame]:
        amount: Array | np.float64 = constant
        if used.size:
            amount = values[:, used] @ coefficients + constant
            driven.append(Screw(frame, number, axes[axis], point))
        if kind == "shift":
            point = point + amount * axes[axis]
        else:
            j, k = (axis + 1) % 3, (axis + 2) % 3
            c, s = np.cos(amount), np.sin(amount)
            if values.dtype == object and not used.size:  # a right angle has no cosine to write down
                c, s = (value * (abs(value) > ROUNDING) for value in (c, s))
            axes[j], axes[k] = c * axes[j] + s * axes[k], c * axes[k] - s * axes[j]
    return Body(np.array(axes), point), driven


def twists_at(
    kinematics: Kinematics,
    screws: Iterable[Screw],
    point: Array,
    directions: Array,
    backward: Iterable[Screw] = (),
) -> Array:
    """Return the twist ``[v; w]`` (6, C, P) of a body at one of its points (3, P), frame of the screws.

    For motions along C directions (V, C) of all variables. `screws` move the body, `backward` another one
    from which it is seen.
    """
    groups = ((1.0, list(screws)), (-1.0, list(backward)))
    kind = np.result_type(point, *(item for _, group in groups for screw in group for item in screw[2:]))
    twists = np.zeros((6, directions.shape[1], point.shape[1]), dtype=kind)
    for sign, group in groups:
        for screw in group:
            rates = sign * (kinematics.coefficients[screw.frame, screw.motion] @ directions)
            turns = MOTIONS[screw.motion][1] == "turn"
            velocity = cross(screw.axis, point - screw.point) if turns else screw.axis
            for column in np.flatnonzero(rates):
                twists[:3, column] += rates[column] * velocity
                if turns:
                    twists[3:, column] += rates[column] * screw.axis
    return twists


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the first axis."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
