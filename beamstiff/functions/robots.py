"""Robots read with their effects checked: names, places, shapes, parameters and scales.

`robot/` reads effects as plain data, for it cannot know the library of effects; whoever reads a robot
of a user reads it here, so that every command refuses the same files.
"""

import os
from pathlib import Path

from beamstiff.diagnosis.apply import EffectError, check_effects
from beamstiff.errors import BeamstiffError, OptionError
from beamstiff.robot import reader
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike


def as_robot(robot: RobotLike, what: str = "robot", assembly: str | None = None) -> Robot:
    """Return a robot: itself, or read with its effects checked; its loops assembled as `assembly` says."""
    found = (
        reader.as_robot(robot, what) if isinstance(robot, Robot) or not _mjcf(robot) else load_robot(robot)
    )
    if not isinstance(robot, Robot):
        found = check_known(found, Path(robot))
    if assembly is None:
        return found
    if not found.loops:
        raise OptionError("assembly", f"found {assembly!r}, but robot {found.name!r} has no closed loops")
    return found.model_copy(update={"assembly": assembly})


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Return the robot that a YAML, URDF, SDF or MJCF (.xml) file describes, by its ending.

    Parameters
    ----------
    path : str or os.PathLike
        A file, or the name of a robot that comes with the package, such as ``ir663``.

    Returns
    -------
    Robot

    Raises
    ------
    BeamstiffError
        When the file cannot be read or its robot cannot be used, its effects included: one line
        ``FILE:LINE: key: message``.

    Examples
    --------
    >>> load_robot("cantilever").fixed
    ('root',)
    """
    if _mjcf(path):
        from beamstiff.simulators.mjcf_reader import read_mjcf

        return read_mjcf(path).robot
    return check_known(reader.load_robot(path), Path(path))


def _mjcf(path: object) -> bool:
    return isinstance(path, str | os.PathLike) and Path(path).suffix.lower() == ".xml"


def check_known(robot: Robot, file: Path) -> Robot:
    """Return a robot that was read from a file, if the library knows its effects."""
    if robot.effects:
        try:
            check_effects(robot)
        except EffectError as error:
            line = reader.line_of(file, ("effects", error.at))
            raise BeamstiffError(f"{line}: {error.where}") from None
    return robot
