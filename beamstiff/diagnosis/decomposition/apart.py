"""Rows that stand apart from all others: gross errors of reading, which least squares spread over all.

A row's error is that of its prediction from all others (Cook and Weisberg, Residuals and Influence, 1982,
eq. 2.2.7). What effects leave has tails, but no gap: no effect moves one row or two so much farther than the
farthest of all others.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from beamstiff.diagnosis.decomposition.open_model import OpenModel, open_stiffness, orthonormal
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

APART = 3.0  # times the error of the farthest other row; causes of 150 simulated tables left at most 2.3
FEW, SHARE = 2, 0.02  # rows, and share of them, that may be gross errors: more are something else
CHANCE = 1e-3  # of so large an error of any row, by what the middle of them scatters
ALONE = 1e-6  # variance of a reading over that of its prediction, below which no other row tells it


def rows_apart(model: OpenModel) -> Integers:
    """Return the rows of a model that stand apart from all others; mostly none."""
    of_value = np.nonzero(model.used)[0]
    most = max(FEW, int(SHARE * len(np.unique(of_value))))
    found = np.zeros(0, dtype=np.intp)
    while (more := _farthest(model.part(~np.isin(of_value, found)), most)).size:
        found = np.concatenate([found, more])
    return np.sort(found) if len(found) <= most else found[:0]


def places_apart(baseline: Baseline) -> tuple[str, ...]:
    """Return the rows of displacements that stand apart, ``file:line`` each.

    A reading that several rows share tells of none of them: each counts by itself.
    """
    alone = replace(baseline, sharing=np.full_like(baseline.sharing, -1))
    return tuple(baseline.rows.place(row) for row in rows_apart(open_stiffness(alone)).tolist())


def _farthest(model: OpenModel, most: int) -> Integers:
    """Return the farthest rows, behind which all others follow at a distance."""
    rows, error = _errors_of_others(model)
    order = np.argsort(-error)
    scale = max(float(np.median(error)) / np.sqrt(chi2.median(3)), 1.0)  # of the middle: robust
    for count in range(1, min(most, len(rows) - 1) + 1):
        last, other = error[order[count - 1]], error[order[count]]
        if last > APART * other and chi2.sf((last / scale) ** 2, 3) < CHANCE / len(rows):
            return rows[order[:count]]
    return rows[:0]


def _errors_of_others(model: OpenModel) -> tuple[Integers, Array]:
    """Return the rows with readings, and how far each is from what all others say of it, in noise."""
    basis = orthonormal(model.tangent)
    left = model.residual - basis @ (basis.T @ model.residual)
    of_value = np.nonzero(model.used)[0]
    rows = np.unique(of_value)
    error = np.zeros(len(rows))
    for at, row in enumerate(rows.tolist()):
        out = np.flatnonzero(of_value == row)
        values, vectors = np.linalg.eigh(np.eye(len(out)) - basis[out] @ basis[out].T)
        told = values > ALONE
        error[at] = np.linalg.norm((vectors.T @ left[out])[told] / values[told])
    return rows, error
