"""Positive definite or a mechanism: found before any answer is given, and named as a motion."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.assembly import element_blocks, gather
from beamstiff.fem.geometry import Geometry
from beamstiff.fem.structure import Structure
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.se3 import Array

# a motion whose scaled stiffness is below this is free: what is left of its stiffness is rounding
SOFTEST = 1e-13
# by how much rounding may change a deflection under its own load
KNOWN = 1e-6
# a random load moves a motion that soft by more than this share of what it could
PROBED = 0.05
# a part strained by a motion has more than this share of the energy that motions of that size could give it
STRAINED = 1e-13


def diagonal_scale(matrix: Array) -> Array:
    """Return d with unit diagonal of ``d K d``, (P, n); 1 where the diagonal is not positive."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def unstable_pose(matrix: Array, size: Array | None = None) -> tuple[int, Array] | None:
    """Return the first pose whose stiffness is not positive definite, with its softest motion (n,), or None.

    The arguments are those of `solve_stable`.
    """
    return solve_stable(matrix, np.zeros((*matrix.shape[:2], 0)), size)[1]


def solve_stable(
    matrix: Array,
    right: Array,
    size: Array | None = None,
    symmetric: bool = True,
    softest: float = SOFTEST,
) -> tuple[Array, tuple[int, Array] | None]:
    """Return the solutions of ``K x = b``, if the symmetric part of K is positive definite at all poses.

    Parameters
    ----------
    matrix : (P, n, n) array
        Stiffness.
    right : (P, n, c) array
    size : (P, n) array, optional
        How large what went into the diagonal is (`assembly.assemble`), so that what rounding left of it does
        not pass for stiffness; default the diagonal.
    symmetric : bool
        Whether K is symmetric.
    softest : float
        The scaled stiffness below which a motion counts as free.

    Returns
    -------
    solution : (P, n, c) array
        Not to be used if there is an unstable pose.
    unstable : None or (pose, motion)
        The first pose whose stiffness is not positive definite, and its softest motion (n,); or at which a
        load's deflection is rounding, and the deflection.

    Raises
    ------
    BeamstiffError
        When a stiffness is not finite.
    """
    if matrix.shape[-1] == 0 or matrix.shape[0] == 0:
        return np.zeros_like(right), None
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    size = diagonal if size is None else np.maximum(size, diagonal)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = scale[:, :, None] * matrix * scale[:, None, :]
    if not np.isfinite(scaled).all():
        raise BeamstiffError(
            "found a stiffness or compliance that is not a finite number, expected one in the range of "
            "numbers; check the units"
        )
    even = scaled if symmetric else 0.5 * (scaled + scaled.swapaxes(-1, -2))
    try:
        pivots = np.diagonal(np.linalg.cholesky(even), axis1=-2, axis2=-1) ** 2
        bad = pivots.min(axis=1) < softest
    except np.linalg.LinAlgError:
        bad = np.linalg.eigvalsh(even)[:, 0] < softest
    solution = np.zeros_like(right)
    if not bad.any():
        # pivots alone miss a soft motion that lies across the unknowns: some loads find it
        loads = scale[:, :, None] * right
        probes = np.broadcast_to(_probes(matrix.shape[-1]), (*matrix.shape[:2], 4))
        solved = np.linalg.solve(scaled, np.concatenate([loads, probes], axis=2))
        moved = np.linalg.norm(solved[:, :, -4:], axis=1).max(axis=1)
        doubtful = np.flatnonzero(moved > PROBED / softest)
        bad[doubtful] = np.linalg.eigvalsh(even[doubtful])[:, 0] < softest
        solved = solved[:, :, :-4]
        solution = scale[:, :, None] * solved
    if bad.any():
        pose = int(np.argmax(bad))
        _, vectors = np.linalg.eigh(even[pose])
        return solution, (pose, scale[pose] * vectors[:, 0])
    if symmetric and (unknown := _rounded_away(solved, loads)) is not None:
        return solution, (unknown[0], solution[unknown])
    return solution, None


def _rounded_away(solved: Array, right: Array) -> tuple[int, slice, int] | None:
    """Return pose and column of a deflection that rounding of the stiffness changes too much, or None.

    A relative error e_i in ``K_ii = 1`` changes the work ``b x`` by ``e_i x_i^2``.
    """
    work = np.abs(np.einsum("pnc,pnc->pc", solved, right))
    squares = solved * solved
    noise = np.finfo(float).eps * np.sqrt(np.einsum("pnc,pnc->pc", squares, squares))
    found = np.argwhere(noise > KNOWN * work)
    return (int(found[0][0]), slice(None), int(found[0][1])) if found.size else None


@cache
def _probes(count: int) -> NDArray[np.float64]:
    """Return four random loads, the same every time."""
    return np.random.default_rng(0).standard_normal((count, 4))


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
            f"robot {robot.name!r}: the stiffness of {listed(resisting)} is lost beside parts some 1e10 "
            f"times stiffer{where}; make those rigid, or this free"
        )
    amount = np.linalg.norm(moved[:, :3], axis=1) + size * np.linalg.norm(moved[:, 3:], axis=1)
    order = np.argsort(-np.round(amount / amount.max(), 6), kind="stable")
    nodes = [robot.nodes[at].name for at in order if amount[at] > 1e-3 * amount[order[0]]]
    most = moved[order[0]]
    turning = size * np.linalg.norm(most[3:]) > 1.001 * np.linalg.norm(most[:3])
    vector = most[3:] if turning else most[:3]
    vector = vector / np.abs(vector).max()
    vector = vector / vector[np.argmax(np.round(np.abs(vector), 6))]  # one of two opposite ones
    direction = ", ".join(f"{value:.2f}" for value in np.round(vector / np.linalg.norm(vector), 2) + 0.0)
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
    """Return the parts that a motion strains most: a mechanism strains none, however soft they are."""
    robot, labels = structure.robot, structure.unknowns.labels
    reach = max(float(np.abs(moved[:, :3]).max()), size * float(np.abs(moved[:, 3:]).max()))
    amount = np.repeat([reach, reach / size], 3)  # of the motion, as displacement and rotation
    blocks, ends = element_blocks(structure, geometry)[pose], moved[structure.elements]
    energy = np.einsum("eia,eijab,ejb->e", ends, blocks, ends)
    most = np.einsum("a,eijab,b->e", amount, np.abs(blocks), amount)
    parts = [beam.name for beam in robot.beams] + [robot.joints[at].name for at in structure.chords]
    parts += [robot.struts[at].name for at in structure.struts]
    shares = [(float(energy[at]), parts[at]) for at in np.flatnonzero(energy > STRAINED * most)]
    for at, joint in enumerate(structure.spring_joint):
        spring, direction = structure.springs[at], labels[structure.springs[at]][1]
        share = float(structure.spring_values[at] * motion[spring] ** 2)
        if share > 0.0 and abs(motion[spring]) > 1e-8 * amount[direction]:
            shares.append((share, f"{robot.joints[joint].name}.{JOINT_DIRECTIONS[direction]}"))
    shares.sort(reverse=True)
    return list(dict.fromkeys(name for share, name in shares if share > 0.01 * shares[0][0]))
