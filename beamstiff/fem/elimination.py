"""Elimination of unknowns from a sparse symmetric matrix of expressions, in the order of the graph.

The order is that of minimum degree: the unknown with the fewest neighbours goes first, so that a chain folds
up from its ends and branches meet where they join. It is found once, and holds for all poses.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from beamstiff.expression_graph.expression import Expression
from beamstiff.fem.recorded import Symmetric

Value = Expression | float


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
    """Return what is left of a matrix after eliminating rows, and the pivots: ``A_kk - A_kr A_rr^-1 A_rk``.

    Raises ZeroDivisionError when a pivot is the number zero.
    """
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
