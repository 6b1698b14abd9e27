"""Robots from YAML: a `Robot`, or one line that says where the file is wrong and what would be right."""

import contextlib
import gc
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import DescriptionError, Problem, path_text
from beamstiff.robot.fitted_model import FittedModel
from beamstiff.robot.library import robot_names, robot_path
from beamstiff.robot.yaml_text import Lines, parse_yaml

VERSION = 1
RobotLike = Robot | str | os.PathLike[str]


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Return the robot of a YAML, URDF or SDF file, or of a name; its effects are not looked at."""
    file = Path(path)
    if str(path) == file.name and not os.path.isfile(file):
        names = _library()
        if file.name in names:
            file = robot_path(file.name)
        elif not file.suffix and not os.path.exists(file):
            raise BeamstiffError(
                f"{file}: no such file, and no robot of this name comes with beamstiff"
                f"{suggest(file.name, names)}"
            )
    if file.suffix.lower() == ".urdf":
        from beamstiff.robot.urdf.reader import read_urdf

        return read_urdf(file)
    if file.suffix.lower() == ".sdf":
        from beamstiff.robot.sdf import read_sdf

        return read_sdf(file)
    if file.suffix.lower() == ".csv":
        raise BeamstiffError(f"{file}: found a table, expected a robot file (YAML, URDF or SDF) in its place")
    text = read_text(file)
    if text.lstrip().startswith("<"):
        raise BeamstiffError(
            f"{file}:1: found XML, expected YAML: the name of a URDF ends in .urdf, of an SDF in .sdf, of an "
            f"MJCF in .xml; xacro is expanded first (xacro {file.name} > robot.urdf)"
        )
    return parse_robot(text, str(file))


def line_of(file: Path, path: tuple[str | int, ...]) -> str:
    """Return ``FILE:LINE`` of a key path of a file that was read; of a file that is no YAML its name."""
    if file.suffix.lower() in (".urdf", ".sdf", ".xml"):
        return str(file)
    return f"{file}:{parse_yaml(read_text(file), str(file))[1].at(path)}"


@contextlib.contextmanager
def _collector_paused() -> Iterator[None]:
    """Keep the garbage collector from walking a large file's values again and again: half the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@_collector_paused()
def parse_robot(text: str, name: str = "<text>") -> Robot:
    """Return the robot that a YAML text describes; messages call the text by `name`."""
    data, lines = parse_yaml(text, name)
    if not isinstance(data, dict):
        expected = f"keys with values, the first `beamstiff: {VERSION}`"
        raise BeamstiffError(f"{name}:{lines.at(())}: found {shown(data)}, expected {expected}")
    if "beamstiff" not in data:
        raise BeamstiffError(
            f"{name}:{lines.at(())}: beamstiff: is missing: a robot starts with `beamstiff: {VERSION}`"
        )
    version, line = data["beamstiff"], lines.at(("beamstiff",))
    if type(version) is not int or version != VERSION:
        raise BeamstiffError(f"{name}:{line}: beamstiff: found version {shown(version)}, expected {VERSION}")
    if isinstance(data.get("model"), str):
        data = {**data, "model": _model_beside(data["model"], name, lines.at(("model",)))}
    try:
        return Robot(**{key: value for key, value in data.items() if key != "beamstiff"})
    except DescriptionError as error:
        raise BeamstiffError(_told(error.problems, data, lines, name)) from None


def _model_beside(path: str, name: str, line: int) -> FittedModel:
    """Return the model of a file that a robot's file names, relative to the folder that this one is in."""
    file = Path(name).parent / path
    try:
        data, lines = parse_yaml(read_text(file), str(file))
    except BeamstiffError as error:
        raise BeamstiffError(f"{name}:{line}: model: {error}") from None
    if not isinstance(data, dict):
        raise BeamstiffError(f"{file}:{lines.at(())}: found {shown(data)}, expected a fitted model's keys")
    try:
        return FittedModel(**data)
    except DescriptionError as error:
        raise BeamstiffError(_told(error.problems, data, lines, str(file))) from None


def _library() -> list[str]:
    try:
        return robot_names()
    except BeamstiffError:  # an installation without robots still reads files
        return []


def _told(problems: Sequence[Problem], data: Any, lines: Lines, name: str) -> str:
    """Return the line that tells the first problem, and how many more there are."""
    # a misspelt key also makes the right one missing: the cause first
    path, message = min(problems, key=lambda problem: not problem[1].startswith("unknown key"))
    where = f"{_named_path(path, data)}: " if path else ""
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{name}:{lines.at(path)}: {where}{message}{more}"


def _named_path(path: tuple[str | int, ...], data: Any) -> str:
    """Return a key path with the names of list items: ``joints[3] (J33).stiffness.radial``."""
    parts: list[str | int] = []
    for part in path:
        parts.append(part)
        try:
            data = data[part]
        except (LookupError, TypeError):
            data = None
        if isinstance(part, int) and isinstance(data, dict) and isinstance(data.get("name"), str):
            parts[-2:] = [f"{path_text(tuple(parts[-2:]))} ({data['name'][:40]})"]
    return path_text(tuple(parts))


def as_robot(robot: RobotLike, what: str = "robot") -> Robot:
    """Return a robot: itself, or read by `load_robot`; `what` names the argument in messages."""
    if isinstance(robot, Robot):
        return robot
    if isinstance(robot, str | os.PathLike):
        return load_robot(robot)
    raise BeamstiffError(
        f"{what}: found {shown(robot)}, expected a Robot, the path of a robot file, or the name of a bundled "
        "robot"
    )
