"""Positive definite or a mechanism: found from scaled pivots before any solve, and named as a motion."""

from __future__ import annotations

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.assembly import gather
from beamstiff.fem.geometry import Geometry
from beamstiff.fem.structure import Structure
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.se3 import Array

# a pivot of the unit-diagonal matrix below this is rounding, not stiffness
PIVOT_TOLERANCE = 1e-12


def diagonal_scale(matrix: Array) -> Array:
    """Return d with unit diagonal of ``d K d``, (P, n); 1 where the diagonal is not positive."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def unstable_pose(matrix: Array) -> tuple[int, Array] | None:
    """Return the first pose whose stiffness is not positive definite, with its softest motion.

    Parameters
    ----------
    matrix : (P, n, n) array
        Symmetric stiffness.

    Returns
    -------
    None, or (pose, motion) with motion an (n,) array
    """
    if matrix.shape[-1] == 0 or matrix.shape[0] == 0:
        return None
    scale = diagonal_scale(matrix)
    scaled = scale[:, :, None] * matrix * scale[:, None, :]
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
    robot, unknowns = structure.robot, structure.unknowns
    everywhere = np.zeros((geometry.terms.shape[0], unknowns.count))
    everywhere[pose] = motion
    moved = gather(structure, geometry, everywhere)[pose]
    positions = geometry.posture.node_positions[pose]
    size = max(float(np.ptp(positions, axis=0).max()), 1e-3)
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
    single = geometry.first == 0 and geometry.terms.shape[0] == 1
    where = "" if single else f" at pose {geometry.first + pose}"
    return BeamstiffError(
        f"robot {robot.name!r} {what}{where}: node {nodes[0]!r} {moves} freely{through}; "
        f"moving nodes: {listed(nodes)}"
    )
