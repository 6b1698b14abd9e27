"""What is to be computed at every pose of a map, stated so that it can be sent, and told from another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError
from beamstiff.expression_graph.compiled import kernel
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.maps.grid import Box, Grid, boxes, make_grid
from beamstiff.maps.quantities import QUANTITIES, check_quantities
from beamstiff.maps.reach import Reach, postures_of_configuration
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import check_stiffness
from beamstiff.se3 import Array

MANY = 16384  # poses a chunk: some tenths of a second, which is what a kill costs
MANY_SEARCHED = 1024  # where joint values have to be found first
UNKNOWNS = 100  # beyond, chunks are smaller: the work at a pose grows


@dataclass(frozen=True, eq=False)
class Job:
    """A map to be computed."""

    robot: Robot
    grid: Grid
    quantities: tuple[str, ...]  # names in `QUANTITIES`
    wrench: Array  # (6,): ``[f, m]`` on the TCP, base frame, N and N m
    gravity: bool  # whether deflection and displacement contain the sag under dead weight
    direction: Array | None  # (3,): of length 1, base frame
    length: float | None  # m: characteristic length of the Jacobian, where one is asked for
    pool: Array | None = None  # (K, A): over positions: postures of the configuration to start from

    def needs(self, what: str) -> bool:
        """Tell whether some quantity follows from compliance, weight or jacobian."""
        if what == "weight" and self.gravity:
            return True
        return any(what in QUANTITIES[name].needs for name in self.quantities)

    @property
    def chunk_size(self) -> int:
        """How many poses a chunk has at most."""
        most = MANY if self.grid.target is None else MANY_SEARCHED
        return max(16, int(most / max(1.0, 6 * len(self.robot.nodes) / UNKNOWNS) ** 2))

    @cached_property
    def boxes(self) -> list[Box]:
        """The chunks, which depend on the job alone: whoever computes one gets the same numbers."""
        return boxes(self.grid.shape, self.chunk_size)

    @cached_property
    def structure(self) -> Structure:
        """The robot, its graph worked out."""
        return compile_structure(self.robot)

    @cached_property
    def reach(self) -> Reach:
        """How to get to points of a grid over positions."""
        assert self.pool is not None
        return Reach(self.structure.kinematics, self.grid.q, self.grid.turned, self.pool)

    @property
    def bytes_of_result(self) -> int:
        """Bytes of all quantities at one pose."""
        joints = 0 if self.grid.target is None else self.grid.q.size
        return 8 * (joints + sum(QUANTITIES[name].size for name in self.quantities)) + 1

    def stated(self) -> dict[str, Any]:
        """Return everything that the numbers depend on, as plain data."""
        grid = self.grid
        return {
            "robot": robot_digest(self.robot),
            "grid": {
                name: [axis.size, float(axis[0]), float(axis[-1]), sha256(axis.tobytes()).hexdigest()[:16]]
                for name, axis in zip(grid.names, grid.axes, strict=True)
            },
            "held": dict(zip([v.name for v in self.robot.actuated], grid.q.tolist(), strict=True)),
            "target": None if grid.target is None else grid.target.tolist(),
            "orientation": "met" if grid.turned else "free",
            "quantities": list(self.quantities),
            "wrench": self.wrench.tolist(),
            "gravity": self.gravity,
            "direction": None if self.direction is None else self.direction.tolist(),
            "length": self.length,
            "chunk": self.chunk_size,
            "versions": versions(),
        }

    def __getstate__(self) -> dict[str, Any]:
        """Send what was stated; what follows from it is worked out there."""
        return {name: self.__dict__[name] for name in self.__dataclass_fields__}


def build_job(
    robot: Robot,
    over: Mapping[str, ArrayLike],
    held: Mapping[str, float] | None = None,
    orientation: ArrayLike | Literal["free"] | None = None,
    quantities: Sequence[str] = ("stiffness",),
    wrench: ArrayLike | None = None,
    gravity: bool = False,
    direction: ArrayLike | None = None,
    length: float | None = None,
) -> Job:
    """Return a map to be computed; the arguments are those of `map_workspace`."""
    names = tuple([quantities] if isinstance(quantities, str) else quantities)
    check_quantities(names, wrench is not None, direction is not None, gravity)
    if {"compliance", "weight"} & {need for name in names for need in QUANTITIES[name].needs}:
        check_stiffness(robot)
    kinematics = compile_structure(robot).kinematics
    grid = make_grid(kinematics, over, held, orientation)
    load = _vector("wrench", wrench, 6)
    if load[3:].any() and robot.tcp not in turning_nodes(robot):
        raise BeamstiffError(
            f"a moment acts on node {robot.tcp!r}, which struts alone hold: it has no rotation"
        )
    along = None
    if direction is not None:
        along = _vector("direction", direction, 3)
        if not along.any():
            raise BeamstiffError("direction: found 0, 0, 0, expected one that points somewhere")
        along = along / np.linalg.norm(along)
    if any("jacobian" in QUANTITIES[name].needs for name in names):
        if length is None:
            from beamstiff.planning.dexterity import characteristic_length  # loads an optimiser

            length = characteristic_length(kinematics).length
        elif not (np.isfinite(length) and length > 0):
            raise BeamstiffError(f"length: found {length}, expected a positive number of metres")
    else:
        length = None
    pool = None
    if grid.target is not None:
        pool = postures_of_configuration(kinematics, grid.q, grid.turned)
    return Job(robot, grid, names, load, gravity, along, length, pool)


def _vector(what: str, values: ArrayLike | None, size: int) -> Array:
    vector = np.zeros(size) if values is None else np.array(values, dtype=np.float64)
    if vector.shape != (size,) or not np.isfinite(vector).all():
        raise BeamstiffError(f"{what}: found {str(values)[:60]!r}, expected {size} finite numbers")
    return vector


def robot_digest(robot: Robot) -> str:
    """Return the SHA-256 of a robot's description."""
    return sha256(robot.model_dump_json().encode()).hexdigest()


def versions() -> dict[str, str]:
    """Return the versions that may change the last digits of a map."""
    return {
        "beamstiff": __version__,
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "numba": "not used" if kernel() is None else version("numba"),
    }
