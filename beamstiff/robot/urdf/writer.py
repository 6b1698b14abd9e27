"""A robot to URDF: into the text it was read from, so that whatever that says besides stays byte for byte.

What changed is put where it stood (origins, axes, limits, masses), stiffness into `<beamstiff>` of its joint,
and what URDF cannot say into `<beamstiff>` of the robot. The text is read back before it is handed out.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.coupling import coupling, frame_expressions, variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import parse_expression
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import compile_frames
from beamstiff.robot.link_tree import (
    EXTENSION,
    LinkTree,
    TreeJoint,
    robot_data,
    short_number,
    stiffness_attributes,
    variable_names,
)
from beamstiff.robot.parts import JointStiffness
from beamstiff.robot.placement import roll_pitch_yaw
from beamstiff.robot.urdf.export import numbers_text, urdf_skeleton
from beamstiff.robot.urdf.reader import parse_urdf, read_tree
from beamstiff.robot.writer import fragment_to_yaml
from beamstiff.robot.xml_text import Edit, Element, add_child, apply_edits, parse_xml, remove, set_attribute
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.units import NUMBER

SAME = 1e-12  # m, rad, or relative: nearer, the number in the file stays as it is written
_NUMBER = re.compile(f"({NUMBER})")


def robot_to_urdf(robot: Robot, like: str | None = None) -> str:
    """Return the URDF text of a robot; `parse_urdf` makes the same robot of it.

    It is written into the URDF text `like`, by default the one that it was read from. A robot that never was
    a URDF gets links and joints of its frames: loops are then cut, and only the extension knows them.
    """
    text = like if like is not None else robot.urdf
    text = _written_into(urdf_skeleton(robot) if text is None else text, robot)
    left = differences(robot, parse_urdf(text, "<urdf>"))
    if left:  # what a person may have added to the text by hand
        raise BeamstiffError(f"robot {robot.name!r} cannot be written as this URDF: {left[0]} would change")
    return text


def urdf_with_held(text: str, held: Mapping[str, TreeJoint]) -> str:
    """Return a URDF text in which joints are fixed, each where it is held (`pruning.pruned`)."""
    root = parse_xml(text, "<urdf>")
    edits = _Edits(text.encode("utf-8"), root)
    placed = {joint.name: joint.placed for joint in read_tree(root).joints}
    for item in root.all("joint"):
        name = item.attributes["name"]
        if name in held:
            edits.attribute(item, "type", "fixed")
            for mimic in item.all("mimic"):
                edits.remove(mimic)
            _write_origin(edits, item, placed[name], held[name].placed)
    return edits.made()


def differences(one: Robot, other: Robot) -> list[str]:
    """Return the keys in which two robots differ, numbers by more than 1e-12; not their URDF texts."""
    a, b = one.model_dump(exclude={"urdf"}), other.model_dump(exclude={"urdf"})
    return [key for key in a if not _alike(a[key], b[key])]


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_alike, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=SAME, abs_tol=SAME)
    if isinstance(a, str) and isinstance(b, str) and a != b:
        one, other = _NUMBER.split(a), _NUMBER.split(b)
        return one[::2] == other[::2] and all(map(_alike, map(float, one[1::2]), map(float, other[1::2])))
    return bool(a == b)


def _written_into(text: str, robot: Robot) -> str:
    """Return the text with the robot's values, the extension only where it says something."""
    data = text.encode("utf-8")
    root = parse_xml(text, "<urdf>")
    edits = _Edits(data, root)
    if robot.name != root.attributes.get("name"):
        edits.attribute(root, "name", robot.name)
    tree = read_tree(root)
    own = coupling(robot).free
    if unknown := [name for name in coupling(Robot(**_told(tree))).free if name not in own]:
        raise BeamstiffError(
            f"robot {robot.name!r} has no joint variable {listed(unknown)}: the URDF that it is to be "
            "written into is of another machine, expected the one that it was read from"
        )
    elements = {item.attributes["name"]: item for item in root.all("joint")}
    for joint in tree.joints:
        _write_stiffness(edits, elements[joint.name], joint, robot)
    _write_places(edits, robot, tree, elements)
    _write_mimics(edits, robot, tree, elements)
    _write_limits(edits, robot, tree, elements)
    _write_masses(edits, robot, root)
    changed = edits.made()
    try:
        if not differences(robot, parse_urdf(changed, "<urdf>")):
            return changed
    except BeamstiffError:  # no TCP yet, or an extension that is older than what was changed
        pass
    return _with_extension(changed, robot)


def _with_extension(text: str, robot: Robot) -> str:
    """Return the text with one extension of the robot as a whole: the keys that the tree does not tell."""
    data = text.encode("utf-8")
    root = parse_xml(text, "<urdf>")
    edits = _Edits(data, root)
    for old in root.all(EXTENSION):
        edits.remove(old)
    tree = read_tree(root)
    keys = _untold(tree, robot)
    if "joints" in keys:
        for item in root.all("joint"):
            for old in item.all(EXTENSION):
                edits.remove(old)
        rigid = tuple(replace(joint, stiffness={}) for joint in tree.joints)
        keys = _untold(replace(tree, joints=rigid), robot)  # what those elements told is told no more
    attribute = f" tcp={quoteattr(robot.tcp)}" if _needs_other_tcp(tree, robot) else ""
    if keys:
        body = fragment_to_yaml(robot, keys).replace("]]>", "]]]]><![CDATA[>")
        edits.child(root, f"<{EXTENSION}{attribute}><![CDATA[\n{body}]]></{EXTENSION}>")
    elif attribute:
        edits.child(root, f"<{EXTENSION}{attribute}/>")
    return edits.made()


def _untold(tree: LinkTree, robot: Robot) -> list[str]:
    """Return the keys of a robot that its tree does not tell."""
    return [key for key in differences(robot, Robot(**_told(tree))) if key not in ("name", "tcp")]


def _told(tree: LinkTree) -> dict[str, Any]:
    """Return what a tree tells of a robot, whichever link is the TCP."""
    return robot_data(tree, tcp=tree.links[0].name)


def _needs_other_tcp(tree: LinkTree, robot: Robot) -> bool:
    try:
        return bool(robot_data(tree)["tcp"] != robot.tcp)
    except BeamstiffError:
        return True


class _Edits:
    """Edits of a text, the children that an element gets together."""

    def __init__(self, text: bytes, root: Element) -> None:
        self.text = text
        self.root = root
        self.edits: list[Edit] = []
        self.children: dict[int, tuple[Element, list[str]]] = {}

    def attribute(self, element: Element, name: str, value: str) -> None:
        self.edits.append(set_attribute(self.text, element, name, value))

    def remove(self, element: Element) -> None:
        self.edits.append(remove(self.text, element))

    def child(self, element: Element, child: str) -> None:
        self.children.setdefault(element.start, (element, []))[1].append(child)

    def child_attribute(self, element: Element, child: str, name: str, value: str) -> None:
        """Set an attribute of a child, which is made where there is none."""
        found = element.one(child)
        if found is None:
            self.child(element, f"<{child} {name}={quoteattr(value)}/>")
        else:
            self.attribute(found, name, value)

    def made(self) -> str:
        new = [
            edit
            for element, children in self.children.values()
            for edit in add_child(self.text, element, "\n".join(children))
        ]
        return apply_edits(self.text, [*self.edits, *new])


def _write_places(edits: _Edits, robot: Robot, tree: LinkTree, elements: Mapping[str, Element]) -> None:
    """Write origins and axes that changed, of joints that the robot's frames have as they are."""
    kinematics = compile_frames(robot)
    own = variable_names(tree.joints)
    frames = {node["name"]: node.get("frame", "base") for node in _told(tree)["nodes"]}
    joints = [
        joint
        for joint in tree.joints
        if _moved_by(robot, frames[joint.parent], frames[joint.child])
        == ({own[joint.name]} if joint.name in own else set())
    ]
    values = np.zeros((1 + len(joints), len(kinematics.coupling.names)))  # at 0, then one joint at 1 each
    for row, joint in enumerate(joints, start=1):
        if joint.name in own:
            values[row, kinematics.coupling.names.index(own[joint.name])] = 1.0
    placed = forward(kinematics, values)
    for row, joint in enumerate(joints, start=1):
        parent, child = (kinematics.frame_index[frames[name]] for name in (joint.parent, joint.child))
        rest, moved = np.linalg.inv(placed[[0, row], parent]) @ placed[[0, row], child]
        element = elements[joint.name]
        axis = joint.axis
        if joint.kind != "fixed":
            motion = np.linalg.inv(rest) @ moved
            if joint.kind == "prismatic":
                axis = motion[:3, 3]
            else:
                axis = vector_from_rotation(motion[:3, :3])
                rest = _onto_axis(edits, element, joint, rest, motion, tree)
        _write_origin(edits, element, joint.placed, rest)
        if np.abs(axis - joint.axis).max() > 10 * SAME:
            edits.child_attribute(element, "axis", "xyz", numbers_text(axis))


def _write_origin(edits: _Edits, element: Element, before: Array, placed: Array) -> None:
    """Write where a joint is at 0, (4, 4), where that changed."""
    size = max(1.0, float(np.abs(before[:3, 3]).max()))
    if np.abs(placed[:3, 3] - before[:3, 3]).max() > SAME * size:
        edits.child_attribute(element, "origin", "xyz", numbers_text(placed[:3, 3]))
    if np.abs(placed[:3, :3] - before[:3, :3]).max() > SAME:
        edits.child_attribute(element, "origin", "rpy", numbers_text(roll_pitch_yaw(placed[:3, :3])))


def _onto_axis(
    edits: _Edits, element: Element, joint: TreeJoint, rest: Array, motion: Array, tree: LinkTree
) -> Array:
    """Return where the joint is at 0: a link in between where the axis misses the child's origin.

    A turn by R about an axis through c moves the origin by ``(1 - R) c``.
    """
    point: Array = np.asarray(np.linalg.lstsq(np.eye(3) - motion[:3, :3], motion[:3, 3])[0], dtype=np.float64)
    if np.abs(point).max() <= 10 * SAME:
        return rest
    between = f"{joint.child}_on_axis"
    while between in {link.name for link in tree.links}:
        between += "_"
    edits.attribute(element.need("child"), "link", between)
    edits.child(edits.root, f"<link name={quoteattr(between)}/>")
    edits.child(
        edits.root,
        f'<joint name={quoteattr(f"{between}_to_{joint.child}")} type="fixed"><parent '
        f"link={quoteattr(between)}/><child link={quoteattr(joint.child)}/>"
        f'<origin xyz="{numbers_text(-point)}"/></joint>',
    )
    shift = np.eye(4)
    shift[:3, 3] = point
    return rest @ shift


def _moved_by(robot: Robot, parent: str, child: str) -> set[str] | None:
    """Return the variables in the frames from a parent's to a child's, or None where there is no such way."""
    frames = {frame.name: frame for frame in robot.frames}
    expressions = frame_expressions(robot)
    used: set[str] = set()
    while child != parent:
        if child not in frames:
            return None
        used.update(name for item in expressions[child].values() for name in item.coefficients)
        child = frames[child].parent
    return used


def _write_mimics(edits: _Edits, robot: Robot, tree: LinkTree, elements: Mapping[str, Element]) -> None:
    """Write how joints follow others, where that changed: the leader's zero may be elsewhere."""
    names, kinds = variable_names(tree.joints), variable_kinds(robot)
    equals = {variable.name: variable.equals for variable in robot.variables}
    for joint in tree.joints:
        told = equals.get(names.get(joint.name, ""))
        if joint.mimic is None or told is None:
            continue
        leader = names[joint.mimic.joint]
        exact = parse_expression(told, kinds[names[joint.name]], kinds)
        if exact.coefficients.keys() != {leader}:
            continue  # the extension tells it
        element, old = elements[joint.name].need("mimic"), (joint.mimic.multiplier, joint.mimic.offset)
        new = (exact.coefficients[leader], exact.constant)
        for name, before, value in zip(("multiplier", "offset"), old, new, strict=True):
            if not _alike(before, value):
                edits.attribute(element, name, short_number(value))


def _write_limits(edits: _Edits, robot: Robot, tree: LinkTree, elements: Mapping[str, Element]) -> None:
    limits = {variable.name: variable.limits for variable in robot.variables}
    names = variable_names(tree.joints)
    for joint in tree.joints:
        new = limits.get(names.get(joint.name, ""))
        if joint.limits is not None and new is not None and elements[joint.name].one("limit") is not None:
            for name, old, value in zip(("lower", "upper"), joint.limits, new, strict=True):
                if not _alike(old, value):
                    edits.child_attribute(elements[joint.name], "limit", name, short_number(value))


def _write_masses(edits: _Edits, robot: Robot, root: Element) -> None:
    """Write the mass of a link that has one in both; all others are left to the extension."""
    for item in root.all("link"):
        inertial = item.one("inertial")
        found = [mass for mass in robot.masses if mass.node == item.attributes["name"]]
        if inertial is None or len(found) != 1:
            continue
        value = inertial.need("mass")
        if not _alike(float(value.attributes["value"]), found[0].mass):
            edits.attribute(value, "value", repr(found[0].mass))
        origin = inertial.one("origin")
        place = "0 0 0" if origin is None else origin.attributes.get("xyz", "0 0 0")
        if not _alike(tuple(map(float, place.split())), found[0].at):
            edits.child_attribute(inertial, "origin", "xyz", numbers_text(np.array(found[0].at)))


def _write_stiffness(edits: _Edits, element: Element, joint: TreeJoint, robot: Robot) -> None:
    new = next((item.stiffness for item in robot.joints if item.name == joint.name), JointStiffness())
    try:
        old = JointStiffness(**joint.stiffness)
    except BeamstiffError as error:
        joint.fail(str(error))
    if old == new:
        return
    for extension in element.all(EXTENSION):
        edits.remove(extension)
    if said := stiffness_attributes(new):
        edits.child(element, f"<{EXTENSION} {said}/>")
