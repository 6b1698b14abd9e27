"""Components that effects sit at: their places on a robot, their stiffness, stroke and scale."""

from collections.abc import Callable, Sequence

import numpy as np

from beamstiff.exam.machine import drives_of, joints_of, own_stiffness
from beamstiff.exam.placing import skeleton_of
from beamstiff.robot.description import Robot

LARGE = 6.6e6  # N m/rad, axis 2 of a robot with 2.7 m reach (KUKA KR240-2)
SMALL = 6.0

Places = Callable[[Robot], Sequence[str | None]]


def nowhere(robot: Robot) -> list[str | None]:
    """Return the one place of effects that have no component."""
    return [None]


def turning_drives(robot: Robot) -> list[str]:
    """Return the revolute drives that are actuated variables."""
    turning = {v.name for v in robot.actuated if v.type == "revolute"}
    return [name for name in drives_of(robot) if name in turning]


def stiffness_of(robot: Robot, component: str | None) -> float:
    """Return the stiffness of a component's (first) joint in its own direction, SI."""
    return own_stiffness(robot, *joints_of(robot, str(component))[0])


def turns(robot: Robot, component: str | None) -> bool:
    """Return whether a component's own direction is a rotation."""
    return joints_of(robot, str(component))[0][1] == 3


def drive_of(robot: Robot, component: str) -> str | None:
    """Return the actuated variable that a component is, or that turns its frame (``f3.d``)."""
    driven = [variable.name for variable in robot.actuated]
    if component in driven:
        return component
    frames = {name: parameters for name, _, parameters in skeleton_of(robot).frames}
    found = [c for e in frames.get(component.rsplit(".", 1)[0], {}).values() for c in e.coefficients]
    return next((name for name in found if name in driven), None)


def slender(robot: Robot) -> float:
    """Return how much softer a structure is than a large robot's, to `SMALL`: by the root of its drives'."""
    turning = [stiffness_of(robot, name) for name in drives_of(robot) if turns(robot, name)]
    return float(np.clip(np.sqrt(LARGE / max(turning)), 1.0, SMALL)) if turning else 1.0


def main_stiffness(robot: Robot) -> float:
    """Return the stiffness of the stiffest turning drive, N m/rad."""
    return LARGE / slender(robot) ** 2


def wrist_stiffness(robot: Robot) -> float:
    """Return the stiffness of the softest turning drive, N m/rad; a tenth of the main one's at least."""
    turning = [stiffness_of(robot, name) for name in drives_of(robot) if turns(robot, name)]
    main = main_stiffness(robot)
    return max(min(turning, default=main), 0.05 * main)
