"""`compensate`: a tool path corrected for geometry, weight, load and effects of the real robot."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.compensation.formats import Program, read_program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.online import OnlineCompensation
from beamstiff.compensation.path import Frames, StatedFrame
from beamstiff.compensation.path_correction import base_errors
from beamstiff.compensation.process.files import read_process
from beamstiff.compensation.process.load import Constant, Process, Together
from beamstiff.compensation.rewrite import Compensated, compensate_program
from beamstiff.compensation.stream import OnlineTargets, prepared
from beamstiff.compensation.taught_base import check_points
from beamstiff.errors import BeamstiffError, OptionError, listed, shown
from beamstiff.files import read_text
from beamstiff.functions.checks import names_of, shown_value, six_numbers
from beamstiff.functions.compensation_notes import compensation_notes
from beamstiff.functions.measured_runs import learned_from
from beamstiff.functions.robots import as_robot
from beamstiff.maps.reach import within
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import actuated_values
from beamstiff.robot.reader import RobotLike
from beamstiff.se3 import Array

BODY = 3  # targets, fewer of which any motion of a body meets


def compensate(
    robot: RobotLike,
    path: Program | str | os.PathLike[str],
    *,
    actual: RobotLike | None = None,
    wrench: ArrayLike | None = None,
    process: Process | str | os.PathLike[str] | None = None,
    base: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    q: Mapping[str, float] | ArrayLike | None = None,
    only: Sequence[str] | None = None,
    taught: bool = False,
    base_taught: ArrayLike | None = None,
    positions_only: bool = False,
    steps: tuple[float, float] | None = None,
    std: Mapping[str, float] | None = None,
    load_std: ArrayLike | None = None,
    leave_doubtful: bool = False,
    measured: Sequence[str | os.PathLike[str]] = (),
    ran: Sequence[str | os.PathLike[str]] = (),
) -> Compensated:
    """Correct a tool path for what the real robot makes of it.

    Every target gets the command at which the real tool comes to rest at it: with the geometry, weight,
    stiffness and effects of the robot, under the load of the process.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Whose geometry the controller takes for true.
    path : Program or path of a file
        ``.csv``; KUKA ``.src``, ``.dat``; ABB ``.mod``, ``.prg``; APT ``.apt``, ``.cls``.
    actual : Robot, path or name, optional
        The real robot, where it differs from `robot`.
    wrench : (6,) array, optional
        Load on the tool's tip, base frame, N and N m; on top of columns of the path and of `process`.
    process : Process or path of a YAML file, optional
        Process model.
    base, tool : (4, 4) array, optional
        Frame of the path in the robot's base frame; programmed tool in the frame of the robot's TCP.
        Default: as the program says, else the base frame and the TCP.
    q : mapping of str to float, or (A,) array, rad or m, optional
        Posture near the first target, to choose the branch in place of what the program states (S and T of
        KRL, configuration of RAPID and FANUC).
    only : sequence of str, optional
        Correct these targets alone; ``"XP*"`` takes many.
    taught : bool
        Targets were taught on the unloaded robot: correct the load's part.
    base_taught : (3, 3) array, optional
        Three points in the frame of the path, m, by which the real robot taught it without process load
        (3-point method: origin, a point on x, a point in the xy plane; or any three of the workpiece that it
        touched, off one line). Targets count from where its tool was then, in the orientation of the target
        nearest to each.
    positions_only : bool
        Leave the orientations as they are.
    steps : (float, float), optional
        Resample to at most this distance, m, and turn, rad, a step: the result is a path table then.
    std : mapping of str to float, optional
        Standard deviations of stiffness parameters, SI, as `identify` finds them; effects bring their own.
    load_std : (6,) array, optional
        Standard deviation of the load, N and N m.
    leave_doubtful : bool
        Targets whose correction is below twice its standard deviation stay as they are.
    measured : sequence of path, optional
        Tables of measured runs of the path: x y z of the tool, and the loads that a cell read, if any. The
        parameters of the process (friction, stiffness, clamp; gain and frame of the cell) are fitted to them.
    ran : sequence of path, optional
        The program that ran in each of these; default: `path` in all.

    Returns
    -------
    Compensated
        Targets that cannot be corrected are in ``correction.reasons`` and stay as they are in ``content``.

    Raises
    ------
    BeamstiffError
        When the path cannot be read, the robots do not fit, or the load is not defined somewhere.
    """
    program, machine = _placed(robot, actual, path, only, base, tool)
    if steps is not None and machine.frames.base.ndim > 2:
        raise OptionError("steps", "found a path of several frames, expected one: see only")
    points = None if base_taught is None else _base_points(base_taught, machine, taught, bool(measured))
    start = _start(machine.controller, q)
    constant, own, learned = _constant(wrench), _process(process), None
    if measured:
        program, learned = learned_from(program, machine, own, constant, measured, ran, start)
        own, machine = learned.process, learned.machine
    elif ran:
        raise OptionError("ran", "found programs that ran, expected what was measured of them (measured) too")
    result = compensate_program(
        program,
        machine,
        _sum(constant, own),
        steps=steps,
        start=start,
        taught=taught,
        positions_only=positions_only,
        base_taught=points,
        std=std,
        load_std=None if load_std is None else six_numbers("load_std", load_std),
        leave_doubtful=leave_doubtful,
    )
    given = {"base": base is not None, "tool": tool is not None}
    common = None
    if not (taught or measured) and points is None and machine.frames.base.ndim == 2:
        common = base_errors(machine, result.correction)[result.known] if result.known.sum() >= BODY else None
    result = replace(result, learned=learned, common=common)
    return replace(result, notes=tuple(compensation_notes(result, program, given, q is not None, taught)))


def compensate_online(
    robot: RobotLike,
    path: Program | str | os.PathLike[str],
    *,
    actual: RobotLike | None = None,
    wrench: ArrayLike | None = None,
    process: Process | str | os.PathLike[str] | None = None,
    base: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    q: Mapping[str, float] | ArrayLike | None = None,
    only: Sequence[str] | None = None,
    std: Mapping[str, float] | None = None,
    load_std: ArrayLike | None = None,
    leave_doubtful: bool = False,
) -> OnlineTargets:
    """Prepare a path for compensation on line: a target and its load in, the command out.

    Parameters
    ----------
    robot, path, actual, wrench, process, base, tool, q, only, std, load_std, leave_doubtful
        As of `compensate`. The load of path, `wrench` and `process` is what the targets are prepared for, and
        what counts where a call states none.

    Returns
    -------
    OnlineTargets
        `command(name, wrench)` and `command_at(pose, wrench)`: answers in the base frame, m and rad.

    Raises
    ------
    BeamstiffError
        As of `compensate`, and when a target is out of reach.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "cell.src"
    >>> _ = file.write_text("PTP {X 1500,Y 0,Z 900,A 0,B 110,C 0,S 6}")
    >>> targets = compensate_online("kr500", file)
    >>> answer = targets.command("PTP 1", [0, 0, -900, 0, 0, 0])
    >>> answer.warm, float((1e3 * answer.correction[2]).round(1))
    (True, 0.5)
    """
    program, machine = _placed(robot, actual, path, only, base, tool)
    start = _start(machine.controller, q)
    spread = np.zeros(6) if load_std is None else six_numbers("load_std", load_std)
    online = OnlineCompensation(machine, dict(std or {}), spread, leave_doubtful)
    return prepared(program, online, _sum(_constant(wrench), _process(process)), start)


def read_std(path: str | os.PathLike[str]) -> dict[str, float]:
    """Return the standard deviations of the parameters that a JSON of `identify` holds, SI."""
    try:
        parameters = json.loads(read_text(Path(path)))["parameters"]
        found = {name: one["std"] for name, one in parameters.items() if one.get("std") is not None}
        return {str(name): float(value) for name, value in found.items()}
    except (ValueError, TypeError, KeyError, AttributeError):
        told = "found no parameters with a std, expected what identify --json writes"
        raise OptionError("std", f"{path}: {told}") from None


def _placed(
    robot: RobotLike,
    actual: RobotLike | None,
    path: Program | str | os.PathLike[str],
    only: Sequence[str] | None,
    base: ArrayLike | None,
    tool: ArrayLike | None,
) -> tuple[Program, Machine]:
    """Return the program, and the machine with the frames that it counts in."""
    controller = as_robot(robot)
    real = None if actual is None else as_robot(actual, "actual")
    if not isinstance(path, Program | str | os.PathLike):
        raise BeamstiffError(f"path: found {shown(path)}, expected a program or the path of its file")
    program = path if isinstance(path, Program) else read_program(Path(path))
    if names := names_of("only", only):
        program = program.only(names)
    try:
        placed = _stated_frame(program, "base", base)
    except OptionError as error:
        try:  # to say both at once
            _stated_frame(program, "tool", tool)
        except OptionError as other:
            raise OptionError("base", f"{error.what}; and tool {other.what}") from None
        raise
    frames = Frames(placed, _stated_frame(program, "tool", tool))
    return program, Machine(controller, real, frames=frames)


def _start(robot: Robot, q: Mapping[str, float] | ArrayLike | None) -> Array | None:
    """Return the posture (A,) that chooses the branch, within the limits of the joints that it names."""
    if q is None:
        return None
    values: Array = actuated_values(robot, q)[0]
    for variable, value in zip(robot.actuated, values.tolist(), strict=True):
        if isinstance(q, Mapping) and variable.name not in q:
            continue  # 0 by default, which need not be within
        if variable.limits is not None and not within(np.array(value), *variable.limits).all():
            low, high, found = (shown_value(robot, variable.name, one) for one in (*variable.limits, value))
            raise OptionError("q", f"{variable.name}: found {found}, expected one within {low} to {high}")
    return values


def _base_points(given: ArrayLike, machine: Machine, taught: bool, measured: bool) -> Array:
    """Return the points (3, 3), m, by which the real robot taught the base, if it can have done so."""
    if taught or measured:
        other = "taught" if taught else "measured"
        raise OptionError("base_taught", f"found together with {other}, expected one of the two")
    if machine.frames.base.ndim > 2:
        raise OptionError("base_taught", "found a path of several frames, expected one: see only")
    points = np.asarray(given, dtype=np.float64)
    check_points(points)
    return points


def _stated_frame(program: Program, what: str, given: ArrayLike | None) -> Array:
    """Return the frame of a path (4, 4), or (N, 4, 4) where it differs by target, or its tool (4, 4).

    `what`: ``base`` or ``tool``. The one that is `given` holds, else the one that the program states; where
    it states one without saying where that is, or several where one can be, the path is refused.
    """
    own: list[StatedFrame | None] = [getattr(place, what) for place in program.places]
    places = zip(program.places, own, strict=True)
    counting = [one for place, one in places if place.position or what == "tool"]
    by_name = {"" if one is None else one.name: one for one in counting or [None]}
    names = listed([name or "none" for name in by_name], 4)
    source, many = program.path.source, len(by_name) > 1
    several = f"{source}: found several frames ({what}) of its targets: {names}; take one's with only"
    if given is not None:
        if many:
            raise OptionError(what, f"{several}, or leave {what} away where the program says them all")
        frame = np.asarray(given, dtype=np.float64)
        if frame.shape != (4, 4) or not np.isfinite(frame).all():
            raise OptionError(what, f"found an array of shape {frame.shape}, expected a transform, 4 x 4")
        return frame
    poses: dict[str, Array] = {}
    for name, one in by_name.items():
        if one is None:
            poses[name] = np.eye(4)
        elif one.pose is not None:
            poses[name] = one.pose
        else:
            at = f":{one.line}" if one.line else ""
            itself = "the robot's own base frame" if what == "base" else "the TCP of the robot file itself"
            told = (
                f"is needed: {source}{at} has {one.name}, whose place the program does not say "
                f"(x=0: {itself})"
            )
            each = f"; take the targets of one at a time with only: {names}" if many else ""
            raise OptionError(what, told + each)
    first = next(iter(poses.values()))
    if all(np.array_equal(pose, first) for pose in poses.values()):
        return np.asarray(first)
    if what == "tool":
        raise OptionError(what, several)
    return np.array([poses.get("" if one is None else one.name, np.eye(4)) for one in own])


def _constant(wrench: ArrayLike | None) -> Process | None:
    return None if wrench is None else Constant(tuple(six_numbers("wrench", wrench).tolist()))


def _process(process: Process | str | os.PathLike[str] | None) -> Process | None:
    return read_process(Path(process)) if isinstance(process, str | os.PathLike) else process


def _sum(*loads: Process | None) -> Process | None:
    parts = tuple(load for load in loads if load is not None)
    return Together(parts) if parts else None
