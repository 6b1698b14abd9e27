"""SDF in: links, joints, poses and inertials of one model, as far as they describe the machine.

Poses follow SDFormat: of a link in the model, of a joint in its child link, unless `relative_to` names a link
or joint; rotations are roll, pitch, yaw. `<include>`, nested models and poses in quaternions are refused.
Stiffness stands in a joint as in URDF: ``<beamstiff torsional="1e6 N*m/rad"/>``; a joint with a
``<spring_stiffness>`` is a spring in series, which no drive moves; one with stops is rigid here. The model
names its TCP: ``<beamstiff tcp="tool0"/>``.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from beamstiff.errors import listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.link_tree import (
    ALONG,
    KINDS,
    LinkTree,
    Mimic,
    TreeJoint,
    TreeLink,
    check_limits,
    kind_of,
    mass_of,
    springs_joined,
    stiffness_of,
    tree_robot,
)
from beamstiff.robot.placement import from_roll_pitch_yaw
from beamstiff.robot.urdf.reader import extension_of
from beamstiff.robot.xml_text import Element, parse_xml
from beamstiff.se3 import Array

UNLIMITED = 1e16  # limits of this size and more are SDF's way to say that there are none
ON_AXIS = 1e-12  # m
REFUSED = ("include", "model")


def read_sdf(path: str | os.PathLike[str], *, tcp: str | None = None) -> Robot:
    """Return the robot of an SDF file; `tcp` names a link, by default the only end of the tree."""
    return parse_sdf(read_text(os.fspath(path)), str(path), tcp=tcp)


def unread(text: str) -> list[str]:
    """Return what an SDF says of links for which a robot has no words."""
    counts = {name: len(re.findall(rf"<{name}\b", text)) for name in ("visual", "collision", "inertia")}
    return [f"not read: <{name}> ({count})" for name, count in counts.items() if count]


def parse_sdf(text: str, name: str = "<text>", *, tcp: str | None = None) -> Robot:
    """Return the robot of the only model of an SDF text; otherwise as `read_sdf`."""
    root = parse_xml(text, name)
    if root.name != "sdf":
        root.fail("expected <sdf> as the outermost element")
    worlds = root.all("world")
    model = (worlds[0] if worlds and not root.all("model") else root).need("model")
    for refused in REFUSED:
        for child in model.all(refused):
            child.fail("cannot be read here, expected links and joints of one model")
    extension, said = extension_of(model)
    if extension is not None and said.keys() - {"tcp", "gravity"}:
        extension.fail(f"found {listed(sorted(said))}, expected tcp and gravity alone")
    return tree_robot(springs_joined(_Poses.of(model).tree()), tcp, said)


@dataclass
class _Poses:
    """The poses of a model's links and joints, each followed to the model's frame."""

    model: Element
    elements: dict[str, Element]
    known: dict[str, Array]
    between: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, model: Element) -> Self:
        elements: dict[str, Element] = {}
        for item in (*model.all("link"), *model.all("joint"), *model.all("frame")):
            name = item.attribute("name")
            if name in elements:
                item.fail("found a second element of this name, expected one")
            elements[name] = item
        return cls(model, elements, {"__model__": np.eye(4), "world": np.eye(4)})

    def tree(self) -> LinkTree:
        """Return the links and joints."""
        links = [_link(item) for item in self.model.all("link")]
        joints = [joint for item in self.model.all("joint") for joint in self._joints(item)]
        if not joints:
            self.model.fail("found no joint, expected links and joints of a machine")
        if any(joint.parent == "world" for joint in joints):
            links.insert(0, TreeLink("world"))
        names = {link.name for link in links}
        links += [TreeLink(joint.child) for joint in joints if joint.child in self.between - names]
        return LinkTree(self.model.attribute("name"), tuple(links), tuple(joints), self.model.source)

    def at(self, name: str, asked: Element, chain: tuple[str, ...] = ()) -> Array:
        """Return the pose of a link, joint or frame in the model."""
        if name in self.known:
            return self.known[name]
        if name not in self.elements:
            asked.fail(f"there is no link or frame {shown(name)}{suggest(name, self.elements)}")
        if name in chain:
            asked.fail(f"poses follow one another in a circle: {' -> '.join([*chain[:8], name])}")
        item = self.elements[name]
        default = "__model__"
        if item.name == "joint":
            default = _text(item, "child")
        elif item.name == "frame":
            default = item.attributes.get("attached_to", default)
        pose, relative_to = _pose(item, default)
        self.known[name] = self.at(relative_to, item, (*chain, name)) @ pose
        return self.known[name]

    def _joints(self, item: Element) -> Iterator[TreeJoint]:
        name, kind = item.attribute("name"), kind_of(item)
        parent, child = _text(item, "parent"), _text(item, "child")
        joint = self.at(name, item)
        body = self.at(child, item)
        # where the axis does not run through the child's origin, a link in between has its frame on it
        apart = KINDS[kind] != "fixed" and np.abs((np.linalg.inv(body) @ joint)[:3, 3]).max() > ON_AXIS
        moved = joint if apart else body
        between = f"{name} axis" if apart else child
        self.between.update([between] if apart else [])
        axis, limits, speed, mimic, k = np.array([0.0, 0.0, 1.0]), None, None, None, 0.0
        if KINDS[kind] != "fixed":
            given = item.need("axis")
            direction = given.need("xyz")
            axis = np.array(direction.numbers(direction.text, 3, "xyz"))
            if not 1e-6 < np.linalg.norm(axis) < 1e6:
                direction.fail(f"found a vector of length {np.linalg.norm(axis):g}, expected a direction")
            expressed = direction.attributes.get("expressed_in", "")
            turn = self.at(expressed, direction)[:3, :3] if expressed else joint[:3, :3]
            axis = moved[:3, :3].T @ turn @ (axis / np.linalg.norm(axis))
            axis = np.where(np.abs(axis) < 1e-15, 0.0, axis)
            limits, speed, mimic, k = _limits(given), _speed(given), _mimic(given), _spring(given)
        yield TreeJoint(
            name=name,
            parent=parent,
            child=between,
            kind="fixed" if k else KINDS[kind],
            placed=np.linalg.inv(self.at(parent, item)) @ moved,
            axis=axis,
            limits=limits if kind != "continuous" else None,
            speed=speed,
            mimic=mimic,
            stiffness=stiffness_of(item) if not k else {} if limits else {ALONG[KINDS[kind]]: k},
            spring=bool(k and not limits),
            fail=item.fail,
        )
        if apart:
            yield TreeJoint(f"{name} to {child}", between, child, "fixed", np.linalg.inv(joint) @ body)


def _pose(item: Element, default: str) -> tuple[Array, str]:
    pose = item.one("pose")
    if pose is None:
        return np.eye(4), default
    if pose.attributes.get("rotation_format", "euler_rpy") != "euler_rpy":
        pose.fail("found a quaternion, expected x y z roll pitch yaw")
    values = np.array(pose.numbers(pose.text or "0 0 0 0 0 0", 6, "pose"))
    if pose.attributes.get("degrees") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return from_roll_pitch_yaw(values[3:], values[:3]), pose.attributes.get("relative_to") or default


def _text(item: Element, name: str) -> str:
    text = item.need(name).text.strip()
    if not text:
        item.fail(f"<{name}> is empty, expected the name of a link")
    return text


def _link(item: Element) -> TreeLink:
    inertial = item.one("inertial")
    mass = inertial.one("mass") if inertial is not None else None
    if inertial is None or mass is None:
        return TreeLink(item.attribute("name"), fail=item.fail)
    value = mass_of(mass, mass.text, "mass")
    x, y, z = _pose(inertial, "")[0][:3, 3].tolist()
    return TreeLink(item.attribute("name"), value, (x, y, z), fail=item.fail)


def _limits(axis: Element) -> tuple[float, float] | None:
    limit = axis.one("limit")
    if limit is None:
        return None
    ends: list[float] = []
    for name in ("lower", "upper"):
        item = limit.one(name)
        text = item.text.strip().lower() if item is not None else "inf"
        if item is None or text.lstrip("+-") in ("inf", "infinity"):
            return None
        ends.append(item.numbers(text, 1, name)[0])
    check_limits(limit, *ends)
    return (ends[0], ends[1]) if max(map(abs, ends)) < UNLIMITED else None


def _speed(axis: Element) -> float | None:
    limit = axis.one("limit")
    item = limit.one("velocity") if limit is not None else None
    speed = item.numbers(item.text.strip(), 1, "velocity")[0] if item is not None else 0.0
    return speed if 0.0 < speed < UNLIMITED else None


def _spring(axis: Element) -> float:
    dynamics = axis.one("dynamics")
    item = dynamics.one("spring_stiffness") if dynamics is not None else None
    return item.numbers(item.text, 1, "spring_stiffness")[0] if item is not None else 0.0


def _mimic(axis: Element) -> Mimic | None:
    mimic = axis.one("mimic")
    if mimic is None:
        return None
    values: dict[str, Any] = {}
    for name, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0)):
        item = mimic.one(name)
        values[name] = default if item is None else item.numbers(item.text, 1, name)[0]
    offset = values["offset"] - values["multiplier"] * values["reference"]
    return Mimic(mimic.attribute("joint"), values["multiplier"], offset)
