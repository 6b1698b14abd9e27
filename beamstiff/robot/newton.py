"""Gauss-Newton on the closure equations, at many poses at once.

For many poses that start close to closed, some steps are one straight-line program (`close_at_once`). No step
of it is limited or halved: what comes out counts only where it is beyond doubt, closed to the last digits, in
the branch of the assembly, and near to where it started. The other poses go the general way (`newton`).
"""

from dataclasses import replace
from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.expression_graph.expression import Expression, Recorder
from beamstiff.expression_graph.graph import ExpressionGraph, compile_graph
from beamstiff.robot.branch import Assembly
from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.se3 import Array

TOLERANCE = 1e-12  # machine sizes, rad
LARGEST_STEP = 0.3  # rad
LARGEST_SHIFT = 0.1  # machine sizes
DAMPING = 0.03  # of the gap
CHUNK = 2048  # poses at a time: all stays in the processor's cache

STEPS = 4  # of the program
CLOSED = 1e-14  # machine sizes: a step more would change nothing
CLEAR = 1e-6  # of the determinant of the assembly: nearer to where branches meet they are looked at closely
MOST = 16  # passive variables: of more the steps are not worth writing down

Mask = NDArray[np.bool_]
Entries = NDArray[Any]  # of expressions and numbers


def newton(system: LoopSystem, free: Array, iterations: int = 80) -> tuple[Array, Array, Array, Mask]:
    """Close the loops from where the passive variables are, some poses after another: see `_newton`."""
    if len(free) <= CHUNK:
        return _newton(system, free, iterations)
    pieces = [free[start : start + CHUNK] for start in range(0, len(free), CHUNK)]
    found = [_newton(system, piece, iterations) for piece in pieces]
    joined = (np.concatenate(parts) for parts in zip(*found, strict=True))
    free, gaps, jacobian, closed = joined
    return free, gaps, jacobian, closed


def _newton(system: LoopSystem, free: Array, iterations: int) -> tuple[Array, Array, Array, Mask]:
    """Move the passive variables until the loops close; steps are limited and halved until they help.

    Returns the free variables (P, A + Q), gaps (P, M), their derivative by the passive variables (P, M, Q),
    scaled, and which poses closed (P,).
    """
    first = system.actuated
    scale = system.scale[first:]
    limit = np.where(system.prismatic[first:], LARGEST_SHIFT, LARGEST_STEP)
    free = free.copy()
    gaps, jacobian = loop_equations(system, free)
    jacobian = jacobian[:, :, first:].copy()
    size = np.linalg.norm(gaps, axis=1)
    part = np.ones(len(free))
    earlier = size.copy()
    active = np.flatnonzero(size > 0.0)
    for iteration in range(iterations):
        if not active.size:
            break
        # Levenberg's damping in measure with the gap: a direction that hardly moves the gap must not take up
        # the whole limited step; it fades fast enough to keep the end quadratic
        step = least_squares(jacobian[active], gaps[active], damping=DAMPING * size[active])
        largest = np.abs(step / limit).max(axis=1, initial=0.0)
        step *= (part[active] / np.maximum(1.0, largest))[:, None]
        trial = free[active]
        trial[:, first:] -= step * scale
        trial_gaps, trial_jacobian = loop_equations(system, trial)
        trial_size = np.linalg.norm(trial_gaps, axis=1)
        polished = size[active] < TOLERANCE
        better = trial_size < size[active]
        taken = active[better]
        free[taken], gaps[taken], size[taken] = trial[better], trial_gaps[better], trial_size[better]
        jacobian[taken] = trial_jacobian[better][:, :, first:]
        part[active] = np.where(better, np.minimum(2.0 * part[active], 1.0), 0.5 * part[active])
        going = ~polished & (part[active] > 1e-4)
        if iteration % 5 == 4:  # no way on: a smallest gap has been reached
            going &= (size[active] < 0.9 * earlier[active]) | (size[active] < TOLERANCE)
            earlier[active] = size[active]
        active = active[going]
    return free, gaps, jacobian, size < TOLERANCE


def least_squares(matrix: Array, right: Array, damping: Array | None = None) -> Array:
    """Return x (P, Q) that minimises ``|matrix x - right|^2 + |damping x|^2``, with matrix (P, M, Q).

    Modified Gram-Schmidt of [matrix, right] is as stable as Householder's reflections (Bjorck 1967), and runs
    over all poses at a stretch. A column that depends on those before it gets x = 0.
    """
    a = np.array(matrix.transpose(2, 1, 0), order="C")
    b = np.array(right.T, order="C")
    columns, _, poses = a.shape
    if damping is not None:
        a = np.concatenate([a, np.eye(columns)[:, :, None] * damping], axis=1)
        b = np.concatenate([b, np.zeros((columns, poses))])
    upper, x = np.zeros((columns, columns, poses)), np.zeros((columns, poses))
    largest = np.sqrt((a**2).sum(axis=1).max(axis=0, initial=0.0))
    for k in range(columns):
        length = np.sqrt((a[k] ** 2).sum(axis=0))
        independent = length > 1e-13 * largest
        unit = np.where(independent, a[k] / np.where(independent, length, 1.0), 0.0)
        upper[k, k + 1 :] = (unit * a[k + 1 :]).sum(axis=1)
        upper[k, k] = np.where(independent, length, np.inf)
        a[k + 1 :] -= unit * upper[k, k + 1 :, None]
        x[k] = (unit * b).sum(axis=0)
        b -= unit * x[k]
    for k in reversed(range(columns)):
        x[k] = (x[k] - (upper[k, k + 1 :] * x[k + 1 :]).sum(axis=0)) / upper[k, k]
    return x.T


def close_at_once(system: LoopSystem, assembly: Assembly, start: Array) -> tuple[Array, Mask]:
    """Return postures (P, A + Q) some Newton steps from their start, and which close in the branch (P,)."""
    program = closing_program(system, assembly)
    if program is None:
        return start.copy(), np.zeros(len(start), dtype=np.bool_)
    rows = program.run(start.T)
    free = start.copy()
    free[:, system.actuated :] = rows[:-1].T
    return free, rows[-1] > 0.0


@lru_cache(maxsize=32)
def closing_program(system: LoopSystem, assembly: Assembly) -> ExpressionGraph | None:
    """Return the program: passive variables, and last a number that is positive where they are closed.

    None where the equations of the loops cannot be written down, or are too many.
    """
    if system.program is None or len(system.scale) - system.actuated > MOST:
        return None
    first, plain = system.actuated, replace(system, program=None)
    recorder = Recorder()
    free = recorder.inputs(len(system.scale))

    def equations(at: Entries) -> tuple[Entries, Entries]:
        gaps, jacobian = loop_equations(plain, at[None])
        return gaps[0], jacobian[0][:, first:]

    now = free.copy()
    for _ in range(STEPS):
        gaps, jacobian = equations(now)
        step, determinant = _solved(jacobian.T @ jacobian, jacobian.T @ gaps)
        if not isinstance(determinant, Expression) and determinant == 0.0:
            return None
        now = now.copy()
        now[first:] -= step * system.scale[first:]
    gaps, jacobian = equations(now)
    sure: list[Any] = [CLOSED**2 - (gaps * gaps).sum()]
    for rows, columns in assembly.blocks:
        there = assembly.jacobian[np.ix_(rows, columns)]
        same = _solved(there.T.astype(object) @ jacobian[np.ix_(rows, columns)])[1]
        sure.append(same - CLEAR * float(np.linalg.det(there.T @ there)))
    limit = np.where(system.prismatic, LARGEST_SHIFT, LARGEST_STEP) * system.scale
    sure += list(limit[first:] ** 2 - (now - free)[first:] * (now - free)[first:])
    least = reduce(Expression.least, [item for item in sure if isinstance(item, Expression)])
    return compile_graph(recorder, len(free), [*now[first:], least])


def _solved(matrix: Entries, right: Entries | None = None) -> tuple[Entries, Any]:
    """Return x of ``A x = b`` and the determinant of A, by elimination along the diagonal."""
    left = matrix.astype(object)
    x = np.zeros(len(left), dtype=object) if right is None else right.astype(object)
    determinant: Any = 1.0
    for k in range(len(left)):
        determinant = left[k, k] * determinant
        if not isinstance(determinant, Expression) and determinant == 0.0:
            return x, 0.0
        inverse = 1.0 / left[k, k]
        for i in range(k + 1, len(left)):
            share = left[i, k] * inverse
            left[i, k + 1 :] -= left[k, k + 1 :] * share
            x[i] = x[i] - share * x[k]
    for k in reversed(range(len(left))):
        x[k] = (x[k] - (left[k, k + 1 :] * x[k + 1 :]).sum()) / left[k, k]
    return x, determinant
