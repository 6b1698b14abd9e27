"""A robot, however it is given: the object, the path of its file, or the name of a bundled robot."""

import os

from beamstiff.errors import BeamstiffError, shown
from beamstiff.robot.description import Robot

RobotLike = Robot | str | os.PathLike[str]


def as_robot(robot: RobotLike, what: str = "robot") -> Robot:
    """Return a robot: itself, or read by `load_robot`; `what` names the argument in messages."""
    if isinstance(robot, Robot):
        return robot
    if isinstance(robot, str | os.PathLike):
        from beamstiff.robot.reader import load_robot

        return load_robot(robot)
    raise BeamstiffError(
        f"{what}: found {shown(robot)}, expected a Robot, the path of a robot file, or the name of a bundled "
        "robot"
    )
