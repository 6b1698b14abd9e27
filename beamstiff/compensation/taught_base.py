"""A base that the real robot taught by the 3-point method: its own errors are in where the workpiece stands.

The controller takes the commanded points for the frame of the path; the real tool was elsewhere. What it
touched, an origin, a point on x and one in the xy plane, is where the workpiece stands. Any three points off
one line do: the workpiece moves as a body, the first point is met, the second gives a direction, the third a
plane.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamstiff.compensation.follow import follow
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import difference, inverse
from beamstiff.errors import OptionError, counted
from beamstiff.se3 import Array, transform

LEAST_ANGLE = 1e-3  # rad, between the directions of two points: what is less is a line
POINTS = ("the origin", "the point on x", "the point in the xy plane")


@dataclass(frozen=True, eq=False)
class TaughtBase:
    """Where the controller was sent for the three points, and where the workpiece stands therefore."""

    poses: Array  # (3, 4, 4), m: commands, base frame
    q: Array  # (3, A): joint values of the controller at these
    motion: Array  # (4, 4): from where the controller has the workpiece to where it stands, base frame

    @property
    def moved(self) -> Array:
        """How far the workpiece stands from where the controller has it, (6,), m at the first point, rad."""
        return np.asarray(difference(self.motion @ self.poses[:1], self.poses[:1])[0])

    def motion_to(self, positions: Array) -> Array:
        """Return the motion (4, 4) of a workpiece whose three points are at positions (3, 3), m."""
        return _motion(self.poses, positions)

    def carried(self, moved: Array, poses: Array) -> Array:
        """Return how poses (N, 4, 4) on the workpiece move, (N, 6), where its points move by (3, 6)."""
        # not from the motion that is: what moves it is small, and is wanted to first order
        return difference(self.motion_to(self.poses[:, :3, 3] + moved[:, :3]) @ poses, poses)


def check_points(points: Array) -> None:
    """Refuse what are not three points (3, 3), m, off one line."""
    wanted = "expected three: the origin, a point on x and a point in the xy plane, each with x, y, z"
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise OptionError("base_taught", f"found an array of shape {points.shape}, {wanted}")
    if len(points) != 3:
        raise OptionError("base_taught", f"found {counted(len(points), 'point')}, {wanted}")
    x, other = points[1:] - points[0]
    if np.linalg.norm(np.cross(x, other)) <= LEAST_ANGLE * np.linalg.norm(x) * np.linalg.norm(other):
        raise OptionError("base_taught", "found three points on one line, expected the third beside it")


def taught_base(
    machine: Machine,
    points: Array,
    targets: Array,
    q: Array,
    reached: Callable[[Array, Array], Array],
    held: Array,
) -> TaughtBase:
    """Return the base that the real robot taught at points (3, 3), m, of the frame of the path.

    `targets` (N, 4, 4), base frame, at joint values `q` (N, A): the tool touched each point as it stands at
    the nearest of them. `reached`: returns the poses (3, 4, 4) of the real tool at joint values (3, A) for
    commands (3, 4, 4). `held` (N, A): as of `external_axes`.
    """
    base = machine.frames.base
    places = points @ base[:3, :3].T + base[:3, 3]
    near = np.linalg.norm(targets[:, :3, 3] - places[:, None], axis=2).argmin(axis=1)
    poses = transform(targets[near, :3, :3], places)
    found = follow(machine.kinematics, machine.frames.node_poses(poses), q[near[0]], held=held[near])
    for row, reason in found.reasons.items():
        raise OptionError("base_taught", f"{POINTS[row]} is {reason}. {_right(base)}")
    return TaughtBase(poses, found.q, _motion(poses, reached(found.q, poses)[:, :3, 3]))


def _right(base: Array) -> str:
    """Return, in words, which points are right for a frame of the path (4, 4)."""
    own = np.array_equal(base, np.eye(4))
    frame = "The program counts from the robot's own base frame. In it" if own else "In the frame of the path"
    return (
        f"{frame}, give three points at which the robot touched the workpiece, off one line, each within its "
        "reach in the orientation of the nearest target"
    )


def _motion(poses: Array, positions: Array) -> Array:
    return _three_point_frame(positions) @ inverse(_three_point_frame(poses[:, :3, 3]))


def _three_point_frame(points: Array) -> Array:
    """Return the frame (4, 4) of an origin, a point on its x axis and one in its xy plane, (3, 3), m."""
    x, other = points[1:] - points[0]
    z = np.cross(x, other)
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    return transform(axes / np.linalg.norm(axes, axis=0), points[0])
