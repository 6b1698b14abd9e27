"""Errors on rows that were not fitted: held-out poses, held-out loads; and what repeats say of the noise."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identification.objective import Objective
from beamstiff.identification.problem import Problem
from beamstiff.identification.refit import refit
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array


def position_rms(problem: Problem, stiffness: Array) -> float:
    """Return the RMS of the norm of the position residual, m, over the rows with a measured position."""
    gap = np.where(problem.used, problem.measured - problem.model.predict(stiffness), 0.0)[:, :3]
    gap = np.linalg.norm(gap[problem.used[:, :3].any(axis=1)], axis=1)
    return float(np.sqrt((gap**2).mean())) if gap.size else 0.0


@dataclass(frozen=True)
class HeldOut:
    """Errors on rows while they were held out."""

    groups: Integers  # (N,): rows of one group were left out together: a pose, or a load
    residual: Array  # (N, 6), m and rad: measured less predicted; NaN where not measured

    @property
    def gap(self) -> Array:
        """Norm of the position residual of every row, (N,), m; NaN where no position was measured."""
        seen = ~np.isnan(self.residual[:, :3])
        size = np.linalg.norm(np.where(seen, self.residual[:, :3], 0.0), axis=1)
        return np.where(seen.any(axis=1), size, np.nan)

    @property
    def rms(self) -> float | None:
        """Root mean square of it over all rows, m; None where no position was measured."""
        gap = self.gap
        return float(np.sqrt(np.nanmean(gap**2))) if np.isfinite(gap).any() else None


def held_out(objective: Objective, groups: Integers, folds: int, begin: Array) -> HeldOut | None:
    """Return the errors on held-out groups (N,) of rows, poses or loads, in so many folds, from `begin` (t,).

    Rows behind the table's go with theirs. None with fewer than three groups, or too few rows left to fit.
    """
    groups = groups[: objective.problem.readings]
    residual = np.full((len(groups), 6), np.nan)
    try:
        for out, test, theta in without_folds(objective, groups, folds, begin):
            gap = test.measured - test.model.predict(objective.parameters.stiffness(theta))
            residual[out] = np.where(test.used, gap, np.nan)
    except BeamstiffError:
        return None
    return HeldOut(groups, residual)


def without_folds(
    objective: Objective, groups: Integers, folds: int, begin: Array
) -> Iterator[tuple[NDArray[np.bool_], Problem, Array]]:
    """Fit with every fold left out in turn; yield its rows (N,), its problem, and the optimum without it."""
    problem, names = objective.problem, np.unique(groups)
    if names.size < 3 or folds < 2:
        raise BeamstiffError(
            f"{problem.source}: found {names.size} groups of rows and {folds} folds, expected three groups "
            "and two folds or more to hold some out"
        )
    for fold in range(min(folds, names.size)):
        out: NDArray[np.bool_] = np.isin(groups, names[fold :: min(folds, names.size)])
        training = replace(objective, problem=problem.rows(problem.without(out)))
        if training.problem.count < begin.size + 1 or not training.problem.model.force.any():
            raise BeamstiffError(f"{problem.source}: with a fold held out, too little is left to fit")
        yield out, problem.rows(np.flatnonzero(out)), refit(training, begin)
