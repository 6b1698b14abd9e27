"""`beamstiff convert`: robots and point lists from and to the files of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from beamstiff.cli.options import argument, flag, option
from beamstiff.cli.output import Outputs, write
from beamstiff.cli.parse import named, parse_variables, robot_file
from beamstiff.errors import BeamstiffError, counted, listed
from beamstiff.units import in_unit

if TYPE_CHECKING:
    from beamstiff.measure.logs import LogTable
    from beamstiff.robot.description import Robot

WRITTEN = {
    ".yaml": "robot file",
    ".yml": "robot file",
    ".urdf": "URDF",
    ".sdf": "SDF",
    ".xml": "MJCF",
    ".csv": "table of frames",
}
TOPIC = "NODE=TOPIC such as smr1=/tracker/smr1"
SETTLE = 2e-3  # s: `simulators.mjcf_writer.SETTLE`, which is slow to import for a default


def convert(
    source: Annotated[
        str,
        argument(
            "IN",
            "Robot: YAML, URDF, SDF, MJCF or a table of frames (CSV, YAML). Log: a ROS bag (.mcap, .db3, "
            ".bag). With --profile: a list of points, or a log in columns.",
        ),
    ],
    out: str = option(
        "FILE",
        "File to write; its ending says the format: .yaml, .urdf, .sdf, .xml (MJCF), .csv (frames, or "
        "points).",
        ...,
    ),
    tcp: str | None = option("NAME", "Link (or node) at the TCP; needed if the links branch."),
    joint_stiffness: list[str] | None = option(
        "[NAME=]VALUE",
        "Stiffness about (or along) a joint's axis: 'lift=1e8 N/m' for one joint, '1e6 N*m/rad' for all "
        "other rigid ones that the unit fits. Repeatable.",
    ),
    convention: str | None = option(
        "NAME", "For a table of frames: classic or modified (Denavit-Hartenberg) or khalil-kleinfinger."
    ),
    like: str | None = option(
        "FILE",
        "Write into this URDF or MJCF and keep everything else in it; default: the URDF that IN came from. "
        "For points, a log or measurements: the robot.",
    ),
    q: list[str] | None = option(
        "NAME=VALUE,...", "For MJCF: the posture at which values that vary with it are taken."
    ),
    series: bool = flag("--series", "URDF, SDF: every compliance a joint in series, as in MJCF."),
    settle: str = option(
        "TIME", "For MJCF: time in which the springs settle, a few time steps.", f"{1e3 * SETTLE:g} ms"
    ),
    profile: str | None = option(
        "FILE", "Columns of a list of points, or of a log: a YAML file, ur-rtde or kuka-rsi."
    ),
    joints: str | None = option(
        "FILE",
        "With a list of points: joint values and loads, to be joined with them; a CSV table, or any with "
        "--joints-profile. With a log of points: the log of the robot.",
    ),
    joints_profile: str | None = option(
        "FILE", "Columns of --joints: a YAML file; of the robot's log also ur-rtde or kuka-rsi."
    ),
    gravity: str | None = option(
        "X,Y,Z",
        "Gravity along the axes of the base in m/s^2, of a robot on a wall or a ceiling (9.81,0,0 or "
        "0,0,9.81); default: as in IN, mostly 0,0,-9.81.",
    ),
    hold: list[str] | None = option(
        "NAME=VALUE", "For a URDF: hold this joint at a value (30deg, 0.2m); repeatable."
    ),
    point: list[str] | None = option(
        "NODE=TOPIC", "For a log: the reflector of a topic; repeatable. Other topics are ignored then."
    ),
    skip: list[str] | None = option("TOPIC", "For a bag: topic to ignore; repeatable."),
    lag: str | None = option(
        "TIME",
        "For a log: how far the clock of the points is ahead of that of the joints; default: estimated.",
    ),
    shortest: str = option("TIME", "For a log: shortest plateau to keep.", "0.3 s"),
    mend_labels: bool = flag(
        "--mend-labels",
        "For measurements (--like ROBOT): correct exchanged names of reflectors by their distances, and "
        "drop one that slipped.",
    ),
    figure: str | None = option("FILE", "For a log: draw what was kept and cut (.png, .svg or .pdf)."),
) -> None:
    """Convert robots and points from and to other formats.

    A URDF keeps what beamstiff does not use (meshes, inertias, transmissions, comments). Stiffness is
    written in <beamstiff> elements, which other readers ignore. SDF contains links, joints, limits,
    masses and joint stiffness; MJCF (MuJoCo) contains every compliance as a joint in series. Notes
    list what is lost. A table of frames contains the chain to the TCP. A profile states the columns
    and units of a tracker's list of points; docs/files.md shows examples.

    \b
    Examples:
      beamstiff convert arm.urdf --tcp tool0 --joint-stiffness "1e6 N*m/rad" --out arm.yaml
      beamstiff convert arm.urdf --gravity 9.81,0,0 --out arm_on_wall.urdf
      beamstiff convert fitted.yaml --out fitted.urdf
      beamstiff convert kr240-2 --out kr240-2.xml
      beamstiff convert kr240-2 --series --out kr240-2.sdf
      beamstiff convert table.csv --convention modified --out arm.yaml
      beamstiff convert kr500 --convention classic --out kr500.csv
      beamstiff convert points.txt --profile leica.yaml --out measurements.csv
      beamstiff convert points.txt --profile sa.yaml --joints krc.log --joints-profile krc.yaml --out data.csv
      beamstiff convert run.mcap --like arm.yaml --out measurements.csv --figure cut.png
      beamstiff convert poses.csv --like arm.yaml --mend-labels --out mended.csv
    """
    others = (path for path in (like, profile, joints, joints_profile) if path is not None)
    outputs = Outputs([robot_file(source), *others], out=out, figure=figure)
    from beamstiff.measure.bags import is_bag
    from beamstiff.measure.profiles import named_profile

    if joints_profile is not None and joints is None:
        raise BeamstiffError("--joints-profile: goes with --joints")
    if mend_labels:
        from beamstiff.functions.convert import mended_table

        text, done = mended_table(source, like)
        write(out, text)
        line = f"{Path(source).name}: names of reflectors as their distances say."
        outputs.result(done, [line], {"written": out, "notes": done})
        return
    columns = None if profile is None else named_profile(profile)
    of_joints = None if joints_profile is None else named_profile(joints_profile)
    if is_bag(source) or (columns is not None and columns.samples):
        from beamstiff.functions.convert import convert_log
        from beamstiff.functions.robots import load_robot

        table = convert_log(
            source,
            columns,
            joints,
            of_joints,
            points={topic: node for node, topic in named("--point", point, TOPIC, once=False)},
            skip=skip or (),
            lag=None if lag is None else in_unit(lag, "s"),
            robot=None if like is None else load_robot(like),
            shortest=in_unit(shortest, "s"),
        )
        _write_log(outputs, source, out, table)
        return
    if point or skip or lag or figure:
        log = "a log (a bag, or a profile of samples)"
        raise BeamstiffError(f"--point, --skip, --lag and --figure: go with {log}")
    if columns is not None:
        from beamstiff.functions.robots import load_robot
        from beamstiff.measure.point_lists import convert_points

        of = None if like is None else load_robot(like)
        points = convert_points(source, columns, joints, of_joints, of)
        write(out, points.text)
        facts = {"points": points.count, "written": out, "notes": list(points.notes)}
        outputs.result(points.notes, [f"{Path(source).name}: {counted(points.count, 'point')}."], facts)
        return
    if joints is not None:
        raise BeamstiffError("--joints: goes with --profile, for lists of points")
    ending = Path(out).suffix.lower()
    if ending not in WRITTEN:
        raise BeamstiffError(
            f"--out {out}: found the ending {ending or 'none'!r}, expected {listed(WRITTEN)}"
        )
    from beamstiff.functions.convert import missing_notes, read_any, robot_text
    from beamstiff.robot.kinematics import actuated_values
    from beamstiff.robot.start_stiffness import with_joint_stiffness

    file = robot_file(source)
    of_input = convention if ending != ".csv" else None  # of a table to be written, it is none of the input
    machine, left_out = read_any(file, tcp=tcp, convention=of_input, hold=hold or ())
    if gravity is not None:
        machine = machine.model_copy(update={"gravity": _acceleration(gravity)})
    robot = with_joint_stiffness(machine, joint_stiffness or [])
    text, lost = robot_text(
        robot,
        out,
        file,
        like=like,
        series=series,
        q=actuated_values(robot, parse_variables(robot, q))[0] if q else None,
        settle=in_unit(settle, "s"),
        convention=convention,
    )
    if joint_stiffness and robot == machine:
        nothing = "--joint-stiffness changes nothing: no joint is rigid (NAME='...' replaces a value)"
        left_out = [*left_out, nothing]
    notes = [*left_out, *(() if ending == ".csv" else missing_notes(robot)), *lost]
    write(out, text, WRITTEN[ending], as_it_is=ending in (".urdf", ".xml"))
    moving = [variable.name for variable in robot.variables]
    facts = {"robot": robot.name, "tcp": robot.tcp, "variables": moving, "written": out, "notes": notes}
    outputs.result(notes, [], facts)
    outputs.console.print(_in_words(robot, machine), soft_wrap=True)


def _acceleration(text: str) -> tuple[float, float, float]:
    """Return an acceleration such as ``9.81,0,0``, m/s^2."""
    parts = [part.strip() for part in text.replace(",", " ").split()]
    try:
        x, y, z = (in_unit(part, "m/s^2") for part in parts)
    except (BeamstiffError, ValueError):
        raise BeamstiffError(
            f"--gravity: found {text!r}, expected three numbers in m/s^2 such as 9.81,0,0"
        ) from None
    return x, y, z


def _write_log(outputs: Outputs, source: str, out: str, table: LogTable) -> None:
    from beamstiff.report.logs import log_figure

    write(out, table.text)
    said = f"{Path(source).name}: {counted(table.count, 'row')}."
    outputs.result(table.notes, [said], table.to_dict() | {"written": out})
    outputs.draw("figure", lambda: log_figure(table))


def _in_words(robot: Robot, before: Robot) -> str:
    """Return what a robot consists of, and which stiffness it was given; `before`: without that."""
    moving = [variable.name for variable in robot.variables]
    said = (
        f"{robot.name}: {len(robot.frames)} frames, {len(robot.joints)} joints, TCP {robot.tcp}, variables "
        f"{listed(moving, 12) or 'none'}."
    )
    if robot == before:
        return said
    from beamstiff.report.verdict import rigid_drives
    from beamstiff.robot.stiffness_parameters import stiffness_parameters

    given, known = set(stiffness_parameters(before).items()), dict.fromkeys(before.identify)
    new = [name for name, value in stiffness_parameters(robot).items() if (name, value) not in given]
    said += f" Start values: {listed(new, 12)}."
    if rigid := rigid_drives(robot):
        said += f" Rigid: {listed(rigid, 12)}."
    if kept := [name for name in known if name not in new]:
        said += f" Kept from the file: {listed(kept, 12)}."
    return said
