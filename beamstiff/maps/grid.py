"""Grids of poses: over joint variables, or over positions of the TCP with its orientation held."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.planning.poses import growing
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Kinematics, actuated_values, pose_of, posture
from beamstiff.se3 import Array

CARTESIAN = ("x", "y", "z")
FREEDOMS = 6  # of a body: robots with as many actuated variables can hold an orientation
MOST_POSES = 10**12

Box = tuple[slice, ...]  # a part of a grid, one slice an axis


@dataclass(frozen=True, eq=False)
class Grid:
    """Poses of a map, the last axis running fastest."""

    names: tuple[str, ...]  # of the axes: actuated variables, or some of x, y and z
    axes: tuple[Array, ...]  # (n,), rad or m: growing values
    # (A,), rad or m: joint values of the variables that are on no axis; over positions, the posture whose
    # configuration the map keeps to
    q: Array
    # (4, 4): over positions: pose of the TCP, base frame, for what is on no axis. None over joint
    # variables
    target: Array | None = None
    turned: bool = False  # whether the orientation of the target has to be met, or the position alone

    @property
    def shape(self) -> tuple[int, ...]:
        """How many values each axis has."""
        return tuple(axis.size for axis in self.axes)

    @property
    def count(self) -> int:
        """How many poses there are."""
        return int(np.prod(self.shape, dtype=object))

    def points(self, box: Box) -> Array:
        """Return the values on the axes (P, D) of the poses of a box."""
        some = [axis[part] for axis, part in zip(self.axes, box, strict=True)]
        return np.stack([item.reshape(-1) for item in np.meshgrid(*some, indexing="ij")], axis=1)

    def joint_values(self, points: Array, robot: Robot) -> Array:
        """Return the actuated variables (P, A) at points of a grid over joint variables."""
        values = np.repeat(self.q[None], len(points), axis=0)
        names = [variable.name for variable in robot.actuated]
        values[:, [names.index(name) for name in self.names]] = points
        return values

    def targets(self, points: Array) -> Array:
        """Return what is to be reached at points of a grid over positions: (P, 4, 4), or (P, 3) positions."""
        assert self.target is not None
        targets = np.repeat(self.target[None], len(points), axis=0)
        targets[:, [CARTESIAN.index(name) for name in self.names], 3] = points
        return targets if self.turned else targets[:, :3, 3]


def make_grid(
    kinematics: Kinematics,
    over: Mapping[str, ArrayLike],
    held: Mapping[str, float] | None = None,
    orientation: ArrayLike | Literal["free"] | None = None,
) -> Grid:
    """Return a grid over joint variables, or over x, y and z of the TCP.

    `over`, rad or m: an axis each, in growing order, at least two values. Names are those of actuated
    variables or, where no variable is called so, x, y and z in the base frame; not both. `held`, rad or m:
    the other variables; those not named are 0. Over positions it is the posture whose configuration is kept,
    and what its TCP has on the axes not named stays. `orientation` (3, 3): of the TCP over positions.
    Default: as in the posture held, for robots of six actuated variables or more; others cannot hold it.
    """
    robot, held = kinematics.robot, dict(held or {})
    actuated = [variable.name for variable in robot.actuated]
    for name in over:
        if name not in actuated and name not in CARTESIAN:
            raise BeamstiffError(
                f"unknown axis {name!r}{suggest(name, [*actuated, *CARTESIAN])}, expected actuated variables "
                f"({listed(actuated, 12) or 'none'}) or x, y, z of the TCP"
            )
        if name in held:
            raise BeamstiffError(f"{name} is on an axis of the map and held: expected one of the two")
    joints = [name for name in over if name in actuated]
    if not over or (joints and len(joints) < len(over)):
        raise BeamstiffError(
            "a map needs axes, all of them joint variables or all of them x, y, z; found "
            f"{listed(over) or 'none'}"
        )
    axes = tuple(growing(name, values) for name, values in over.items())
    q = actuated_values(robot, held)[0]
    if joints:
        if orientation is not None:
            raise BeamstiffError(
                "an orientation is held over x, y, z alone, found a grid over joint variables"
            )
        grid = Grid(tuple(over), axes, q)
    else:
        if not actuated:
            raise BeamstiffError(f"robot {robot.name!r} has no actuated variable: its TCP stays where it is")
        target = pose_of(kinematics, posture(kinematics, q[None]), robot.tcp)[0]
        turned = len(actuated) >= FREEDOMS if orientation is None else not isinstance(orientation, str)
        if turned and len(actuated) < FREEDOMS:
            raise BeamstiffError(
                f"robot {robot.name!r} has {len(actuated)} actuated variables: it cannot hold an "
                "orientation, expected free"
            )
        if orientation is not None and turned:
            target[:3, :3] = _rotation(orientation)
        grid = Grid(tuple(over), axes, q, target, turned)
    if grid.count > MOST_POSES:
        raise BeamstiffError(f"found a grid of {grid.count:.2g} poses, expected at most {MOST_POSES:.0e}")
    return grid


def _rotation(orientation: ArrayLike | str) -> Array:
    rotation = np.asarray(orientation, dtype=np.float64)
    if rotation.shape != (3, 3) or not (
        np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
    ):
        raise BeamstiffError("orientation: expected a right-handed rotation matrix (3, 3), or free")
    return rotation


def boxes(shape: tuple[int, ...], most: int) -> list[Box]:
    """Return a grid in boxes of at most `most` poses, each of them poses that follow on one another."""
    whole, split = 1, len(shape)
    while split and whole * shape[split - 1] <= most:
        split -= 1
        whole *= shape[split]
    rest = tuple(slice(0, size) for size in shape[split:])
    if split == 0:
        return [rest]
    size = shape[split - 1]
    pieces = -(-size // max(1, most // whole))
    ends = [size * at // pieces for at in range(pieces + 1)]
    along = [slice(start, stop) for start, stop in itertools.pairwise(ends)]
    return [
        (*(slice(at, at + 1) for at in before), part, *rest)
        for before in itertools.product(*map(range, shape[: split - 1]))
        for part in along
    ]
