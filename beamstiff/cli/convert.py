"""`beamstiff convert`: robots and point lists from and to the files of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamstiff.cli.options import option, robot_file
from beamstiff.cli.output import Outputs, note, write
from beamstiff.errors import BeamstiffError, listed, shown
from beamstiff.files import read_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
SETTLE = 2e-3  # s: `simulators.mjcf_writer.SETTLE`, which is slow to import for a default


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN",
            help="Robot: YAML, URDF, SDF or a table of frames (CSV, YAML). Log: a ROS bag (.mcap, .db3, "
            ".bag). With --profile: a list of points, or a log in columns.",
        ),
    ],
    out: str = option(
        "FILE",
        "What to write, by its ending: .yaml, .urdf, .sdf, .xml (MJCF), .csv (frames, or points).",
        ...,
    ),
    tcp: str | None = option("NAME", "Link (or node) at the TCP, where there are several ends."),
    joint_stiffness: list[str] | None = option(
        "[NAME=]VALUE",
        "Stiffness about (or along) a joint's axis: 'lift=1e8 N/m' for one joint, '1e6 N*m/rad' for all "
        "other rigid ones that the unit fits. Repeatable.",
    ),
    convention: str | None = option(
        "NAME", "Of a table of frames: classic or modified (Denavit-Hartenberg) or khalil-kleinfinger."
    ),
    like: str | None = option(
        "FILE", "Write into this URDF (default: that which IN came from) or MJCF, leaving all else as it is."
    ),
    q: list[str] | None = option(
        "NAME=VALUE,...", "Of an MJCF: the posture whose values stand for what varies with it."
    ),
    series: bool = typer.Option(
        False, "--series", help="URDF, SDF: every compliance a joint in series, as in MJCF."
    ),
    settle: str = option(
        "TIME", "Of an MJCF: within which its springs settle, a few time steps.", f"{1e3 * SETTLE:g} ms"
    ),
    profile: str | None = option(
        "FILE", "What the columns of a list of points, or of a log, are: a YAML file, ur-rtde or kuka-rsi."
    ),
    joints: str | None = option(
        "FILE",
        "With a list of points: CSV of joint values and loads, to be joined with them. With a log of points: "
        "the log of the robot.",
    ),
    joints_profile: str | None = option(
        "FILE", "What the columns of the robot's log are: a YAML file, ur-rtde or kuka-rsi."
    ),
    hold: list[str] | None = option(
        "NAME=VALUE", "Of a URDF: hold this joint at a value (30deg, 0.2m); repeatable."
    ),
    point: list[str] | None = option(
        "NODE=TOPIC", "Of a log: which reflector a topic is; repeatable. Others are left out then."
    ),
    skip: list[str] | None = option("TOPIC", "Of a bag: leave this out; repeatable."),
    lag: str | None = option(
        "TIME", "Of a log: what the points' clock shows more than the joints' (else found)."
    ),
    shortest: str = option("TIME", "Of a log: shortest plateau that is kept.", "0.3 s"),
    figure: str | None = option("FILE", "Of a log: draw what was kept and cut (.png, .svg or .pdf)."),
) -> None:
    """Convert robots and points from and to other formats.

    URDF keeps what beamstiff has no use for (meshes, inertias, transmissions, comments): it is
    written back as it was, with stiffness in <beamstiff> elements that other readers pass over. SDF
    holds links, joints, limits, masses and joint stiffness; MJCF (MuJoCo) every compliance as a joint
    in series; notes list what they lose. Tables of frames hold the chain to the TCP. A profile says
    what the columns of a tracker's list of points are, and in which units; docs/files.md shows some.

    \b
    Examples:
      beamstiff convert arm.urdf --tcp tool0 --joint-stiffness "1e6 N*m/rad" --out arm.yaml
      beamstiff convert fitted.yaml --out fitted.urdf
      beamstiff convert kr240-2 --out kr240-2.xml
      beamstiff convert kr240-2 --series --out kr240-2.sdf
      beamstiff convert table.csv --convention modified --out arm.yaml
      beamstiff convert kr500 --convention classic --out kr500.csv
      beamstiff convert points.txt --profile leica.yaml --out measurements.csv
      beamstiff convert run.mcap --like arm.yaml --out measurements.csv --figure cut.png
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    inputs: list[str | Path] = [
        robot_file(source),
        *(path for path in (like, profile, joints) if path is not None),
    ]
    outputs = Outputs(inputs, out=out, figure=figure)
    from beamstiff.measure.bags import is_bag
    from beamstiff.measure.profiles import named_profile
    from beamstiff.report.tables import counted

    columns = None if profile is None else named_profile(profile)
    if is_bag(source) or (columns is not None and columns.samples):
        from beamstiff.functions.convert_logs import convert_log
        from beamstiff.functions.robots import load_robot
        from beamstiff.units import in_unit

        table = convert_log(
            source,
            columns,
            joints,
            None if joints_profile is None else named_profile(joints_profile),
            points=point_nodes(point or []),
            skip=skip or (),
            lag=None if lag is None else in_unit(lag, "s"),
            robot=None if like is None else load_robot(like),
            shortest=in_unit(shortest, "s"),
        )
        write(out, table.text)
        said = f"{Path(source).name}: {counted(table.count, 'row')}."
        outputs.result(table.notes, [said], table.to_dict() | {"written": out})
        outputs.draw("figure", lambda: draw_log(table))
        return
    if point or skip or lag or figure:
        raise BeamstiffError(
            "--point, --skip, --lag and --figure: go with a log (a bag, or a profile of samples)"
        )
    if columns is not None:
        from beamstiff.measure.point_lists import convert_points

        points = convert_points(source, columns, joints)
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
    read, pruning = read_pruned(source, tcp, hold or []) or (None, [])
    machine = read or read_robot(source, tcp, convention, written=ending)
    robot = with_joint_stiffness(machine, joint_stiffness or [])
    notes = [*pruning, *_notes(robot)]
    if series:
        if ending not in (".urdf", ".sdf"):
            raise BeamstiffError("--series: goes with an --out that ends in .urdf or .sdf")
        from beamstiff.simulators.series_joints import robot_to_series

        text, lost = robot_to_series(robot, ending[1:])
        notes += lost
    elif ending == ".urdf":
        from beamstiff.robot.urdf.writer import robot_to_urdf

        text = robot_to_urdf(robot, None if like is None else read_text(like))
        if robot.loops:
            notes.append("URDF knows no loops: its passive joints look free to other readers")
    elif ending == ".sdf":
        from beamstiff.robot.sdf_writer import robot_to_sdf

        written = robot_to_sdf(robot)
        text = written.text
        notes += written.lost
    elif ending == ".xml":
        from beamstiff.simulators.mjcf_writer import robot_to_mjcf

        if like is not None:
            from beamstiff.simulators.mjcf_edit import mjcf_like

            text, lost = mjcf_like(robot, read_text(like), like)
        else:
            from beamstiff.cli.variables import parse_variables
            from beamstiff.robot.kinematics import actuated_values
            from beamstiff.units import in_unit

            where = actuated_values(robot, parse_variables(robot, q))[0] if q else None
            text, lost = robot_to_mjcf(robot, where, in_unit(settle, "s"))
        notes += lost
    elif ending == ".csv":
        from beamstiff.robot.dh_output import robot_to_table

        if convention is None:
            raise BeamstiffError("--convention: is missing, expected classic, modified or khalil-kleinfinger")
        made = robot_to_table(robot, convention)
        text, notes = made.text, list(made.notes)
    else:
        from beamstiff.robot.yaml_edit import robot_yaml

        text = robot_yaml(robot, robot_file(source))
    if like is not None and ending not in (".urdf", ".xml"):
        raise BeamstiffError("--like: goes with an --out that ends in .urdf or .xml")
    write(out, text, WRITTEN[ending], as_it_is=ending in (".urdf", ".xml"))
    moving = [variable.name for variable in robot.variables]
    said = (
        f"{robot.name}: {len(robot.frames)} frames, {len(robot.joints)} joints, TCP {robot.tcp}, variables "
        f"{listed(moving, 12) or 'none'}."
    )
    facts = {"robot": robot.name, "tcp": robot.tcp, "variables": moving, "written": out, "notes": notes}
    outputs.result(notes, [], facts)
    outputs.console.print(said, soft_wrap=True)


def read_pruned(source: str, tcp: str | None, hold: list[str]) -> tuple[Robot, list[str]] | None:
    """Return the robot of a URDF pruned to the chain of its TCP, and notes; None where nothing is pruned."""
    from beamstiff.cli.options import parse_quantity
    from beamstiff.robot.link_tree import tree_robot
    from beamstiff.robot.pruning import pruned
    from beamstiff.robot.urdf.reader import read_tree
    from beamstiff.robot.xml_text import parse_xml

    file = robot_file(source)
    if file.suffix.lower() != ".urdf":
        if hold:
            raise BeamstiffError("--hold: goes with a URDF")
        return None
    if tcp is None:
        if hold:
            raise BeamstiffError("--hold: goes with --tcp LINK")
        return None
    tree = read_tree(parse_xml(read_text(file), str(file)))
    kinds = {joint.name: joint.kind for joint in tree.joints}
    values = {}
    for text in hold:
        name, equals, value = (word.strip() for word in text.partition("="))
        if not equals:
            raise BeamstiffError(f"--hold: found {shown(text)}, expected NAME=VALUE such as q7=30deg")
        kind = "length" if kinds.get(name) == "prismatic" else "angle"
        values[name] = parse_quantity("--hold", value, kind)
    if not values and tcp not in {link.name for link in tree.links}:
        return None  # the reader says what is wrong
    chain, notes = pruned(tree, tcp, values)
    return (tree_robot(chain, tcp), notes) if notes or values else None


def draw_log(table: LogTable) -> Figure:
    """Draw what was kept of a log and what was cut."""
    from beamstiff.report.logs import log_figure

    return log_figure(table)


def point_nodes(texts: list[str]) -> dict[str, str]:
    """Return the nodes of topics, from texts such as ``"smr1=/tracker/smr1"``."""
    pairs = [text.partition("=") for text in texts]
    for text, (node, _, topic) in zip(texts, pairs, strict=True):
        if not (node.strip() and topic.strip()):
            raise BeamstiffError(
                f"--point: found {shown(text)}, expected NODE=TOPIC such as smr1=/tracker/smr1"
            )
    return {topic.strip(): node.strip() for node, _, topic in pairs}


def read_robot(source: str, tcp: str | None, convention: str | None, written: str = "") -> Robot:
    """Return the robot of any file that one can be read from.

    `tcp`: node at the TCP. `convention`: of a table that does not say. `written`: ending of the output: a
    convention given for a table to be written is none of the input.
    """
    from beamstiff.functions.robots import check_known, load_robot
    from beamstiff.robot.dh_tables import is_table, parse_yaml_table, read_table
    from beamstiff.robot.sdf import read_sdf
    from beamstiff.robot.urdf.reader import read_urdf
    from beamstiff.robot.yaml_text import parse_yaml

    file = robot_file(source)
    ending = file.suffix.lower()
    of_input = convention if written != ".csv" else None
    if ending == ".urdf":
        return check_known(read_urdf(file, tcp=tcp), file)
    if ending == ".sdf":
        return read_sdf(file, tcp=tcp)
    if ending == ".xml":
        from beamstiff.simulators.mjcf_reader import read_mjcf

        read = read_mjcf(file, tcp=tcp)
        for item in read.lost:
            note(item)
        return read.robot
    if ending == ".csv":
        robot = read_table(file, of_input)
    elif ending in (".yaml", ".yml"):
        text = read_text(file)
        table = "rows" in text and is_table(parse_yaml(text, str(file))[0])
        robot = parse_yaml_table(text, of_input, str(file)) if table else load_robot(file)
    else:
        robot = load_robot(source)
    if tcp is None:
        return robot
    from beamstiff.robot.link_tree import robot_of

    def fail(message: str) -> Any:
        raise BeamstiffError(f"--tcp: {message}")

    return robot_of(fail, {key: getattr(robot, key) for key in type(robot).model_fields} | {"tcp": tcp})


def with_joint_stiffness(robot: Robot, texts: list[str]) -> Robot:
    """Return the robot with a stiffness about or along the axis of joints that are rigid there."""
    from beamstiff.robot.coupling import variable_kinds
    from beamstiff.robot.stiffness import stiffness_parameters
    from beamstiff.units import quantity

    if not texts:
        return robot
    kinds = variable_kinds(robot)
    own = {
        joint.name: "axial" if kinds[joint.variable] == "length" else "torsional"
        for joint in robot.joints
        if joint.variable is not None
    }
    given: dict[str, float] = {}
    for text in sorted(texts, key=lambda text: "=" in text):  # a joint's own value, wherever it stands, wins
        name, named, value = text.rpartition("=")
        name = name.strip()
        if named and name not in own:
            from beamstiff.errors import suggest

            raise BeamstiffError(
                f"--joint-stiffness: there is no moving joint {name!r}{suggest(name, own)}, expected one of "
                f"{listed(own, 12)}"
            )
        found: dict[str, float] = {}
        problems: dict[str, BeamstiffError] = {}
        for direction, kind in (("torsional", "rotational stiffness"), ("axial", "translational stiffness")):
            try:
                found[direction] = quantity(value, kind)
            except BeamstiffError as error:
                problems[direction] = error
        if len(found) != 1:  # a plain number fits both
            meant = own.get(name, "torsional" if "torsional" in own.values() else "axial")
            why = f": {problems[meant]}" if not found else ""
            raise BeamstiffError(
                f"--joint-stiffness: found {shown(text)}, expected a stiffness with its unit, such as "
                f"'1e6 N*m/rad' or '1e8 N/m'{why}"
            )
        ((direction, size),) = found.items()
        fitting = [name] if named else [joint for joint, kind in own.items() if kind == direction]
        if not fitting or own[fitting[0]] != direction:
            raise BeamstiffError(
                f"--joint-stiffness: found {shown(text)}, which is {direction}; no joint "
                f"{'of this name ' if named else ''}moves so"
            )
        rigid = [
            joint for joint in fitting if named or robot.parameter(f"{joint}.{direction}") == float("inf")
        ]
        given |= {f"{joint}.{direction}": size for joint in rigid}
    wanted = {*robot.identify, *given}
    ordered = [name for name in stiffness_parameters(robot) if name in wanted]
    return robot.with_parameters(given).model_copy(update={"identify": tuple(ordered)})


def _notes(robot: Robot) -> list[str]:
    from beamstiff.robot.stiffness import missing_stiffness

    missing = missing_stiffness(robot)
    if not missing:
        return []
    return [
        f"no compliance: the joints {listed(missing, 12)} are rigid; give them a stiffness with "
        "--joint-stiffness '1e6 N*m/rad' (or NAME='...')"
    ]
