"""The unknowns of a structure, numbered once per graph; rigid parts and rigid joint directions have none.

Rigids and joints form trees. The root of each tree has the six components of its displacement in the base
frame; a joint on the tree adds its relative displacement in the joint's own frame, one unknown for each
direction that is not rigid. So `rigid` is a constraint, `free` a release, and a soft joint next to a hard one
costs no digits. What closes a loop of rigids and joints becomes constraint rows (see `constraints`).

The displacement of a node is a sum of terms, one for each unknown block on its way to the root::

    u_node = sum_t +-X(p_node - p_t) R_t z_t
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from networkx.utils import UnionFind
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.parts import JOINT_DIRECTIONS, Joint

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Unknowns:
    """Numbering of the unknowns ``z`` (n) in blocks of six, and the terms that make nodes of them."""

    count: int  # number of unknowns, n
    blocks: Index  # (K, 6): unknown of each direction of each block; -1 where there is none (rigid)
    labels: tuple[tuple[str, int], ...]  # for each unknown: its node or joint, and the direction 0..5
    # (K,): index of the joint whose relative displacement the block is; -1 for a root node
    block_joint: Index
    # term_node, term_block, term_origin, term_sign, (T,): terms, sorted by node: the node, the block, the
    # node from which the arm is drawn (of a joint its second), and -1 where the way to the root passes a
    # joint from its second node to its first
    term_node: Index
    term_block: Index
    term_origin: Index
    term_sign: Index
    # tree_joints, chord_joints: joints that carry unknowns, and joints that close a loop
    tree_joints: Index
    chord_joints: Index
    chord_rigids: Index  # rigids that close a loop
    held: Index  # nodes that are fixed without being the root of their tree


def joint_values(joint: Joint) -> NDArray[np.float64]:
    """Return the stiffness of the six directions of a joint, (6,), SI; inf is rigid, 0 is free."""
    return np.array([getattr(joint.stiffness, kind) for kind in JOINT_DIRECTIONS])


def turning_nodes(robot: Robot) -> set[str]:
    """Return the nodes that have a rotation: all but those that only struts hold."""
    ends = [item.nodes for item in robot.beams] + [item.nodes for item in robot.rigids]
    ends += [item.nodes for item in robot.joints]
    return {name for pair in ends for name in pair} | set(robot.fixed)


def joint_unknowns(unknowns: Unknowns) -> dict[tuple[int, int], int]:
    """Return the unknown of every joint (its index) and direction 0..5 that has one."""
    return {
        (int(joint), direction): int(number)
        for joint, block in zip(unknowns.block_joint, unknowns.blocks, strict=True)
        for direction, number in enumerate(block)
        if joint >= 0 and number >= 0
    }


def number_unknowns(robot: Robot) -> Unknowns:
    """Return the numbering of the unknowns of a robot's structure."""
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    fixed = {index[name] for name in robot.fixed}
    tree, tree_joints, chord_rigids, chord_joints = _spanning_forest(robot, index)

    blocks: list[list[int]] = []
    block_joint: list[int] = []
    labels: list[tuple[str, int]] = []
    # node -> (block, origin, sign) on its way to the root
    paths: dict[int, list[tuple[int, int, int]]] = {}
    held: list[int] = []

    def new_block(label: str, directions: list[bool], joint: int) -> int:
        start = len(labels)
        numbers = iter(range(start, start + sum(directions)))
        blocks.append([next(numbers) if has else -1 for has in directions])
        labels.extend((label, direction) for direction, has in enumerate(directions) if has)
        block_joint.append(joint)
        return len(blocks) - 1

    turning = {index[name] for name in turning_nodes(robot)}
    if index[robot.tcp] not in turning:
        raise BeamstiffError(
            f"tcp: node {robot.tcp!r} is held by struts alone and has no rotation; attach a rigid or beam"
        )
    # roots: fixed nodes first, then the TCP (its displacement is then an unknown), then the order of the file
    for root in [*sorted(fixed), index[robot.tcp], *range(len(robot.nodes))]:
        if root in paths:
            continue
        if root in fixed:
            paths[root] = []
        else:
            six = [True] * 3 + [root in turning] * 3
            paths[root] = [(new_block(robot.nodes[root].name, six, -1), root, 1)]
        front = deque([root])
        while front:
            node = front.popleft()
            for neighbour, joint, sign in tree[node]:
                if neighbour in paths:
                    continue
                paths[neighbour] = list(paths[node])
                if joint >= 0:
                    values = joint_values(robot.joints[joint])
                    if (values != RIGID).any():
                        directions = [bool(value != RIGID) for value in values]
                        block = new_block(robot.joints[joint].name, directions, joint)
                        pivot = index[robot.joints[joint].nodes[1]]  # coincident with the first until loaded
                        paths[neighbour].append((block, pivot, sign))
                if neighbour in fixed and paths[neighbour]:
                    held.append(neighbour)
                front.append(neighbour)
    terms = [(node, *term) for node in range(len(robot.nodes)) for term in paths[node]]
    columns = np.array(terms, dtype=np.int64).reshape(-1, 4).T
    return Unknowns(
        count=len(labels),
        blocks=np.array(blocks, dtype=np.int64).reshape(-1, 6),
        labels=tuple(labels),
        block_joint=np.array(block_joint, dtype=np.int64),
        term_node=columns[0],
        term_block=columns[1],
        term_origin=columns[2],
        term_sign=columns[3],
        tree_joints=np.array(tree_joints, dtype=np.int64),
        chord_joints=np.array(chord_joints, dtype=np.int64),
        chord_rigids=np.array(chord_rigids, dtype=np.int64),
        held=np.array(sorted(held), dtype=np.int64),
    )


def _spanning_forest(
    robot: Robot, index: dict[str, int]
) -> tuple[list[list[tuple[int, int, int]]], list[int], list[int], list[int]]:
    """Return the tree as neighbours (node, joint or -1, sign), and what is on it and what closes loops.

    Rigids come first, then joints with many rigid directions: the fewer constraint rows are left for loops.
    """
    joined: UnionFind[int] = UnionFind()
    tree: list[list[tuple[int, int, int]]] = [[] for _ in robot.nodes]
    tree_joints: list[int] = []
    chords: tuple[list[int], list[int]] = ([], [])
    rigid = [int((joint_values(joint) == RIGID).sum()) for joint in robot.joints]
    by_rigidity = sorted(range(len(robot.joints)), key=lambda at: -rigid[at])
    edges = [(at, -1, item.nodes) for at, item in enumerate(robot.rigids)]
    edges += [(at, at, robot.joints[at].nodes) for at in by_rigidity]
    for at, joint, (first, second) in edges:
        a, b = index[first], index[second]
        if joined[a] == joined[b]:
            chords[joint >= 0].append(at)
            continue
        joined.union(a, b)
        # a joint's relative displacement is that of its second node against its first
        tree[a].append((b, joint, 1))
        tree[b].append((a, joint, -1))
        if joint >= 0:
            tree_joints.append(joint)
    return tree, sorted(tree_joints), chords[0], sorted(chords[1])
