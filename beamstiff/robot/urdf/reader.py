"""URDF to a robot.

The tree of links gives frames, nodes, rigids, joints and masses (`link_tree`). What URDF has no words for
stands in elements `<beamstiff>`, which other readers pass over:

- in a ``<joint>`` its stiffness: ``<beamstiff torsional="1e6 N*m/rad" tilting="rigid"/>``, fixed joints too;
- in ``<robot>`` the TCP, ``<beamstiff tcp="tool0"/>``, and as its text, in YAML, keys of a robot file that
  take the place of what the tree says: ``gravity``, ``beams``, ``loops``, ``effects`` and so on.
"""

import os
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.link_tree import (
    EXTENSION,
    KINDS,
    SPRING,
    LinkTree,
    Mimic,
    TreeJoint,
    TreeLink,
    check_limits,
    kind_of,
    mass_of,
    robot_data,
    robot_of,
    springs_joined,
    stiffness_of,
)
from beamstiff.robot.placement import from_roll_pitch_yaw
from beamstiff.robot.xml_text import Element, parse_xml
from beamstiff.robot.yaml_text import parse_yaml
from beamstiff.se3 import Array

UNSAID = ("urdf", "beamstiff")  # keys that an extension may not hold
POSTURES = 5  # in which a URDF and the frames in its extension are compared
SAME_PLACE = 1e-9  # rad, and of the machine's size


def read_urdf(path: str | os.PathLike[str], *, tcp: str | None = None) -> Robot:
    """Return the robot of a URDF file; `tcp`: the link of the TCP, else what the extension or tree says."""
    return parse_urdf(read_text(os.fspath(path)), str(path), tcp=tcp)


def parse_urdf(text: str, name: str = "<text>", *, tcp: str | None = None) -> Robot:
    """Return the robot of a URDF text; otherwise as `read_urdf`.

    >>> robot = parse_urdf('''<robot name="crane"><link name="foot"/><link name="arm"/>
    ...     <joint name="slew" type="revolute"><parent link="foot"/><child link="arm"/>
    ...     <origin xyz="0 0 2"/><axis xyz="0 0 1"/><limit lower="-3" upper="3"/>
    ...     <beamstiff torsional="1e6 N*m/rad"/></joint></robot>''')
    >>> robot.tcp, robot.variables[0].limits, robot.parameter("slew.torsional")
    ('arm', (-3.0, 3.0), 1000000.0)
    """
    root = parse_xml(text, name)
    tree = springs_joined(whole := read_tree(root))
    extension, fragment = extension_of(root)
    for joint in tree.joints:
        if joint.stiffness and "joints" in fragment:
            joint.fail(
                "its stiffness stands in joints: of the robot's <beamstiff> too, expected one of the two"
            )
    data = robot_data(tree, tcp or fragment.get("tcp"))
    place = (root if extension is None else extension).fail
    springs = any(joint.spring for joint in whole.joints)  # what it says is no tree of drives to be edited
    more = ({"tcp": tcp} if tcp else {}) | ({} if springs else {"urdf": text})
    robot = robot_of(place, data | fragment | more)
    if fragment.keys() & {"frames", "variables"}:
        far = disagreement(robot_of(root.fail, data | {"tcp": tree.links[0].name}), robot)
        if far:
            place(
                f"frames: {far}, expected the same machine: change both, or take `frames` and `variables` "
                "out of the extension"
            )
    return robot


def read_tree(root: Element) -> LinkTree:
    """Return the links and joints of a ``<robot>``."""
    if root.name != "robot":
        hint = " (a file of SDF ends in .sdf)" if root.name == "sdf" else ""
        root.fail(f"expected <robot> as the outermost element{hint}")
    for child in root.children:
        if child.name.startswith("xacro:"):
            child.fail("found a macro, expected plain URDF: expand it with `xacro FILE > robot.urdf`")
    links = tuple(_link(item) for item in root.all("link"))
    joints = tuple(_joint(item) for item in root.all("joint"))
    if not joints and root.one(EXTENSION) is None:
        root.fail("found no joint, expected links and joints of a machine")
    return LinkTree(root.attribute("name"), links, joints, root.source)


def _link(item: Element) -> TreeLink:
    name = item.attribute("name")
    inertial = item.one("inertial")
    if inertial is None:
        return TreeLink(name, fail=item.fail)
    value = inertial.need("mass")
    mass = mass_of(value, value.attribute("value"), "value")
    x, y, z = origin_of(inertial)[:3, 3].tolist()
    return TreeLink(name, mass, (x, y, z), fail=item.fail)


def _joint(item: Element) -> TreeJoint:
    name, kind = item.attribute("name"), kind_of(item)
    axis = np.array([1.0, 0.0, 0.0])  # URDF's default
    given = item.one("axis")
    if given is not None:
        axis = np.array(given.numbers(given.attribute("xyz"), 3, "xyz"))
        length = float(np.linalg.norm(axis))
        if not 1e-6 < length < 1e6:
            if KINDS[kind] != "fixed":
                given.fail(f"xyz: found a vector of length {length:g}, expected a direction")
            axis, length = np.array([0.0, 0.0, 1.0]), 1.0
        axis = axis / length
    if KINDS[kind] == "fixed":
        axis = np.array([0.0, 0.0, 1.0])
    extension = item.one(EXTENSION)
    spring = extension is not None and SPRING in extension.attributes
    return TreeJoint(
        name=name,
        parent=item.need("parent").attribute("link"),
        child=item.need("child").attribute("link"),
        kind="fixed" if spring else KINDS[kind],
        placed=origin_of(item),
        axis=axis + 0.0,
        limits=_limits(item) if kind != "continuous" else None,
        speed=_speed(item),
        mimic=_mimic(item),
        stiffness=stiffness_of(item),
        spring=spring,
        fail=item.fail,
    )


def origin_of(item: Element) -> Array:
    """Return the pose that an element's `<origin>` says, (4, 4)."""
    origin = item.one("origin")
    if origin is None:
        return np.eye(4)
    rpy, xyz = (
        np.array(origin.numbers(origin.attributes.get(name, "0 0 0"), 3, name)) for name in ("rpy", "xyz")
    )
    return from_roll_pitch_yaw(rpy, xyz)


def _limits(item: Element) -> tuple[float, float] | None:
    limit = item.one("limit")
    if limit is None or item.attributes["type"] == "fixed":
        return None
    low, high = (limit.numbers(limit.attributes.get(name, "0"), 1, name)[0] for name in ("lower", "upper"))
    check_limits(limit, low, high)
    return low, high


def _speed(item: Element) -> float | None:
    limit = item.one("limit")
    if limit is None or item.attributes["type"] == "fixed":
        return None
    speed = limit.numbers(limit.attributes.get("velocity", "0"), 1, "velocity")[0]
    return speed if speed > 0 else None  # 0 stands where the author knew none


def _mimic(item: Element) -> Mimic | None:
    mimic = item.one("mimic")
    if mimic is None or item.attributes["type"] == "fixed":
        return None
    multiplier, offset = (
        mimic.numbers(mimic.attributes.get(name, default), 1, name)[0]
        for name, default in (("multiplier", "1"), ("offset", "0"))
    )
    return Mimic(mimic.attribute("joint"), multiplier, offset)


def extension_of(root: Element) -> tuple[Element | None, dict[str, Any]]:
    """Return the extension of the robot as a whole, and the keys of a robot file that it says."""
    extension = root.one(EXTENSION)
    if extension is None:
        return None, {}
    fragment: Any = {}
    if extension.text.strip():
        fragment, _ = parse_yaml(extension.text, f"{extension.source}:{extension.line}: <beamstiff>")
        if not isinstance(fragment, dict):
            extension.fail(f"found {shown(fragment)}, expected keys of a robot file")
    for name in UNSAID:
        if name in fragment:
            extension.fail(f"the key {name!r} does not belong here")
    for name, value in extension.attributes.items():
        if name != "tcp":
            extension.fail(f"unknown attribute {shown(name)}, expected tcp")
        fragment["tcp"] = value
    return extension, fragment


def disagreement(tree: Robot, robot: Robot) -> str:
    """Return what differs between frames of the same name, or nothing; loops are not closed here."""
    try:
        one, other = compile_frames(tree), compile_frames(robot)
    except BeamstiffError as error:
        return str(error)
    free = [*other.coupling.free]
    unknown = [name for name in one.coupling.free if name not in free]
    if unknown:
        return f"the joint {listed(unknown)} moves none of the frames"
    generator = np.random.default_rng(0)
    values = generator.uniform(-1.0, 1.0, (POSTURES, len(free)))
    same = values[:, [free.index(name) for name in one.coupling.free]]
    placed: list[Array] = [forward(one, all_values(one, same)), forward(other, all_values(other, values))]
    size = max(one.size, other.size, 1.0)
    inner = {joint.nodes[0] for joint in tree.joints}  # nodes that are no links; their frames are ours alone
    for name in dict.fromkeys(node.frame for node in tree.nodes if node.name not in inner):
        if name in other.frame_index:
            at = one.frame_index[name]
            gap = np.abs(placed[0][:, at] - placed[1][:, other.frame_index[name]]).max()
            if gap > SAME_PLACE * size:
                return f"the frame {name!r} stands {gap:.3g} (m or rad) beside the link of this name"
    return ""
