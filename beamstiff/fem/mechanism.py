"""Positive definite or a mechanism: found before any answer is given, and named as a motion."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.assembly import element_blocks, gather
from beamstiff.fem.placed_structure import Geometry
from beamstiff.fem.structure import Structure
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.se3 import Array

# what is wrong with a robot
MECHANISM, NEARLY = "is a mechanism", "is so near a mechanism that rounding decides"
BUCKLES, NEARLY_BUCKLES = "buckles under its load", "is so near buckling that rounding decides"
# a motion whose scaled stiffness is below this is free: what is left of its stiffness is rounding
SOFTEST = 1e-13
# a random load moves a motion that soft by more than this share of what it could
PROBED = 0.05
# an answer with no motion softer than this is right to far better than a millionth
FIRM = 1e-9
# a part strained by a motion has more than this share of the energy that motions of that size could give it
STRAINED = 1e-13
# m and rad by which a free motion of one unit of energy moves all nodes less where it moves none: rounding
UNMOVED = 1e-20


def diagonal_scale(matrix: Array) -> Array:
    """Return d with unit diagonal of ``d K d``, (P, n); 1 where the diagonal is not positive."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def solve_firm(
    matrix: Array, right: Array, size: Array, symmetric: bool = True
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the solutions (P, n, c) of ``K x = b``, and where (P,) K is too firm for rounding to show.

    They are zero elsewhere. `size` (P, n) is how large what went into the diagonal is (`assembly.assemble`),
    so that what rounding left of it does not pass for stiffness. Unless K is symmetric, its symmetric part
    decides.
    """
    return _solve(matrix, right, np.maximum(size, np.diagonal(matrix, axis1=-2, axis2=-1)), symmetric, FIRM)


def solve_stable(
    matrix: Array, right: Array, softest: float = SOFTEST
) -> tuple[Array, tuple[int, Array] | None]:
    """Return the solutions (P, n, c) of ``K x = b`` for symmetric K, and where it is not positive definite.

    The latter is the first such pose with its softest motion (n,), or None; the solutions then mean nothing.
    `softest` is the scaled stiffness below which a motion counts as free.
    """
    solution, firm = _solve(matrix, right, np.diagonal(matrix, axis1=-2, axis2=-1), True, softest)
    if firm.all():
        return solution, None
    pose = int(np.argmin(firm))
    scale = diagonal_scale(matrix[pose])
    _, vectors = np.linalg.eigh(scale[:, None] * matrix[pose] * scale)
    return solution, (pose, scale * vectors[:, 0])


def _solve(
    matrix: Array, right: Array, size: Array, symmetric: bool, softest: float
) -> tuple[Array, NDArray[np.bool_]]:
    solution, firm = np.zeros_like(right), np.ones(matrix.shape[0], dtype=np.bool_)
    if matrix.shape[-1] == 0 or matrix.shape[0] == 0:
        return solution, firm
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
        firm = pivots.min(axis=1) >= softest
    except np.linalg.LinAlgError:
        firm = np.linalg.eigvalsh(even)[:, 0] >= softest
    if not firm.any():
        return solution, firm
    # pivots alone miss a soft motion that lies across the unknowns: some loads find it
    loads = scale[:, :, None] * right
    probes = np.broadcast_to(_probes(matrix.shape[-1]), (*matrix.shape[:2], 4))
    both = np.concatenate([loads, probes], axis=2)
    solved = np.linalg.solve(scaled[firm], both[firm]) if not firm.all() else np.linalg.solve(scaled, both)
    moved = np.linalg.norm(solved[:, :, -4:], axis=1).max(axis=1)
    doubtful = np.flatnonzero(moved > PROBED / softest)
    where = np.flatnonzero(firm)
    solution[where] = scale[where, :, None] * solved[:, :, :-4]
    firm[where[doubtful]] = np.linalg.eigvalsh(even[where[doubtful]])[:, 0] >= softest
    return solution, firm


class PoseError(BeamstiffError):
    """What is wrong with a robot at one of several poses.

    `pose`: its number, of all that were asked for. `where`: how the message calls it; may be empty.
    """

    def __init__(self, message: str, pose: int, where: str) -> None:
        super().__init__(message)
        self.pose, self.where = pose, where


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
    structure: Structure, geometry: Geometry, pose: int, motion: Array, what: str = MECHANISM
) -> BeamstiffError:
    """Return the error that names a free motion (n,): the nodes that move, how, and the joints that move.

    `pose` counts within the geometry, `what` says what is wrong with the robot.
    """
    robot = structure.robot
    everywhere = np.zeros((geometry.terms.shape[0], structure.unknowns.count))
    everywhere[pose] = motion
    moved = gather(structure, geometry, everywhere)[pose]
    positions = geometry.posture.node_positions[pose]
    size = max(float(np.ptp(positions, axis=0).max()), 1e-3)
    where = f" at pose {geometry.number[pose]}" if geometry.number[pose] or len(geometry.number) > 1 else ""
    amount = np.linalg.norm(moved[:, :3], axis=1) + size * np.linalg.norm(moved[:, 3:], axis=1)
    if amount.max() < UNMOVED:
        return BeamstiffError(
            f"robot {robot.name!r}{where}: directions that move no node are known to rounding alone: "
            "rigid parts of their loops hold them"
        )
    resisting = _resisting(structure, geometry, pose, motion, moved, size)
    if what in (MECHANISM, NEARLY) and resisting:
        return BeamstiffError(
            f"robot {robot.name!r}: the stiffness of {listed(resisting)} is lost in rounding beside far "
            f"stiffer parts{where}; make those rigid, or this free"
        )
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
    return PoseError(
        f"robot {robot.name!r} {what}{where}: node {nodes[0]!r} {moves} freely{through}; "
        f"moving nodes: {listed(nodes)}",
        int(geometry.number[pose]),
        where,
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
    for at, spring in enumerate(structure.springs):
        joint, direction = labels[spring]
        share = float(structure.spring_values[at] * motion[spring] ** 2)
        if share > 0.0 and abs(motion[spring]) > 1e-8 * amount[direction]:
            shares.append((share, f"{joint}.{JOINT_DIRECTIONS[direction]}"))
    shares.sort(reverse=True)
    return list(dict.fromkeys(name for share, name in shares if share > 0.01 * shares[0][0]))
