"""Programs: the steps that some outputs need, in order, with a place for each result, run over many poses.

The poses lie along the last axis, so that a step is one operation on a stretch of numbers that stays in the
processor's cache. With numba installed (extra `fast`) the same steps run compiled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.expression_graph.compiled import kernel
from beamstiff.expression_graph.expression import Expression, Op, Recorder
from beamstiff.se3 import Array

MANY = 256  # poses: for fewer it is not worth writing a program
WIDTH = 1024  # poses at a time: a step takes longer than its call

Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ExpressionGraph:
    """Steps from inputs to outputs."""

    # inputs, places: the first `inputs` of the `places` for numbers are the inputs
    inputs: int
    places: int
    steps: Index  # (M, 5): instruction, place of the result, places of the operands x, y, z
    constants: Array  # (M,)
    outputs: Index  # (O,): place of each output; -1 where it is the number in `offsets`
    # factors, offsets, (O,): each output is ``factor * place + offset``
    factors: Array
    offsets: Array

    def run(self, values: Array, compiled: bool | None = None) -> Array:
        """Return the outputs (O, P) for inputs (I, P); `compiled` by numba, default where it is installed."""
        values = np.ascontiguousarray(values, dtype=np.float64)
        result = np.empty((len(self.outputs), values.shape[1]))
        run = kernel() if compiled is None or compiled else None
        if run is None:
            self._interpret(values, result)
        else:
            run(
                self.steps,
                self.constants,
                self.outputs,
                self.factors,
                self.offsets,
                self.places,
                values,
                result,
            )
        return result

    def _interpret(self, values: Array, result: Array) -> None:
        poses = values.shape[1]
        rows = np.zeros((self.places + 1, min(WIDTH, max(poses, 1))))
        calls = self._calls(list(rows))
        fixed = self.outputs < 0
        with np.errstate(all="ignore"):  # what is no number shows in the outputs
            for start in range(0, poses, WIDTH):
                some = values[:, start : start + WIDTH]
                count = some.shape[1]
                rows[: self.inputs, :count] = some
                for function, operands in calls:
                    function(*operands)
                stop = start + count
                for at, place in enumerate(self.outputs):
                    np.multiply(rows[place, :count], self.factors[at], out=result[at, start:stop])
        result[fixed] = self.offsets[fixed, None]

    def _calls(self, rows: list[Array]) -> list[tuple[Any, tuple[Any, ...]]]:
        """Return the steps as calls of numpy's functions on the rows; the last row is for products."""
        spare = rows[-1]
        calls: list[tuple[Any, tuple[Any, ...]]] = []
        two = {Op.ADD: np.add, Op.SUB: np.subtract, Op.MUL: np.multiply, Op.DIV: np.divide}
        one = {Op.SQRT: np.sqrt, Op.COS: np.cos, Op.SIN: np.sin}
        for (code, result, x, y, z), constant in zip(self.steps.tolist(), self.constants, strict=True):
            op, out = Op(code), rows[result]
            if op in two:
                calls.append((two[op], (rows[x], rows[y], out)))
            elif op in one:
                calls.append((one[op], (rows[x], out)))
            elif op is Op.MIN:  # takes no `out` by position
                calls.append((partial(np.minimum, rows[x], rows[y], out=out), ()))
            elif op is Op.ADD_CONSTANT:
                calls.append((np.add, (rows[x], np.array(constant), out)))
            elif op is Op.MUL_CONSTANT:
                calls.append((np.multiply, (rows[x], np.array(constant), out)))
            elif op is Op.DIV_CONSTANT:
                calls.append((np.divide, (np.array(constant), rows[x], out)))
            else:
                calls.append((np.multiply, (rows[x], rows[y], spare)))
                last = {
                    Op.MUL_ADD: (np.add, (rows[z], spare, out)),
                    Op.MUL_SUB: (np.subtract, (rows[z], spare, out)),
                    Op.SUB_FROM_MUL: (np.subtract, (spare, rows[z], out)),
                }
                calls.append(last[op])
        return calls


def compile_graph(recorder: Recorder, inputs: int, outputs: Sequence[Expression | float]) -> ExpressionGraph:
    """Return the program that makes the outputs of a record, whose first steps are so many inputs."""
    needed = _needed(recorder, [item.at for item in outputs if isinstance(item, Expression)])
    uses = np.zeros(len(recorder.steps), dtype=np.int64)
    for at in needed:
        for operand in recorder.steps[at][1:3]:
            if operand >= 0:
                uses[operand] += 1
    kept = {item.at for item in outputs if isinstance(item, Expression)}
    fused: dict[int, tuple[Op, int, int, int]] = {}
    absorbed: set[int] = set()
    for at in needed:
        op, x, y, _ = recorder.steps[at]
        if op not in (Op.ADD, Op.SUB):
            continue
        for product, other in ((y, x), (x, y)):
            if recorder.steps[product][0] is Op.MUL and uses[product] == 1 and product not in kept:
                if product == other:
                    continue
                code = Op.MUL_ADD if op is Op.ADD else Op.MUL_SUB if product == y else Op.SUB_FROM_MUL
                fused[at] = (code, *recorder.steps[product][1:3], other)
                absorbed.add(product)
                break
    order = [at for at in needed if at not in absorbed and recorder.steps[at][0] is not Op.INPUT]
    rows = []
    for at in order:
        op, x, y, _ = recorder.steps[at]
        rows.append((at, *fused.get(at, (op, x, y, -1))))
    steps, places = _placed(rows, inputs, kept)
    where = {row[0]: int(step[1]) for row, step in zip(rows, steps, strict=True)}
    where |= {at: at for at in range(inputs)}
    made = [item if isinstance(item, Expression) else None for item in outputs]
    return ExpressionGraph(
        inputs=inputs,
        places=places,
        steps=np.array(steps, dtype=np.int64).reshape(-1, 5),
        constants=np.array([recorder.steps[at][3] for at in order], dtype=np.float64),
        outputs=np.array([-1 if item is None else where[item.at] for item in made], dtype=np.int64),
        factors=np.array([0.0 if item is None else -1.0 if item.negative else 1.0 for item in made]),
        offsets=np.array([0.0 if isinstance(item, Expression) else float(item) for item in outputs]),
    )


def _needed(recorder: Recorder, wanted: list[int]) -> list[int]:
    """Return the steps that some need, in order."""
    found: set[int] = set()
    front = list(wanted)
    while front:
        at = front.pop()
        if at in found:
            continue
        found.add(at)
        front += [operand for operand in recorder.steps[at][1:3] if operand >= 0]
    return sorted(found)


def _placed(
    rows: list[tuple[int, Op, int, int, int]], inputs: int, kept: set[int]
) -> tuple[list[tuple[int, int, int, int, int]], int]:
    """Give every result a place; one that is no longer needed leaves its own to later ones.

    A result never takes the place of its own operands: the loop over poses runs in parallel only where they
    lie apart.
    """
    last = {}
    for number, (_, _, *operands) in enumerate(rows):
        for operand in operands:
            last[operand] = number
    place = {at: at for at in range(inputs)}
    free: list[int] = []
    count = inputs
    steps = []
    for number, (at, op, *operands) in enumerate(rows):
        if free:
            place[at] = free.pop()
        else:
            place[at], count = count, count + 1
        x, y, z = (place[operand] if operand >= 0 else 0 for operand in operands)
        steps.append((int(op), place[at], x, y, z))
        for operand in {operand for operand in operands if operand >= 0}:
            if last[operand] == number and operand not in kept and operand >= inputs:
                free.append(place[operand])
    return steps, count
