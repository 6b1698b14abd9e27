"""Errors on rows that were not fitted: held-out poses, held-out loads; and what repeats say of the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identify.minimise import minimise
from beamstiff.identify.objective import Objective
from beamstiff.identify.problem import Problem
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array


def position_gap(problem: Problem, stiffness: Array) -> Array:
    """Return the norm of the position residual of every row with a measured position, (rows,), m."""
    gap = np.where(problem.used, problem.measured - problem.model.predict(stiffness), 0.0)[:, :3]
    result: Array = np.linalg.norm(gap[problem.used[:, :3].any(axis=1)], axis=1)
    return result


def position_rms(problem: Problem, stiffness: Array) -> float:
    """Return the root mean square over rows of the norm of the position residual, m."""
    gap = position_gap(problem, stiffness)
    return float(np.sqrt((gap**2).mean())) if gap.size else 0.0


def held_out_rms(objective: Objective, groups: Integers, folds: int, begin: Array) -> float | None:
    """Return the RMS of the position residual on groups of rows left out of the fit, m.

    Parameters
    ----------
    objective : Objective
    groups : (N,) array of int
        Rows of one group are left out together: poses, or loads.
    folds : int
        At most so many fits.
    begin : (t,) array
        Where to start: the optimum of all rows.

    Returns
    -------
    float or None
        None with fewer than three groups, or where the rest is too little to fit.
    """
    names = np.unique(groups)
    if names.size < 3 or folds < 2:
        return None
    squares: list[Array] = []
    for fold in range(min(folds, names.size)):
        out: NDArray[np.bool_] = np.isin(groups, names[fold :: min(folds, names.size)])
        training = objective.problem.rows(~out)
        if training.count < begin.size + 1 or not training.model.force.any():
            return None
        try:
            found = minimise(replace(objective, problem=training), begin=begin)
        except BeamstiffError:
            return None
        squares.append(
            position_gap(objective.problem.rows(out), objective.parameters.stiffness(found.theta)) ** 2
        )
    together = np.concatenate(squares)
    return float(np.sqrt(together.mean())) if together.size else None
