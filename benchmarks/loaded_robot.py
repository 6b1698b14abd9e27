"""A serial robot under load, computed apart from beamstiff: its joints' equilibrium where it really is.

Nothing is linear here: transforms are products of Denavit and Hartenberg's (modified), the drives wind up
under the torques of load and weights at the joints' deflected angles, with backlash, until they are in
equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True, eq=False)
class LoadedRobot:
    """A robot of six joints.

    Attributes
    ----------
    table : (6, 3) array
        alpha, d, r of every joint.
    stiffness : (6,) array, N m/rad
    offset : (6,) array, rad
        Of the encoders.
    weights : tuple of (joint, position in its frame, kg)
    backlash : (6,) array, rad
        Half width of the dead zones.
    flank : float, N m
        Torque within which a dead zone is crossed.
    """

    table: Array
    stiffness: Array
    offset: Array
    weights: tuple[tuple[int, tuple[float, float, float], float], ...] = ()
    backlash: Array | None = None
    flank: float = 1.0

    def frames(self, theta: Array) -> list[Array]:
        """Return the transform of every frame, base frame."""
        result, at = [], np.eye(4)
        for (alpha, d, r), angle in zip(self.table, theta, strict=True):
            ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(angle), np.sin(angle)
            at = at @ np.array(
                [
                    [ct, -st, 0, d],
                    [ca * st, ca * ct, -sa, -r * sa],
                    [sa * st, sa * ct, ca, r * ca],
                    [0, 0, 0, 1],
                ]
            )
            result.append(at)
        return result

    def torques(self, theta: Array, wrench: Array) -> Array:
        """Return the torques of weights and of the wrench on the last frame, at deflected angles."""
        frames = self.frames(theta)
        loads = [(5, frames[5][:3, 3], wrench[:3], wrench[3:])]
        loads += [
            (joint, frames[joint][:3, :3] @ np.array(at) + frames[joint][:3, 3], mass * GRAVITY, np.zeros(3))
            for joint, at, mass in self.weights
        ]
        result = np.zeros(6)
        for joint, point, force, moment in loads:
            for axis in range(joint + 1):
                arm = point - frames[axis][:3, 3]
                result[axis] += frames[axis][:3, 2] @ (np.cross(arm, force) + moment)
        return result

    def pose(self, q: Array, wrench: Array) -> Array:
        """Return where the last frame comes to rest, (4, 4), for joint readings (6,) under a wrench (6,)."""
        start = q + self.offset
        theta = start
        for _ in range(200):
            torque = self.torques(theta, wrench)
            wound = torque / self.stiffness
            if self.backlash is not None:
                wound = wound + self.backlash * np.tanh(torque / self.flank)
            new = start + wound
            if np.abs(new - theta).max() < 1e-14:
                break
            theta = new
        return self.frames(theta)[5]

    def readings(self, pose: Array, start: Array) -> Array:
        """Return the joint values (6,) with which a robot without load stands at a pose: inverse geometry."""
        rigid = replace(self, offset=np.zeros(6))
        q = start.copy()
        for _ in range(50):
            frames = rigid.frames(q)
            at = frames[5]
            turn = pose[:3, :3] @ at[:3, :3].T
            angle = 0.5 * np.array(
                [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
            )
            error = np.concatenate([pose[:3, 3] - at[:3, 3], angle])
            jacobian = np.array([[*np.cross(f[:3, 2], at[:3, 3] - f[:3, 3]), *f[:3, 2]] for f in frames]).T
            q = q + np.linalg.solve(jacobian, error)
            if np.abs(error).max() < 1e-13:
                break
        return q
