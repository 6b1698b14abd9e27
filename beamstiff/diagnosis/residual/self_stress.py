"""Which wrenches statics determines in a place of a machine whose loops hold rigid parts.

With rigid parts the reactions are the multipliers of constraints, known but for the self-stresses: reactions
that hold one another without any load, the null space of the constraints' transpose. A reaction is determined
where no self-stress has a part in it, and that is where the rest of the machine lets its direction move (the
ranges and null spaces of a matrix are orthogonal): it then follows by virtual work.

The springs of a place are determined always: their force follows from how far they are strained. In a loop
some of them move only together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from beamstiff.errors import BeamstiffError
from beamstiff.fem.condensation import Port, port_row
from beamstiff.fem.constraints import (
    RANK_TOLERANCE,
    constraint_rows,
    count_ranks,
    has_constraints,
    unknown_sizes,
)
from beamstiff.fem.placed_structure import Geometry, place
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.model.ports import find_ports, opened
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

Index = NDArray[np.int64]
PART = RANK_TOLERANCE**0.5  # what has less of a unit self-stress has no part in it (its square is rounding)


@dataclass(frozen=True)
class Reach:
    """How the p directions of a place can move where all other rigid parts hold, at P poses.

    `held`, `loose`: int arrays; rigid directions, and springs, that move independently of one another.
    `share`: (P, p, r) array; what each direction moves per unit of those: first `held`, then `loose`.
    `reactions`: (P, R, h) array; least wrench of all rigid directions per unit force on `held` that it
        balances.
    `stressed`: (P, p, p) array or None; projector onto the self-stresses' part in the place, forces in N and
        moments over the machine's size; None where all is determined.
    """

    held: Index
    loose: Index
    share: Array
    reactions: Array
    stressed: Array | None = None


def everywhere(rigid: NDArray[np.bool_]) -> Reach:
    """Return the reach of directions, rigid or not (p,), that all move independently."""
    held, loose = np.flatnonzero(rigid), np.flatnonzero(~rigid)
    return Reach(held, loose, np.eye(rigid.size)[None, :, [*held, *loose]], np.eye(held.size)[None])


def reach_of(
    structure: Structure, geometry: Geometry, ports: Sequence[Port], rigid: NDArray[np.bool_]
) -> Reach:
    """Return how the directions of a place can move.

    `structure`: with all of these directions opened.
    `ports`: the p directions.
    `rigid`: (p,) bool array; those that the machine holds rigid.
    Raises BeamstiffError at a pose where the directions move in other ways than at the first.
    """
    moved, size = _moved(structure, geometry, ports), _sizes(structure, ports)
    held = _independent(moved[0], np.flatnonzero(rigid), np.zeros((0, moved.shape[2])))
    loose = _independent(moved[0], np.flatnonzero(~rigid), moved[0, held])
    own, count = [*held, *loose], held.size
    share = moved @ np.linalg.pinv(moved[:, own])
    share[np.abs(share) < RANK_TOLERANCE] = 0.0
    least = np.linalg.svd(moved[:, own], compute_uv=False).min(axis=1, initial=np.inf)
    beside = np.abs(moved - share @ moved[:, own]).max(axis=(1, 2), initial=0.0)
    across = np.abs(share[:, rigid, count:]).max(axis=(1, 2), initial=0.0)
    odd = (least < RANK_TOLERANCE) | (np.maximum(beside, across) > RANK_TOLERANCE)
    if odd.any():
        raise BeamstiffError(
            f"pose {geometry.number[int(np.argmax(odd))]} is a singular position of its loop, where other "
            "motions are possible: leave it out"
        )
    if len(own) == rigid.size:
        return everywhere(rigid)
    known = share[:, rigid, :count]
    least_wrench = np.linalg.pinv(known).swapaxes(-1, -2)
    stressed = np.zeros((len(moved), rigid.size, rigid.size))
    unknown = np.eye(int(rigid.sum())) - known @ least_wrench.swapaxes(-1, -2)
    stressed[:, rigid[:, None] & rigid] = unknown.reshape(len(moved), -1)
    return Reach(
        held,
        loose,
        share=share * (size[:, None] / size[own]),
        reactions=least_wrench * (size[held] / size[rigid][:, None]),
        stressed=stressed,
    )


def _moved(structure: Structure, geometry: Geometry, ports: Sequence[Port]) -> Array:
    """Return what ports move in unit motions that are possible, (P, p, n), lengths over the machine's size.

    The motions are orthonormal; those that rigid parts hold are zero.
    """
    scale = unknown_sizes(structure)
    motions = np.broadcast_to(np.diag(scale), (geometry.number.size, scale.size, scale.size))
    if has_constraints(structure):
        _, singular, right = np.linalg.svd(constraint_rows(structure, geometry) * scale, full_matrices=True)
        free = np.arange(scale.size) >= count_ranks(singular, scale)[:, None]
        motions = (right * free[:, :, None]).swapaxes(-1, -2) * scale[:, None]
    rows = np.concatenate([port_row(structure, geometry, port) for port in ports], axis=1)
    return rows @ motions / _sizes(structure, ports)[:, None]


def _sizes(structure: Structure, ports: Sequence[Port]) -> Array:
    """Return the machine's size, m, for ports that slide and 1 for those that turn, (p,)."""
    size = structure.kinematics.size
    return np.array([1.0 if port.kind != "strut" and port.direction > 2 else size for port in ports])


def _independent(moved: Array, some: Index, beside: Array) -> Index:
    """Return those of some rows that are independent of one another and of the rows beside."""
    rows = moved[some] - moved[some] @ np.linalg.pinv(beside) @ beside
    if not rows.size:
        return some[:0]
    _, triangle, order = qr(rows.T, mode="economic", pivoting=True)
    count = int((np.abs(np.diagonal(triangle)) > PART).sum())
    return np.sort(some[order[:count]])


def self_stresses(
    robot: Robot, where: Posture, places: Mapping[str, Sequence[tuple[str, int]]]
) -> dict[str, list[str]]:
    """Return which rigid directions of the machine the self-stresses of its places need, at the first pose.

    `places`: by name of the place: joints and their directions 0..5.
    Returns `needed`, dict of str to list of str; by name of the place: stiffness parameters, such as
    ``J12.axial``.
    """
    rigid = [name for name, value in stiffness_parameters(robot).items() if value == RIGID]
    ports, _ = find_ports(robot, rigid)
    structure = compile_structure(opened(robot, rigid))
    moved = _moved(structure, place(structure, where.only(slice(1))), ports)[0]
    stressed = np.eye(len(ports)) - moved @ np.linalg.pinv(moved, rcond=RANK_TOLERANCE)
    at = {
        (robot.joints[port.index].name, port.direction): k
        for k, port in enumerate(ports)
        if port.kind == "joint"
    }
    found = {}
    for name, directions in places.items():
        part = np.abs(stressed[:, [at[one] for one in directions]]).max(axis=1) > PART
        found[name] = list(dict.fromkeys(ports[k].name for k in np.flatnonzero(part)))
    return found
