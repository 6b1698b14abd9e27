"""`beamstiff compensate`: a tool path corrected for geometry, weight, load and effects of the real robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamstiff.cli.frames import parse_frame
from beamstiff.cli.identify_options import chosen
from beamstiff.cli.options import Debug, Html, Json, Quiet, RobotFile, parse_names, robot_file
from beamstiff.cli.output import (
    check_outputs,
    effects_text,
    people,
    say,
    source_of,
    working,
    write_figure,
    write_json,
)
from beamstiff.errors import BeamstiffError, listed
from beamstiff.outputs import write_output

if TYPE_CHECKING:
    from beamstiff.compensation.formats import Program
    from beamstiff.compensation.machine import Machine
    from beamstiff.compensation.process.load import Process
    from beamstiff.compensation.rewrite import Compensated
    from beamstiff.robot.description import Robot
    from beamstiff.se3 import Array

REFUSE, KEEP = "refuse", "keep"


def compensate(
    context: typer.Context,
    robot: RobotFile,
    path: Annotated[
        str,
        typer.Argument(
            metavar="PATH",
            help="Path: .csv; KUKA .src, .dat; ABB .mod, .prg; APT .apt, .cls. Its targets are corrected.",
        ),
    ],
    out: Annotated[
        str | None,
        typer.Option("--out", metavar="FILE", help="Write the corrected path, in the format of PATH."),
    ] = None,
    actual: Annotated[
        str | None,
        typer.Option(
            "--actual",
            metavar="ROBOT",
            help="The real robot (calibrated geometry, stiffness, effects), where it differs from ROBOT, "
            "which the controller takes for true.",
        ),
    ] = None,
    wrench: Annotated[
        list[str] | None,
        typer.Option(
            "--wrench",
            metavar="NAME=VALUE,...",
            help="Load on the tool's tip, base frame, such as fz=-900N,mx=20; on top of the others.",
        ),
    ] = None,
    process: Annotated[
        str | None,
        typer.Option("--process", metavar="FILE", help="Process model (YAML): bent beam, table of forces."),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(
            "--base",
            metavar="NAME=VALUE,...",
            help="Frame of the path ($BASE, wobj) in the robot's base frame: x, y, z and a, b, c (KUKA's "
            "A B C) or qw, qx, qy, qz; default: the same frame.",
        ),
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(
            "--tool",
            metavar="NAME=VALUE,...",
            help="Programmed tool ($TOOL, tooldata) in the frame of the robot's TCP; default: the TCP.",
        ),
    ] = None,
    q: Annotated[
        list[str] | None,
        typer.Option(
            "--q", metavar="NAME=VALUE,...", help="Posture near the first target, to choose the branch."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME,...", help="Correct these targets alone; XP* takes many."),
    ] = None,
    taught: Annotated[
        bool,
        typer.Option("--taught", help="Targets were taught on the unloaded robot: correct the load's part."),
    ] = False,
    positions_only: Annotated[
        bool, typer.Option("--positions-only", help="Leave the orientations as they are.")
    ] = False,
    unreachable: Annotated[
        str,
        typer.Option(
            "--unreachable",
            metavar="refuse|keep",
            help="Targets that cannot be corrected: write nothing, or leave these as they are.",
        ),
    ] = REFUSE,
    resample: Annotated[
        str | None,
        typer.Option(
            "--resample",
            metavar="step=LENGTH,angle=ANGLE",
            help="Put targets in between; --out is a path table (.csv) then.",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option("--figure", metavar="FILE", help="Draw the path before and after (.png, .svg or .pdf)."),
    ] = None,
    json: Json = None,
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Correct a tool path for what the real robot makes of it.

    Every target gets the command (fake pose) at which the real tool comes to rest at the target:
    with the geometry, weight, stiffness and effects of the robot, under the load of the process.
    Position and orientation; of robots with fewer than six joints, and where the file holds no
    orientation, the position alone. Only numbers of targets change, everything else stays byte
    for byte. The error after correction is that of the numbers as they are written.

    Loads add up: columns fx to mz of a path table, --wrench, --process. A target that cannot be
    reached or corrected is listed with its line; unless --unreachable keep, no path is written
    then and the exit code is 2.

    \b
    Examples:
      beamstiff compensate kr500 cell.src --wrench fz=-900N --out corrected.src
      beamstiff compensate kr500 cell.dat --actual calibrated.yaml --process milling.yaml \\
          --base x=1200mm,z=600mm --tool z=180mm --out corrected.dat --figure path.png
      beamstiff compensate kr240-2 path.csv --resample step=5mm --out dense.csv --html report.html

    \b
    A path table (a, b, c: rotation vector, or declared before the header as KUKA ABC, Euler ZYX ...):
      # orientation: KUKA ABC
      x [mm],y [mm],z [mm],a [deg],b [deg],c [deg],fz [N]
      1500,-200,900,0,90,0,-350
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.cli.variables import parse_variables
    from beamstiff.compensation.formats import read_program
    from beamstiff.compensation.machine import Machine
    from beamstiff.compensation.path import Frames
    from beamstiff.compensation.rewrite import compensate_program
    from beamstiff.report.compensation import (
        compensation_figure,
        compensation_table,
        compensation_text,
        uncorrected_table,
    )
    from beamstiff.report.figures import check_format
    from beamstiff.robot.kinematics import actuated_values
    from beamstiff.robot.reader import load_robot

    chosen("--unreachable", unreachable, (REFUSE, KEEP))
    steps = _steps(resample)
    if steps is not None and out is not None and Path(out).suffix.lower() != ".csv":
        raise BeamstiffError(f"--out {out}: a resampled path is written as a table, expected a name.csv")
    if out is not None and steps is None:
        _check_format(path, out)
    if figure is not None:
        check_format(figure)
    controller = load_robot(robot)
    real = load_robot(actual) if actual is not None else None
    frames = Frames(parse_frame("--base", base), parse_frame("--tool", tool))
    machine = Machine(controller, real, frames=frames)
    start = actuated_values(controller, parse_variables(controller, q))[0] if q else None
    program = read_program(path)
    if names := parse_names(only, "--only"):
        program = program.only(names)
    load = _load(wrench, process)
    inputs: list[str | Path] = [robot_file(robot), path, *([robot_file(actual)] if actual else [])]
    inputs += [process] if process else []
    check_outputs(inputs, json, out=out, figure=figure, html=html)
    source = source_of(context, html, inputs)
    with working(f"correcting {len(program.path)} targets", quiet):
        result = compensate_program(
            program, machine, load, steps=steps, start=start, taught=taught, positions_only=positions_only
        )
    placed = base is not None or tool is not None
    notes = _notes(result, machine, program, placed=placed, branch=bool(q), taught=taught)
    for note in notes:
        say(f"note: {note}", quiet)
    facts = _facts(result, controller) | {"notes": notes}
    reasons = result.correction.reasons
    console = people(quiet, json)
    if reasons:
        console.print(uncorrected_table(result))
    if reasons and unreachable == REFUSE:
        write_json(facts, json)
        raise _refusal(result)
    console.print(compensation_table(result))
    console.print(compensation_text(result))
    if figure is not None:
        write_figure(compensation_figure(result, f"{controller.name}: {Path(path).name}"), figure)
    if out is not None:
        write_output(out, result.content, as_it_is=steps is None)
    elif not quiet:
        say("note: --out FILE writes the corrected path", quiet)
    if html is not None and source is not None:
        from beamstiff.report.html.compensation import compensation_html

        write_output(html, compensation_html(result, controller, source, facts, notes))
    write_json(facts, json)


def _check_format(path: str, out: str) -> None:
    """Refuse an output whose ending is that of another language than the path is written in."""
    from beamstiff.compensation.formats import ENDINGS

    read, write = (Path(name).suffix.lower() for name in (path, out))
    if read in ENDINGS and write in ENDINGS and ENDINGS[read] is not ENDINGS[write]:
        raise BeamstiffError(
            f"--out {out}: found the ending {write}, expected {read} as of {path}: a path is corrected "
            "in the language it is written in"
        )


def _load(wrench: Sequence[str] | None, process: str | None) -> Process | None:
    from beamstiff.cli.variables import parse_wrench
    from beamstiff.compensation.process.load import Constant, Together
    from beamstiff.compensation.process.reader import read_process

    parts: list[Process] = []
    if wrench:
        parts.append(Constant(tuple(parse_wrench(wrench))))
    if process is not None:
        parts.append(read_process(process))
    return Together(tuple(parts)) if parts else None


def _steps(text: str | None) -> tuple[float, float] | None:
    """Return the longest step and turn, m and rad, of a text such as ``step=5mm,angle=1deg``."""
    from beamstiff.units import quantity

    if text is None:
        return None
    kinds = {"step": "length", "angle": "angle"}
    found = dict.fromkeys(kinds, float("inf"))
    for part in text.split(","):
        name, equals, value = (word.strip() for word in part.partition("="))
        if name not in kinds or not equals:
            raise BeamstiffError(f"--resample: found {part.strip()!r}, expected step=5mm, angle=1deg or both")
        if found[name] < float("inf"):
            raise BeamstiffError(f"--resample: {name} is given twice")
        try:
            found[name] = quantity(value, kinds[name])
        except BeamstiffError as error:
            raise BeamstiffError(f"--resample: {name}: {error}") from None
        if not found[name] > 0:
            raise BeamstiffError(f"--resample: {name}: found {value!r}, expected more than 0")
    return found["step"], found["angle"]


def _notes(
    result: Compensated, machine: Machine, program: Program, placed: bool, branch: bool, taught: bool
) -> list[str]:
    """Return what is worth knowing, where the frames are `placed` and the `branch` is chosen or not."""
    from beamstiff.cli.variables import shown_value
    from beamstiff.robot.stiffness import missing_stiffness

    found, said = result.correction, [*([] if taught else _unproven(result, machine)), *program.notes]
    if missing_stiffness(machine.real) and not machine.real.effects:
        what = "differ in geometry alone" if machine.actual is not None else "are one and the same"
        said.append(
            f"robot {machine.real.name!r} is rigid: weight and load move nothing, so that controller and "
            f"real robot {what}; give it a stiffness, or the real robot as --actual"
        )
    if not placed and program.frames:
        said.append(
            f"{'; '.join(program.frames)}: --base and --tool say where this is, here both are left out: the "
            f"path counts from the robot's base, and is that of its TCP {machine.controller.tcp!r}"
        )
    if not branch:
        names = [variable.name for variable in machine.controller.actuated]
        first = zip(names, found.q[0].round(6).tolist(), strict=True)
        shown = (f"{name} = {shown_value(machine.controller, name, value + 0.0)}" for name, value in first)
        posture = ", ".join(shown)
        said.append(f"the path begins at {posture}; --q chooses another posture")
    if found.switched.size:
        lines = listed([str(found.path.lines[row]) for row in found.switched.tolist()])
        said.append(f"the joints have to jump before line {lines}: another configuration")
    if machine.set_aside:
        said.append(f"{effects_text(machine.set_aside)}: of measuring, which moves no tool: left out")
    if machine.real.effects:
        said.append(f"with the robot's effects: {effects_text(machine.real.effects)}")
    return said


def _unproven(result: Compensated, machine: Machine) -> list[str]:
    """Return what effects do to the unloaded robot: displacements that they were found from do not fix it."""
    said = []
    for effect, parts in machine.unproven(result.correction.q[result.known]).items():
        shown = ", ".join(f"{name} {1e3 * size:.2g} mm" for name, size in parts.items())
        said.append(
            f"the correction takes {effect} to move the unloaded tool already ({shown}): displacements, "
            "loaded minus unloaded, do not fix that part, absolute positions do; check a target, or teach "
            "the targets and correct what the load does alone (--taught)"
        )
    return said


def _refusal(result: Compensated) -> BeamstiffError:
    found = result.correction
    path, reasons = found.path, found.reasons
    each = [f"line {path.lines[row]} {path.names[row]} ({reason})" for row, reason in reasons.items()]
    return BeamstiffError(
        f"{path.source}: {len(reasons)} of {len(path)} targets cannot be corrected: {listed(each, 5)}; "
        "no path is written, --unreachable keep leaves them as they are"
    )


def _facts(result: Compensated, robot: Robot) -> dict[str, Any]:
    from dataclasses import asdict

    import numpy as np

    from beamstiff.report.compensation import size_of
    from beamstiff.se3 import vector_from_rotation

    found, known = result.correction, result.known
    names = [variable.name for variable in robot.actuated]
    before, after = size_of(found.before[known]), size_of(result.after[known])
    turns = vector_from_rotation(found.commands[:, :3, :3])

    def row_of(errors: Array, row: int) -> list[float] | None:
        return None if np.isnan(errors[row]).any() else errors[row].tolist()

    targets = [
        {
            "name": name,
            "line": int(found.path.lines[row]),
            "corrected": row not in found.reasons,
            "reason": found.reasons.get(row),
            "q": dict(zip(names, found.q[row].tolist(), strict=True)),
            "command": [*found.commands[row, :3, 3].tolist(), *turns[row].tolist()],
            "wrench": found.wrench[row].tolist(),
            "before": row_of(found.before, row),
            "after": row_of(result.after, row),
        }
        for row, name in enumerate(found.path.names)
    ]
    return {
        "format": "beamstiff-compensation/1",
        "before": asdict(before),
        "after": asdict(after),
        "improvement": 1 - after.rms_mm / before.rms_mm if before.rms_mm > 0 else None,
        "rounds": found.rounds,
        "unreachable": [
            {"line": int(found.path.lines[row]), "name": found.path.names[row], "reason": reason}
            for row, reason in found.reasons.items()
        ],
        "targets": targets,
    }
