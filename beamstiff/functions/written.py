"""A robot as the text of a simulator's format, by the ending of the file."""

from __future__ import annotations

from pathlib import Path

from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_writer import robot_to_mjcf
from beamstiff.simulators.series_joints import robot_to_series

SERIES = (
    "the SDF holds every compliance as a joint in series, for simulators: read back, these count as drives"
)


def as_written(robot: Robot, path: str, source: Path) -> tuple[str, tuple[str, ...]]:
    """Return a robot's text for a path that ends in .xml, .urdf or .sdf, and what it does not say.

    An MJCF that the robot was read from, `source`, is edited in place; an SDF takes effects as joints.
    """
    ending = Path(path).suffix.lower()
    if ending == ".urdf":
        return robot_to_urdf(robot), ()
    if ending == ".sdf" and robot.effects:
        text, lost = robot_to_series(robot, "sdf")
        return text, (*lost, SERIES)
    if ending == ".sdf":
        written = robot_to_sdf(robot)
        return written.text, written.lost
    if source.suffix.lower() == ".xml":
        return mjcf_like(robot, read_text(source), str(source))
    return robot_to_mjcf(robot)
