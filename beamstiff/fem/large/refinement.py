"""How good a solution is: refinement by residuals in extended precision.

A factor in double precision leaves an error of condition times 1e-16: at a million unknowns one of 1e-3. With
better residuals (Wilkinson; Higham, Accuracy and Stability of Numerical Algorithms, ch. 12) some more
solutions bring it down to the last digits. Where `numpy.longdouble` is no more than a double the refinement
stops earlier, and the error that remains says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.se3 import Array

Solve = Callable[[Array], Array]
ENOUGH = 1e-11  # relative error
MOST = 12


@dataclass(frozen=True)
class Quality:
    """What is known of a solution."""

    # largest relative error of a column that is to be expected, in the norm scaled to unit diagonal
    error: float
    residual: float  # largest ``|b - K x| / |b|``, likewise
    refinements: int  # how often it was refined
    first_error: float  # relative error before the refinement


def refined(
    scale: Array, forces: Callable[[NDArray[Any]], NDArray[Any]], solve: Solve, right: Array
) -> tuple[Array, Quality]:
    """Return the solution (n, c) of a symmetric system, refined as far as it goes, and how good it is.

    `scale` (n,) holds the square roots of the diagonal, `forces` gives ``K x`` in extended precision, `solve`
    ``K^-1 b`` in double precision.
    """
    row = scale[:, None]
    load = np.maximum(_norms(right / row), np.finfo(float).tiny)
    x: NDArray[Any] = solve(right).astype(np.longdouble)
    size = np.maximum(_norms(row * x.astype(np.float64)), np.finfo(float).tiny)
    error = before = np.inf
    first, times = 0.0, 0
    left = (right - forces(x)).astype(np.float64)
    while times < MOST and error > ENOUGH:
        step = solve(left)
        change = float((_norms(row * step) / size).max())
        first = change if times == 0 else first
        if not change < 0.5 * before:  # it grows no better
            break
        x = x + step
        times += 1
        left = (right - forces(x)).astype(np.float64)
        # what a step leaves is to the step as the step was to the one before, or to the whole
        rate = change / before if np.isfinite(before) else change
        error, before = max(change * min(rate, 1.0), np.finfo(float).eps), change
    residual = float((_norms(left / row) / load).max())
    return x.astype(np.float64), Quality(min(error, before) if times else first, residual, times, first)


def _norms(columns: Array) -> Array:
    return np.asarray(np.sqrt((columns * columns).sum(axis=0)))
