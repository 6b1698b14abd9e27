"""Cutting forces from a table over one variable of the path: depth of cut, feed, way, a coordinate."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.load import travel
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.se3 import Array, rotate_screw

TableFrame = Literal["base", "tool", "feed"]
COORDINATES = ("x", "y", "z")
WAY = "way"
ROUNDING = 1e-9  # of the range of the table


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
