"""Ports that rigid parts let move only together: springs in parallel, perhaps at unlike lever arms.

With the displacements e of all ports a fixed share E of those of some independent ones, ``e = E y``, springs
Phi at the ports are ``E^T Phi E`` at the independent ones. Derivatives by them: `model.port_derivatives`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.condensation import Port, port_row, port_unknowns
from beamstiff.fem.constraints import (
    RANK_TOLERANCE,
    constraint_rows,
    has_constraints,
    null_space,
    unknown_sizes,
)
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import Structure
from beamstiff.robot.kinematics import Posture
from beamstiff.se3 import Array

SAME_SHARE = 1e-9  # relative difference of shares from pose to pose that is rounding


def independent_ports(
    structure: Structure, posture: Posture, ports: Sequence[Port]
) -> tuple[NDArray[np.int64], Array]:
    """Return which ports move by themselves (r,), and what all p ports move per unit of these, (p, r)."""
    everything = np.arange(len(ports)), np.eye(len(ports))
    if -1 not in port_unknowns(structure, ports) and not has_constraints(structure):
        return everything

    def found(some: Posture) -> tuple[NDArray[np.int64], Array]:
        geometry, scale = place(structure, some), unknown_sizes(structure)
        poses = geometry.number.size
        rows = np.concatenate([port_row(structure, geometry, port) for port in ports], axis=1)
        basis = np.broadcast_to(np.diag(scale), (poses, scale.size, scale.size))
        if has_constraints(structure):
            basis = null_space(constraint_rows(structure, geometry), scale, f"robot {structure.robot.name!r}")
        return shares(rows, basis)

    first = posture.only(slice(1))
    if found(first)[0].size == len(ports):
        return everything
    independent, share = found(posture)
    change = np.abs(share - share[0]).max(axis=(0, 2)) > SAME_SHARE * np.abs(share[0]).max(axis=1)
    if change.any():
        names = [port.name for port, odd in zip(ports, change, strict=True) if odd]
        raise BeamstiffError(
            f"the directions {listed(dict.fromkeys(names))} cannot move without others, by shares that "
            "change from pose to pose: leave them out, or fewer of their loop open"
        )
    return independent, share[0]


def shares(rows: Array, basis: Array) -> tuple[NDArray[np.int64], Array]:
    """Return which rows (P, p, n) can move by themselves (r,), and what all do when those move (P, p, r).

    ``rows @ z = share @ (rows[independent] @ z)`` for every z in the span of the basis (P, n, g). The same
    rows at all poses; r is the rank at the first.
    """
    inside = rows @ basis
    size = np.maximum(np.linalg.norm(inside, axis=2, keepdims=True), np.finfo(float).tiny)
    unit = inside / size
    _, triangle, order = qr(unit[0].T, mode="economic", pivoting=True)
    left = np.abs(np.diagonal(triangle))
    independent = np.sort(order[: int((left > RANK_TOLERANCE**0.5).sum())]).astype(np.int64)
    share: Array = unit @ np.linalg.pinv(unit[:, independent]) * size / size[:, independent].swapaxes(-1, -2)
    return independent, share
