"""Whether the rows of a posture were subtracted from one unloaded reading that the table states as several.

The error of that reading is common to the rows of the posture, whatever their load, and as large as that of
each loaded reading: an effect may look like it in one of these ways, hardly in all.
"""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from beamstiff.diagnosis.decomposition.open_model import orthonormal
from beamstiff.diagnosis.predictions import predictions
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure.arrays import Integers, places_of_each
from beamstiff.se3 import Array

CHANCE = 1e-3  # probability below which a common error is none of chance, and none of the same instrument
NOISE = 1.5  # times the noise: more scatter of single readings is an effect's
INDEPENDENT = 1e-9  # singular value of unit columns, below which loads of a posture say nothing new
NOTE = (
    "the rows of a posture have an error in common ({0:.0f} % of the noise variance): if one unloaded "
    "reading was subtracted from all of them, state it in the table (# unloaded_reading: shared) and "
    "diagnose again"
)


def shared_reading(result: Diagnosis) -> str:
    """Return a note that rows of a posture share an unloaded reading that is not stated; empty where not.

    Of the residual with the causes, or without: a drift that is none may have taken the common error up.
    """
    baseline = result.baseline
    if baseline.absolute or (baseline.sharing >= 0).any():
        return ""
    stated = baseline.rows.sigma[:, :3]
    sigma = np.where(np.isfinite(stated), stated, baseline.sigma[:, :3])
    used = np.asarray(baseline.used[:, :3].all(axis=1))
    postures = [own[used[own]] for own in places_of_each(baseline.rows.pose)]
    for predicted in reversed(predictions(result)):
        if predicted is not None:
            left = (baseline.measured - predicted)[:, :3] / sigma
            if share := _common_share(left, baseline.rows.wrench, postures):
                return NOTE.format(100.0 * share)
    return ""


def _common_share(left: Array, wrench: Array, postures: Sequence[Integers]) -> float:
    """Return the share of the noise variance that the rows of a posture have in common; 0 where none shows.

    In each posture the residual (N, 3) is a constant, something linear in the load, and scatter. Constants
    are held against scatter by the F test of a random effect.
    """
    constants, squares, weight, freedom = [], [], 0.0, 0
    for own in postures:
        basis = orthonormal(wrench[own], least=INDEPENDENT)
        constant = np.ones(own.size) - basis @ basis.sum(axis=0)  # what no load can make
        size, free = float(np.linalg.norm(constant)), own.size - basis.shape[1] - 1
        if free < 1 or size < INDEPENDENT:
            continue
        by_load = basis @ (basis.T @ left[own])
        found = constant @ left[own] / size
        constants.append(found)
        squares.append(((left[own] - by_load - np.outer(constant, found) / size) ** 2).sum(axis=0))
        weight, freedom = weight + size**2, freedom + free
    if not constants:
        return 0.0
    count, of_constants = len(constants), np.square(constants).sum(axis=0)
    within = np.sum(squares, axis=0) / freedom  # variances of x, y, z, in those that are counted with
    if not within.all() or (within > NOISE**2).any():  # rows without noise, or with what no noise explains
        return 0.0
    common = (of_constants - count * within) / weight
    f, expected = of_constants / count / within, 1.0 + weight / count  # if the common variance is the other
    tails = stats.f.cdf(f / expected, count, freedom)
    none = stats.f.sf(of_constants.sum() / (3 * count) / within.mean(), 3 * count, 3 * freedom)
    if none > CHANCE or (np.minimum(tails, 1.0 - tails) < CHANCE).any():
        return 0.0
    return float(common.sum() / (common + within).sum())
