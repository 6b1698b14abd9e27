"""Gauss-Newton on the closure equations, at many poses at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from beamstiff.robot.loops import LoopSystem, loop_equations
from beamstiff.se3 import Array

TOLERANCE = 1e-12  # machine sizes, rad
LARGEST_STEP = 0.3  # rad
LARGEST_SHIFT = 0.1  # machine sizes
DAMPING = 0.03  # of the gap
CHUNK = 2048  # poses at a time: all stays in the processor's cache

Mask = NDArray[np.bool_]


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
