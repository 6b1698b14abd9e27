"""A tool path: targets in their order, the frames they are written in, loads that come with them.

Data alone: the correction is in `compensation.path_correction`.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.posture import StatedPosture
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array, vector_from_rotation


@dataclass(frozen=True, eq=False)
class ToolPath:
    """N targets of a tool."""

    source: str  # the file
    names: tuple[str, ...]
    lines: Integers  # (N,) int: where each target stands in the file
    poses: Array  # (N, 4, 4), m: of the tool in the frame of the path
    # (N,) bool: whether the file has room for an orientation of this target; where not, its position alone is
    # corrected
    turns: NDArray[np.bool_]
    # whether the orientations are known, be they written or what the format takes for granted
    stated: bool = True
    # (N, 6): ``[f, m]`` on the tool at its tip, base frame of the robot, N and N m
    wrench: Array | None = None
    # (N,): other quantities along the path, SI: what a process may depend on
    columns: Mapping[str, Array] = field(default_factory=dict)
    stated_postures: tuple[StatedPosture | None, ...] = ()  # one each target; none where no target states one
    # (N, A), rad or m: targets that the file writes as joint values, of the controller; NaN where it does not
    joints: Array | None = None
    joint_names: tuple[str, ...] = ()  # as the file calls them, if it does
    files: tuple[str, ...] = ()  # of the targets, where they stand in several
    # (N,), mm or deg: axes of a program beside the robot's, as it names them; NaN where it does not state one
    external: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.names)

    def at(self, rows: NDArray[np.intp]) -> Self:
        """Return some of the targets."""
        return replace(
            self,
            names=tuple(self.names[row] for row in rows.tolist()),
            lines=self.lines[rows],
            poses=self.poses[rows],
            turns=self.turns[rows],
            wrench=None if self.wrench is None else self.wrench[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
            stated_postures=tuple(self.stated_postures[row] for row in rows.tolist() if self.stated_postures),
            joints=None if self.joints is None else self.joints[rows],
            files=tuple(self.files[row] for row in rows.tolist() if self.files),
            external={name: values[rows] for name, values in self.external.items()},
        )

    @property
    def way(self) -> Array:
        """The way along the path to every target, (N,), m."""
        steps = np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def moved_to(self, poses: Array) -> Self:
        """Return the path with other poses (N, 4, 4)."""
        return replace(self, poses=poses)

    def place(self, row: int) -> str:
        """Return what a message calls a target: its file, line and name."""
        return f"{self.files[row] if self.files else self.source}:{self.lines[row]}: {self.names[row]}"

    def called(self, row: int) -> str:
        """Return the name of a target, with its line where others have the same name: a RAPID motion's."""
        name = self.names[row]
        return name if self._counts[name] == 1 else f"line {self.line(row)}, {name}"

    @cached_property
    def _counts(self) -> Counter[str]:
        return Counter(self.names)

    def line(self, row: int) -> str:
        """Return the line of a target, with its file where it is another than the path's."""
        elsewhere = self.files and self.files[row] != self.source
        return f"{self.files[row]}:{self.lines[row]}" if elsewhere else str(self.lines[row])


@dataclass(frozen=True, eq=False)
class StatedFrame:
    """A frame or a tool that a program says its targets are in."""

    name: str  # as the program calls it
    line: int
    pose: Array | None  # (4, 4), m; None: the program does not say where it is


@dataclass(frozen=True, eq=False)
class Frames:
    """What the numbers of a path count from, and which point of the tool they place."""

    # (4, 4), or (N, 4, 4) where they differ by target, m: the frame of the path (KRL $BASE, RAPID wobj, APT
    # part) in the base frame of the robot
    base: Array = field(default_factory=lambda: np.eye(4))
    # (4, 4), m: the programmed tool (KRL $TOOL, RAPID tooldata) in the frame of the robot's `tcp` node
    tool: Array = field(default_factory=lambda: np.eye(4))

    def to_base(self, path: ToolPath) -> ToolPath:
        """Return the path in the base frame of the robot."""
        return path.moved_to(self.base @ path.poses)

    def to_path(self, poses: Array) -> Array:
        """Return poses of the tool in the frame of the path, (N, 4, 4), from those in the base frame."""
        return inverse(self.base) @ poses

    def node_poses(self, poses: Array) -> Array:
        """Return the poses (N, 4, 4) of the `tcp` node that bring the tool to poses, base frame."""
        return poses @ inverse(self.tool)


def inverse(pose: Array) -> Array:
    """Return the inverse of transforms (..., 4, 4)."""
    result = np.zeros_like(pose)
    turn = pose[..., :3, :3].swapaxes(-1, -2)
    result[..., :3, :3] = turn
    result[..., :3, 3] = -(turn @ pose[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def difference(poses: Array, targets: Array) -> Array:
    """Return how far poses are from targets, (N, 6): ``[p - p_t, rotation vector of R R_t^T]``."""
    turned = poses[:, :3, :3] @ targets[:, :3, :3].swapaxes(1, 2)
    return np.hstack([poses[:, :3, 3] - targets[:, :3, 3], vector_from_rotation(turned)])
