"""A robot's compliance written into an MJCF file: springs beside its joints, no other byte changed.

Joints of the file that carry the names of the robot's drives say where a part of the machine is; MuJoCo's
parser (optional extra `mujoco`) says how its bodies lie. A spring goes behind the drive before it; those of
the base go into the body that stands on the world and carries the first drive; what is compliant at the tool
gets a body of its own around the TCP's site.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.description import Robot
from beamstiff.robot.urdf.export import LEAST_MASS
from beamstiff.robot.xml_text import Edit, Element, apply_edits, parse_xml, set_attribute
from beamstiff.se3 import Array, transform
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.bodies import BodyJoint, BodyTree, placed_bodies
from beamstiff.simulators.mjcf_writer import SETTLE, joint_text
from beamstiff.simulators.statics import engine

SAME = 1e-9  # of a stiffness: not worth an edit
LEAST_INERTIAL = '<inertial pos="0 0 0" mass="{0}" diaginertia="{0} {0} {0}"/>'.format(repr(LEAST_MASS))


def mjcf_like(robot: Robot, text: str, file: str) -> tuple[str, tuple[str, ...]]:
    """Return an MJCF text with the compliance of a robot in it, and what of the robot it does not say.

    `file`: the path of the text, from which MuJoCo finds meshes and included files.
    """
    root = parse_xml(text, file)
    elements = {item.attributes["name"]: item for item in _all(root, "joint") if "name" in item.attributes}
    for item in [*elements.values()]:  # variables have letters, digits and _ alone
        elements.setdefault(re.sub(r"[^A-Za-z0-9_]", "_", item.attributes["name"]), item)
    tree = assemble(robot)
    lost = [*tree.lost]
    if tree.closures or tree.tendons:
        lost.append("struts, balancers and elements that close loops: the file keeps those that it has")
    (model, poses), ours = _placed(file), placed_bodies(tree.bodies, {})
    known_springs = _springs(model)
    for name, (own, _) in known_springs.items():
        if own in elements:
            elements.setdefault(name, elements[own])
    tree = _without(tree, known_springs)
    data, edits = text.encode("utf-8"), list[Edit]()
    added: dict[tuple[int, str], list[str]] = {}  # of a place in the text, and what stands around a line
    for name, before, number, springs in _groups(tree, elements):
        body = next(item for item in _all(root, "body") if elements[name] in item.children)
        standing = next(item for item in _all(root, "body") if item.start <= body.start < item.end)
        anchor = elements[name]
        indent = _indent(data, anchor.start)
        place = (anchor.start, f"{{}}\n{indent}") if before else (anchor.end, f"\n{indent}{{}}")
        at = int(model.joint(anchor.attributes["name"]).bodyid[0])
        stands_on = int(model.body_rootid[at])
        if before and standing is not body:
            at, place = stands_on, (standing.inside, f"\n{_indent(data, standing.start)}  {{}}")
            if not model.body_mass[at] > 0.0 and not standing.all(
                "inertial"
            ):  # what moves must weigh something
                added.setdefault(place, [LEAST_INERTIAL])
        there = np.linalg.inv(poses[at]) @ ours[number]
        for spring in springs:
            if (known := elements.get(spring.name)) is not None:
                edits.append(_restiffened(data, known, spring))
                continue
            at_home, axis = there[:3, :3] @ spring.at + there[:3, 3], there[:3, :3] @ spring.axis
            moved = replace(spring, at=at_home, axis=axis, rest=0.0)  # the balancer's tendon is not written
            added.setdefault(place, []).append(joint_text(moved, SETTLE, 0.0))
    edits += [
        Edit(at, at, "".join(around.format(line) for line in lines)) for (at, around), lines in added.items()
    ]
    edits += _at_tool(robot, tree, root, data, elements, lost)
    result = apply_edits(data, edits) if edits else text
    return result, tuple(lost)


def _springs(model: Any) -> dict[str, tuple[str, float]]:
    """Return the file's own springs by the names that a robot read from it gives them: name and stiffness."""
    found: dict[str, tuple[str, float]] = {}
    for at in np.flatnonzero((model.jnt_type >= 2) & (model.jnt_stiffness > 0.0)):
        name = model.joint(at).name
        own, direction = name or f"joint_{at}", "axial" if model.jnt_type[at] == 2 else "torsional"
        for called in (own, f"{own}.{direction}"):
            found[called] = name, float(model.jnt_stiffness[at])
    return found


def _without(tree: BodyTree, springs: dict[str, tuple[str, float]]) -> BodyTree:
    """Return a machine without the springs that the file has as they are."""

    def stands(joint: BodyJoint) -> bool:
        known = springs.get(joint.name, ("", np.inf))[1]
        return joint.role == "spring" and abs(known - joint.stiffness) <= SAME * joint.stiffness

    bodies = [
        replace(body, joints=[joint for joint in body.joints if not stands(joint)]) for body in tree.bodies
    ]
    return replace(tree, bodies=tuple(bodies))


def _groups(tree: BodyTree, elements: dict[str, Element]) -> Iterator[tuple[str, bool, int, list[BodyJoint]]]:
    """Yield springs: the joint beside which they go, whether before it, the body they are given in."""
    drives = [joint.name for body in tree.bodies for joint in body.joints if joint.role == "drive"]
    anchors: dict[int, str] = {}
    for number, body in enumerate(tree.bodies):
        own = [joint.name for joint in body.joints if joint.role in ("drive", "passive")]
        anchors[number] = own[-1] if own else anchors.get(body.parent, "")
        springs = [joint for joint in body.joints if joint.role == "spring"]
        if not springs or body.name == "tool-compliance":
            continue
        name = anchors[number] or next(iter(drives), "")  # the base: before the first drive
        if name not in elements:
            raise BeamstiffError(
                f"the file has no joint {name!r}, behind which {springs[0].name} goes: expected joints "
                f"named as the robot's variables, found {listed(elements, 12) or 'none'}"
            )
        yield name, not anchors[number], number, springs


def _all(root: Element, name: str) -> Iterator[Element]:
    for child in root.children:
        if child.name == name:
            yield child
        if child.name not in ("default", "equality", "actuator", "sensor", "tendon"):
            yield from _all(child, name)


def _placed(file: str) -> tuple[Any, list[Array]]:
    """Return MuJoCo's model of a file, and where its bodies are with all joints at 0, (4, 4)."""
    mujoco = engine()
    model = mujoco.MjModel.from_xml_path(file)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    for joint in np.flatnonzero(model.jnt_type < 2):  # free and ball joints stay
        at = int(model.jnt_qposadr[joint])
        width = 7 if model.jnt_type[joint] == 0 else 4
        data.qpos[at : at + width] = model.qpos0[at : at + width]
    mujoco.mj_kinematics(model, data)
    turned = data.xmat.reshape(-1, 3, 3)
    return model, [transform(*placed) for placed in zip(turned, data.xpos, strict=True)]


def _restiffened(data: bytes, element: Element, spring: BodyJoint) -> Edit:
    """Return the edit that gives a joint of the file another stiffness."""
    return set_attribute(data, element, "stiffness", repr(float(spring.stiffness)))


def _at_tool(
    robot: Robot, tree: BodyTree, root: Element, data: bytes, elements: dict[str, Element], lost: list[str]
) -> Iterator[Edit]:
    """Yield the edit that puts the TCP's site into a body behind the springs of the tool."""
    tools = [(number, body) for number, body in enumerate(tree.bodies) if body.name == "tool-compliance"]
    sites = [item for item in _all(root, "site") if item.attributes.get("name") == robot.tcp]
    for number, body in tools:
        if all(joint.name in elements for joint in body.joints):
            yield from (_restiffened(data, elements[joint.name], joint) for joint in body.joints)
            continue
        holder = [item for item in _all(root, "body") if sites and sites[0] in item.children]
        if not holder:
            lost.append(f"tool-compliance: the file has no site {robot.tcp!r}, around which it goes")
            continue
        model, poses = _placed(root.source)
        ours = placed_bodies(tree.bodies, {})[number]
        there = np.linalg.inv(poses[int(model.site(robot.tcp).bodyid[0])]) @ ours
        (site,) = sites
        indent = _indent(data, site.start)
        lines = [f'<body name="{body.name}">', f"  {LEAST_INERTIAL}"]
        for joint in body.joints:
            at, axis = there[:3, :3] @ joint.at + there[:3, 3], there[:3, :3] @ joint.axis
            lines.append(f"  {joint_text(replace(joint, at=at, axis=axis), SETTLE, 0.0)}")
        lines += [f"  {data[site.start : site.end].decode()}", "</body>"]
        yield Edit(site.start, site.end, f"\n{indent}".join(lines))


def _indent(data: bytes, at: int) -> str:
    line = data[data.rfind(b"\n", 0, at) + 1 : at].decode()
    return "".join(itertools.takewhile(str.isspace, line))
