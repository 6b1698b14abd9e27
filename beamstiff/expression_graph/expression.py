"""Arithmetic that is written down instead of done: expressions of inputs, recorded as they are built.

Put into numpy arrays of objects they go through the same formulas as numbers do, and the record is what those
formulas come to for one robot: zeros and ones of its geometry fold away, what occurs twice is done once.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Op(IntEnum):
    """Instructions; x, y, z are operands, c a constant."""

    INPUT = 0
    ADD = 1  # x + y
    SUB = 2  # x - y
    MUL = 3  # x y
    DIV = 4  # x / y
    MIN = 5  # the smaller of x and y; NaN if one is
    ADD_CONSTANT = 6  # x + c
    MUL_CONSTANT = 7  # c x
    DIV_CONSTANT = 8  # c / x
    SQRT = 9
    COS = 10
    SIN = 11
    MUL_ADD = 12  # z + x y
    MUL_SUB = 13  # z - x y
    SUB_FROM_MUL = 14  # x y - z


COMMUTATIVE = (Op.ADD, Op.MUL, Op.MIN)


class Recorder:
    """The record: each step once, by its instruction, operands and constant."""

    def __init__(self) -> None:
        self.steps: list[tuple[Op, int, int, float]] = []
        self._known: dict[tuple[Op, int, int, float], int] = {}

    def input(self) -> Expression:
        """Return a new input."""
        self.steps.append((Op.INPUT, -1, -1, float(len(self.steps))))
        return Expression(self, len(self.steps) - 1)

    def inputs(self, count: int) -> NDArray[Any]:
        """Return new inputs as an array of objects (count,)."""
        row = np.empty(count, dtype=object)
        row[:] = [self.input() for _ in range(count)]
        return row

    def step(self, op: Op, x: int, y: int = -1, constant: float = 0.0) -> int:
        """Return the number of a step, recorded only once."""
        if x > y >= 0 and op in COMMUTATIVE:
            x, y = y, x
        key = (op, x, y, constant)
        if (at := self._known.get(key)) is not None:
            return at
        self.steps.append(key)
        self._known[key] = len(self.steps) - 1
        return len(self.steps) - 1


class Expression:
    """A recorded number, or its negative: signs go along with the operands and cost no step."""

    __slots__ = ("at", "negative", "recorder")

    def __init__(self, recorder: Recorder, at: int, negative: bool = False) -> None:
        self.recorder, self.at, self.negative = recorder, at, negative

    def _new(self, op: Op, x: int, y: int = -1, constant: float = 0.0, negative: bool = False) -> Expression:
        return Expression(self.recorder, self.recorder.step(op, x, y, constant), negative)

    def __neg__(self) -> Expression:
        return Expression(self.recorder, self.at, not self.negative)

    def __pos__(self) -> Expression:
        return self

    def __add__(self, other: Expression | float) -> Expression | float:
        if not isinstance(other, Expression):
            value = float(other)
            if value == 0.0:
                return self
            return self._new(Op.ADD_CONSTANT, self.at, -1, -value if self.negative else value, self.negative)
        if self.negative == other.negative:
            return self._new(Op.ADD, self.at, other.at, negative=self.negative)
        plus, minus = (other, self) if self.negative else (self, other)
        return 0.0 if plus.at == minus.at else self._new(Op.SUB, plus.at, minus.at)

    __radd__ = __add__

    def __sub__(self, other: Expression | float) -> Expression | float:
        return self + (-other)

    def __rsub__(self, other: float) -> Expression | float:
        return -self + other

    def __mul__(self, other: Expression | float) -> Expression | float:
        if not isinstance(other, Expression):
            value = float(other)
            negative = self.negative != (value < 0.0)
            if value == 0.0:
                return 0.0
            if abs(value) == 1.0:
                return Expression(self.recorder, self.at, negative)
            return self._new(Op.MUL_CONSTANT, self.at, -1, abs(value), negative)
        return self._new(Op.MUL, self.at, other.at, negative=self.negative != other.negative)

    __rmul__ = __mul__

    def __truediv__(self, other: Expression | float) -> Expression | float:
        if not isinstance(other, Expression):
            return self * (1.0 / float(other))
        return self._new(Op.DIV, self.at, other.at, negative=self.negative != other.negative)

    def __rtruediv__(self, other: float) -> Expression | float:
        value = float(other)
        if value == 0.0:
            return 0.0
        return self._new(Op.DIV_CONSTANT, self.at, -1, abs(value), self.negative != (value < 0.0))

    # numpy's ufuncs call these on arrays of objects
    def sqrt(self) -> Expression:
        """Return the square root."""
        return self._new(Op.SQRT, self._plain())

    def cos(self) -> Expression:
        """Return the cosine."""
        return self._new(Op.COS, self.at)

    def sin(self) -> Expression:
        """Return the sine."""
        return self._new(Op.SIN, self.at, negative=self.negative)

    def least(self, other: Expression) -> Expression:
        """Return the smaller of two."""
        return self._new(Op.MIN, self._plain(), other._plain())

    def _plain(self) -> int:
        """Return the step of this number without a sign beside it."""
        return self.recorder.step(Op.MUL_CONSTANT, self.at, -1, -1.0) if self.negative else self.at


def square_root(x: Expression | float) -> Expression | float:
    """Return the square root of a number or an expression."""
    return x.sqrt() if isinstance(x, Expression) else math.sqrt(x)
