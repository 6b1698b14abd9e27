"""The same steps compiled by numba, where it is installed; the machine code is kept beside this file."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from beamstiff.tape.expression import Op

SWITCH = "BEAMSTIFF_COMPILED"
LANES = 64  # poses at a time: all places stay in the nearest cache

# plain numbers, which numba takes for constants
_ADD = int(Op.ADD)
_SUB = int(Op.SUB)
_MUL = int(Op.MUL)
_DIV = int(Op.DIV)
_MIN = int(Op.MIN)
_ADD_CONSTANT = int(Op.ADD_CONSTANT)
_MUL_CONSTANT = int(Op.MUL_CONSTANT)
_DIV_CONSTANT = int(Op.DIV_CONSTANT)
_SQRT = int(Op.SQRT)
_COS = int(Op.COS)
_MUL_ADD = int(Op.MUL_ADD)
_MUL_SUB = int(Op.MUL_SUB)
_SUB_FROM_MUL = int(Op.SUB_FROM_MUL)


def kernel() -> Callable[..., None] | None:
    """Return the compiled loop over steps; None without numba, or where BEAMSTIFF_COMPILED is 0."""
    return None if os.environ.get(SWITCH) == "0" else _compiled()


@cache
def _compiled() -> Callable[..., None] | None:
    if importlib.util.find_spec("numba") is None:
        return None
    import numba

    # without a place to keep machine code it is compiled once a process
    try:
        compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(_run)
    except RuntimeError:
        compiled = numba.njit(nogil=True, error_model="numpy")(_run)
    function: Callable[..., None] = compiled
    return function


def _run(  # type: ignore[no-untyped-def]
    steps, constants, outputs, factors, offsets, places, values, result
):
    """Run all steps on some poses after another; the steps used most come first."""
    poses = values.shape[1]
    rows = np.zeros((places, LANES))
    for start in range(0, poses, LANES):
        count = min(LANES, poses - start)
        for at in range(values.shape[0]):
            for lane in range(count):
                rows[at, lane] = values[at, start + lane]
        for number in range(steps.shape[0]):
            op = steps[number, 0]
            out, x = rows[steps[number, 1]], rows[steps[number, 2]]
            y, z = rows[steps[number, 3]], rows[steps[number, 4]]
            c = constants[number]
            if op == _MUL_SUB:
                for lane in range(LANES):
                    out[lane] = z[lane] - x[lane] * y[lane]
            elif op == _MUL_ADD:
                for lane in range(LANES):
                    out[lane] = z[lane] + x[lane] * y[lane]
            elif op == _MUL:
                for lane in range(LANES):
                    out[lane] = x[lane] * y[lane]
            elif op == _MUL_CONSTANT:
                for lane in range(LANES):
                    out[lane] = c * x[lane]
            elif op == _ADD:
                for lane in range(LANES):
                    out[lane] = x[lane] + y[lane]
            elif op == _SUB:
                for lane in range(LANES):
                    out[lane] = x[lane] - y[lane]
            elif op == _SUB_FROM_MUL:
                for lane in range(LANES):
                    out[lane] = x[lane] * y[lane] - z[lane]
            elif op == _ADD_CONSTANT:
                for lane in range(LANES):
                    out[lane] = x[lane] + c
            elif op == _DIV_CONSTANT:
                for lane in range(LANES):
                    out[lane] = c / x[lane]
            elif op == _MIN:
                for lane in range(LANES):
                    a, b = x[lane], y[lane]
                    out[lane] = a if a < b or a != a else b
            elif op == _DIV:
                for lane in range(LANES):
                    out[lane] = x[lane] / y[lane]
            elif op == _SQRT:
                for lane in range(LANES):
                    out[lane] = np.sqrt(x[lane])
            elif op == _COS:
                for lane in range(LANES):
                    out[lane] = np.cos(x[lane])
            else:
                for lane in range(LANES):
                    out[lane] = np.sin(x[lane])
        for at in range(outputs.shape[0]):
            if outputs[at] < 0:
                for lane in range(count):
                    result[at, start + lane] = offsets[at]
            else:
                for lane in range(count):
                    result[at, start + lane] = factors[at] * rows[outputs[at], lane]
