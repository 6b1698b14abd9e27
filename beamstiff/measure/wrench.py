"""Wrenches at the TCP in the base frame, from a force and its lever arm, from a sensor, from dead weights.

A wrench is ``[f, m]``, N and N m, and acts on the robot's tool. Carried from one point to another of the same
body it does the same work: ``m_b = m_a + (a - b) x f``.
"""

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import finite, rotation_matrix
from beamstiff.se3 import Array, rotate_screw

STANDARD_GRAVITY = 9.80665  # m/s^2, CGPM 1901


def wrench_from_force(
    direction: ArrayLike,
    magnitude: ArrayLike,
    arm: ArrayLike = (0.0, 0.0, 0.0),
    moment: ArrayLike = (0.0, 0.0, 0.0),
) -> Array:
    """Return the wrench at the TCP of a force of known direction that acts beside it.

    `direction` (..., 3): of the force on the tool, base frame, any length but zero. `magnitude` (...), N.
    `arm` (..., 3), m: from the TCP to the point where the force acts, base frame. `moment` (..., 3), N m: a
    pure moment on top of it.

    >>> wrench_from_force([0, 0, -2], 100.0, arm=[0.5, 0, 0])
    array([   0.,   0., -100.,    0.,   50.,    0.])
    """
    along = finite(direction, "direction of the force", 3)
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    if (length == 0).any():
        raise BeamstiffError("direction of the force: found a zero vector, expected a direction")
    force = along / length * finite(magnitude, "magnitude of the force")[..., None]
    turning = np.cross(finite(arm, "lever arm", 3), force) + finite(moment, "moment", 3)
    return np.concatenate(np.broadcast_arrays(force, turning), axis=-1)


def transport_wrench(wrench: ArrayLike, start: ArrayLike, end: ArrayLike) -> Array:
    """Return the wrench that acts at `end` as `wrench` does at `start`, two points of one rigid body.

    `wrench` (..., 6), N and N m: ``[f, m]`` about `start`, base frame. `start, end` (..., 3), m: base frame.

    >>> transport_wrench([0, 0, -100, 0, 0, 0], start=[1.5, 0, 1], end=[1, 0, 1])
    array([   0.,   0., -100.,    0.,   50.,    0.])
    """
    w = finite(wrench, "wrench", 6)
    force = w[..., :3]
    moment = w[..., 3:] + np.cross(finite(start, "start", 3) - finite(end, "end", 3), force)
    return np.concatenate(np.broadcast_arrays(force, moment), axis=-1)


def wrench_from_sensor(
    reading: ArrayLike,
    rotation: ArrayLike,
    sensor: ArrayLike,
    tcp: ArrayLike,
    *,
    tare: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    reaction: bool = False,
) -> Array:
    """Return the wrench on the tool at the TCP in the base frame, from a force and moment sensor.

    `reading` (..., 6), N and N m: ``[f, m]`` at the sensor's origin, in its axes. `rotation` (..., 3, 3):
    base from sensor axes. `sensor, tcp` (..., 3), m: the sensor's origin and the TCP, base frame. `tare`
    (..., 6): reading at the same pose without load; it takes the tool's weight and the zero offset away.
    `reaction`: the sensor tells what the tool exerts, not what is exerted on it: the sign is turned.
    """
    load = finite(reading, "sensor reading", 6) - finite(tare, "tare", 6)
    screw = rotate_screw(rotation_matrix(rotation, "sensor rotation"))
    turned = np.einsum("...ij,...j->...i", screw, load)
    return transport_wrench(-turned if reaction else turned, sensor, tcp)


def wrench_from_dead_weight(
    mass: ArrayLike,
    attachment: ArrayLike,
    tcp: ArrayLike,
    *,
    pulley: ArrayLike | None = None,
    gravity: ArrayLike = (0.0, 0.0, -STANDARD_GRAVITY),
    efficiency: float = 1.0,
) -> Array:
    """Return the wrench at the TCP of a weight that hangs from the tool, straight or over a pulley.

    `mass` (...), kg: hanging mass, zero or more. `attachment` (..., 3), m: where the cable is fixed to the
    tool, base frame. `tcp` (..., 3), m. `pulley` (..., 3), m: where the cable leaves the pulley; the force
    points from the attachment to it. None: the weight hangs straight down. `gravity` (3,), m/s^2: base frame.
    `efficiency`: share of the weight that the pulley passes on, above 0, at most 1.

    >>> wrench_from_dead_weight(10.0, [1, 0, 1], [1, 0, 1], pulley=[3, 0, 1])
    array([98.0665,  0.    ,  0.    ,  0.    ,  0.    ,  0.    ])
    """
    m = finite(mass, "mass")
    if (m < 0).any():
        raise BeamstiffError(f"mass: found {m.min()}, expected zero or more kg")
    share = float(finite(efficiency, "efficiency"))
    if not 0 < share <= 1:
        raise BeamstiffError(f"efficiency: found {share}, expected a number above 0 and at most 1")
    weight = finite(gravity, "gravity", 3)
    at, tool = finite(attachment, "attachment", 3), finite(tcp, "tcp", 3)
    direction = weight if pulley is None else finite(pulley, "pulley", 3) - at
    if (np.linalg.norm(direction, axis=-1) == 0).any():
        what = "gravity" if pulley is None else "pulley"
        raise BeamstiffError(f"{what}: found no direction, expected the weight to pull somewhere")
    return wrench_from_force(direction, share * m * np.linalg.norm(weight), arm=at - tool)
