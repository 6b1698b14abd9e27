"""A bundled robot, put into poses."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from beamstiff import Robot, compile_structure, posture, tcp_compliance
from beamstiff.fem.structure import Structure
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.parts import Rigid
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array


def limits(robot: Robot) -> Array:
    """Return the limits (A, 2) of the actuated variables."""
    return np.array([variable.limits for variable in robot.actuated], dtype=np.float64).reshape(-1, 2)


def inside(robot: Robot, poses: int, seed: int = 0) -> Array:
    """Return random joint values (P, A) within the limits."""
    low, high = limits(robot).T
    return np.random.default_rng(seed).uniform(low, high, (poses, len(low)))


def corners(robot: Robot) -> Array:
    """Return all corners (2^A, A) of the joint space."""
    return np.array(list(itertools.product(*limits(robot))), dtype=np.float64)


def at(robot: Robot, q: Any) -> tuple[Structure, Posture]:
    """Return the robot's structure and its postures."""
    structure = compile_structure(robot)
    return structure, posture(structure.kinematics, q)


def compliance(robot: Robot, q: Any) -> Array:
    """Return the compliance at the TCP (P, 6, 6)."""
    return tcp_compliance(*at(robot, q))


def values(posed: tuple[Structure, Posture], name: str) -> Array:
    """Return one variable at all poses."""
    structure, place = posed
    return place.values[:, structure.kinematics.coupling.names.index(name)]


def point(posed: tuple[Structure, Posture], node: str) -> Array:
    """Return where a node is at all poses, (P, 3)."""
    structure, place = posed
    return place.node_positions[:, structure.kinematics.node_index[node]]


def springs(robot: Robot) -> dict[str, float]:
    """Return the stiffness of joints and struts by name."""
    beams = {f"{beam.name}.E" for beam in robot.beams}
    return {name: value for name, value in stiffness_parameters(robot).items() if name not in beams}


def nothing_gives_but(
    robot: Robot, soft: Mapping[str, float] | None = None, beams: tuple[str, ...] = ()
) -> Robot:
    """Return the robot all rigid, but for the stiffness values in `soft`, the `beams` and what is free."""
    stiff = {name: RIGID for name, value in springs(robot).items() if value != FREE}
    rigid = [Rigid(name=beam.name, nodes=beam.nodes) for beam in robot.beams if beam.name not in beams]
    return robot.with_parameters({**stiff, **(soft or {})}).model_copy(
        update={
            "beams": tuple(beam for beam in robot.beams if beam.name in beams),
            "rigids": (*robot.rigids, *rigid),
            "identify": (),
        }
    )
