"""URDF and SDF in which every compliance is a joint in series, for simulators that read these formats.

SDF says the stiffness of a joint itself (`<dynamics><spring_stiffness>`), URDF does not: there our own
element `<beamstiff>` does. Neither holds loops, tendons, stops that rub; what is lost is listed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from beamstiff.robot.description import Robot
from beamstiff.robot.link_tree import EXTENSION, SPRING
from beamstiff.robot.placement import roll_pitch_yaw
from beamstiff.robot.sdf_writer import DRAWN, PREFIXED, SDF_HEAD, extension
from beamstiff.robot.urdf.export import FARTHEST, WEIGHTLESS_LINKS, link_lines, mass_of_points, numbers_text
from beamstiff.se3 import Array, transform
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.bodies import BodyJoint, BodyTree, free_name, inertia_of
from beamstiff.simulators.mjcf_writer import SETTLE
from beamstiff.simulators.urdf_parts import Files, with_urdf_parts


@dataclass(frozen=True, eq=False)
class SeriesLink:
    """A link and the one joint that carries it; none (fixed) where `joint` is None."""

    name: str
    parent: str
    placed: Array  # (4, 4): its frame in its parent's, the joint's axis through its origin
    joint: BodyJoint | None
    body: int | None  # whose masses and sites it carries
    frame: Array  # (4, 4): that body's frame in the link's


def robot_to_series(
    robot: Robot, kind: str, q: Array | None = None, files: Files | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return the URDF or SDF of a robot, and what it does not say; `q`, `files`: as of `robot_to_mjcf`."""
    tree = with_urdf_parts(assemble(robot, q), robot, files)
    lost = list(tree.lost)
    if tree.closures:
        lost.append(f"loops: cut open at {', '.join(one.name for one in tree.closures)}")
    if tree.tendons:
        lost.append(f"struts and balancers: {', '.join(one.name for one in tree.tendons)}")
    joints = [joint for body in tree.bodies for joint in body.joints]
    if any(joint.friction or joint.cubic for joint in joints):
        lost.append("friction and cubic springs of drives")
    if kind == "urdf" and any(joint.stiffness for joint in joints):
        lost.append("the stiffness of the joints in series, but in <beamstiff>: URDF has no springs")
    return series_text(tree, kind, lost), tuple(lost)


def series_text(tree: BodyTree, kind: str, lost: list[str]) -> str:
    """Return the text of a machine, `kind` "urdf" or "sdf", which says what is `lost` in it."""
    return (_urdf if kind == "urdf" else _sdf)(tree, [*series_links(tree)], lost)


def series_links(tree: BodyTree) -> Iterator[SeriesLink]:
    """Yield links, parents first: one for every joint of every body, and one of its name for every site.

    No link is called as a joint is: SDF takes both for one name.
    """
    called, taken = _site_links(tree)
    own: dict[int, tuple[str, Array]] = {-1: ("", np.eye(4))}
    for number, body in enumerate(tree.bodies):
        parent, frame = own[body.parent]
        frame = frame @ body.placed
        joints: list[BodyJoint | None] = [*body.joints] or [None]
        for at, joint in enumerate(joints):
            last = at == len(joints) - 1
            anchor = transform(np.eye(3), np.zeros(3) if joint is None else joint.at)
            name = body.name if last or joint is None else f"{body.name} behind {joint.name}"
            name = free_name(f"{name} link" if name in taken else name, taken)
            behind: Array = np.asarray(np.linalg.inv(anchor), dtype=np.float64)
            yield SeriesLink(name, parent, frame @ anchor, joint, number if last else None, behind)
            parent, frame = name, behind
        own[number] = parent, frame
        for site, pose in body.sites:
            yield SeriesLink(called[site], parent, frame @ pose, None, None, np.eye(4))


def _site_links(tree: BodyTree) -> tuple[dict[str, str], set[str]]:
    """Return the links of sites, and all names that are taken: `world` is SDF's own."""
    taken = {"world", *(joint.name for body in tree.bodies for joint in body.joints)}
    sites = [site for body in tree.bodies for site, _ in body.sites]
    return {site: free_name(f"{site} site" if site in taken else site, taken) for site in sites}, taken


def _extension(tree: BodyTree, name: str) -> str:
    return extension(_site_links(tree)[0][tree.tcp], tree.gravity, name)


def _inertial(tree: BodyTree, link: SeriesLink) -> tuple[float, Array, Array]:
    """Return mass, centre and inertia of a link, in its frame, which is turned as its body's."""
    if link.body is None:
        return mass_of_points([])
    mass, centre, inertia = inertia_of(tree.bodies[link.body])
    return mass, link.frame[:3, :3] @ centre + link.frame[:3, 3], inertia


def _shapes(tree: BodyTree, link: SeriesLink, kind: str) -> Iterator[str]:
    """Yield the shapes that a link carries."""
    for number, shape in enumerate([] if link.body is None else tree.bodies[link.body].shapes):
        drawn, pose = DRAWN[shape.collision], link.frame @ shape.pose
        sizes = {name: numbers_text(value) for name, value in shape.sizes.items()}
        place = [numbers_text(part) for part in (pose[:3, 3], roll_pitch_yaw(pose[:3, :3]))]
        if kind == "urdf":
            sizes |= {"filename": shape.file} if shape.file else {}
            inside = " ".join(f"{name}={quoteattr(value)}" for name, value in sizes.items())
            at = '<origin xyz="{}" rpy="{}"/>'.format(*place)
            yield f"    <{drawn}>{at}<geometry><{shape.kind} {inside}/></geometry></{drawn}>"
        else:
            sizes |= {"uri": escape(shape.file)} if shape.file else {}
            inside = "".join(f"<{name}>{value}</{name}>" for name, value in sizes.items())
            at = "<pose>{} {}</pose>".format(*place)
            geometry = f"<geometry><{shape.kind}>{inside}</{shape.kind}></geometry>"
            yield f'<{drawn} name="{drawn} {number}">{at}{geometry}</{drawn}>'


def _comment(lost: list[str]) -> list[str]:
    """Return what a file does not say as a comment at its head."""
    said = "".join(f"\n    - {item}" for item in [WEIGHTLESS_LINKS, *lost]).replace("--", "- -")
    return [f"  <!-- Every compliance is a joint in series. Not here, or not exactly:{said}\n  -->"]


def _urdf(tree: BodyTree, links: list[SeriesLink], lost: list[str]) -> str:
    lines = [
        '<?xml version="1.0"?>',
        f"<robot name={quoteattr(tree.name)}>",
        *_comment(lost),
        f"  {_extension(tree, EXTENSION)}",
        '  <mujoco><compiler fusestatic="false" discardvisual="false" strippath="false"/></mujoco>',
    ]
    for link in links:
        *start, end = link_lines(link.name, *_inertial(tree, link))
        lines += [*start, *_shapes(tree, link, "urdf"), end]
    for link in links[1:]:
        joint, placed = link.joint, link.placed
        kind, name = "fixed", f"{link.name} in {link.parent}"
        inside = ""
        if joint is not None:
            name, slides = joint.name, joint.kind == "slide"
            kind = "prismatic" if slides else "revolute" if joint.limits else "continuous"
            inside = f'<axis xyz="{numbers_text(joint.axis)}"/>'
            if k := float(joint.stiffness):
                unit = "N/m" if slides else "N*m/rad"
                inside += f'<dynamics damping="{2 * k * SETTLE!r}"/><{EXTENSION} {SPRING}="{k!r} {unit}"/>'
            low, high = joint.limits or (-FARTHEST, FARTHEST)
            if kind != "continuous":
                inside += f'<limit lower="{low!r}" upper="{high!r}" effort="0" velocity="0"/>'
            if joint.leader:
                inside += f'<mimic joint={quoteattr(joint.leader)} multiplier="{joint.factor!r}"/>'
        lines.append(
            f"  <joint name={quoteattr(name)} type={quoteattr(kind)}><parent link={quoteattr(link.parent)}/>"
            f'<child link={quoteattr(link.name)}/><origin xyz="{numbers_text(placed[:3, 3])}" '
            f'rpy="{numbers_text(roll_pitch_yaw(placed[:3, :3]))}"/>{inside}</joint>'
        )
    return "\n".join([*lines, "</robot>", ""])


def _sdf(tree: BodyTree, links: list[SeriesLink], lost: list[str]) -> str:
    lines = [
        SDF_HEAD,
        f"  <model name={quoteattr(tree.name)}>",
        *_comment(lost),
        f"    {_extension(tree, PREFIXED)}",
    ]
    carried = {link.name: _joint_name(link) for link in links[1:]}
    for link in links:
        mass, centre, inertia = _inertial(tree, link)
        moments = "".join(
            f"<i{'xyz'[i]}{'xyz'[j]}>{float(inertia[i, j])!r}</i{'xyz'[i]}{'xyz'[j]}>"
            for i in range(3)
            for j in range(i, 3)
        )
        at = f"<pose relative_to={quoteattr(carried[link.name])}>0 0 0 0 0 0</pose>" if link.parent else ""
        shapes = "".join(_shapes(tree, link, "sdf"))
        lines.append(
            f"    <link name={quoteattr(link.name)}>{at}<inertial><pose>{numbers_text(centre)} 0 0 0</pose>"
            f"<mass>{mass!r}</mass><inertia>{moments}</inertia></inertial>{shapes}</link>"
        )
    lines.append(
        f'    <joint name="base to world" type="fixed"><parent>world</parent><child>{escape(links[0].name)}'
        "</child></joint>"
    )
    for link in links[1:]:
        joint = link.joint
        kind, inside = "fixed", ""
        if joint is not None:
            kind = "prismatic" if joint.kind == "slide" else "revolute"
            k = float(joint.stiffness)
            spring = (
                f"<dynamics><spring_stiffness>{k!r}</spring_stiffness><spring_reference>0</spring_reference>"
                f"<damping>{2 * k * SETTLE!r}</damping></dynamics>"
                if k
                else ""
            )
            low, high = (-joint.deadband, joint.deadband) if joint.deadband else joint.limits or (-1e16, 1e16)
            mimic = (
                f"<mimic joint={quoteattr(joint.leader)}><multiplier>{joint.factor!r}</multiplier></mimic>"
            )
            inside = (
                f"<axis><xyz>{numbers_text(joint.axis)}</xyz><limit><lower>{float(low)!r}</lower>"
                f"<upper>{float(high)!r}</upper></limit>{spring}{mimic if joint.leader else ''}</axis>"
            )
        pose = np.concatenate([link.placed[:3, 3], roll_pitch_yaw(link.placed[:3, :3])])
        lines.append(
            f"    <joint name={quoteattr(_joint_name(link))} type={quoteattr(kind)}>"
            f"<parent>{escape(link.parent)}</parent><child>{escape(link.name)}</child>"
            f"<pose relative_to={quoteattr(link.parent)}>{numbers_text(pose)}</pose>{inside}</joint>"
        )
    return "\n".join([*lines, "  </model>", "</sdf>", ""])


def _joint_name(link: SeriesLink) -> str:
    return f"{link.name} in {link.parent}" if link.joint is None else link.joint.name
