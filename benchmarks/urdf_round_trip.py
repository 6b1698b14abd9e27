"""URDF files read, written and compared: `python -m benchmarks.urdf_round_trip FOLDER_OR_FILE ...`.

Each file goes URDF -> robot -> YAML -> robot -> URDF. Asked: the same text, byte for byte but for the one
line that names the TCP, and links that stand where URDF's own product of transforms (by scipy) puts them, to
1e-12. What is refused is counted by its reason. Without arguments: the trailblazer of the shared data.

Reached on ros-industrial/abb @ 77db19b, bulletphysics/bullet3 @ 6c888f4ab and Gepetto/example-robot-data @
39aa943: 153 of 153 files that were read, links to 1.8e-15 of the size; 110 are refused (without bullet3's
random_urdfs), most of them things without joints, the others XML or numbers that URDF does not allow.
"""

from __future__ import annotations

import os
import re
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.report.tables import number, table
from beamstiff.robot.description import Robot
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.link_tree import variable_names
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.urdf.reader import parse_urdf, read_tree
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.robot.xml_text import parse_xml
from beamstiff.se3 import Array

ASKED = 1e-12  # of the machine's size
SHARED = Path(__file__).resolve().parents[1] / os.environ.get("BEAMSTIFF_SHARED", "../shared")
_TCP = re.compile(r'\s*<beamstiff tcp="[^"]*"/>')


@dataclass
class Found:
    """What the files showed."""

    read: int = 0
    same: int = 0
    farthest: float = 0.0
    changed: list[str] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)


def round_trips(files: Iterable[Path]) -> Found:
    """Return what becomes of URDF files."""
    found = Found()
    for file in files:
        try:
            text = file.read_bytes().decode()
            tree = read_tree(parse_xml(text, "URDF"))
            robot = parse_urdf(text, "URDF", tcp=tree.links[-1].name)
        except (BeamstiffError, UnicodeDecodeError) as error:
            found.refused[
                re.sub(r"^URDF:?\d*:? ?|'[^']*'|<(link|joint|robot) [^>]*>: ", "", str(error))[:70]
            ] += 1
            continue
        found.read += 1
        written = robot_to_urdf(parse_robot(robot_to_yaml(robot)))
        if text in (written, _TCP.sub("", written)):
            found.same += 1
        else:
            found.changed.append(str(file))
        found.farthest = max(found.farthest, farthest_link(robot, text))
    return found


def farthest_link(robot: Robot, text: str) -> float:
    """Return how far the links stand from where URDF's own transforms put them, over the machine's size."""
    names = variable_names(read_tree(parse_xml(text, "URDF")).joints)
    kinematics = compile_frames(robot)
    free = np.linspace(0.3, 1.1, len(kinematics.coupling.free))
    values = all_values(kinematics, free[None])
    of_joint = {joint: float(values[0, kinematics.coupling.names.index(own)]) for joint, own in names.items()}
    placed = forward(kinematics, values)[0]
    nodes = {node.name: kinematics.frame_index[node.frame] for node in robot.nodes}
    poses = link_poses(ET.fromstring(text.encode()), of_joint)
    return (
        max(float(np.abs(placed[nodes[link]] - pose).max()) for link, pose in poses.items()) / kinematics.size
    )


def link_poses(root: ET.Element, q: Mapping[str, float]) -> dict[str, Array]:
    """Return the pose of every link, from the values of all joints that move."""

    def numbers(item: ET.Element | None, name: str, default: str) -> Array:
        return np.array(((item.get(name) if item is not None else None) or default).split(), dtype=np.float64)

    steps: dict[str, tuple[str, Array]] = {}
    for joint in root.findall("joint"):
        name, origin, step = joint.get("name", ""), joint.find("origin"), np.eye(4)
        step[:3, :3] = Rotation.from_euler("xyz", numbers(origin, "rpy", "0 0 0")).as_matrix()
        step[:3, 3] = numbers(origin, "xyz", "0 0 0")
        if name in q:
            moved, axis = np.eye(4), numbers(joint.find("axis"), "xyz", "1 0 0")
            axis = q[name] * axis / np.linalg.norm(axis)
            if joint.get("type") == "prismatic":
                moved[:3, 3] = axis
            else:
                moved[:3, :3] = Rotation.from_rotvec(axis).as_matrix()
            step = step @ moved
        ends = (joint.find("parent"), joint.find("child"))
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        steps[child] = parent, step
    poses: dict[str, Array] = {}
    for link in root.findall("link"):
        name, pose = link.get("name", ""), np.eye(4)
        while name in steps:
            name, step = steps[name]
            pose = step @ pose
        poses[link.get("name", "")] = pose
    return poses


def main(arguments: list[str]) -> None:
    """Print the table."""
    given = [Path(text) for text in arguments] or [SHARED / "real" / "hilti_trailblazer"]
    files = [file for path in given for file in (sorted(path.rglob("*.urdf")) if path.is_dir() else [path])]
    found = round_trips(files)
    console = Console()
    result = table("URDF files, there and back", "", "asked", "reached")
    result.add_row("files", "", f"{len(files)}")
    result.add_row("read", "", f"{found.read}")
    result.add_row("written byte for byte", f"{found.read}", f"{found.same}")
    result.add_row("farthest link / size", f"{ASKED:g}", number(found.farthest))
    console.print(result)
    for file in found.changed:
        console.print(f"changed: {file}", soft_wrap=True, markup=False)
    for reason, count in found.refused.most_common():
        console.print(f"refused {count}: {reason}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main(sys.argv[1:])
