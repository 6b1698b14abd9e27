"""What every process model offers, and the simplest: a constant, columns of the path, a sum."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from beamstiff.compensation.path import ToolPath
from beamstiff.se3 import Array


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
