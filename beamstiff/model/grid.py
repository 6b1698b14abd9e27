"""Gridded stiffness: the workspace cut into cubes, each with springs of its own (seed 001, section 3)."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import finite, positive
from beamstiff.model.cube_kinematics import CubeDeviations, deviating
from beamstiff.model.fuzzy_inference import Partition
from beamstiff.model.varying import displaced, ports_at
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

ON_THE_FACE = 5e-3  # share of a cube's side by which joint readings may miss a sampling point on its face
AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Cubes:
    """Cubes of one size side by side, numbered with the last axis fastest.

    >>> two = Cubes(np.array([1.0, -0.6, 1.0]), 0.6, (1, 2, 1))
    >>> two.inside([[1.2, -0.1, 1.1], [1.2, 0.0, 1.1], [0.0, 0.0, 0.0]]).tolist()
    [[True, False], [True, True], [False, False]]
    """

    low: Array  # (3,), m: least corner, base frame
    size: float
    counts: tuple[int, int, int]  # number of cubes along x, y and z; C in all

    def __post_init__(self) -> None:
        """Check the cubes."""
        object.__setattr__(self, "low", finite(self.low, "cubes: least corner", 3))
        positive(self.size, "cubes: size")
        if min(self.counts) < 1:
            raise BeamstiffError(f"cubes: found {self.counts} cubes along x, y, z, expected one or more each")

    @property
    def count(self) -> int:
        """Number C of cubes."""
        return int(np.prod(self.counts))

    @property
    def high(self) -> Array:
        """Largest corner, (3,), m."""
        return self.low + self.size * np.array(self.counts)

    @property
    def centres(self) -> Array:
        """Return the centres (C, 3), m."""
        steps = np.array(list(product(*(range(count) for count in self.counts))), dtype=np.float64)
        return self.low + self.size * (steps + 0.5)

    def name(self, cube: int) -> str:
        """Return a cube's place along x, y and z, counted from 1: ``"2.1.1"``."""
        return ".".join(str(int(at) + 1) for at in np.unravel_index(cube, self.counts))

    def inside(self, positions: ArrayLike) -> NDArray[np.bool_]:
        """Return which positions (N, 3) lie in which cube, (N, C); one on a face lies in both."""
        at = finite(positions, "positions", -1, 3)
        away = np.abs(at[:, None] - self.centres).max(axis=2)
        return np.asarray(away <= (0.5 + ON_THE_FACE) * self.size)

    def weights(self, positions: ArrayLike, interpolate: bool) -> Array:
        """Return the share of every cube at positions (N, 3), (N, C); a row sums to one, or to zero outside.

        Between the centres of neighbouring cubes linearly along each axis, if `interpolate`; else the cube
        itself (the mean of both on a face).
        """
        at = finite(positions, "positions", -1, 3)
        inside = self.inside(at).astype(np.float64)
        held = inside.sum(axis=1, keepdims=True)
        if not interpolate:
            result: Array = inside / np.maximum(held, 1.0)
            return result
        steps = [
            low + self.size * (np.arange(count) + 0.5)
            for low, count in zip(self.low, self.counts, strict=True)
        ]
        result = Partition(AXES, tuple(steps)).firing(at) * (held > 0)
        return result


@dataclass(frozen=True, eq=False)
class GriddedStiffness:
    """A robot whose springs change from cube to cube, as a `Model`."""

    robot: Robot
    parameters: tuple[str, ...]  # m springs that vary
    cubes: Cubes
    compliance: Array  # (C, m): m/N or rad/(N m)
    rows: NDArray[np.int64]  # (C,): measured rows in each cube
    # between cubes, the logarithm of the compliance linearly; else every cube for itself
    interpolate: bool = False
    # answer in cubes without data (as the fit left them), and beyond the grid as at its rim; else such rows
    # are refused
    extrapolate: bool = False
    deviations: CubeDeviations | None = None  # of the kinematics, by cube

    def extrapolating(self) -> Self:
        """Return the model that answers outside the cubes with data too."""
        return replace(self, extrapolate=True)

    def outside(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Return which postures (N, A) have their TCP beyond the grid, or in a cube without data, (N,)."""
        known = self.cubes.inside(tcp_positions(self.robot, q)) & (self.rows > 0)
        return np.asarray(~known.any(axis=1))

    def compliances(self, q: ArrayLike) -> Array:
        """Return the compliances (N, m) of the springs in postures (N, A)."""
        return np.exp(self._weights(tcp_positions(self.robot, q)) @ np.log(self.compliance))

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return displacements (N, 6), base frame, m and rad."""
        compliances = self.compliances(q)
        return displaced(ports_at(self.robot, self.parameters, q, wrench), compliances)

    def offsets(self, q: ArrayLike) -> Array:
        """Return what the unloaded TCP is off the robot's own kinematics, (N, 6): ``[d, r]``, m and rad."""
        joints = finite(q, "joint values", -1, len(self.robot.actuated))
        if self.deviations is None:
            return np.zeros((len(joints), 6))
        shared = self._weights(tcp_positions(self.robot, joints)) @ self.deviations.values
        return deviating(self.robot, self.deviations.parameters).offsets(joints, shared)

    def _weights(self, at: Array) -> Array:
        """Return the share of every cube where the TCP is, (N, C)."""
        if not self.extrapolate:
            self._refuse(at)
        return self.cubes.weights(np.clip(at, self.cubes.low, self.cubes.high), self.interpolate)

    def _refuse(self, at: Array) -> None:
        inside = self.cubes.inside(at)
        known = inside & (self.rows > 0)
        if known.any(axis=1).all():
            return
        row = int(np.argmin(known.any(axis=1)))
        where = ", ".join(f"{name} = {value:.3f}" for name, value in zip(AXES, at[row], strict=True))
        if not inside[row].any():
            low, high = (", ".join(f"{v:.3f}" for v in end) for end in (self.cubes.low, self.cubes.high))
            raise BeamstiffError(
                f"row {row}: found the TCP at {where} m, beyond the grid from {low} to {high} m; ask "
                "within it, or allow extrapolation"
            )
        raise BeamstiffError(
            f"row {row}: found the TCP at {where} m, in cube {self.cubes.name(int(np.argmax(inside[row])))} "
            "that has no data; measure there, or allow extrapolation"
        )


def tcp_positions(robot: Robot, q: ArrayLike) -> Array:
    """Return the nominal positions (N, 3) of the TCP in postures (N, A), m."""
    kinematics = compile_kinematics(robot)
    poses, pose = np.unique(finite(q, "joint values", -1, len(robot.actuated)), axis=0, return_inverse=True)
    tcp = kinematics.node_index[robot.tcp]
    result: Array = posture(kinematics, poses).node_positions[pose.reshape(-1), tcp]
    return result
