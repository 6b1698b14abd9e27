"""A robot, however it is given: the object, the path of its file, or the name of a bundled robot."""

from __future__ import annotations

import os

from beamstiff.errors import BeamstiffError, shown
from beamstiff.robot.description import Robot

RobotLike = Robot | str | os.PathLike[str]


def as_robot(robot: RobotLike, what: str = "robot") -> Robot:
    """Return a robot: itself, or read from its file.

    Parameters
    ----------
    robot : Robot, str or os.PathLike
        A path, or the name of a bundled robot such as ``"ir663"``, is read with `load_robot`.
    what : str
        The argument, for messages.
    """
    if isinstance(robot, Robot):
        return robot
    if isinstance(robot, str | os.PathLike):
        from beamstiff.robot.reader import load_robot

        return load_robot(robot)
    raise BeamstiffError(
        f"{what}: found {shown(robot)}, expected a Robot, the path of a robot file, or the name of a bundled "
        "robot"
    )
