"""Some Newton steps towards closed loops as one straight-line program, for many poses that start close by.

No step is limited or halved: what comes out counts only where it is beyond doubt, closed to the last digits,
in the branch of the assembly, and near to where it started. The other poses go the general way (`newton`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.expression_graph.expression import Expression, Recorder
from beamstiff.expression_graph.graph import ExpressionGraph, compile_graph
from beamstiff.robot.branch import Assembly
from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.robot.newton import LARGEST_SHIFT, LARGEST_STEP, Mask
from beamstiff.se3 import Array

STEPS = 4
CLOSED = 1e-14  # machine sizes: a step more would change nothing
CLEAR = 1e-6  # of the determinant of the assembly: nearer to where branches meet they are looked at closely
MOST = 16  # passive variables: of more the steps are not worth writing down

Entries = NDArray[Any]  # of expressions and numbers


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
