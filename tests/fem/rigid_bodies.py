"""A second way to the stiffness of a loaded machine of rigid bodies and springs, sharing no code with it.

Every node is a body with a position and a rotation vector of its own, absolute. What connects two of them is
measured exactly at any displacement, and the equilibrium is differentiated: once by complex step, and again
by central differences. Rigid directions are constraints with Lagrange multipliers (their null space by SVD).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

STEP = 1e-4


def rotation(vector: Array) -> Array:
    """Return exp of rotation vectors (..., 3); good for complex numbers near zero."""
    s = cross_matrix(vector)
    square = (vector * vector).sum(-1)[..., None, None]
    first = 1 - square / 6 + square**2 / 120
    second = 0.5 - square / 24 + square**2 / 720
    return np.eye(3) + first * s + second * (s @ s)


def rotation_vector(matrix: Array) -> Array:
    """Return log of rotations near the identity."""
    twist = 0.5 * np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        axis=-1,
    )
    square = (twist * twist).sum(-1)[..., None]
    return twist * (1 + square / 6 + 3 * square**2 / 40)


def cross_matrix(vector: Array) -> Array:
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


class RigidBodies:
    """Bodies at `points`; see `builders.frame` for the meaning of the parts."""

    def __init__(self, points, fixed=(0,), rigids=(), joints=(), struts=(), masses=(), gravity=(0, 0, -9.81)):
        self.points = np.array(points, dtype=float)
        self.free = np.setdiff1d(np.arange(len(points)), fixed)
        self.rigids, self.joints, self.struts = rigids, joints, struts
        self.masses, self.gravity = masses, np.array(gravity, dtype=float)
        values = [np.full(6, np.inf)] * len(rigids)
        values += [np.array([v[0], v[1], v[1], v[2], v[3], v[3]], dtype=float) for _, _, _, v in joints]
        values += [np.array([value], dtype=float) for _, _, value in struts]
        self.values = np.concatenate(values)

    def strains(self, x: Array) -> Array:
        """Return all relative displacements, (..., e), for displacements (..., 6 times the free nodes)."""
        moved = np.zeros((*x.shape[:-1], len(self.points), 6), dtype=x.dtype)
        moved[..., self.free, :] = x.reshape(*x.shape[:-1], -1, 6)
        p, r = self.points + moved[..., :3], rotation(moved[..., 3:])

        def seen(a: int, b: int) -> tuple[Array, Array]:
            """Return the pose of b as the first node sees it."""
            back = r[..., a, :, :].swapaxes(-1, -2)
            apart = (back @ (p[..., b, :] - p[..., a, :])[..., None])[..., 0]
            return apart, rotation_vector(back @ r[..., b, :, :])

        parts = []
        for a, b in self.rigids:
            apart, turned = seen(a, b)
            parts += [apart - (self.points[b] - self.points[a]), turned]
        for a, b, axis, _ in self.joints:
            basis = axes_along(axis)
            parts += [vector @ basis for vector in seen(a, b)]
        for a, b, _ in self.struts:
            apart = p[..., b, :] - p[..., a, :]
            length = np.sqrt((apart * apart).sum(-1))[..., None]
            parts.append(length - np.linalg.norm(self.points[b] - self.points[a]))
        return np.concatenate(parts, axis=-1)

    def load_gradient(self, x: Array, loads: Array, gravity: bool) -> Array:
        """Return the work of constant wrenches and of the weight per unit of each displacement, (..., x)."""
        vector = x.reshape(*x.shape[:-1], -1, 6)[..., 3:]
        s = cross_matrix(vector)
        to_spin = np.eye(3) + 0.5 * s + s @ s / 6  # derivative of the rotation vector to angular velocity
        wrench = np.broadcast_to(loads[self.free], (*x.shape[:-1], len(self.free), 6)).astype(x.dtype)
        wrench = wrench.copy()
        for node, mass, offset in self.masses if gravity else ():
            at = list(self.free).index(node)
            arm = rotation(vector[..., at, :]) @ np.array(offset, dtype=float)
            wrench[..., at, :3] += mass * self.gravity
            wrench[..., at, 3:] += np.cross(arm, mass * self.gravity)
        moment = (to_spin.swapaxes(-1, -2) @ wrench[..., 3:, None])[..., 0]
        return np.concatenate([wrench[..., :3], moment], axis=-1).reshape(x.shape)

    def displacement(self, loads: Array, gravity: bool = False) -> Array:
        """Return the displacements (N, 6) of the exact equilibrium under wrenches (N, 6) (Newton)."""
        rigid, size = np.isinf(self.values), 6 * len(self.free)
        step, spring = 1e-30 * 1j * np.eye(size), np.where(rigid, 0.0, self.values)
        x, holding = np.zeros(size), np.zeros(int(rigid.sum()))
        for _ in range(30):
            slope = np.imag(self.strains(x + step)) / 1e-30
            strain, load = self.strains(x), self.load_gradient(x, loads, gravity)
            missing = load - slope @ (spring * strain) - slope[:, rigid] @ holding
            matrix = np.block(
                [
                    [(slope * spring) @ slope.T, slope[:, rigid]],
                    [slope[:, rigid].T, np.zeros((holding.size, holding.size))],
                ]
            )
            right = np.concatenate([missing, -strain[rigid]])
            scale = 1 / np.sqrt(np.maximum(np.abs(matrix).max(axis=1), 1e-12))
            solved = scale * np.linalg.lstsq(matrix * scale * scale[:, None], right * scale, rcond=1e-13)[0]
            x, holding = x + solved[:size], holding + solved[size:]
            if np.abs(solved[:size]).max() < 1e-13:
                break
        else:
            raise AssertionError("no equilibrium")
        result = np.zeros((len(self.points), 6))
        result[self.free] = x.reshape(-1, 6)
        return result

    def compliance(self, node: int, loads: Array, gravity: bool = False) -> Array:
        """Return the compliance (6, 6) of a node under wrenches (N, 6) that strain the bodies' springs.

        The unloaded springs are taken to be such that the given geometry is in equilibrium.
        """
        size = 6 * len(self.free)
        rigid = np.isinf(self.values)
        step = 1e-30 * 1j * np.eye(size)

        def slopes(x: Array) -> Array:
            return np.imag(self.strains(x[..., None, :] + step)) / 1e-30  # (..., x, e)

        at = np.zeros(size)
        slope = slopes(at)
        spring = np.where(rigid, 0.0, self.values)
        elastic = (slope * spring) @ slope.T
        _, singular, right = np.linalg.svd(slope[:, rigid].T)
        rank = int((singular > 1e-9).sum())
        allowed = right[rank:].T
        load = self.load_gradient(at, loads, gravity)
        moved = allowed @ np.linalg.solve(allowed.T @ elastic @ allowed, allowed.T @ load)
        stress = spring * (moved @ slope)
        missing = load - elastic @ moved
        stress[rigid] = np.linalg.lstsq(slope[:, rigid], missing, rcond=1e-9)[0]
        shifts = STEP * np.concatenate([np.eye(size), -np.eye(size)])
        pull = slopes(shifts) @ stress  # (2x, x): generalised inner forces at shifted places
        push = self.load_gradient(shifts, loads, gravity)
        change = (pull - push)[:size] - (pull - push)[size:]
        tangent = elastic + change.T / (2 * STEP)
        result = allowed @ np.linalg.solve(allowed.T @ tangent @ allowed, allowed.T)
        start = 6 * list(self.free).index(node)
        return result[start : start + 6, start : start + 6]


def axes_along(axis: Array) -> Array:
    """Return a right-handed basis (columns) whose first vector is along the axis."""
    x = np.array(axis, dtype=float) / np.linalg.norm(axis)
    helper = np.eye(3)[np.argmin(np.abs(x))]
    y = np.cross(helper, x) / np.linalg.norm(np.cross(helper, x))
    return np.stack([x, y, np.cross(x, y)], axis=1)
