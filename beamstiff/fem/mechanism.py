"""Positive definite or a mechanism: found from scaled pivots before any solve, and named as a motion."""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.assembly import element_blocks, gather
from beamstiff.fem.geometry import Geometry
from beamstiff.fem.structure import Structure
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.se3 import Array

# a pivot of the scaled matrix below this is rounding, not stiffness
PIVOT_TOLERANCE = 1e-10
# a part strained by a motion has more than this share of the energy that motions of that size could give it
STRAINED = 1e-8


def diagonal_scale(matrix: Array) -> Array:
    """Return d with unit diagonal of ``d K d``, (P, n); 1 where the diagonal is not positive."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def unstable_pose(matrix: Array, size: Array | None = None) -> tuple[int, Array] | None:
    """Return the first pose whose stiffness is not positive definite, with its softest motion.

    Parameters
    ----------
    matrix : (P, n, n) array
        Symmetric stiffness.
    size : (P, n) array, optional
        How large what went into the diagonal is (`assembly.assemble`), so that what rounding left of it does
        not pass for stiffness; default the diagonal.

    Returns
    -------
    None, or (pose, motion) with motion an (n,) array
    """
    if matrix.shape[-1] == 0 or matrix.shape[0] == 0:
        return None
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    size = diagonal if size is None else np.maximum(size, diagonal)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = scale[:, :, None] * matrix * scale[:, None, :]
    finite = np.isfinite(scaled).all(axis=(1, 2))
    if not finite.all():
        raise BeamstiffError(
            f"found values that are not finite at pose {int(np.argmin(finite))}, expected a stiffness or "
            "compliance in the range of numbers; check the units"
        )
    try:
        pivots = np.diagonal(np.linalg.cholesky(scaled), axis1=-2, axis2=-1) ** 2
        bad = (pivots < PIVOT_TOLERANCE).any(axis=1)
    except np.linalg.LinAlgError:
        bad = np.linalg.eigvalsh(scaled)[:, 0] < PIVOT_TOLERANCE
    if not bad.any():
        return None
    pose = int(np.argmax(bad))
    _, vectors = np.linalg.eigh(scaled[pose])
    return pose, scale[pose] * vectors[:, 0]


def scaled_condition(matrix: Array) -> Array:
    """Return the condition number of the stiffness scaled to unit diagonal, (P,)."""
    scale = diagonal_scale(matrix)
    eigenvalues = np.linalg.eigvalsh(scale[:, :, None] * matrix * scale[:, None, :])
    return eigenvalues[:, -1] / eigenvalues[:, 0]


def mechanism_error(
    structure: Structure, geometry: Geometry, pose: int, motion: Array, what: str = "is a mechanism"
) -> BeamstiffError:
    """Return the error that names a free motion: the nodes that move, how, and the joints that give way.

    Parameters
    ----------
    pose : int
        Pose within `geometry`.
    motion : (n,) array
        The motion as unknowns.
    what : str
        What is wrong with the robot.
    """
    robot = structure.robot
    everywhere = np.zeros((geometry.terms.shape[0], structure.unknowns.count))
    everywhere[pose] = motion
    moved = gather(structure, geometry, everywhere)[pose]
    positions = geometry.posture.node_positions[pose]
    size = max(float(np.ptp(positions, axis=0).max()), 1e-3)
    where = f" at pose {geometry.number[pose]}" if geometry.number[pose] or len(geometry.number) > 1 else ""
    resisting = _resisting(structure, geometry, pose, motion, moved, size)
    if what == "is a mechanism" and resisting:
        return BeamstiffError(
            f"robot {robot.name!r}: the stiffness of {listed(resisting)} is lost beside parts more than "
            f"{1 / PIVOT_TOLERANCE:.0e} times stiffer{where}; make those rigid, or this free"
        )
    amount = np.linalg.norm(moved[:, :3], axis=1) + size * np.linalg.norm(moved[:, 3:], axis=1)
    order = np.argsort(-amount)
    nodes = [robot.nodes[at].name for at in order if amount[at] > 1e-3 * amount[order[0]]]
    most = moved[order[0]]
    turning = size * np.linalg.norm(most[3:]) > np.linalg.norm(most[:3])
    vector = most[3:] if turning else most[:3]
    direction = ", ".join(f"{value:.2f}" for value in vector / np.linalg.norm(vector))
    joints = []
    for at, joint in enumerate(robot.joints):
        a, b = structure.joint_nodes[at]
        relative = moved[b] - moved[a]
        local = geometry.joint_rotation[pose, at].T @ relative.reshape(2, 3).T
        gives = np.abs(local.T.reshape(6) * np.array([1.0] * 3 + [size] * 3)) > 1e-3 * amount[order[0]]
        joints += [f"{joint.name}.{kind}" for kind in dict.fromkeys(np.array(JOINT_DIRECTIONS)[gives])]
    moves = f"{'turns about' if turning else 'moves along'} ({direction})"
    through = f", through {listed(joints)}" if joints else ""
    return BeamstiffError(
        f"robot {robot.name!r} {what}{where}: node {nodes[0]!r} {moves} freely{through}; "
        f"moving nodes: {listed(nodes)}"
    )


def _resisting(
    structure: Structure, geometry: Geometry, pose: int, motion: Array, moved: Array, size: float
) -> list[str]:
    """Return the parts that a motion strains: a mechanism strains none, however soft they are."""
    robot, labels = structure.robot, structure.unknowns.labels
    reach = max(float(np.abs(moved[:, :3]).max()), size * float(np.abs(moved[:, 3:]).max()))
    amount = np.repeat([reach, reach / size], 3)  # of the motion, as displacement and rotation
    blocks, ends = element_blocks(structure, geometry)[pose], moved[structure.elements]
    energy = np.einsum("eia,eijab,ejb->e", ends, blocks, ends)
    most = np.einsum("a,eijab,b->e", amount, np.abs(blocks), amount)
    parts = [beam.name for beam in robot.beams] + [robot.joints[at].name for at in structure.chords]
    parts += [robot.struts[at].name for at in structure.struts]
    names = [parts[at] for at in np.flatnonzero(energy > STRAINED * most)]
    stiff = structure.spring_values > 0.0
    for spring, joint in zip(structure.springs[stiff], structure.spring_joint[stiff], strict=True):
        direction = labels[spring][1]
        if motion[spring] ** 2 > STRAINED * amount[direction] ** 2:
            names.append(f"{robot.joints[joint].name}.{JOINT_DIRECTIONS[direction]}")
    return list(dict.fromkeys(names))
