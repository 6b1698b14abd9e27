"""The condensation of many poses as one straight-line program, written down once per structure.

What the general way (`condensation`) does pose by pose with matrices is here worked out beforehand for one
structure: its sparsity, the order of elimination, everything that no joint moves. The program says at which
poses its answer is beyond doubt; the others are left to the general way, which also names what is wrong.

Below the stiffness stand the rows of the observed nodes, ``u = W z``, and of the dead weight. Eliminating all
unknowns but the ports leaves everything that is asked for in one symmetric matrix::

    [K  W^T  f]        [  S                                ]
    [W   0   0]   ->   [  B^T    -C_clamped                ]
    [f^T 0   0]        [  g^T    -d_clamped^T     (unused) ]

The order of elimination is that of minimum degree: the unknown with the fewest neighbours goes first, so that
a chain folds up from its ends and branches meet where they join.
"""

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.expression_graph.expression import Expression, Recorder
from beamstiff.expression_graph.graph import ExpressionGraph, compile_graph
from beamstiff.fem.assembly import assemble
from beamstiff.fem.constraints import has_constraints
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import Structure
from beamstiff.fem.symbolic_stiffness import RecordedStiffness, Symmetric, Unfit
from beamstiff.robot.closure import declared_start
from beamstiff.robot.frames import all_values
from beamstiff.robot.kinematics import posture_at
from beamstiff.se3 import Array

LARGEST = 100_000  # products of an elimination that is worth writing down
MOST_UNKNOWNS = 500
# a pivot below this share of what went into it leaves doubt: rounding could show in the tenth digit
FIRM = 1e-7
# how much more than at the reference may meet at an unknown in other postures and coordinates
MORE = 4.0
BLOCK = 4096  # poses at a time: what goes between the program and its answer stays small

Index = NDArray[np.int64]
Value = Expression | float


@dataclass(frozen=True, eq=False)
class CondensationProgram:
    """From the values of all variables to the structure as seen from its ports and observed nodes."""

    # its outputs are what the arrays below refer to, and last a number that is positive where they are beyond
    # doubt
    program: ExpressionGraph
    # which output each entry is, of S (p, p), B (p, o), C_clamped (o, o), g (p,) and d_clamped (o,); the last
    # two are all -1 without the dead weight
    parts: tuple[Index, ...]
    port_size: Array  # (p,): how large what meets at the ports is

    def run(self, values: Array, compiled: bool | None = None) -> tuple[list[Array], NDArray[np.bool_]]:
        """Return the five parts, (P, ...), for values (P, V), and where they are beyond doubt (P,)."""
        result = [np.zeros((len(values), *part.shape)) for part in self.parts]
        sure = np.empty(len(values), dtype=np.bool_)
        for start in range(0, len(values), BLOCK):
            some = slice(start, start + BLOCK)
            rows = self.program.run(values[some].T, compiled)
            for whole, part in zip(result, self.parts, strict=True):
                if part.size and part.flat[0] >= 0:  # outputs in a row
                    found = rows[part.flat[0] : part.flat[0] + part.size].reshape(*part.shape, -1)
                    whole[some] = np.moveaxis(found, -1, 0)
            sure[some] = rows[-1] > 0.0
        return result, sure


@lru_cache(maxsize=32)
def condensation_program(
    structure: Structure, observed: tuple[int, ...], ports: tuple[int, ...], dead: bool
) -> CondensationProgram | None:
    """Return the program of a structure for observed nodes and ports (unknowns), their springs left out.

    None where only the general way will do: with loops of rigid parts, with large structures, and where
    something is wrong at all poses. `dead` says whether the dead weight is wanted.
    """
    if has_constraints(structure) or not 0 < structure.unknowns.count <= MOST_UNKNOWNS:
        return None
    if (structure.joint_normal >= 0).any():  # which it takes for their own axes
        return None
    try:
        return _written(structure, observed, ports, dead)
    except (Unfit, BeamstiffError, ZeroDivisionError):
        return None


def _sizes(structure: Structure) -> Array:
    """Return how large what meets at each unknown is (n,), in a posture in which the machine closes."""
    kinematics = structure.kinematics
    if kinematics.loops and kinematics.assembly is None:
        raise Unfit
    free = kinematics.assembly.free if kinematics.assembly else declared_start(kinematics)
    where = posture_at(kinematics, all_values(kinematics, free[None]))
    return np.asarray(assemble(structure, place(structure, where))[1][0])


def _written(
    structure: Structure, observed: tuple[int, ...], ports: tuple[int, ...], dead: bool
) -> CondensationProgram:
    recorder, count, sizes = Recorder(), structure.unknowns.count, _sizes(structure)
    values = recorder.inputs(len(structure.kinematics.coupling.names))
    recorded = RecordedStiffness(structure, values, frozenset(ports))
    frames = [int(structure.kinematics.node_frame[node]) for node in observed]
    matrix: Symmetric = dict(recorded.matrix)
    seen = [recorded.map_of(node, frame) for node, frame in zip(observed, frames, strict=True)]
    for row, columns in enumerate(seen):
        for unknown, column in columns.items():
            for direction, value in enumerate(column):
                if isinstance(value, Expression) or value != 0.0:
                    matrix[unknown, count + 6 * row + direction] = value
    last = count + 6 * len(observed)
    for unknown, value in (recorded.dead_loads() if dead else {}).items():
        matrix[unknown, last] = value
    order, products = elimination_order(matrix, sorted(set(range(count)) - set(ports)))
    if products > LARGEST:
        raise Unfit
    left, pivots = eliminate(matrix, order)
    for at, pivot in pivots.items():
        recorded.must_be_positive(pivot * (1.0 / (FIRM * MORE * sizes[at])) - 1.0)
    rotations = [recorded.rotation(0, frame) for frame in frames]
    made = _in_base(left, list(ports), count, rotations, dead)
    firm: Value = 1.0
    if recorded.sound:
        firm = reduce(Expression.least, recorded.sound)
    outputs: list[Value] = []
    parts: list[Index] = []
    for part in made:
        parts.append(np.arange(part.size, dtype=np.int64).reshape(part.shape) + len(outputs))
        outputs += list(part.flat)
    p, o = len(ports), 6 * len(observed)
    if not dead:
        parts += [np.full((count,), -1, dtype=np.int64) for count in (p, o)]
    program = compile_graph(recorder, len(values), [*outputs, firm])
    return CondensationProgram(program, tuple(parts), sizes[list(ports)])


def _in_base(
    left: Symmetric, ports: list[int], count: int, rotations: list[NDArray[Any]], dead: bool
) -> list[NDArray[Any]]:
    """Return S, B, C_clamped (and g, d_clamped) with the observed nodes in the base frame."""
    places = [*ports, *range(count, count + 6 * len(rotations)), count + 6 * len(rotations)]
    p, o = len(ports), 6 * len(rotations)
    whole = np.empty((p + o + 1, p + o + 1), dtype=object)
    for i, row in enumerate(places):
        for j, column in enumerate(places[: i + 1]):
            whole[i, j] = whole[j, i] = left.get((min(row, column), max(row, column)), 0.0)
    for number, rotation in enumerate(rotations):
        for half in (0, 3):
            some = slice(p + 6 * number + half, p + 6 * number + half + 3)
            whole[some] = _turned(rotation, whole[some])
    for number, rotation in enumerate(rotations):
        for half in (0, 3):
            some = slice(p + 6 * number + half, p + 6 * number + half + 3)
            whole[:, some] = _turned(rotation, whole[:, some].T).T
    lower = np.tril_indices(p + o, -1)
    whole[lower] = whole.T[lower]  # one half is enough
    seen = slice(p, p + o)
    parts = [whole[:p, :p], whole[:p, seen], -whole[seen, seen]]
    return [*parts, whole[:p, -1], -whole[seen, -1]] if dead else parts


def _turned(rotation: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    """Return ``R rows`` for expressions (3, c)."""
    result = np.empty(rows.shape, dtype=object)
    for i in range(3):
        for j in range(rows.shape[1]):
            result[i, j] = sum((rotation[i, k] * rows[k, j] for k in range(3)), 0.0)
    return result


def neighbours(matrix: Symmetric) -> dict[int, set[int]]:
    """Return which rows each row meets."""
    found: dict[int, set[int]] = {}
    for row, column in matrix:
        found.setdefault(row, set()).add(column)
        found.setdefault(column, set()).add(row)
    for row, others in found.items():
        others.discard(row)
    return found


def elimination_order(matrix: Symmetric, rest: Collection[int]) -> tuple[list[int], int]:
    """Return the order in which to eliminate some rows, and how many products that takes."""
    meets = {row: set(others) for row, others in neighbours(matrix).items()}
    left = dict.fromkeys(sorted(rest))
    order, products = [], 0
    while left:
        row = min(left, key=lambda at: len(meets.get(at, ())))
        del left[row]
        others = meets.pop(row, set())
        for other in others:
            meets[other] |= others
            meets[other] -= {other, row}
        order.append(row)
        products += len(others) * (len(others) + 1) // 2
    return order, products


def eliminate(matrix: Symmetric, order: list[int]) -> tuple[Symmetric, dict[int, Value]]:
    """Return what is left after eliminating rows, and the pivots; a pivot of 0 is a ZeroDivisionError."""
    left, meets = dict(matrix), neighbours(matrix)
    pivots: dict[int, Value] = {}
    for row in order:
        pivot = left.pop((row, row), 0.0)
        others = sorted(meets.pop(row, set()))
        pivots[row] = pivot
        along: dict[int, Any] = {at: left.pop((min(at, row), max(at, row))) for at in others}
        if not isinstance(pivot, Expression) and pivot == 0.0:
            raise ZeroDivisionError
        inverse: Any = 1.0 / pivot
        for number, i in enumerate(others):
            share = along[i] * inverse
            for j in others[number:]:
                left[i, j] = left.get((i, j), 0.0) - share * along[j]
            meets[i].discard(row)
            meets[i].update(at for at in others if at != i)
    return left, pivots
