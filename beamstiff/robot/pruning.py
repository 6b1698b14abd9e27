"""A tree of links pruned to the chain of its TCP: what else moves is held, its mass stays."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.robot.link_tree import LinkTree, TreeJoint, TreeLink
from beamstiff.se3 import Array, rotation_from_vector, transform


def pruned(
    tree: LinkTree, tcp: str, held: Mapping[str, float] | None = None
) -> tuple[LinkTree, dict[str, TreeJoint], list[str]]:
    """Return the links from the root to a TCP and what moves with them, the joints that are held, and notes.

    Joints off the chain are held at 0 (or the nearer limit); their links become masses of the link that
    carries them. Joints that follow another one move with it, or are held with it.

    `held`: values of joints that are held, rad or m, on the chain too.
    """
    joints = {joint.name: joint for joint in tree.joints}
    values = dict(held or {})
    moving = [name for name, joint in joints.items() if joint.kind != "fixed"]
    for name in values:
        if name not in moving:
            raise BeamstiffError(
                f"{tree.source}: --hold: there is no moving joint {name!r}{suggest(name, moving)}, expected "
                f"one of {listed(moving, 12)}"
            )
    carrier = {joint.child: joint for joint in tree.joints}
    if tcp not in {link.name for link in tree.links}:
        names = [link.name for link in tree.links]
        raise BeamstiffError(f"{tree.source}: --tcp: there is no link {tcp!r}{suggest(tcp, names)}")
    chain = {tcp}
    link = tcp
    while link in carrier and carrier[link].parent not in chain:
        link = carrier[link].parent
        chain.add(link)
    apart = [name for name in moving if joints[name].child not in chain and name not in values]
    off = [name for name in apart if joints[_leader(joints, name)].child not in chain]
    for name in off:
        low, high = joints[name].limits or (-np.inf, np.inf)
        values[name] = float(np.clip(0.0, low, high))
    for _ in moving:  # a chain of followers comes to its end after as many rounds
        for follower in moving:
            mimic = joints[follower].mimic
            if mimic is not None and mimic.joint in values and follower not in values:
                values[follower] = mimic.multiplier * values[mimic.joint] + mimic.offset
    fixed = {name: _held(joint, values[name]) for name, joint in joints.items() if name in values}
    kept: list[TreeJoint] = []
    branches: dict[str, tuple[str, Array]] = {}  # link of a branch: what carries it, where it is there
    waiting = list(tree.joints)
    seen = {link}
    while waiting:  # the carried after what carries them
        ready = [joint for joint in waiting if joint.parent in seen]
        if not ready:
            break
        for joint in ready:
            waiting.remove(joint)
            seen.add(joint.child)
            placed = fixed.get(joint.name, joint)
            if joint.parent in branches:
                root, at = branches[joint.parent]
                branches[joint.child] = root, at @ placed.placed
            elif joint.name in off:
                branches[joint.child] = joint.parent, placed.placed
            else:
                kept.append(placed)
    links = {one.name: one for one in tree.links}
    lumped = 0.0
    for name, (root, at) in branches.items():
        mass = links[name].mass
        lumped += mass
        if mass > 0:
            centre = (at @ np.array([*links[name].centre, 1.0]))[:3]
            links[root] = _with_mass(links[root], mass, centre)
    notes = []
    if off:
        carried = f"; their links ({lumped:.4g} kg) are masses of the links that carry them" if lumped else ""
        where = listed([f"{name} at {values[name]:.4g}" for name in off], 12)
        notes.append(
            f"pruned to the chain of {tcp}: held {where}{carried} (--hold NAME=VALUE holds one elsewhere)"
        )
    remaining = tuple(one for name, one in links.items() if name not in branches)
    return replace(tree, links=remaining, joints=tuple(kept)), fixed, notes


def _leader(joints: Mapping[str, TreeJoint], name: str) -> str:
    """Return the joint that another one follows in the end; itself, if it follows none."""
    for _ in joints:
        mimic = joints[name].mimic
        if mimic is None or mimic.joint not in joints:
            break
        name = mimic.joint
    return name


def _held(joint: TreeJoint, value: float) -> TreeJoint:
    """Return a joint that is fixed at a value."""
    moved = (
        transform(rotation_from_vector(joint.axis * value), np.zeros(3))
        if joint.kind == "revolute"
        else transform(np.eye(3), joint.axis * value)
    )
    return replace(joint, kind="fixed", placed=joint.placed @ moved, mimic=None, limits=None, stiffness={})


def _with_mass(link: TreeLink, mass: float, centre: Array) -> TreeLink:
    total = link.mass + mass
    at = (link.mass * np.array(link.centre) + mass * centre) / total
    return replace(link, mass=total, centre=(float(at[0]), float(at[1]), float(at[2])))
