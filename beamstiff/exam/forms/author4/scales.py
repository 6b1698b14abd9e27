"""The scales of a machine that the sizes of forms follow, and laws beside what a hinge has."""

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.components import LARGE, slender, stiffness_of, turns
from beamstiff.exam.laws import Curved, Law
from beamstiff.exam.machine import Machine, Mesh, drives_of
from beamstiff.robot.description import Robot


def main_stiffness(robot: Robot) -> float:
    """Return the stiffness of the stiffest turning drive, N m/rad."""
    return LARGE / slender(robot) ** 2


def wrist_stiffness(robot: Robot) -> float:
    """Return the stiffness of the softest turning drive, N m/rad; a tenth of the main one's at least."""
    turning = [stiffness_of(robot, name) for name in drives_of(robot) if turns(robot, name)]
    main = main_stiffness(robot)
    return max(min(turning, default=main), 0.05 * main)


def rounded_ramp(x: Array, width: float) -> Curved:
    """Return a ramp that is 0 for x < 0 and x for x > 0, rounded over a width, and its slope."""
    root = np.sqrt(x**2 + width**2)
    return 0.5 * (x + root), 0.5 * (1.0 + x / root)


def beside(machine: Machine, hinge: str, direction: int, law: Law) -> Machine:
    """Return the machine with a law parallel to whatever a hinge has in a direction."""
    return machine.plus(meshes=(Mesh((hinge, direction), (hinge, direction), (1.0, 0.0), law),))


def round_about(machine: Machine, hinge: str, first: int, law: Law) -> Machine:
    """Return the machine with a law in every way of tilting about two directions of a hinge.

    `law`: of one of four springs on diameters 45 degrees apart, each with half of the stiffness.
    """
    for angle in 0.25 * np.pi * np.arange(4):
        weights = (float(np.cos(angle)), float(np.sin(angle)))
        machine = machine.plus(meshes=(Mesh((hinge, first), (hinge, first + 1), weights, law),))
    return machine
