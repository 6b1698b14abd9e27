"""Where to measure for gridded stiffness: nine points a cube with the tool turned (seed 001, section 3.2)."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.measure.arrays import rotation_matrix
from beamstiff.model.grid import Cubes
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import Kinematics
from beamstiff.se3 import Array, rotation_from_vector

TURNS = (-10.0, 0.0, 10.0)  # deg, about the tool's y axis
TOLERANCE = 1e-7  # m and rad


@dataclass(frozen=True, eq=False)
class Sampling:
    """Configurations to measure, S of them."""

    q: Array  # (S, A): actuated variables, rad or m
    position: Array  # (S, 3), m: of the TCP
    # (S,): whether the robot gets there within its limits; where not, q is the closest approach
    reached: NDArray[np.bool_]


def sampling_points(cubes: Cubes) -> Array:
    """Return the corners and centres of all cubes, each once, (S, 3), m.

    >>> [len(sampling_points(Cubes(np.zeros(3), 1.0, counts))) for counts in ((1, 1, 1), (2, 1, 1))]
    [9, 14]
    """
    steps = [range(count + 1) for count in cubes.counts]
    corners = cubes.low + cubes.size * np.array(list(product(*steps)), dtype=np.float64)
    return np.concatenate([corners, cubes.centres])


def point_in_each(cubes: Cubes, random: np.random.Generator) -> Array:
    """Return one random point in every cube, (C, 3), m: where seed 001 verifies."""
    return cubes.centres + cubes.size * random.uniform(-0.5, 0.5, (cubes.count, 3))


def sample(
    kinematics: Kinematics,
    positions: ArrayLike,
    rotation: ArrayLike,
    turns: ArrayLike = TURNS,
    start: ArrayLike | None = None,
    seed: int = 0,
) -> Sampling:
    """Return configurations that bring the TCP to positions (S, 3), with the tool turned about its y axis.

    S T of them, the `turns` (T,), deg, of one position one after the other. `rotation` (3, 3) is that of the
    TCP's frame where it is not turned; neighbours of `start` (A,) get neighbouring configurations.
    """
    at, turned = np.asarray(positions, dtype=np.float64), np.deg2rad(np.asarray(turns, dtype=np.float64))
    about_y = rotation_from_vector(turned[:, None] * np.array([0.0, 1.0, 0.0]))
    targets = np.tile(np.eye(4), (len(at) * len(turned), 1, 1))
    targets[:, :3, :3] = np.tile(rotation_matrix(rotation, "rotation of the tool") @ about_y, (len(at), 1, 1))
    targets[:, :3, 3] = np.repeat(at, len(turned), axis=0)
    found = inverse_geometry(kinematics, targets, start=start, seed=seed, tolerance=TOLERANCE, restarts=20)
    return Sampling(found.q, targets[:, :3, 3], found.reached)
