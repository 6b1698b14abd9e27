"""A robot as text, in the format that the ending of a file says."""

import os
from pathlib import Path

from beamstiff.errors import OptionError
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.dh_output import robot_to_table
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.robot.yaml_edit import robot_yaml
from beamstiff.se3 import Array
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_writer import SETTLE, robot_to_mjcf
from beamstiff.simulators.series_joints import robot_to_series
from beamstiff.simulators.urdf_parts import Files

SERIES = "the SDF holds every compliance as a joint in series, for simulators"
LOOPS = "URDF knows no loops: its passive joints look free to other readers"


def robot_text(
    robot: Robot,
    path: str,
    source: Path,
    *,
    like: str | os.PathLike[str] | None = None,
    series: bool = False,
    q: Array | None = None,
    settle: float = SETTLE,
    convention: str | None = None,
) -> tuple[str, tuple[str, ...]]:
    """Return a robot's text for the ending of `path`, and what it does not say.

    `source`: the file that the robot was read from, whose YAML is edited. `like`: a URDF or MJCF that is
    edited. `series`: every compliance a joint of the URDF or SDF. `q` (A,) and `settle`, s: of an MJCF, see
    `robot_to_mjcf`. `convention`: of a table of frames.
    """
    ending = Path(path).suffix.lower()
    if series and ending not in (".urdf", ".sdf"):
        raise OptionError("series", "goes with an --out that ends in .urdf or .sdf")
    if like is not None and ending not in (".urdf", ".xml"):
        raise OptionError("like", "goes with an --out that ends in .urdf or .xml")
    if series:
        return robot_to_series(robot, ending[1:], q, Files(source, Path(path)))
    if ending == ".urdf":
        lost = (LOOPS,) if robot.loops else ()
        return robot_to_urdf(robot, None if like is None else read_text(Path(like))), lost
    if ending == ".sdf":
        written = robot_to_sdf(robot)
        return written.text, written.lost
    if ending == ".xml" and like is not None:
        return mjcf_like(robot, read_text(Path(like)), str(like))
    if ending == ".xml":
        return robot_to_mjcf(robot, q, settle, Files(source, Path(path)))
    if ending == ".csv":
        if convention is None:
            raise OptionError("convention", "is missing, expected classic, modified or khalil-kleinfinger")
        table = robot_to_table(robot, convention)
        return table.text, tuple(table.notes)
    return robot_yaml(robot, source), ()


def applied_text(robot: Robot, path: str, source: Path) -> tuple[str, tuple[str, ...]]:
    """Return a robot with what was found in it, in a simulator's format, and what is lost.

    An MJCF that the robot was read from is edited in place; an SDF takes stiffness and effects as joints.
    """
    ending = Path(path).suffix.lower()
    series = ending == ".sdf"
    like = source if ending == source.suffix.lower() == ".xml" else None
    text, lost = robot_text(robot, path, source, like=like, series=series)
    return text, (*lost, SERIES) if series else lost
