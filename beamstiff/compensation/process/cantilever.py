"""A tool that bends a clamped beam elastically: the forming experiment of seed 003, section 4."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.path import ToolPath, inverse
from beamstiff.compensation.process.corotational import LARGEST_RATIO, contact
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

STILL = 1e-9  # m: a way shorter than this is none
Method = Literal["incremental", "euler-bernoulli"]


@dataclass(frozen=True, eq=False)
class Cantilever:
    """A flat beam, clamped at one end, under the tip of a tool.

    The tip is a point. It presses on the face of the beam and slides along it; it slides from target to
    target, and so friction points against the way it came.
    """

    # length, width, thickness: m
    length: float
    width: float
    thickness: float
    modulus: float  # Pa: E
    # (4, 4), m: base frame: origin on the face that the tool touches where the beam leaves the clamp, x along
    # the beam, z out of the face, against the tool
    clamp: Array
    method: Method = "incremental"
    friction: float = 0.0  # coefficient of Coulomb friction

    @property
    def bending_stiffness(self) -> float:
        """EI, N m^2."""
        return self.modulus * self.width * self.thickness**3 / 12

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the force of the beam on the tool, (N, 6), base frame."""
        distance, deflection = self._contact(tool, path)
        touching = deflection > 0
        normal, slope, tangential = np.zeros(len(tool)), np.zeros(len(tool)), np.zeros(len(tool))
        x, w = distance[touching], deflection[touching]
        way = np.zeros(len(tool)) if self.friction == 0 else self._slid(path)
        if self.method == "euler-bernoulli":
            normal[touching] = 3.0 * w / x**3  # over EI: small deflections, on the straight beam
        else:
            for direction in np.unique(way[touching]).tolist():
                some = touching & (way == direction)
                found = contact(distance[some], deflection[some], self.friction * direction)
                normal[some], slope[some] = found.normal, found.slope
                self._check_on_beam(found.length, np.flatnonzero(some), path)
        normal *= self.bending_stiffness
        tangential = -self.friction * way * normal
        local = np.zeros((len(tool), 3))
        # the normal out of the bent face is (sin, 0, cos) of its slope, the tangent (cos, 0, -sin)
        local[:, 0] = normal * np.sin(slope) + tangential * np.cos(slope)
        local[:, 2] = normal * np.cos(slope) - tangential * np.sin(slope)
        wrench = np.zeros((len(tool), 6))
        wrench[:, :3] = local @ self.clamp[:3, :3].T
        return wrench

    def _contact(self, tool: Array, path: ToolPath) -> tuple[Array, Array]:
        """Return distance from the clamp and deflection, (N,) each."""
        local = (inverse(self.clamp) @ tool)[:, :3, 3]
        distance, deflection = local[:, 0], -local[:, 2]
        touching = deflection > 0
        for wrong, what in (
            (touching & (distance <= 0), "is behind the clamp"),
            (touching & (distance > self.length), "is beyond the free end of the beam"),
            (touching & (np.abs(local[:, 1]) > 0.5 * self.width), "is beside the beam"),
            (
                touching & (deflection > LARGEST_RATIO * distance),
                "bends the beam too far: the deflection is more than "
                f"{LARGEST_RATIO:g} of the distance from the clamp",
            ),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                x, y, z = 1e3 * local[row]
                raise BeamstiffError(
                    f"{path.place(row)}: the tool {what}, at x {x:.4g}, y {y:.4g}, z {z:.4g} mm from the "
                    "clamp"
                )
        return distance, deflection

    def _check_on_beam(self, length: Array, rows: NDArray[np.intp], path: ToolPath) -> None:
        if (off := length > self.length).any():
            at = int(np.argmax(off))
            raise BeamstiffError(
                f"{path.place(int(rows[at]))}: the tool slips off the beam: it would touch at "
                f"{1e3 * length[at]:.4g} mm of {1e3 * self.length:.4g} mm"
            )

    def _slid(self, path: ToolPath) -> Array:
        """Return which way along the beam the tool came to each target, (N,)."""
        distance, deflection = self._contact(path.poses, path)
        place = distance.copy()
        touching = deflection > 0
        if self.method == "incremental" and touching.any():
            place[touching] = contact(distance[touching], deflection[touching]).length
        return sliding(place)


def sliding(place: Array) -> Array:
    """Return which way the tool slid to each place along a line, (N,): 1, -1, or 0 where it stood still.

    `place` (N,), m: on the line, in the order of the path. To the first nothing slid.

    >>> sliding(np.array([0.0, 0.1, 0.1, 0.05]))
    array([ 0., 1., 0., -1.])
    """
    way = np.diff(place, prepend=place[:1])
    return np.where(np.abs(way) > STILL, np.sign(way), 0.0)
