"""Links and joints, as URDF, SDF and tables of frames give them, to a robot: frames, nodes, rigids, joints.

Every link has a frame and a node of its name. A joint that moves is an elastic joint, rigid until it is given
a stiffness, between a node of its own name (on the side of the parent) and the child's; both stand at the
child's origin, where the axis is. What joins two of them within a link is a rigid of the link's name.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NoReturn

import networkx as nx
import numpy as np

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.robot.checks import TABLE_COLUMNS
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import DescriptionError, path_text, stiffness_text
from beamstiff.robot.parts import STIFFNESS_KINDS, JointStiffness
from beamstiff.robot.placement import frame_parameters, turned_to
from beamstiff.robot.xml_text import Element
from beamstiff.se3 import Array, transform

Kind = Literal["fixed", "revolute", "prismatic"]
EXTENSION = "beamstiff"  # the element of ours, which other readers pass over
KINDS: dict[str, Kind] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}
ALONG = {"revolute": "torsional", "prismatic": "axial"}
SPRING = "spring"  # attribute: stiffness of a joint that is a spring in series, no drive
SAME_AXIS = 1e-9
WEIGHTLESS = 1e-6  # kg: masses below only keep simulators from refusing a link


def _raise(message: str) -> NoReturn:
    raise BeamstiffError(message)


@dataclass(frozen=True)
class TreeLink:
    """A body."""

    name: str
    mass: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (3,), m: centre of mass in the link's frame
    # raises an error at the link's place in its file
    fail: Callable[[str], NoReturn] = field(default=_raise, compare=False)


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: ``multiplier * joint + offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint of a link with its parent."""

    name: str
    parent: str
    child: str
    kind: Kind
    placed: Array  # (4, 4): child's frame in the parent's, the joint at 0
    # (3,): direction of the axis, in the child's frame
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    limits: tuple[float, float] | None = None
    speed: float | None = None
    mimic: Mimic | None = None
    # as in a robot file: ``{"torsional": "1e6 N*m/rad"}``
    stiffness: Mapping[str, Any] = field(default_factory=dict)
    variable: str = ""  # what the joint's variable is called; by default after the joint
    spring: bool = False  # a joint of a simulator's file that its spring holds and no drive
    fail: Callable[[str], NoReturn] = _raise  # raises an error at the joint's place in its file


@dataclass(frozen=True)
class LinkTree:
    """Links and joints of a file."""

    name: str
    links: tuple[TreeLink, ...]
    joints: tuple[TreeJoint, ...]
    source: str


def robot_data(tree: LinkTree, tcp: str | None = None) -> dict[str, Any]:
    """Return keyword arguments of `Robot` for links and joints; the TCP is by default the only end."""
    root, joints = _ordered(tree)
    variables = variable_names(joints)
    nodes: list[dict[str, Any]] = [{"name": root.name}]
    frames: list[dict[str, Any]] = []
    rigids: list[dict[str, Any]] = []
    elastic: list[dict[str, Any]] = []
    names = {link.name for link in tree.links}
    frame_of = {root.name: "base"}
    taken_nodes, taken_frames, taken_elements = set(names), {*names, "base"}, {joint.name for joint in joints}
    children = [joint.parent for joint in joints]
    for joint in joints:
        own = joint.child if joint.child != "base" else _free("base link", taken_frames)
        frame_of[joint.child] = own
        made = [*_frames(joint, frame_of[joint.parent], own, variables.get(joint.name), taken_frames)]
        frames += made
        # the frame that the joint turns or slides: its z axis is the joint's
        turned = joint.kind != "fixed" and bool(np.any(joint.axis[:2]))
        held, axis = (made[-2]["name"], [0.0, 0.0, 1.0]) if turned else (own, joint.axis.tolist())
        nodes.append({"name": joint.child, "frame": own})
        start, end = joint.parent, joint.child
        if joint.kind != "fixed" or joint.stiffness:
            end = _free(joint.name, taken_nodes, " joint")
            nodes.append({"name": end, "frame": held})
            spring = {
                "name": joint.name,
                "nodes": [end, joint.child],
                "frame": held,
                "axis": axis,
                "stiffness": dict(joint.stiffness),
            }
            elastic.append(spring | ({"variable": variables[joint.name]} if joint.name in variables else {}))
        alone = children.count(joint.parent) == 1
        link = joint.parent if alone else f"{joint.parent} to {joint.child}"
        rigids.append({"name": _free(link, taken_elements, " link"), "nodes": [start, end]})
    data: dict[str, Any] = {
        "name": tree.name,
        "variables": [_variable(joint, variables, joints) for joint in joints if joint.kind != "fixed"],
        "frames": frames,
        "nodes": nodes,
        "rigids": rigids,
        "joints": elastic,
        "masses": [
            {"node": link.name, "mass": link.mass, "at": list(link.centre)}
            for link in tree.links
            if link.mass > WEIGHTLESS
        ],
        "fixed": [root.name],
        "tcp": _tcp(tree, root.name, joints, tcp),
        "identify": [
            f"{joint.name}.{kind}"
            for joint in joints
            for kind, value in joint.stiffness.items()
            if value not in ("rigid", "free")
        ],
    }
    return {key: value for key, value in data.items() if value}


def springs_joined(tree: LinkTree) -> LinkTree:
    """Return a tree in which a spring about the axis of the joint before it is that joint's stiffness."""
    joints, dropped = list(tree.joints), set[str]()
    leaving = Counter(joint.parent for joint in joints)
    heavy = {link.name for link in tree.links if link.mass > WEIGHTLESS}
    for spring in (joint for joint in tree.joints if joint.spring):
        before = next((joint for joint in joints if joint.child == spring.parent), None)
        if before is None or before.kind == "fixed" or before.stiffness:
            continue
        ((direction, value),) = spring.stiffness.items()
        turn, step = spring.placed[:3, :3], spring.placed[:3, 3]
        apart = np.linalg.norm(np.cross(before.axis, turn @ spring.axis))
        if before.kind == "revolute":
            apart += np.linalg.norm(np.cross(before.axis, step))
        name = spring.name.removesuffix(f".{direction}")
        # a node that every joint has before its spring (`robot_data`), from a robot that was written
        beside = [joint for joint in joints if joint.parent == spring.parent and joint is not spring]
        own = all(joint.child == f"{name} joint" and not leaving[joint.child] for joint in beside)
        alone = own and not heavy & {spring.parent, *(joint.child for joint in beside)}
        if alone and ALONG[before.kind] == direction and apart < SAME_AXIS:
            joints[joints.index(before)] = replace(
                before,
                name=name,
                child=spring.child,
                placed=before.placed @ spring.placed,
                axis=turn.T @ before.axis,
                variable=before.variable or before.name,
                stiffness={direction: value},
            )
            dropped |= {spring.parent, *(joint.child for joint in beside)}
            joints = [joint for joint in joints if joint is not spring and joint not in beside]
    links = tuple(link for link in tree.links if link.name not in dropped)
    return replace(tree, links=links, joints=tuple(joints))


def stiffness_of(item: Element) -> dict[str, Any]:
    """Return the stiffness that a joint's element `<beamstiff>` gives; `spring` stands alone."""
    extension = item.one(EXTENSION)
    if extension is None:
        return {}
    if [*extension.attributes] == [SPRING] and item.attribute("type") != "fixed":
        return {ALONG[KINDS[kind_of(item)]]: extension.attributes[SPRING]}
    for name in extension.attributes:
        if name not in STIFFNESS_KINDS:
            extension.fail(
                f"unknown attribute {shown(name)}{suggest(name, STIFFNESS_KINDS)}, expected "
                f"{listed(STIFFNESS_KINDS)}"
            )
    return dict(extension.attributes)


def kind_of(item: Element) -> str:
    """Return the type of a joint, one of `KINDS`."""
    kind = item.attribute("type")
    if kind not in KINDS:
        item.fail(
            f"type: found {shown(kind)}{suggest(kind, KINDS)}, expected fixed, revolute, continuous or "
            "prismatic"
        )
    return kind


def mass_of(item: Element, text: str, what: str) -> float:
    """Return the mass, kg, that an element gives."""
    mass = item.numbers(text, 1, what)[0]
    if mass < 0:
        item.fail(f"found {mass:g} kg, expected a mass of 0 or more")
    return mass


def check_limits(item: Element, low: float, high: float) -> None:
    """Refuse a lower limit above the upper one."""
    if low > high:
        item.fail(f"found lower {low:g} above upper {high:g}, expected the lower limit below the upper one")


def stiffness_attributes(stiffness: JointStiffness) -> str:
    """Return what is not rigid in a stiffness as attributes of `<beamstiff>`, with units."""
    said = []
    for kind in STIFFNESS_KINDS:
        value = stiffness_text(getattr(stiffness, kind))
        unit = "N*m/rad" if kind in ("torsional", "tilting") else "N/m"
        if value != "rigid":
            said.append(f'{kind}="{value if isinstance(value, str) else f"{short_number(value)} {unit}"}"')
    return " ".join(said)


def short_number(value: float) -> str:
    """Return the shortest text of a number that is read back the same."""
    value += 0.0
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


def robot_of(fail: Callable[[str], NoReturn], data: Mapping[str, Any]) -> Robot:
    """Return the robot of such keyword arguments, what is wrong with it told by `fail`."""
    try:
        return Robot(**data)
    except DescriptionError as error:
        path, message = error.problems[0]
        fail(f"{path_text(path)}: {message}" if path else message)


def tree_robot(tree: LinkTree, tcp: str | None = None, more: Mapping[str, Any] | None = None) -> Robot:
    """Return the robot of links and joints, see `robot_data`, with `more` keys of a robot file."""

    def fail(message: str) -> NoReturn:
        raise BeamstiffError(f"{tree.source}: {message}")

    data = dict(more or {}) | ({"tcp": tcp} if tcp else {})
    return robot_of(fail, robot_data(tree, data.get("tcp")) | data)


def variable_names(joints: Iterable[TreeJoint]) -> dict[str, str]:
    """Return the variables of the joints that move: letters, digits and _, all unlike."""
    taken: set[str] = {*TABLE_COLUMNS, "pi"}
    names: dict[str, str] = {}
    for joint in joints:
        if joint.kind != "fixed":
            plain = re.sub(r"[^A-Za-z0-9_]", "_", joint.variable or joint.name)[:80]
            plain = plain if re.match(r"[A-Za-z_]", plain) else f"q_{plain}"
            names[joint.name] = _free(plain, taken, "_", number_first=True)
    return names


def ends(root: str, joints: Sequence[TreeJoint]) -> list[str]:
    """Return the links that no joint leaves, of those that move (of all where none does)."""
    parents = {joint.parent for joint in joints}
    moving = {root: False}
    for joint in joints:
        moving[joint.child] = moving[joint.parent] or joint.kind != "fixed"
    leaves = [name for name in moving if name not in parents]
    return [name for name in leaves if moving[name]] or leaves


def _tcp(tree: LinkTree, root: str, joints: Sequence[TreeJoint], tcp: str | None) -> str:
    if tcp is not None:  # `Robot` refuses a node that is none
        return tcp
    leaves = ends(root, joints)
    if len(leaves) > 1:
        raise BeamstiffError(
            f"{tree.source}: found {len(leaves)} ends of the chain ({listed(leaves, 12)}), expected to be "
            f"told which is the TCP: `beamstiff convert {tree.source} --tcp {leaves[0]} --out "
            f"ROBOT{'.urdf' if tree.source.endswith('.urdf') else '.yaml'}`, "
            f'or <beamstiff tcp="{leaves[0]}"/> in <robot>'
        )
    return leaves[0]


def _ordered(tree: LinkTree) -> tuple[TreeLink, list[TreeJoint]]:
    """Return the root, and the joints each after the one that carries its parent, as a walk meets them."""
    if not tree.links:
        raise BeamstiffError(f"{tree.source}: found no link, expected links and joints")
    links: dict[str, TreeLink] = {}
    for link in tree.links:
        if link.name in links:
            link.fail("found a second link of this name, expected one")
        links[link.name] = link
    seen: set[str] = set()
    carrier: dict[str, TreeJoint] = {}
    for joint in tree.joints:
        if joint.name in seen:
            joint.fail("found a second joint of this name, expected one")
        seen.add(joint.name)
        for what, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                joint.fail(f"{what}: there is no link {name!r}{suggest(name, links)}")
        if joint.child in carrier:
            joint.fail(
                f"the link {joint.child!r} hangs on {carrier[joint.child].name!r} already: a loop, which a "
                "tree of links cannot say; describe the loop in a robot file (loops:)"
            )
        carrier[joint.child] = joint
    roots = [name for name in links if name not in carrier]
    if len(roots) != 1:
        found = f"{len(roots)} links without a parent ({listed(roots)})" if roots else "a cycle of joints"
        raise BeamstiffError(f"{tree.source}: found {found}, expected one base link that all others hang on")
    carried: nx.DiGraph[str] = nx.DiGraph([(joint.parent, joint.child) for joint in tree.joints])
    carried.add_node(roots[0])
    order = [carrier[name] for name in nx.dfs_preorder_nodes(carried, roots[0]) if name in carrier]
    if len(order) < len(tree.joints):
        lost = next(joint for joint in tree.joints if joint not in order)
        lost.fail(f"is part of a cycle of joints that does not hang on the base link {roots[0]!r}")
    return links[roots[0]], order


def _free(name: str, taken: set[str], suffix: str = "", *, number_first: bool = False) -> str:
    """Return the name, changed until it is not taken, and take it."""
    tried, count = name, 1 if number_first else 0
    while tried in taken:
        count += 1
        tried = f"{name}{suffix}{'' if count == 1 else count}"
    taken.add(tried)
    return tried


def _frames(
    joint: TreeJoint, parent: str, own: str, variable: str | None, taken: set[str]
) -> Iterator[dict[str, Any]]:
    """Yield the frames from a parent's to a child's, one where the axis is the child's z."""
    if joint.kind == "fixed":
        yield from _chain(parent, frame_parameters(joint.placed), own, taken)
        return
    across = float(np.hypot(*joint.axis[:2]))
    turned: Array = np.eye(4)
    sign = "-" if across == 0.0 and joint.axis[2] < 0 else ""
    if across > 0.0:
        turned = transform(turned_to(joint.axis), np.zeros(3))
    name = own if across == 0.0 else _free(f"{own} axis", taken)
    parts = frame_parameters(joint.placed @ turned)
    moved = "theta" if joint.kind == "revolute" else "r"
    constant = parts[-1].pop(moved, 0.0)
    more = f" {'-' if constant < 0 else '+'} {abs(constant)!r}" if constant else ""
    expression: dict[str, Any] = {moved: f"{sign}{variable}{more}"}
    yield from _chain(parent, [*parts[:-1], {**parts[-1], **expression}], name, taken)
    if name != own:
        yield from _chain(name, frame_parameters(turned.swapaxes(0, 1)), own, taken)


def _chain(
    parent: str, parts: Sequence[Mapping[str, Any]], own: str, taken: set[str]
) -> Iterator[dict[str, Any]]:
    for part in parts[:-1]:
        name = _free(f"{own} origin", taken)
        yield {"name": name, "parent": parent, **part}
        parent = name
    yield {"name": own, "parent": parent, **parts[-1]}


def _variable(joint: TreeJoint, variables: Mapping[str, str], joints: Sequence[TreeJoint]) -> dict[str, Any]:
    data: dict[str, Any] = {"name": variables[joint.name], "type": joint.kind}
    if joint.limits is not None and joint.limits[0] < joint.limits[1]:
        data["limits"] = list(joint.limits)
    if joint.speed is not None and joint.mimic is None:  # one that follows has that of the joint it follows
        data["speed"] = joint.speed
    if joint.mimic is not None:
        followed = {other.name: other.kind for other in joints}
        source = joint.mimic.joint
        if source not in variables:
            what = "is fixed" if source in followed else f"is no joint{suggest(source, variables)}"
            joint.fail(f"mimic: {source!r} {what}, expected a joint that moves")
        units = {("revolute", "prismatic"): " rad/m", ("prismatic", "revolute"): " m/rad"}
        unit = units.get((joint.kind, followed[source]), "")
        factor, offset, term = joint.mimic.multiplier, joint.mimic.offset, variables[source]
        if factor not in (1.0, -1.0) or unit:
            term = f"{abs(factor)!r}{unit} * {term}"
        more = f" {'-' if offset < 0 else '+'} {abs(offset)!r}" if offset else ""
        data["equals"] = f"{'-' if factor < 0 else ''}{term}{more}"
    return data
