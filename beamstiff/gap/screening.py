"""Rows that no effect explains: found against everything that could be, never against the bare model.

The gap is taken as noise, the unknown and every effect of the library at once, each as large as the gap's median
allows; a row is an outlier when the others, through that covariance, leave it too unlikely (leave-one-out
residuals of Gaussian processes: Rasmussen & Williams 2006, eqs 5.10 to 5.12).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.library import Hypothesis, Library, whitened
from beamstiff.gap.whitened import Whitened, whiten
from beamstiff.se3 import Array

MOST = 0.15  # of the rows
ROUNDS = 6
SURE = 1e-4  # probability that any row of a sound table is flagged
PARTS = 0.3  # of the gap's variance, that each part of the library may make
SHAPES = 5  # of a candidate
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
    return (
        np.array(found, dtype=np.intp)[np.argsort(-unlikely[found], kind="stable")]
        if found
        else np.zeros(0, dtype=np.intp)
    )


def _left_out(baseline: Baseline, library: Library, white: Whitened) -> tuple[Array, NDArray[np.intp]]:
    """Return each row's squared distance from what the others predict (N,), and its number of values."""
    left = white.leave(white.gap[:, None])[:, 0]
    typical = float(np.median(np.abs(left))) / MEDIAN
    variance = max(typical**2 - 1.0, 0.05)
    some = whitened(_some_shapes(library.hypotheses), white)
    size = [np.sqrt((white.leave(one.columns) ** 2).sum() / white.gap.size) for one in some]
    kept = [one.columns / s for one, s in zip(some, size, strict=True) if s > 0]
    own = 1.0 / (1.0 + variance * white.unknown)
    n = white.gap.size
    stacked = np.concatenate([np.zeros((n, 0)), *kept], axis=1)
    # precision of noise, unknown and library (Woodbury), and then of the fitted values as well
    root = np.linalg.cholesky(
        np.eye(stacked.shape[1]) / (PARTS * variance) + stacked.T @ (own[:, None] * stacked)
    )
    factor = np.linalg.solve(root, stacked.T * own)  # (c, n)
    toward = own[:, None] * white.tangent - factor.T @ (factor @ white.tangent)
    fitted = np.linalg.cholesky(white.tangent.T @ toward) if white.tangent.shape[1] else np.zeros((0, 0))
    second = np.linalg.solve(fitted, toward.T) if white.tangent.shape[1] else np.zeros((0, n))
    weighed = own * white.gap - factor.T @ (factor @ white.gap) - second.T @ (second @ white.gap)
    seen = white.back(weighed[:, None])[:, 0]
    taken = white.back(np.concatenate([factor, second]).T)  # (n, c + t), of values as they were measured
    plain = white.back(np.diag(np.sqrt(own)))
    number = np.full(white.used.shape, -1)
    number[white.used] = np.arange(n)
    scale = max(1.0, typical / np.sqrt(1.0 + variance))
    distance, count = np.zeros(len(number)), np.zeros(len(number), dtype=np.intp)
    for row in np.flatnonzero(white.used.any(axis=1)):
        at = number[row][white.used[row]]
        block = plain[at] @ plain[at].T - taken[at] @ taken[at].T
        distance[row] = float(seen[at] @ np.linalg.solve(block, seen[at])) / scale**2
        count[row] = at.size
    return distance, count


def _some_shapes(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return a few shapes of every candidate: many are near others."""
    by_key: dict[str, list[Hypothesis]] = defaultdict(list)
    for one in hypotheses:
        by_key[one.key].append(one)
    return [one for some in by_key.values() for one in some[:: 1 + (len(some) - 1) // SHAPES]]
