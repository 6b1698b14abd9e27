"""`beamstiff compensate`: a tool path corrected for geometry, weight, load and effects of the real robot."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from beamstiff.cli.options import Assembly, Html, argument, flag, option, robot_argument
from beamstiff.cli.output import Outputs, note, working, write
from beamstiff.cli.parse import (
    parse_frame,
    parse_names,
    parse_points,
    parse_quantities,
    parse_variables,
    parse_wrench,
    robot_file,
)
from beamstiff.errors import BeamstiffError, listed
from beamstiff.outputs import check_replaceable

if TYPE_CHECKING:
    from beamstiff.compensation.rewrite import Compensated

REFUSE, KEEP = "refuse", "keep"


def compensate(
    robot: Annotated[
        str,
        robot_argument(
            "The robot as the controller has it, usually the nominal one: YAML, URDF or SDF file, or the "
            "name of a bundled robot."
        ),
    ],
    path: Annotated[
        str,
        argument(
            "PATH",
            "Path: .csv (poses or joint values); KUKA .src, .dat; ABB .mod, .prg; FANUC .ls; UR .script; "
            "APT .apt, .cls.",
        ),
    ],
    out: str | None = option("FILE", "Write the corrected path, in the format of PATH."),
    joints_out: str | None = option(
        "CSV", "Write the joint values of the corrected commands, deg and mm, a line for each target."
    ),
    actual: str | None = option(
        "ROBOT",
        "The real robot, as calibrate --out or diagnose --apply wrote it. Default: ROBOT; then its weight, "
        "load and effects are corrected, but no geometry error.",
    ),
    wrench: list[str] | None = option(
        "NAME=VALUE,...",
        "Load on the tool's tip, base frame, such as fz=-900N,mx=20; added to the other loads.",
    ),
    process: str | None = option("FILE", "Process model (YAML): bent beam, table of forces."),
    base: str | None = option(
        "NAME=VALUE,...",
        "Frame of the path ($BASE, wobj) in the robot's base frame: x, y, z and a, b, c (KUKA's "
        "A B C) or qw, qx, qy, qz; default: as the program says, else the same frame.",
    ),
    tool: str | None = option(
        "NAME=VALUE,...",
        "Programmed tool ($TOOL, tooldata) in the frame of the robot's TCP; default: as the program says, "
        "else the TCP.",
    ),
    q: list[str] | None = option(
        "NAME=VALUE,...", "Posture near the first target, instead of the one that the path states."
    ),
    only: list[str] | None = option("NAME,...", "Correct only these targets; XP* matches several."),
    taught: bool = flag(
        "--taught", "Targets were taught on the unloaded robot: correct only the effect of the load."
    ),
    base_taught: list[str] | None = option(
        "NAME=VALUE,...",
        "The real robot itself taught the frame of the path, unloaded: its origin, a point on x, a point in "
        "the xy plane, or any three points of the workpiece that it touched; each by x, y, z in the frame of "
        "the path (give three times). Targets count from where its tool was then.",
    ),
    positions_only: bool = flag("--positions-only", "Leave the orientations as they are."),
    unreachable: str = option(
        "refuse|keep",
        "If a target cannot be corrected: write nothing, or keep such targets as they are.",
        REFUSE,
    ),
    resample: str | None = option(
        "step=LENGTH,angle=ANGLE", "Insert targets in between; --out is a path table (.csv) then."
    ),
    std: str | None = option(
        "FILE", "Standard deviations of stiffness, as `identify --json` wrote them; effects have their own."
    ),
    load_std: list[str] | None = option("NAME=VALUE,...", "Standard deviation of the load, such as fz=20N."),
    leave_doubtful: bool = flag(
        "--leave-doubtful",
        "Keep targets as they are if their correction is below twice its standard deviation.",
    ),
    stream: bool = flag("--stream", "Answer lines of stdin with commands on stdout (online compensation)."),
    measured: list[str] | None = option(
        "RUN.csv",
        "A measured run (x, y, z of every target, loads if a cell read them): fit the process to it.",
    ),
    ran: list[str] | None = option("PROGRAM", "The program of this run; default: PATH."),
    learned: str | None = option("FILE", "Write the process as fitted to the measured runs, for --process."),
    figure: str | None = option("FILE", "Draw the path before and after (.png, .svg or .pdf)."),
    assembly: Assembly = None,
    html: Html = None,
) -> None:
    """Correct a tool path for the errors of the real robot.

    Each target is replaced by the command (fake pose) at which the real tool comes to rest at the
    target, with the robot's geometry, weight, stiffness and effects, under the process load. Position
    and orientation are corrected; only the position for robots with fewer than six joints and for
    files without orientations. Only the numbers of targets change; everything else stays byte for
    byte. The error after correction includes the rounding of the written numbers.

    --stream prepares the targets and answers each line `target NAME fx fy fz mx my mz` or
    `pose x y z a b c fx fy fz mx my mz` (SI, rotation vector, frame of the path; loads in the
    base frame) with `ok`, the command in the same form, its standard deviation, the joint values, and
    whether the answer was prepared (`warm`).

    --measured learns from where the tool really went in a run: friction, stiffness and clamp of a
    beam, size of tabulated forces, gain and frame of a load cell. Give all runs so far, each with its
    program (--ran), and repeat until the path no longer improves.

    Loads add up: columns fx to mz of a path table, --wrench, --process. A target that cannot be
    reached or corrected is listed with its line. Then no path and no report is written and the
    exit code is 2, unless --unreachable keep.

    \b
    Examples:
      beamstiff compensate kr500 cell.src --wrench fz=-900N --out corrected.src
      beamstiff compensate kr500 cell.dat --actual calibrated.yaml --process milling.yaml \\
          --base x=1200mm,z=600mm --tool z=180mm --out corrected.dat --figure path.png
      beamstiff compensate kr240-2 path.csv --resample step=5mm --out dense.csv --html report.html
      beamstiff compensate kr500 cell.src --process beam.yaml --measured run.csv \\
          --ran first.src --out again.src --learned found.yaml
      beamstiff compensate kr500 cell.src --stream --load-std fx=5N,fy=5N,fz=5N < forces.txt

    \b
    A path table (a, b, c: rotation vector, or declared before the header as KUKA ABC, Euler ZYX ...):
      # orientation: KUKA ABC
      x [mm],y [mm],z [mm],a [deg],b [deg],c [deg],fz [N]
      1500,-200,900,0,90,0,-350
    """
    from beamstiff.compensation.formats import points_beside
    from beamstiff.compensation.process.files import process_to_yaml
    from beamstiff.functions.checks import one_of
    from beamstiff.functions.compensate import compensate as run
    from beamstiff.functions.compensate import compensate_online, read_std
    from beamstiff.functions.robots import as_robot
    from beamstiff.report.compensation import compensation_figure, compensation_told, learned_head

    one_of("unreachable", unreachable, (REFUSE, KEEP))
    steps = _steps(resample)
    if steps is not None and out is not None and Path(out).suffix.lower() != ".csv":
        raise BeamstiffError(f"--out {out}: a resampled path is written as a table, expected a name.csv")
    if out is not None and steps is None:
        _check_format(path, out)
    controller = as_robot(robot, assembly=assembly)
    inputs: list[str | Path] = [robot_file(robot), path, *([robot_file(actual)] if actual else [])]
    inputs += [*([process] if process else []), *(measured or []), *(ran or [])]
    points = points_beside(path)  # of a .src, which may stand in its .dat: that is written too
    points_out = None if points is None or out is None else str(Path(out).with_suffix(points.suffix))
    inputs += [] if points is None else [points]
    elsewhere = {} if points_out is None else {"--out (its .dat)": points_out}
    if points_out is not None:
        check_replaceable(points_out)
    wanted: dict[str, Any] = {"out": out, "joints_out": joints_out, "learned": learned}
    outputs = Outputs(inputs, elsewhere=elsewhere, figure=figure, html=html, **wanted)
    given: dict[str, Any] = {
        "actual": actual,
        "wrench": parse_wrench(wrench),
        "process": process,
        "base": parse_frame("--base", base),
        "tool": parse_frame("--tool", tool),
        "q": parse_variables(controller, q) if q else None,
        "only": parse_names(only, "--only"),
        "std": None if std is None else read_std(std),
        "load_std": parse_wrench(load_std, "--load-std"),
        "leave_doubtful": leave_doubtful,
    }
    if stream:
        if (
            out
            or joints_out
            or learned
            or figure
            or html
            or steps
            or taught
            or base_taught
            or positions_only
            or measured
            or ran
        ):
            told = "answers lines, and goes with no --out, page, resampling, --taught or --base-taught"
            raise BeamstiffError(f"--stream: {told}")
        with working("preparing the targets"):
            targets = compensate_online(controller, path, **given)
        targets.serve(iter(sys.stdin.readline, ""), lambda line: print(line, flush=True))
        return
    if learned and not measured:
        raise BeamstiffError("--learned: found no measured run, expected --measured RUN.csv")
    with working("correcting the targets"):
        result = run(
            controller,
            path,
            taught=taught,
            base_taught=parse_points("--base-taught", base_taught),
            positions_only=positions_only,
            steps=steps,
            measured=measured or (),
            ran=ran or (),
            **given,
        )
    refused = bool(result.correction.reasons) and unreachable == REFUSE
    outputs.result(result.notes, compensation_told(result, refused), result.to_dict())
    if learned is not None and result.learned is not None:
        write(learned, process_to_yaml(result.learned.process, learned_head(result.learned)))
    if refused:
        raise _refusal(result)
    if out is not None:
        write(out, result.content, as_it_is=steps is None)
        if points_out is not None and result.points is not None:
            write(points_out, result.points, as_it_is=True)
    elif joints_out is None:
        note("--out FILE writes the corrected path, --joints-out FILE its joint values")
    if joints_out is not None:
        write(joints_out, result.joint_table())
    outputs.draw("figure", lambda: compensation_figure(result, f"{controller.name}: {Path(path).name}"))
    outputs.page("compensation", result, controller)


def _check_format(path: str, out: str) -> None:
    """Refuse an output whose ending is that of another language than the path is written in."""
    from beamstiff.compensation.formats import ENDINGS, ending_of

    read, write = map(ending_of, (path, out))
    if read in ENDINGS and write in ENDINGS and ENDINGS[read] is not ENDINGS[write]:
        raise BeamstiffError(
            f"--out {out}: found the ending {write}, expected {read} as of {path}: a path is corrected "
            "in the language it is written in"
        )


def _steps(text: str | None) -> tuple[float, float] | None:
    """Return the longest step and turn, m and rad, of a text such as ``step=5mm,angle=1deg``."""
    if text is None:
        return None
    kinds, expected = {"step": "length", "angle": "angle"}, "step=5mm, angle=1deg or both"
    found = parse_quantities("--resample", [text], kinds, expected, "more than 0")
    return found.get("step", float("inf")), found.get("angle", float("inf"))


def _refusal(result: Compensated) -> BeamstiffError:
    from beamstiff.report.compensation import uncorrected_action

    found = result.correction
    path, reasons = found.path, found.reasons
    each = [f"line {path.line(row)}, {path.names[row]} ({reason})" for row, reason in reasons.items()]
    return BeamstiffError(
        f"{path.source}: {len(reasons)} of {len(path)} targets cannot be corrected: {listed(each, 2)}; "
        f"no path is written. {uncorrected_action(result).rstrip('.')}"
    )
