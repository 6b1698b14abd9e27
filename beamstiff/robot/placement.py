"""Rigid transforms as parameters of frames, and as the roll, pitch, yaw of other files; closed forms.

Khalil and Kleinfinger's six motions are rot(z, gamma) trans(z, b) rot(x, alpha) trans(x, d) rot(z, theta)
trans(z, r). Their rotation is the z-x-z product, so gamma, alpha and theta are its Euler angles; with gamma
known, ``rot(z, -gamma) p = [d, -r sin(alpha), b + r cos(alpha)]`` gives d, r and b. Every rigid transform
has such parameters. Where the two z axes are parallel (sin(alpha) = 0), gamma turns x along the offset; where
they are nearly so, r and b would be huge and of opposite sign, and two frames are taken instead: one that
shifts and one that turns.
"""

import math

import numpy as np

from beamstiff.robot.frames import MOTIONS
from beamstiff.se3 import Array, rotation_about, transform

NEARLY_PARALLEL = 0.1  # sin(alpha) below which r would be ten times the offset and more
ZERO = 1e-15  # rad or m: rounding of what is meant to be 0

LENGTHS = frozenset(name for name, kind, _ in MOTIONS if kind == "shift")

Parameters = dict[str, float]


def elementary(parameters: dict[str, float]) -> Array:
    """Return the transform (4, 4) of a frame's parameters, rad and m; what is not named is 0.

    >>> elementary({"alpha": np.pi / 2, "r": 2.0}).round(12)[:3, 3]
    array([ 0., -2.,  0.])
    """
    result = np.eye(4)
    for name, kind, axis in MOTIONS:
        value = parameters.get(name, 0.0)
        if value == 0.0:
            continue
        turn = rotation_about(axis, np.asarray(value)) if kind == "turn" else np.eye(3)
        result = result @ transform(turn, value * np.eye(3)[axis] if kind == "shift" else np.zeros(3))
    return result


def frame_parameters(placed: Array) -> list[Parameters]:
    """Return the parameters of the frame that a transform (4, 4) makes: of one frame, or of two in a row.

    The last motion is along the new z axis, so that a joint about or along it adds to theta or r of the last.

    >>> quarter = transform(rotation_about(0, np.asarray(-np.pi / 2)), np.array([0.5, 0.0, 0.0]))
    >>> frame_parameters(quarter)
    [{'alpha': -1.5707963267948966, 'd': 0.5}]
    """
    rotation, p = placed[:3, :3], placed[:3, 3]
    leaning = math.hypot(rotation[0, 2], rotation[1, 2])
    sideways = math.hypot(p[0], p[1])
    if leaning > NEARLY_PARALLEL:
        return [_crossed(rotation, p)]
    if leaning <= ZERO:
        return [_parallel(rotation, p)]
    turning = _crossed(rotation, np.zeros(3))
    if sideways <= ZERO:  # along the old z axis
        return [_named({**turning, "b": float(p[2])})]
    return [_parallel(np.eye(3), p), turning]


def _crossed(rotation: Array, p: Array) -> Parameters:
    lean = math.hypot(rotation[0, 2], rotation[1, 2])
    alpha = math.atan2(lean, rotation[2, 2])
    gamma = math.atan2(rotation[0, 2], -rotation[1, 2])
    if abs(gamma) > math.pi / 2 + 1e-9:  # of the two solutions the one that turns less
        gamma, alpha = gamma - math.copysign(math.pi, gamma), -alpha
    # what the other two leave: where the axes are nearly parallel, gamma is uncertain, the product is not
    left = elementary({"gamma": gamma, "alpha": alpha})[:3, :3].T @ rotation
    theta = math.atan2(left[1, 0], left[0, 0])
    c, s = math.cos(gamma), math.sin(gamma)
    r = (s * p[0] - c * p[1]) / math.sin(alpha)
    b = p[2] - r * math.cos(alpha)
    return _named({"gamma": gamma, "b": b, "alpha": alpha, "d": c * p[0] + s * p[1], "theta": theta, "r": r})


def _parallel(rotation: Array, p: Array) -> Parameters:
    turned_over = rotation[2, 2] < 0
    gamma, d = math.atan2(p[1], p[0]), math.hypot(p[0], p[1])
    if d <= ZERO:
        gamma = 0.0
    elif abs(gamma) > math.pi / 2 + 1e-9:
        gamma, d = gamma - math.copysign(math.pi, gamma), -d
    # rot(z, gamma) rot(x, 0 or pi) rot(z, theta) = rot(z, gamma +- theta) rot(x, 0 or pi)
    angle = math.atan2(rotation[1, 0], rotation[0, 0])
    theta = gamma - angle if turned_over else angle - gamma
    if abs(theta) > math.pi:
        theta -= math.copysign(2 * math.pi, theta)
    alpha, r = (math.pi, -p[2]) if turned_over else (0.0, p[2])
    return _named({"gamma": gamma, "alpha": alpha, "d": d, "theta": theta, "r": r})


def _named(parameters: Parameters) -> Parameters:
    return {
        name: float(f"{value:.15g}") if name in LENGTHS else float(value)  # 0.12, not 0.12000000000000001
        for name, value in parameters.items()
        if abs(value) > ZERO
    }


def from_roll_pitch_yaw(rpy: Array, position: Array) -> Array:
    """Return the transform (4, 4) with rotation Rz(yaw) Ry(pitch) Rx(roll), as URDF and SDF write it."""
    roll, pitch, yaw = (rotation_about(axis, np.asarray(angle)) for axis, angle in enumerate(rpy))
    return transform(yaw @ pitch @ roll, np.asarray(position, dtype=np.float64))


def roll_pitch_yaw(rotation: Array) -> Array:
    """Return roll, pitch, yaw (3,) of a rotation (3, 3), rad; where pitch is +-90 deg, roll is 0."""
    lean = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], lean)
    sine, cosine = (rotation[1, 0], rotation[0, 0]) if lean > ZERO else (-rotation[0, 1], rotation[1, 1])
    yaw = math.atan2(sine, cosine)
    # what the other two leave, so that near the pole, where they are uncertain, the product is not
    left = (rotation_about(2, np.asarray(yaw)) @ rotation_about(1, np.asarray(pitch))).T @ rotation
    roll = math.atan2(left[2, 1], left[1, 1])
    return np.array([angle if abs(angle) > ZERO else 0.0 for angle in (roll, pitch, yaw)])


def turned_to(axis: Array) -> Array:
    """Return a rotation (3, 3) that carries z onto a direction (3,)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    if z < 0:  # 1 + z would lose digits: z to the opposite of the axis, half a turn about x before
        return turned_to(-np.array([x, y, z])) * [1.0, -1.0, -1.0]
    f = 1.0 / (1.0 + z)
    return np.array([[1 - x * x * f, -x * y * f, x], [-x * y * f, 1 - y * y * f, y], [-x, -y, z]])
