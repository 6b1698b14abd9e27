"""Rows that no effect explains: found against everything that could be, never against the bare model.

The gap is taken as noise, the unknown and every effect of the library at once, each as large as the gap's median
allows; a row is an outlier when the others, through that covariance, leave it too unlikely (leave-one-out
residuals of Gaussian processes: Rasmussen & Williams 2006, eqs 5.10 to 5.12).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.library import Library
from beamstiff.gap.whitened import Whitened, whiten
from beamstiff.se3 import Array

MOST = 0.15  # of the rows
ROUNDS = 6
SURE = 1e-4  # probability that any row of a sound table is flagged
PARTS = 0.3  # of the gap's variance, that each part of the library may make
MEDIAN = 0.6744897501960817  # of the size of a standard normal variable


def outlying_rows(baseline: Baseline, library: Library) -> NDArray[np.intp]:
    """Return the rows that nothing explains, the worst first."""
    found: list[int] = []
    used = baseline.used.copy()
    rows = int(used.any(axis=1).sum())
    unlikely = np.zeros(len(used))
    for _ in range(ROUNDS):
        white = whiten(baseline, used)
        if white.freedom < 10:
            return np.zeros(0, dtype=np.intp)
        distance, count = _left_out(baseline, library, white)
        bound = chi2.isf(SURE / rows, np.maximum(count, 1))
        excess = np.where(count > 0, distance / bound, 0.0)
        worst = np.flatnonzero(excess > 1.0)
        worst = worst[np.argsort(-excess[worst])][: max(1, int(0.05 * rows))]
        if not worst.size or len(found) + worst.size > MOST * rows:
            break
        found += worst.tolist()
        unlikely[worst] = excess[worst]
        used[worst] = False
    return np.array(found, dtype=np.intp)[np.argsort(-unlikely[found], kind="stable")] if found else np.zeros(
        0, dtype=np.intp
    )


def _left_out(baseline: Baseline, library: Library, white: Whitened) -> tuple[Array, NDArray[np.intp]]:
    """Return each row's squared distance from what the others predict (N,), and its number of values."""
    left = white.leave(white.gap[:, None])[:, 0]
    typical = float(np.median(np.abs(left))) / MEDIAN
    variance = max(typical**2 - 1.0, 0.05)
    columns = [white.turn(one.shape.columns) for one in library.hypotheses]
    size = [np.sqrt((white.leave(c) ** 2).sum() / c.shape[0]) for c in columns]
    kept = [c / s for c, s in zip(columns, size, strict=True) if s > 0]
    n = white.gap.size
    covariance = np.eye(n) + np.diag(variance * white.unknown)
    if kept:
        stacked = np.concatenate(kept, axis=1)
        covariance += PARTS * variance * (stacked @ stacked.T)
    precision = np.linalg.inv(covariance)
    toward = precision @ white.tangent
    precision -= toward @ np.linalg.solve(white.tangent.T @ toward, toward.T)
    own = white.axes.T @ (white.axes.T @ precision.T).T  # of values as they were measured
    weighed = white.axes.T @ (precision @ white.gap)
    scale = max(1.0, typical / np.sqrt(1.0 + variance))
    number = np.full(white.used.shape, -1)
    number[white.used] = np.arange(n)
    distance, count = np.zeros(len(number)), np.zeros(len(number), dtype=np.intp)
    for row in np.flatnonzero(white.used.any(axis=1)):
        at = number[row][white.used[row]]
        part = weighed[at]
        distance[row] = float(part @ np.linalg.solve(own[np.ix_(at, at)], part)) / scale**2
        count[row] = at.size
    return distance, count
