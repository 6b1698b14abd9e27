"""What every process model offers, and the simplest: a constant, columns of the path, a sum; a table.

The table of cutting forces is over one variable of the path: depth of cut, feed, way, a coordinate.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from beamstiff.compensation.path import ToolPath
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.se3 import Array, rotate_screw

TableFrame = Literal["base", "tool", "feed"]
COORDINATES = ("x", "y", "z")
WAY = "way"
ROUNDING = 1e-9  # of the range of the table


class Process(Protocol):
    """A load on the tool along its path."""

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the load at every target.

        `tool` (N, 4, 4): where the real tool is, base frame, m. `path`: where it should be, base frame; its
        order gives the direction of travel, its columns all else. Returns (N, 6) array: ``[f, m]`` on the
        tool at its tip, base frame, N and N m.
        """


@dataclass(frozen=True)
class Constant:
    """The same load everywhere, such as a weight: ``[f, m]`` at the tool's tip, base frame, N and N m."""

    value: tuple[float, ...]

    def wrench(self, tool: Array, path: ToolPath) -> Array:  # noqa: ARG002 (the protocol's)
        """Return the load (N, 6)."""
        return np.broadcast_to(np.array(self.value, dtype=np.float64), (len(tool), 6)).copy()


@dataclass(frozen=True)
class FromPath:
    """The load that the path's own columns state."""

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the load (N, 6), zero where the path states none."""
        return np.zeros((len(tool), 6)) if path.wrench is None else path.wrench


@dataclass(frozen=True)
class Together:
    """Loads that act at the same time; none where the tool moves in air."""

    parts: tuple[Process, ...] = ()

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the sum of the loads (N, 6)."""
        total = np.zeros((len(tool), 6))
        for part in self.parts:
            total = total + part.wrench(tool, path)
        return total


def travel(path: ToolPath) -> Array:
    """Return unit vectors (N, 3) along the path, base frame; zero where it stands still."""
    positions = path.poses[:, :3, 3]
    if len(positions) < 2:
        return np.zeros_like(positions)
    ways = np.diff(positions, axis=0)
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = np.where(length > 0, ways / np.where(length > 0, length, 1.0), 0.0)
    both = np.vstack([ways[:1], ways]) + np.vstack([ways, ways[-1:]])
    size = np.linalg.norm(both, axis=1, keepdims=True)
    return np.asarray(np.where(size > 1e-9, both / np.where(size > 1e-9, size, 1.0), 0.0))


def beside_columns(process: Process | None) -> Together:
    """Return the loads that the path's columns state, and those of a process where there is one."""
    return Together((FromPath(), *([] if process is None else [process])))


@dataclass(frozen=True, eq=False)
class CuttingTable:
    """Loads interpolated linearly over a variable."""

    # a column of the path; ``way`` along the path from its beginning; or ``x``, ``y``, ``z`` of the real tool
    # in the base frame, m
    variable: str
    values: Array  # (K,): rising, SI
    loads: Array  # (K, 6): ``[f, m]`` on the tool, N and N m
    # of the loads' components. In ``feed`` x points the way the tool travels, z along the part of the tool's
    # z that is square to it
    frame: TableFrame = "base"

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the load at every target, (N, 6), base frame."""
        at = self._variable(tool, path)
        low, high = float(self.values[0]), float(self.values[-1])
        margin = ROUNDING * (high - low)
        if (outside := (at < low - margin) | (at > high + margin)).any():
            row = int(np.argmax(outside))
            raise BeamstiffError(
                f"{path.place(row)}: found {self.variable} = {at[row]:.6g}, expected {low:.6g} to "
                f"{high:.6g}, which the table of cutting forces holds (SI)"
            )
        local = np.stack([np.interp(at, self.values, column) for column in self.loads.T], axis=1)
        if self.frame == "base":
            return local
        turn = tool[:, :3, :3] if self.frame == "tool" else self._feed(tool, path)
        return np.asarray((rotate_screw(turn) @ local[..., None])[..., 0])

    def _variable(self, tool: Array, path: ToolPath) -> Array:
        if self.variable in path.columns:
            return np.asarray(path.columns[self.variable])
        if self.variable in COORDINATES:
            return np.asarray(tool[:, COORDINATES.index(self.variable), 3])
        if self.variable == WAY:
            return path.way
        known = [*path.columns, WAY, *COORDINATES]
        raise BeamstiffError(
            f"{path.source}: found no column {self.variable!r}{suggest(self.variable, known)}, which the "
            f"table of cutting forces is over; known: {listed(known)}"
        )

    def _feed(self, tool: Array, path: ToolPath) -> Array:
        x = travel(path)
        z = tool[:, :3, 2] - np.sum(tool[:, :3, 2] * x, axis=1, keepdims=True) * x
        length = np.linalg.norm(z, axis=1)
        if (wrong := (length < 1e-6) | (np.abs(x).max(axis=1) == 0)).any():
            row = int(np.argmax(wrong))
            raise BeamstiffError(
                f"{path.place(row)}: the direction of travel is not known or along the tool, so the frame "
                "feed of the cutting forces is not defined; expected the frame base or tool"
            )
        z = z / length[:, None]
        return np.stack([x, np.cross(z, x), z], axis=2)
