"""The same steps compiled by numba, where it is installed; the machine code is kept beside this file."""

import importlib.util
import os
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from beamstiff.expression_graph.expression import Op

SWITCH = "BEAMSTIFF_COMPILED"
LANES = 64  # poses at a time: all places stay in the nearest cache

# Sine and cosine that run over many poses at once, to the last digit but one: quarter turns are taken off in
# three parts (Cody and Waite), the rest are the polynomials of fdlibm (Ng, Sun Microsystems, 1993).
NEAR = 1e5  # rad: beyond, the library's own
WHOLE = 6755399441055744.0  # 1.5 2^52: adding it rounds to whole numbers
QUARTERS = 0.6366197723675814  # 2 / pi
QUARTER = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
S = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
C = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)

# plain numbers, which numba takes for constants
_ADD, _SUB, _MUL, _DIV, _MIN = map(int, (Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.MIN))
_ADD_CONSTANT, _MUL_CONSTANT, _DIV_CONSTANT = map(int, (Op.ADD_CONSTANT, Op.MUL_CONSTANT, Op.DIV_CONSTANT))
_MUL_ADD, _MUL_SUB, _SUB_FROM_MUL = map(int, (Op.MUL_ADD, Op.MUL_SUB, Op.SUB_FROM_MUL))
_SQRT, _COS = int(Op.SQRT), int(Op.COS)


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


def _run(  # type: ignore[no-untyped-def]  # numba finds the types
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
            else:
                far = 0
                for lane in range(LANES):
                    far += not abs(x[lane]) <= NEAR
                if far and op == _COS:
                    for lane in range(LANES):
                        out[lane] = np.cos(x[lane])
                elif far:
                    for lane in range(LANES):
                        out[lane] = np.sin(x[lane])
                else:
                    ahead = 1.0 if op == _COS else 0.0
                    for lane in range(LANES):
                        # what is left of x after n quarter turns, and what its last digit lost
                        n = (x[lane] * QUARTERS + WHOLE) - WHOLE
                        most = x[lane] - n * QUARTER[0]
                        more = most - n * QUARTER[1]
                        r = more - n * QUARTER[2]
                        lost = ((most - more) - n * QUARTER[1]) + ((more - r) - n * QUARTER[2])
                        square = r * r
                        cube = square * r
                        odd = S[1] + square * (S[2] + square * (S[3] + square * (S[4] + square * S[5])))
                        sine = r - ((square * (0.5 * lost - cube * odd) - lost) - cube * S[0])
                        even = square * (C[2] + square * (C[3] + square * (C[4] + square * C[5])))
                        even = square * (C[0] + square * (C[1] + even))
                        half = 0.5 * square
                        first = 1.0 - half
                        cosine = first + (((1.0 - first) - half) + (square * even - r * lost))
                        n += ahead
                        quadrant = n - 4.0 * (((0.25 * n - 0.375) + WHOLE) - WHOLE)
                        value = cosine if abs(quadrant - 2.0) == 1.0 else sine
                        out[lane] = -value if quadrant >= 2.0 else value
        for at in range(outputs.shape[0]):
            if outputs[at] < 0:
                for lane in range(count):
                    result[at, start + lane] = offsets[at]
            else:
                for lane in range(count):
                    result[at, start + lane] = factors[at] * rows[outputs[at], lane]
