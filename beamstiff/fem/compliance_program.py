"""The compliance at the TCP of many poses as one straight-line program, written down once per structure.

What the general way (`condensation`) does pose by pose with matrices is here worked out beforehand for one
structure: its sparsity, the order of elimination, everything that no joint moves. The program says at which
poses its answer is beyond doubt; the others are left to the general way, which also names what is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.fem.assembly import assemble
from beamstiff.fem.constraints import has_constraints
from beamstiff.fem.elimination import eliminate, elimination_order
from beamstiff.fem.geometry import place
from beamstiff.fem.recorded import RecordedStiffness, Symmetric, Unfit
from beamstiff.fem.structure import Structure
from beamstiff.robot.closure import declared_start
from beamstiff.robot.frames import all_values
from beamstiff.robot.kinematics import posture_at
from beamstiff.se3 import Array
from beamstiff.tape.expression import Expression, Recorder
from beamstiff.tape.program import Program, compile_program

LARGEST = 100_000  # products of an elimination that is worth writing down
# a pivot below this share of what went into it leaves doubt: rounding could show in the tenth digit
FIRM = 1e-7
# how much more than at the reference may meet at an unknown in other postures and coordinates
MORE = 4.0


BLOCK = 8192  # poses at a time: what goes between the program and its answer stays small


@dataclass(frozen=True, eq=False)
class ComplianceProgram:
    """From the values of all variables to the compliance at the TCP.

    Attributes
    ----------
    program : Program
        Its outputs: the upper triangle of the compliance by rows, and a number that is positive where the
        answer is beyond doubt.
    """

    program: Program

    def run(self, values: Array, compiled: bool | None = None) -> tuple[Array, NDArray[np.bool_]]:
        """Return the compliance (P, 6, 6) for values (P, V), and where it is beyond doubt (P,)."""
        compliance = np.empty((len(values), 6, 6))
        sure = np.empty(len(values), dtype=np.bool_)
        for start in range(0, len(values), BLOCK):
            some = slice(start, start + BLOCK)
            rows = self.program.run(values[some].T, compiled)
            compliance[some] = rows[_TRIANGLE].transpose(2, 0, 1)
            sure[some] = rows[-1] > 0.0
        return compliance, sure


_TRIANGLE = np.zeros((6, 6), dtype=np.int64)
_TRIANGLE[np.triu_indices(6)] = np.arange(21)
_TRIANGLE = np.maximum(_TRIANGLE, _TRIANGLE.T)


@lru_cache(maxsize=32)
def compliance_program(structure: Structure) -> ComplianceProgram | None:
    """Return the program of a structure, or None where only the general way will do.

    That is so with loops of rigid parts, with large structures, and where something is wrong at all poses.
    """
    if has_constraints(structure) or structure.unknowns.count == 0:
        return None
    try:
        return _written(structure, _sizes(structure))
    except (Unfit, BeamstiffError, ZeroDivisionError):
        return None


def _sizes(structure: Structure) -> Array:
    """Return how large what meets at each unknown may be (n,), from a posture in which the machine closes."""
    kinematics = structure.kinematics
    if kinematics.loops and kinematics.assembly is None:
        raise Unfit
    free = kinematics.assembly.free if kinematics.assembly else declared_start(kinematics)
    where = posture_at(kinematics, all_values(kinematics, free[None]))
    sizes: Array = MORE * assemble(structure, place(structure, where))[1][0]
    return sizes


def _written(structure: Structure, sizes: Array) -> ComplianceProgram:
    recorder, count = Recorder(), structure.unknowns.count
    values = recorder.inputs(len(structure.kinematics.coupling.names))
    recorded = RecordedStiffness(structure, values)
    tcp = structure.kinematics.node_index[structure.robot.tcp]
    frame = int(structure.kinematics.node_frame[tcp])
    # below the stiffness the rows of u = W z: eliminating z leaves -W K^-1 W^T
    matrix: Symmetric = dict(recorded.matrix)
    for unknown, column in recorded.map_of(tcp, frame).items():
        for direction, value in enumerate(column):
            if isinstance(value, Expression) or value != 0.0:
                matrix[unknown, count + direction] = value
    order, products = elimination_order(matrix, range(count))
    if products > LARGEST:
        raise Unfit
    left, pivots = eliminate(matrix, order)
    for at, pivot in pivots.items():
        recorded.must_be_positive(pivot * (1.0 / (FIRM * sizes[at])) - 1.0)
    outputs = _turned(left, recorded.rotation(0, frame), count)
    firm: Expression | float = 1.0
    if recorded.sound:
        firm = reduce(Expression.least, recorded.sound)
    return ComplianceProgram(compile_program(recorder, len(values), [*outputs, firm]))


def _turned(left: Symmetric, rotation: NDArray[np.object_], count: int) -> list[Expression | float]:
    """Return the upper triangle of ``-R left R^T`` by rows, R on displacement and rotation."""

    def entry(i: int, j: int) -> Expression | float:
        return left.get((count + min(i, j), count + max(i, j)), 0.0)

    half = np.empty((6, 6), dtype=object)
    for i in range(6):
        for j in range(6):
            part = 3 * (i // 3)
            half[i, j] = sum((rotation[i % 3, k] * entry(part + k, j) for k in range(3)), 0.0)
    return [
        -sum((half[i, 3 * (j // 3) + k] * rotation[j % 3, k] for k in range(3)), 0.0)
        for i in range(6)
        for j in range(i, 6)
    ]
