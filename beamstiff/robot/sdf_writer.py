"""A robot to SDF: one model of links and joints, with stiffness in `<beamstiff>` of its joints.

The links and joints are those of its URDF, or those that it would have. What SDF, as `sdf.py` reads it,
cannot say is left out, and told. The text is read back before it is handed out: its links stand where the
frames do.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.description import Robot
from beamstiff.robot.link_tree import (
    EXTENSION,
    LinkTree,
    TreeJoint,
    short_number,
    stiffness_attributes,
    variable_names,
)
from beamstiff.robot.parts import JointStiffness
from beamstiff.robot.placement import from_roll_pitch_yaw, roll_pitch_yaw
from beamstiff.robot.sdf import parse_sdf
from beamstiff.robot.urdf.export import numbers_text, urdf_skeleton
from beamstiff.robot.urdf.reader import disagreement, read_tree
from beamstiff.robot.urdf.writer import robot_to_urdf
from beamstiff.robot.xml_text import Element, parse_xml
from beamstiff.se3 import Array, transform

UNSAID = ("loops", "beams", "struts", "effects")  # what a tree of links has no words for
PREFIXED = f"{EXTENSION}:extension"  # what SDF's own parser lets pass; one without prefix Drake refuses
SDF_HEAD = f'<?xml version="1.0"?>\n<sdf version="1.11" xmlns:{EXTENSION}="{EXTENSION}">'
DRAWN = ("visual", "collision")
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Written:
    """An SDF text, and what of the robot it does not say."""

    text: str
    lost: tuple[str, ...]


def robot_to_sdf(robot: Robot) -> Written:
    """Return the SDF text of a robot, and what is lost in it."""
    root = parse_xml(urdf_skeleton(robot) if robot.urdf is None else robot_to_urdf(robot), "<urdf>")
    tree = read_tree(root)
    links = {item.attributes["name"]: item for item in root.all("link")}
    stiffness = _stiffness(robot, tree)
    ends = _tcp(robot, links)
    lines = [SDF_HEAD, f"  <model name={quoteattr(robot.name)}>"]
    carriers = {joint.child: joint for joint in tree.joints}
    for name, link in links.items():
        lines += _link(name, link, carriers.get(name))
    variables = variable_names(tree.joints)
    limits = {variable.name: variable.limits for variable in robot.variables}
    for joint in tree.joints:  # URDF asks for limits where there are none
        joint = replace(joint, limits=limits.get(variables.get(joint.name, "")))
        lines += _joint(joint, stiffness.get(joint.name, JointStiffness()))
    for frame, at in ends:
        lines += _end(robot.tcp, frame, at)
    known = robot.tcp if ends or robot.tcp in links else tree.joints[-1].child if tree.joints else ""
    text = "\n".join([*lines, f"    {extension(known, robot.gravity, PREFIXED)}", "  </model>", "</sdf>", ""])
    again = parse_sdf(text, "<sdf>")
    if far := disagreement(again, robot):
        raise BeamstiffError(f"robot {robot.name!r} cannot be written as SDF: {far}")
    return Written(text, tuple(_lost(robot, again, root, stiffness)))


def extension(tcp: str, gravity: tuple[float, float, float], name: str) -> str:
    """Return the element of ours that says what is the TCP, and gravity where it is not as usual."""
    usual = gravity == Robot.model_fields["gravity"].default
    said = "" if usual else f"gravity: [{', '.join(map(short_number, gravity))}]"
    return f"<{name} tcp={quoteattr(tcp)}>{said}</{name}>" if tcp else ""


def _stiffness(robot: Robot, tree: LinkTree) -> dict[str, JointStiffness]:
    """Return the stiffness of joints of the tree: their own, or of the only joint of the same variable."""
    variables = variable_names(tree.joints)
    found: dict[str, JointStiffness] = {}
    for joint in tree.joints:
        own = [item for item in robot.joints if item.name == joint.name]
        same = [item for item in robot.joints if item.variable == variables.get(joint.name, "")]
        if len(chosen := own or same) == 1:
            found[joint.name] = chosen[0].stiffness
    return found


def _tcp(robot: Robot, links: Mapping[str, Element]) -> list[tuple[str, Array]]:
    """Return the link that carries the TCP and where, if the TCP is no link itself."""
    if robot.tcp in links:
        return []
    node = next(node for node in robot.nodes if node.name == robot.tcp)
    return [(node.frame, np.array(node.at))] if node.frame in links else []


def _pose(placed: Array, relative_to: str = "") -> str:
    about = f" relative_to={quoteattr(relative_to)}" if relative_to else ""
    values = np.concatenate([placed[:3, 3], roll_pitch_yaw(placed[:3, :3])])
    return f"<pose{about}>{numbers_text(values)}</pose>"


def _link(name: str, link: Element, carrier: TreeJoint | None) -> list[str]:
    inside = [] if carrier is None else [f"      {_pose(np.eye(4), carrier.name)}"]
    inertial = link.one("inertial")
    if inertial is not None:
        origin = inertial.one("origin")
        said = {} if origin is None else origin.attributes
        xyz, rpy = (np.array([float(v) for v in said.get(key, "0 0 0").split()]) for key in ("xyz", "rpy"))
        inside += ["      <inertial>", f"        {_pose(from_roll_pitch_yaw(rpy, xyz))}"]
        inside.append(f"        <mass>{escape(inertial.need('mass').attribute('value'))}</mass>")
        inertia = inertial.one("inertia")
        if inertia is not None:
            moments = (f"<{key}>{escape(inertia.attributes.get(key, '0'))}</{key}>" for key in INERTIA)
            inside.append(f"        <inertia>{''.join(moments)}</inertia>")
        inside.append("      </inertial>")
    if not inside:
        return [f"    <link name={quoteattr(name)}/>"]
    return [f"    <link name={quoteattr(name)}>", *inside, "    </link>"]


def _joint(joint: TreeJoint, stiffness: JointStiffness) -> list[str]:
    kind = "continuous" if joint.kind == "revolute" and joint.limits is None else joint.kind
    lines = [
        f"    <joint name={quoteattr(joint.name)} type={quoteattr(kind)}>",
        f"      <parent>{escape(joint.parent)}</parent>",
        f"      <child>{escape(joint.child)}</child>",
        f"      {_pose(joint.placed, joint.parent)}",
    ]
    if joint.kind != "fixed":
        lines += ["      <axis>", f"        <xyz>{numbers_text(joint.axis)}</xyz>"]
        ends = dict(zip(("lower", "upper"), joint.limits or (), strict=False))
        told = ends | ({"velocity": joint.speed} if joint.speed else {})
        if told:
            inside = "".join(f"<{key}>{short_number(value)}</{key}>" for key, value in told.items())
            lines.append(f"        <limit>{inside}</limit>")
        if joint.mimic is not None:
            factor, offset = map(short_number, (joint.mimic.multiplier, joint.mimic.offset))
            lines.append(
                f"        <mimic joint={quoteattr(joint.mimic.joint)}><multiplier>{factor}</multiplier>"
                f"<offset>{offset}</offset></mimic>"
            )
        lines.append("      </axis>")
    if said := stiffness_attributes(stiffness):
        lines.append(f"      <{PREFIXED} {said}/>")
    return [*lines, "    </joint>"]


def _end(name: str, frame: str, at: Array) -> list[str]:
    """Return a link at the TCP, fixed to the link of its frame."""
    joint = f"{frame} to {name}"
    return [
        f"    <link name={quoteattr(name)}>{_pose(np.eye(4), joint)}</link>",
        f'    <joint name={quoteattr(joint)} type="fixed"><parent>{escape(frame)}</parent>'
        f"<child>{escape(name)}</child>{_pose(transform(np.eye(3), at), frame)}</joint>",
    ]


def _lost(
    robot: Robot, again: Robot, root: Element, stiffness: Mapping[str, JointStiffness]
) -> Iterator[str]:
    for key in UNSAID:
        if count := len(getattr(robot, key)):
            yield f"{key} ({count}) are not written: SDF holds links and joints"
    if robot.model is not None:
        yield f"the model ({robot.model.kind}) is not written: SDF holds links and joints"
    if robot.loops:
        yield "the passive joints of the loops look free to other readers"
    written = {id(value) for value in stiffness.values()}
    rest = [
        item.name
        for item in robot.joints
        if id(item.stiffness) not in written and item.stiffness != JointStiffness()
    ]
    if rest:
        yield f"the stiffness of {listed(rest, 12)} is not written: no joint of the SDF moves there"
    if again.tcp != robot.tcp:
        yield f"the TCP {robot.tcp!r} is no link of the SDF"
    heavy, left = (sum(item.mass for item in one.masses) for one in (robot, again))
    if abs(heavy - left) > 1e-9 * max(heavy, 1.0):
        yield f"masses: {left:g} of {heavy:g} kg are written"
    if any(item.all(name) for item in root.all("link") for name in DRAWN):
        yield "meshes and other shapes of the URDF are not written"
