"""The assembly branch of closed loops: which of the ways to put them together a posture belongs to.

Two branches meet only where the passive variables are undetermined, so the sign of the determinant of
``J_p = d gaps / d passive`` tells them apart. J_p has redundant rows (a planar loop closes out of its plane
by itself), so the determinant is that of ``J_reference^T J_p``, which by Cauchy and Binet has the same sign.
And it is taken block by block of the variables that depend on one another: in one determinant of several
loops, two flips would cancel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.se3 import Array

Block = tuple[NDArray[np.intp], NDArray[np.intp]]
NEAR_SINGULAR = 1e-5  # ratio of the pivots of J_p below which branches are too close to be distinguished
_ZERO = 1e-9


@dataclass(frozen=True, eq=False)
class Assembly:
    """Where the loops close, as the reference of the assembly branch."""

    free: Array  # (A + Q,), rad or m: actuated and passive variables there
    jacobian: Array  # (M, Q): derivative of the gaps by the passive variables there, scaled
    # (rows, columns): parts of the Jacobian that have a branch of their own; none where any branch will do
    blocks: tuple[Block, ...]

    def same_branch(self, jacobian: Array, reference: Array | None = None) -> NDArray[np.bool_]:
        """Return whether Jacobians (P, M, Q) belong to the branch of the reference, (P,).

        `reference` (P, M, Q), instead of the assembly's own, compares with a posture close by.
        """
        return np.asarray((self.signs(jacobian, reference) > 0.0).all(axis=1))

    def signs(self, jacobian: Array, reference: Array | None = None) -> Array:
        """Return the sign of every block of Jacobians (P, M, Q) beside the reference, (P, B)."""
        reference = self.jacobian if reference is None else reference
        signs = np.empty((len(jacobian), len(self.blocks)))
        for at, (rows, columns) in enumerate(self.blocks):
            here = jacobian[:, rows[:, None], columns]
            there = reference[..., rows[:, None], columns]
            signs[:, at] = np.sign(np.linalg.det(np.swapaxes(there, -1, -2) @ here))
        return signs

    def patterns(self, jacobian: Array) -> list[str]:
        """Return the signs of the determinants of the blocks at Jacobians (P, M, Q), such as ``+-``.

        They do not know the reference: where a block has more rows than columns, and so a column space that
        stays (planar loops), the rows are chosen by that space.
        """
        signs = [
            np.linalg.det(jacobian[:, _leading_rows(self.jacobian, rows, columns)[:, None], columns]) > 0.0
            for rows, columns in self.blocks
        ]
        return ["".join("+" if sign[pose] else "-" for sign in signs) for pose in range(len(jacobian))]


def _leading_rows(jacobian: Array, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return as many rows as columns, each the first that adds at least half of what any other would."""
    if len(rows) == len(columns):
        return rows
    left = np.linalg.qr(jacobian[np.ix_(rows, columns)])[0]
    chosen = []
    for _ in columns:
        lengths = np.linalg.norm(left, axis=1)
        chosen.append(int(np.argmax(lengths > 0.5 * lengths.max())))
        unit = left[chosen[-1]] / lengths[chosen[-1]]
        left = left - np.outer(left @ unit, unit)
    leading: NDArray[np.intp] = rows[np.sort(chosen)]
    return leading


def near_singular(jacobian: Array) -> NDArray[np.bool_]:
    """Return where J_p (P, M, Q) is so close to singular that branches meet, (P,)."""
    s = np.linalg.svd(jacobian, compute_uv=False)
    if not s.shape[1]:
        return np.zeros(len(jacobian), dtype=np.bool_)
    return np.asarray(s[:, -1] < NEAR_SINGULAR * s[:, 0])


def margin(jacobian: Array) -> Array:
    """Return how far J_p (P, M, Q) is from singular, (P,): its least singular value, of unit columns."""
    length = np.linalg.norm(jacobian, axis=1, keepdims=True)
    unit = jacobian / np.where(length > 0.0, length, 1.0)
    return np.asarray(np.linalg.svd(unit, compute_uv=False).min(axis=1, initial=1.0))


def assembly_at(system: LoopSystem, free: Array) -> Assembly | None:
    """Return the assembly at a closed posture (A + Q,), or None where passive variables are undetermined."""
    jacobian = loop_equations(system, free[None])[1][0, :, system.actuated :]
    if near_singular(jacobian[None]).any():
        return None
    return Assembly(free=free, jacobian=jacobian, blocks=_blocks(system, free, jacobian))


def scattered(system: LoopSystem, free: Array) -> Array:
    """Return eight open postures (8, A + Q) around one (A + Q,): what holds at all of them holds always."""
    return free + 0.1 * system.scale * np.random.default_rng(0).standard_normal((8, len(free)))


def _blocks(system: LoopSystem, free: Array, jacobian: Array) -> tuple[Block, ...]:
    """Split J_p into its irreducible diagonal blocks (Dulmage and Mendelsohn)."""
    passive = jacobian.shape[1]
    # away from the closed posture, so that no entry is zero by its symmetry alone
    around = loop_equations(system, scattered(system, free))[1][:, :, system.actuated :]
    pattern = np.abs(around).max(axis=0) > _ZERO
    independent = np.sort(qr(jacobian.T, mode="r", pivoting=True)[1][:passive])
    chosen = pattern[independent]
    row_of = maximum_bipartite_matching(csr_array(chosen), perm_type="row")
    if (row_of < 0).any():  # cannot be: the rows are independent
        return ((np.arange(len(jacobian)), np.arange(passive)),)
    # variable j needs variable i when the row that determines j holds i
    needs = chosen[row_of].copy()
    loop_of = np.concatenate([np.full(part.stop - part.start, at) for at, part in enumerate(system.rows)])
    redundant = [
        at for at in range(len(system.rows)) if (loop_of == at).sum() > (loop_of[independent] == at).sum()
    ]
    for at in redundant:  # which of its rows is redundant changes with the posture: keep it whole
        columns = np.flatnonzero(loop_of[independent][row_of] == at)
        needs[np.ix_(columns, columns)] = True
    count, block_of = connected_components(csr_array(needs), directed=True, connection="strong")
    blocks: list[Block] = []
    for block in range(count):
        columns = np.flatnonzero(block_of == block)
        rows: NDArray[np.intp] = independent[row_of[columns]].astype(np.intp)
        whole = [at for at in redundant if (loop_of[rows] == at).any()]
        rows = np.union1d(rows, np.flatnonzero(np.isin(loop_of, whole))).astype(np.intp)
        blocks.append((rows, columns))
    return tuple(sorted(blocks, key=lambda block: int(block[1][0])))
