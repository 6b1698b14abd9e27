"""What closes a loop of rigid parts: constraint rows on the unknowns, and their exact null space.

``G z = 0`` holds for fixed nodes met on the way, rigids and rigid joint directions that close a loop, and rigid
struts. Redundant rows (a planar loop of rigid links has them) are found by rank, not by a penalty.
"""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.assembly import node_map
from beamstiff.fem.geometry import Geometry, strut_directions
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_values
from beamstiff.robot.fields import RIGID
from beamstiff.se3 import Array, displacement_transport, rotate_screw

RANK_TOLERANCE = 1e-9


def has_constraints(structure: Structure) -> bool:
    """Return whether any loop of rigid parts leaves constraint rows."""
    unknowns, robot = structure.unknowns, structure.robot
    rigid_joint = any((joint_values(robot.joints[at]) == RIGID).any() for at in unknowns.chord_joints)
    rigid_strut = any(strut.stiffness == RIGID for strut in robot.struts)
    return bool(unknowns.held.size or unknowns.chord_rigids.size or rigid_joint or rigid_strut)


def constraint_rows(structure: Structure, geometry: Geometry) -> Array:
    """Return G of ``G z = 0``, (P, g, n), base-frame or joint-frame components."""
    robot, unknowns = structure.robot, structure.unknowns
    index, positions = structure.kinematics.node_index, geometry.posture.node_positions
    rows = [node_map(structure, geometry, int(node)) for node in unknowns.held]
    for at in unknowns.chord_rigids:
        a, b = (index[name] for name in robot.rigids[at].nodes)
        carried = displacement_transport(positions[:, b] - positions[:, a]) @ node_map(structure, geometry, a)
        rows.append(node_map(structure, geometry, b) - carried)
    for at in unknowns.chord_joints:
        rigid = joint_values(robot.joints[at]) == RIGID
        rows.append(joint_rows(structure, geometry, int(at))[:, rigid])
    for at, strut in enumerate(robot.struts):
        if strut.stiffness == RIGID:
            rows.append(strut_row(structure, geometry, at))
    empty = np.zeros((positions.shape[0], 0, unknowns.count))
    return np.concatenate([empty, *rows], axis=1)


def joint_rows(structure: Structure, geometry: Geometry, joint: int) -> Array:
    """Return the relative displacement of a joint's second node against its first, joint frame, (P, 6, n)."""
    a, b = structure.joint_nodes[joint]
    relative = node_map(structure, geometry, int(b)) - node_map(structure, geometry, int(a))
    return rotate_screw(geometry.joint_rotation[:, joint]).swapaxes(-1, -2) @ relative


def strut_row(structure: Structure, geometry: Geometry, strut: int) -> Array:
    """Return the elongation of a strut as a row on the unknowns, (P, 1, n)."""
    a, b = (structure.kinematics.node_index[name] for name in structure.robot.struts[strut].nodes)
    along = strut_directions(structure, geometry, np.array([strut]))
    relative = (node_map(structure, geometry, b) - node_map(structure, geometry, a))[:, :3]
    return along @ relative


def null_space(rows: Array, scale: Array, what: str) -> Array:
    """Return a basis N of the motions that all rows leave free, ``rows @ N = 0``, (P, n, m).

    Parameters
    ----------
    rows : (P, g, n) array
    scale : (n,) array
        Size of a unit of each unknown, so that metres and radians compare.
    what : str
        What the rows stand for, for the message.

    Raises
    ------
    BeamstiffError
        When the rank differs between poses: some of them are singular positions of a rigid loop.
    """
    poses, _, count = rows.shape
    scaled = rows * scale
    _, singular, right = np.linalg.svd(scaled, full_matrices=True)
    largest = singular.max(axis=1, initial=0.0, keepdims=True)
    # a loop of rigids alone leaves rows of rounding errors: nothing to compare with but the machine's size
    rank = (singular > RANK_TOLERANCE * np.maximum(largest, scale.max(initial=1.0))).sum(axis=1)
    if poses and (rank != rank[0]).any():
        odd = int(np.argmax(rank != np.bincount(rank).argmax()))
        raise BeamstiffError(f"{what}: pose {odd} is a singular position of a loop of rigid parts; leave it out")
    keep = int(rank[0]) if poses else 0
    return right[:, keep:].swapaxes(-1, -2) * scale[:, None]


def imposed(rows: Array, basis: Array, scale: Array, names: list[str]) -> Array:
    """Return W with ``rows @ W = I`` inside the span of `basis`, (P, n, p): unit motion of each row.

    Raises
    ------
    BeamstiffError
        When a row cannot move because rigid parts hold it.
    """
    inside = rows @ basis
    _, singular, _ = np.linalg.svd(inside, full_matrices=False)
    if inside.shape[2] < len(names) or (singular.min(initial=np.inf) <= RANK_TOLERANCE * singular.max(initial=0.0)):
        stuck = [name for at, name in enumerate(names) if np.abs(inside[:, at]).max(initial=0.0) <= 1e-9 * scale.max()]
        raise BeamstiffError(
            f"the directions {', '.join(stuck or names)} cannot move on their own: rigid parts of their loops hold them"
        )
    inverse: Array = np.linalg.pinv(inside)
    return basis @ inverse
