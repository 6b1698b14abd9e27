"""What closes a loop of rigid parts: constraint rows on the unknowns, and their exact null space.

``G z = 0`` holds for fixed nodes met on the way, rigids and rigid joint directions that close a loop, and
rigid struts. Redundant rows (a planar loop of rigid links has them) are found by rank, not by a penalty.
"""

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.assembly import node_map
from beamstiff.fem.placed_structure import Geometry, strut_directions
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_values
from beamstiff.robot.fields import RIGID
from beamstiff.se3 import Array, displacement_transport, rotate_screw

RANK_TOLERANCE = 1e-9
ROUNDING = 1e-13  # of a basis whose columns have length one


def has_constraints(structure: Structure) -> bool:
    """Return whether any loop of rigid parts leaves constraint rows."""
    unknowns, robot = structure.unknowns, structure.robot
    rigid_joint = any((joint_values(robot.joints[at]) == RIGID).any() for at in unknowns.chord_joints)
    rigid_strut = any(strut.rigid for strut in robot.struts)
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
        if strut.rigid:
            rows.append(strut_row(structure, geometry, at))
    empty = np.zeros((positions.shape[0], 0, unknowns.count))
    return np.concatenate([empty, *rows], axis=1)


def joint_rows(structure: Structure, geometry: Geometry, joint: int) -> Array:
    """Return the relative displacement of a joint's second node against its first, joint frame, (P, 6, n)."""
    a, b = structure.joint_nodes[joint]
    relative = node_map(structure, geometry, int(b)) - node_map(structure, geometry, int(a))
    return rotate_screw(geometry.joint_rotation[:, joint]).swapaxes(-1, -2) @ relative


def beam_rows(structure: Structure, geometry: Geometry, beam: int) -> Array:
    """Return the deformation of a beam, second end against the first carried along, local axes, (P, 6, n)."""
    a, b = structure.elements[beam]
    positions = geometry.posture.node_positions
    carry = displacement_transport(positions[:, b] - positions[:, a])
    relative = node_map(structure, geometry, int(b)) - carry @ node_map(structure, geometry, int(a))
    return rotate_screw(geometry.beam_rotation[:, beam]).swapaxes(-1, -2) @ relative


def strut_row(structure: Structure, geometry: Geometry, strut: int) -> Array:
    """Return the elongation of a strut as a row on the unknowns, (P, 1, n)."""
    a, b = (structure.kinematics.node_index[name] for name in structure.robot.struts[strut].nodes)
    along, _ = strut_directions(structure, geometry, np.array([strut]))
    relative = (node_map(structure, geometry, b) - node_map(structure, geometry, a))[:, :3]
    return along @ relative


def unknown_sizes(structure: Structure) -> Array:
    """Return the size of a unit of each unknown, (n,), so that metres and radians compare."""
    size = structure.kinematics.size
    return np.array([size if direction < 3 else 1.0 for _, direction in structure.unknowns.labels])


def ranks(rows: Array, scale: Array) -> NDArray[np.int64]:
    """Return the rank of the rows of each pose, (P,): it falls in a singular position of a loop."""
    return count_ranks(np.asarray(np.linalg.svd(rows * scale, compute_uv=False), dtype=np.float64), scale)


def count_ranks(singular: Array, scale: Array) -> NDArray[np.int64]:
    """Return the rank of rows of each pose, (P,), from their singular values (P, k), scaled as in `ranks`."""
    counts: NDArray[np.int64] = _independent(singular, scale).sum(axis=1)
    return counts


def _independent(singular: Array, scale: Array) -> NDArray[np.bool_]:
    """Return which singular values (P, k) are more than rounding."""
    # a loop of rigids alone leaves rows of rounding errors: nothing to compare with but the machine's size
    largest = singular.max(axis=1, initial=scale.max(initial=1.0), keepdims=True)
    return np.asarray(singular > RANK_TOLERANCE * largest)


def scaled_inverse(rows: Array, scale: Array) -> Array:
    """Return the pseudo-inverse (P, n, k) of ``rows * scale``, of the rank that `ranks` finds."""
    left, singular, right = np.linalg.svd(rows * scale, full_matrices=False)
    kept = _independent(singular, scale)
    inverse = np.divide(1.0, singular, out=np.zeros_like(singular), where=kept)
    return np.asarray(right.swapaxes(-1, -2) @ (inverse[..., None] * left.swapaxes(-1, -2)))


def null_space(rows: Array, scale: Array, what: str) -> Array:
    """Return a basis N of the motions that all rows (P, g, n) leave free, ``rows @ N = 0``, (P, n, m).

    `scale` (n,) is the size of a unit of each unknown, so that metres and radians compare; `what` begins
    messages.
    """
    _, singular, right = np.linalg.svd(rows * scale, full_matrices=True)
    rank = count_ranks(singular, scale)
    if rank.size and (rank != rank[0]).any():
        wrong = int(np.argmax(rank != np.bincount(rank).argmax()))
        raise BeamstiffError(
            f"{what}: pose {wrong} is a singular position of a loop of rigid parts; leave it out"
        )
    free = right[:, int(rank[0]) if rank.size else 0 :]
    # rounding errors would carry the stiffness of what does not move into what moves
    free[np.abs(free) < ROUNDING] = 0.0
    return free.swapaxes(-1, -2) * scale[:, None]


def imposed(rows: Array, basis: Array, names: list[str]) -> Array:
    """Return W with ``rows @ W = I`` inside the span of `basis`, (P, n, p): unit motion of each row."""
    inside = rows @ basis
    size = np.linalg.norm(inside, axis=2, keepdims=True)
    stuck = (size[..., 0] <= RANK_TOLERANCE * np.linalg.norm(basis, axis=(1, 2))[:, None]).any(axis=0)
    left, singular, _ = np.linalg.svd(inside / np.where(size > 0.0, size, 1.0), full_matrices=True)
    missing = len(names) - (singular > RANK_TOLERANCE).sum(axis=1)
    if stuck.any() or missing.any():
        pose = int(np.argmax(missing))
        coupled = (np.abs(left[pose, :, len(names) - missing[pose] :]) > RANK_TOLERANCE**0.5).any(axis=1)
        which = [name for name, wrong in zip(names, stuck if stuck.any() else coupled, strict=True) if wrong]
        how = "cannot move at all" if stuck.any() else "cannot move without one another"
        raise BeamstiffError(
            f"the directions {listed(dict.fromkeys(which))} {how}: rigid parts of their loops hold them"
        )
    return basis @ np.linalg.pinv(inside)
