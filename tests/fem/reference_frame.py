"""A second way to the same answers, sharing no code and no matrix with the package.

Every node has its six displacements in the base frame (dense). A beam's stiffness comes from its
flexibility as a cantilever, not from the slope-deflection matrix; rigids, rigid directions of joints, rigid
struts and supports are Lagrange multipliers (Felippa, Introduction to Finite Element Methods, ch. 8 and 9).
Rows that depend on others are left out by a pivoted QR; the saddle point system is solved by LU with
refinement in extended precision.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]


@dataclass
class ReferenceFrame:
    """A frame as plain numbers.

    `beams` are (i, j, properties, up) with properties E G A Iy Iz J Ay Az (inf without shear), `joints`
    (i, j, axis, six stiffness values) with inf rigid and 0 free, `struts` (i, j, stiffness).
    """

    points: Array
    fixed: Sequence[int]
    beams: list[tuple[int, int, dict[str, float], Array]] = field(default_factory=list)
    rigids: list[tuple[int, int]] = field(default_factory=list)
    joints: list[tuple[int, int, Array, Array]] = field(default_factory=list)
    struts: list[tuple[int, int, float]] = field(default_factory=list)

    def displacement(self, loads: Array) -> Array:
        """Return the displacement of all nodes (N, 6) under wrenches (N, 6) on them."""
        stiffness, rows = self.system()
        size = stiffness.shape[0]
        # unit diagonal: newtons against newton metres, soft against stiff
        diagonal = np.diag(stiffness)
        scale = 1 / np.sqrt(np.maximum(diagonal, 1e-6 * diagonal.max() or 1.0))
        rows = independent(rows * scale)
        saddle = np.block([[scale[:, None] * stiffness * scale, rows.T], [rows, np.zeros((len(rows),) * 2)]])
        right = np.concatenate([scale * loads.reshape(-1), np.zeros(len(rows))])
        return (scale * refined(saddle, right)[:size]).reshape(-1, 6)

    def softness(self) -> float:
        """Return the smallest scaled stiffness of a motion the constraints allow; 0 is a mechanism."""
        stiffness, rows = self.system()
        basis = linalg.null_space(rows, rcond=1e-10) if len(rows) else np.eye(len(stiffness))
        if basis.shape[1] == 0:
            return 1.0
        reduced = basis.T @ stiffness @ basis
        diagonal = np.diag(reduced)
        largest = np.diag(stiffness).max() or 1.0
        scale = 1 / np.sqrt(np.where(diagonal > 1e-14 * largest, diagonal, largest))
        return float(linalg.eigvalsh(scale[:, None] * reduced * scale)[0])

    def system(self) -> tuple[Array, Array]:
        """Return the stiffness (6N, 6N) of everything elastic, and the rows that must not move."""
        count = len(self.points)
        stiffness, rows = np.zeros((6 * count, 6 * count)), []
        for i, j, properties, up in self.beams:
            self.add(stiffness, i, j, beam_end_stiffness(self.points[j] - self.points[i], up, **properties))
        for i, j in self.rigids:
            rows.append(self.relative(i, j))
        for i, j, axis, values in self.joints:
            turn = np.kron(np.eye(2), any_axes(axis))
            self.add(stiffness, i, j, turn @ np.diag(np.where(np.isinf(values), 0.0, values)) @ turn.T)
            rows.append((turn.T @ self.relative(i, j))[np.isinf(values)])
        for i, j, value in self.struts:
            along = np.zeros(6)
            along[:3] = (self.points[j] - self.points[i]) / np.linalg.norm(self.points[j] - self.points[i])
            apart = np.zeros((6, 6 * count))
            apart[:, 6 * j : 6 * j + 6], apart[:, 6 * i : 6 * i + 6] = np.eye(6), -np.eye(6)
            row = along @ apart
            if np.isinf(value):
                rows.append(row[None])
            else:
                stiffness += value * np.outer(row, row)
        for node in self.fixed:
            rows.append(np.eye(6 * count)[6 * node : 6 * node + 6])
        turning = {node for i, j, *_ in [*self.beams, *self.rigids, *self.joints] for node in (i, j)}
        for node in set(range(count)) - turning - set(self.fixed):
            rows.append(np.eye(6 * count)[6 * node + 3 : 6 * node + 6])
        return stiffness, np.concatenate(rows) if rows else np.zeros((0, 6 * count))

    def relative(self, i: int, j: int) -> Array:
        """Return rows (6, 6N): displacement of j less that of i carried to j as by a rigid body."""
        arm = self.points[j] - self.points[i]
        rows = np.zeros((6, 6 * len(self.points)))
        rows[:, 6 * j : 6 * j + 6] = np.eye(6)
        rows[:, 6 * i : 6 * i + 6] -= np.eye(6)
        for axis in range(3):
            rows[:3, 6 * i + 3 + axis] -= np.cross(np.eye(3)[axis], arm)
        return rows

    def add(self, stiffness: Array, i: int, j: int, end: Array) -> None:
        """Add an element whose end j has this stiffness when i is held."""
        relative = self.relative(i, j)
        stiffness += relative.T @ end @ relative


def properties_of(section: Any, material: Any) -> dict[str, float]:
    """Return what `beams` take of a section and a material."""
    own = {name: getattr(section, name) for name in ("A", "Iy", "Iz", "J")}
    return own | {"E": material.E, "G": material.G, "Ay": section.Ay or np.inf, "Az": section.Az or np.inf}


def flexibility(L: float, **properties: float) -> Array:
    """Return the flexibility (6, 6) of a cantilever's end in its own axes (Gere and Timoshenko)."""
    E, G, A, Iy, Iz, J = (properties[name] for name in ("E", "G", "A", "Iy", "Iz", "J"))
    Ay, Az = (properties.get(name, np.inf) for name in ("Ay", "Az"))
    bent_y, bent_z = L**3 / (3 * E * Iz) + L / (G * Ay), L**3 / (3 * E * Iy) + L / (G * Az)
    result = np.diag([L / (E * A), bent_y, bent_z, L / (G * J), L / (E * Iy), L / (E * Iz)])
    result[1, 5] = result[5, 1] = L**2 / (2 * E * Iz)
    result[2, 4] = result[4, 2] = -(L**2) / (2 * E * Iy)
    return result


def beam_end_stiffness(axis: Array, up: Array, **properties: float) -> Array:
    """Return the stiffness (6, 6) of a beam's far end, the near one clamped: its flexibility inverted."""
    length = float(np.linalg.norm(axis))
    own = flexibility(length, **properties)
    x = axis / length
    y = up - x * (x @ up)  # Gram-Schmidt: in the plane of x and up
    y /= np.linalg.norm(y)
    turn = np.kron(np.eye(2), np.column_stack([x, y, np.cross(x, y)]))
    return turn @ np.linalg.inv(own) @ turn.T


def any_axes(axis: Array) -> Array:
    """Return a rotation whose first column is along the axis."""
    first = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    columns: Array = np.column_stack([first, linalg.null_space(first[None])])
    if np.linalg.det(columns) < 0:
        columns[:, 2] *= -1
    return columns


def independent(rows: Array, tolerance: float = 1e-10) -> Array:
    """Return an orthonormal set of rows that span the given ones."""
    if not len(rows):
        return rows
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0] / size[size > 0, None]
    q, r, _ = linalg.qr(rows.T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    return q[:, : int((diagonal > tolerance * diagonal[0]).sum())].T


def refined(matrix: Array, right: Array) -> Array:
    """Return the solution of a linear system by LU, its residual brought down in extended precision."""
    factors = linalg.lu_factor(matrix)
    exact = matrix.astype(np.longdouble)
    result = linalg.lu_solve(factors, right).astype(np.longdouble)
    for _ in range(4):
        residual = right - exact @ result
        result = result + linalg.lu_solve(factors, residual.astype(np.float64))
    return result.astype(np.float64)
