"""Robots read with their effects checked: names, places, shapes, parameters and scales.

`robot/` reads effects as plain data, for it cannot know the library of effects; whoever reads a robot
of a user reads it here, so that every command refuses the same files.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from beamstiff.diagnosis.apply import EffectError, check_effects
from beamstiff.errors import BeamstiffError, OptionError, shown
from beamstiff.robot import reader
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.start_stiffness import with_joint_stiffness


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


def load_robot(path: str | os.PathLike[str], *, joint_stiffness: str | Sequence[str] = ()) -> Robot:
    """Return the robot that a YAML, URDF, SDF or MJCF (.xml) file describes, by its ending.

    Parameters
    ----------
    path : str or os.PathLike
        A file, or the name of a robot that comes with the package, such as ``ir663``.
    joint_stiffness : str or sequence of str
        Start values about or along the axes of the joints that are rigid there, such as ``"1e6 N*m/rad"``:
        of a URDF all. ``"joint-2=2e6 N*m/rad"`` is of one joint and replaces its value. They count as guesses
        (``robot.unmeasured``) until a fit determines them, and are what it fits (``robot.identify``).

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
    robot = _from_mjcf(path) if _mjcf(path) else check_known(reader.load_robot(path), Path(path))
    texts = [joint_stiffness] if isinstance(joint_stiffness, str) else list(joint_stiffness)
    if not all(isinstance(text, str) for text in texts):
        raise OptionError("joint_stiffness", f"found {shown(texts)}, expected a list of texts")
    return with_joint_stiffness(robot, texts)


def _from_mjcf(path: str | os.PathLike[str]) -> Robot:
    from beamstiff.simulators.mjcf_reader import read_mjcf

    return read_mjcf(path).robot


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
