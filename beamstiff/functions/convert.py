"""A robot from any file into any format; logs as tables."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from beamstiff.errors import BeamstiffError, OptionError, listed, shown
from beamstiff.files import read_text
from beamstiff.functions.robots import check_known, load_robot
from beamstiff.measure.bags import is_bag, read_bag
from beamstiff.measure.foreign_tables import refuse_points
from beamstiff.measure.logs import LogTable, table_of_log
from beamstiff.measure.plateaus import SHORTEST
from beamstiff.measure.point_lists import signals_of
from beamstiff.measure.profile_cells import mass_notes
from beamstiff.measure.profiles import Profile
from beamstiff.measure.reader import read_measurements
from beamstiff.measure.signals import Signal
from beamstiff.measure.swapped_labels import mend_labels
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.description import Robot
from beamstiff.robot.dh_output import robot_to_table
from beamstiff.robot.dh_tables import is_table, parse_yaml_table, read_table
from beamstiff.robot.link_tree import robot_of, tree_robot
from beamstiff.robot.pruning import pruned
from beamstiff.robot.sdf import read_sdf, unread
from beamstiff.robot.sdf_writer import robot_to_sdf
from beamstiff.robot.stiffness_parameters import missing_stiffness
from beamstiff.robot.urdf.reader import extension_of, read_tree, read_urdf
from beamstiff.robot.urdf.writer import robot_to_urdf, urdf_with_held
from beamstiff.robot.xml_text import parse_xml
from beamstiff.robot.yaml_edit import robot_yaml
from beamstiff.robot.yaml_text import parse_yaml
from beamstiff.se3 import Array
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_writer import SETTLE, robot_to_mjcf
from beamstiff.simulators.series_joints import robot_to_series
from beamstiff.simulators.urdf_parts import Files
from beamstiff.units import quantity

LARGEST = 1 << 30  # bytes of a log in columns
SERIES = "the SDF holds every compliance as a joint in series, for simulators"
LOOPS = "URDF knows no loops: its passive joints look free to other readers"


def read_any(
    file: Path, *, tcp: str | None = None, convention: str | None = None, hold: Sequence[str] = ()
) -> tuple[Robot, list[str]]:
    """Return the robot of any file that one can be read from, and notes on what of it was left out.

    `tcp`: node at the TCP; a URDF is pruned to the chain that leads there, with joints held at values such as
    ``"q7=30deg"`` (`hold`). `convention`: of a table of frames that does not say.
    """
    ending = file.suffix.lower()
    if hold and ending != ".urdf":
        raise OptionError("hold", "goes with a URDF")
    if hold and tcp is None:
        raise OptionError("hold", "goes with --tcp LINK")
    if ending == ".urdf":
        return _pruned(file, tcp, hold) or (check_known(read_urdf(file, tcp=tcp), file), [])
    if ending == ".sdf":
        return read_sdf(file, tcp=tcp), unread(read_text(file))
    if ending == ".xml":
        from beamstiff.simulators.mjcf_reader import read_mjcf

        read = read_mjcf(file, tcp=tcp)
        return read.robot, list(read.lost)
    if ending == ".csv":
        refuse_points(read_text(file), str(file))
        robot = read_table(file, convention)
    else:
        text = read_text(file) if ending in (".yaml", ".yml") else ""
        table = "rows" in text and is_table(parse_yaml(text, str(file))[0])
        robot = parse_yaml_table(text, convention, str(file)) if table else load_robot(file)
    if tcp is None:
        return robot, []

    def fail(message: str) -> Any:
        raise OptionError("tcp", message)

    return robot_of(fail, {key: getattr(robot, key) for key in type(robot).model_fields} | {"tcp": tcp}), []


def mended_table(path: str | Path, robot: str | Path | None) -> tuple[str, tuple[str, ...]]:
    """Return the text of a table with exchanged names of reflectors put back, and what was done."""
    if robot is None:
        raise OptionError("mend_labels", "goes with --like ROBOT, whose nodes the reflectors are")
    machine = load_robot(robot)
    mended, done = mend_labels(read_measurements(path, machine), machine)
    return measurements_to_csv(mended, machine), done


def _pruned(file: Path, tcp: str | None, hold: Sequence[str]) -> tuple[Robot, list[str]] | None:
    """Return the robot of a URDF pruned to the chain of its TCP, and notes; None where nothing is pruned."""
    if tcp is None:
        return None
    text = read_text(file)
    root = parse_xml(text, str(file))
    _, more = extension_of(root)
    if hold and (dropped := [key for key in more if key != "tcp"]):
        raise OptionError(
            "hold",
            f"{file} has {listed(dropped, 3)} written by beamstiff, which would be lost; expected the URDF "
            "from before. For `compensate`, a column of the path named after the joint holds it",
        )
    tree = read_tree(root)
    kinds = {joint.name: joint.kind for joint in tree.joints}
    values = {}
    for stated in hold:
        name, equals, value = (word.strip() for word in stated.partition("="))
        if not equals:
            raise OptionError("hold", f"found {shown(stated)}, expected NAME=VALUE such as q7=30deg")
        try:
            values[name] = quantity(value, "length" if kinds.get(name) == "prismatic" else "angle")
        except BeamstiffError as error:
            raise OptionError("hold", str(error)) from None
    if not values and tcp not in {link.name for link in tree.links}:
        return None  # the reader says what is wrong
    chain, held, notes = pruned(tree, tcp, values)
    if not held:
        return None
    robot = tree_robot(chain, tcp)
    return robot.model_copy(update={"urdf": urdf_with_held(text, held)}), notes


def missing_notes(robot: Robot) -> list[str]:
    """Return notes on the joints that are rigid, and on a robot that weighs nothing where it should."""
    notes, rigid = list[str](), listed(missing_stiffness(robot), 12)
    if rigid:
        notes.append(
            f"no compliance: the joints {rigid} are rigid; give them a stiffness with --joint-stiffness "
            "'1e6 N*m/rad' (or NAME='...')"
        )
    if not (robot.masses or robot.beams) and robot.actuated and any(robot.gravity):
        notes.append(
            "no masses: gravity cannot load the drives, and of positions (x y z) the sag under the robot's "
            "own weight is taken for other errors; give masses (URDF: <inertial>), estimates are enough"
        )
    return notes


def convert_log(
    path: str | os.PathLike[str],
    profile: Profile | None = None,
    joints: str | os.PathLike[str] | None = None,
    joints_profile: Profile | None = None,
    *,
    points: Mapping[str, str] | None = None,
    skip: Iterable[str] = (),
    lag: float | None = None,
    robot: Robot | None = None,
    shortest: float = SHORTEST,
) -> LogTable:
    """Return a log as a table of measurements (`measure.logs.table_of_log`).

    `path`: a bag, or columns that `profile` names. `joints`: the log of the robot, where it is another file.
    """
    signals, notes = _read(path, profile, skip)
    if joints is not None:
        more, others = _read(joints, joints_profile, ())
        signals = [one for one in signals if one.kind != "joints"]
        signals += [one for one in more if one.kind not in ("point", "pose")]
        notes += others
    made = table_of_log(signals, str(path), points=points, lag=lag, robot=robot, shortest=shortest)
    return replace(made, notes=(*notes, *made.notes))


def _read(
    path: str | os.PathLike[str], profile: Profile | None, skip: Iterable[str]
) -> tuple[list[Signal], list[str]]:
    if is_bag(path):
        return read_bag(path, skip)
    if profile is None or not profile.samples:
        raise BeamstiffError(
            f"{path}: is no bag; a log in columns needs a profile with `samples: true` "
            "(or --joints-profile ur-rtde, kuka-rsi)"
        )
    return signals_of(read_text(Path(path), LARGEST), profile, str(path)), mass_notes(profile)


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
