"""Rows that no effect explains: found against everything that could be, never against the bare model.

The gap is taken as noise, the unknown and every effect of the library at once (`variance`); a row is an
outlier when the others, through that covariance, leave it too unlikely (leave-one-out residuals of Gaussian
processes: Rasmussen & Williams 2006, eqs 5.10 to 5.12).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamstiff.diagnosis.inference.library import Hypothesis, Library, by_candidate, whitened
from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline
from beamstiff.diagnosis.residual.gross_errors import by_chance
from beamstiff.diagnosis.residual.noise_variance import Variance, estimate, precision
from beamstiff.diagnosis.residual.whitened import Whitened, whiten
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array

MOST = 0.15  # of the rows
ROUNDS = 6
MAIN = 1e-6  # of the largest variance of what the shapes do together, below which others are omitted
SURE = 1e-3  # probability that any row of a sound table is flagged
SOUND, BUT = 0.58, 2  # of the bound, within which all other rows lie but for so many, where some are mishaps
SILENCE = 0.3  # of the noise claimed: claims are off by two at times, not by more
CLAIM, NO_CLAIM = 0.6, 2.0  # standard deviation of the log noise scale: claims are off by two at times


@dataclass(frozen=True)
class Screened:
    """What is left to explain.

    `baseline`: with sigma as the rows show it.
    `used`: (N, 6) bool array; without outliers.
    `outliers`: (k,) int array; the worst first.
    `noise`: (2,) array; scale of the noise of positions and rotations, against the sigma claimed.
    `strength`: how many times farther the outliers are than the farthest sound row would be, squared; their
        median.
    `isolated`: whether they stand apart as mishaps do (`mishaps`), and all other rows are as near as sound
        ones are.
    `below_claim`: whether the rows scatter so much less than the noise claimed, as simulated ones do, that
        the claim is kept.
    """

    baseline: Baseline
    used: NDArray[np.bool_]
    outliers: NDArray[np.intp]
    noise: Array
    strength: float = 0.0
    isolated: bool = False
    below_claim: bool = False


def screen(baseline: Baseline, library: Library) -> Screened:
    """Return a baseline with its noise as the rows show it, and without the rows that nothing explains."""
    some = _some_shapes(library.hypotheses)
    used = baseline.used.copy()
    found: dict[int, float] = {}
    rows = int(used.any(axis=1).sum())
    noise, excess = np.ones(2), np.zeros(len(used))
    whole = whiten(baseline)
    for turn in range(ROUNDS):
        white = whiten(baseline, used) if found else whole
        if white.freedom < 10:
            break
        columns = _unit_columns(some, white)
        if not found:
            of_all = columns
        variance = estimate(white, columns, CLAIM if baseline.claimed else NO_CLAIM, sound=turn > 0)
        noise = variance.noise
        distance, count = _left_out(white, columns, variance)
        scale = _spread(distance, count)
        excess = _excess(distance, count, rows) / scale
        worst = np.flatnonzero(excess > 1.0)
        worst = worst[np.argsort(-excess[worst])][: max(1, int(0.04 * rows))]
        if not worst.size:
            if not found:
                break
            # rows that are off alike speak for one another: those about wrong rows count without each other
            about = [row for row in _about(baseline, list(found)) if used[row].any()]
            far = _apart(whole, of_all, variance, rows, scale, [*found, *about])
            spared = {row: far[row] for row in about if far[row] > 1.0}
            if spared and turn < ROUNDS - 1 and len(found) + len(spared) <= MOST * rows:
                found |= spared
                used[list(spared)] = False
                continue
            # and what was left out beside wrong rows may be what the sound ones predict
            far = _apart(whole, of_all, variance, rows, scale, list(found))
            back = [row for row, value in far.items() if value < 1.0]
            used[back] = baseline.used[back]
            found = {row: value for row, value in far.items() if row not in back}
            break
        if len(found) + worst.size > MOST * rows:  # too many: not outliers, but something else
            used = baseline.used.copy()
            found = {}
            noise = estimate(whole, of_all, CLAIM if baseline.claimed else NO_CLAIM).noise
            break
        found |= {int(row): float(excess[row]) for row in worst}
        used[worst] = False
    below_claim = _below_claim(whole) if baseline.claimed else np.zeros(2, dtype=np.bool_)
    noise = np.where(below_claim, 1.0, noise)
    sigma = baseline.sigma * np.repeat(noise, 3)
    order = sorted(found, key=found.__getitem__, reverse=True)
    strength = float(np.median(list(found.values()))) if found else 0.0
    excess[order] = 0.0
    isolated = len(order) > 0 and bool(np.sort(excess)[-1 - BUT] < SOUND) and by_chance(baseline, order)
    outliers = np.array(order, dtype=np.intp)
    shown = replace(baseline, sigma=sigma)
    return Screened(shown, used, outliers, noise, strength, isolated, bool(below_claim.any()))


def unlikely(squared: Array, values: NDArray[np.intp], rows: int) -> NDArray[np.bool_]:
    """Return which rows are farther off (squared, over the noise) than hardly any of so many sound ones."""
    return np.asarray(_excess(squared, values, rows) > 1.0)


def _excess(distance: Array, count: NDArray[np.intp], rows: int) -> Array:
    """Return squared distances (N,) over those that hardly any of so many sound rows reaches."""
    return np.where(count > 0, distance / chi2.isf(SURE / rows, np.maximum(count, 1)), 0.0)


def _apart(
    white: Whitened, columns: Array, variance: Variance, rows: int, scale: float, some: list[int]
) -> dict[int, float]:
    """Return how far some rows are from what all others predict, over what hardly any sound row reaches."""
    excess = _excess(*_left_out(white, columns, variance, some), rows) / scale
    return {row: float(excess[row]) for row in some}


def _below_claim(white: Whitened) -> NDArray[np.bool_]:
    """Return whether all that the fit leaves of positions, and of rotations, is far below the noise claimed.

    What is left then is of the program that made the rows, or of averaging; no claim is off by so much.
    """
    left = white.project_out(white.gap[:, None])[:, 0]
    rotation = white.component >= 3
    sizes = [np.sqrt((left[own] ** 2).mean()) if own.any() else np.inf for own in (~rotation, rotation)]
    return np.array(sizes) < SILENCE


def _spread(distance: Array, count: NDArray[np.intp]) -> float:
    """Return how much larger distances are than they should be, by their median; at least 1."""
    known = count > 0
    return max(1.0, float(np.median(distance[known] / chi2.median(count[known]))))


def _left_out(
    white: Whitened, columns: Array, variance: Variance, together: Sequence[int] = ()
) -> tuple[Array, NDArray[np.intp]]:
    """Return each row's squared distance from what the others predict (N,), and its number of values.

    Of rows left out together, none counts among the others; only they have distances then.
    """
    inverse, _ = precision(white, columns, variance)
    seen = white.adjoint(inverse.times(white.gap)[:, None])[:, 0]
    taken = white.adjoint(inverse.factor.T)  # (n, c + t), of values as they were measured
    row = np.nonzero(white.used)[0]
    distance, count = np.zeros(len(white.used)), np.zeros(len(white.used), dtype=np.intp)
    if together:
        places = [np.flatnonzero(row == one) for one in together]
        at = np.concatenate(places)
        block = white.products(inverse.own, at) - taken[at] @ taken[at].T
        covariance = _inverse(block)
        left = covariance @ seen[at]
        ends = np.cumsum([0, *(own.size for own in places)]).tolist()
        for one, start, end in zip(together, ends[:-1], ends[1:], strict=True):
            its = covariance[None, start:end, start:end]
            distance[one], count[one] = _squared(its, left[None, start:end])[0], end - start
        return distance, count
    squares, values = white.squares(inverse.own), white.used.sum(axis=1)
    first = np.cumsum(values) - values
    for size in np.unique(values[values > 0]).tolist():
        rows = np.flatnonzero(values == size)
        at = first[rows][:, None] + np.arange(size)  # (rows, size): each component has axes of its own
        block = squares[at][:, :, None] * np.eye(size) - taken[at] @ taken[at].swapaxes(1, 2)
        covariance = _inverse(block)
        distance[rows] = _squared(covariance, (covariance @ seen[at][:, :, None])[:, :, 0])
        count[rows] = size
    return distance, count


def _squared(covariance: Array, left: Array) -> Array:
    """Return the squared sizes (B,) of vectors (B, m) against their covariance (B, m, m)."""
    return np.asarray(np.einsum("bi,bij,bj->b", left, _inverse(covariance), left))


def _inverse(matrix: Array) -> Array:
    """Return the inverses of symmetric matrices (..., m, m), of what counts of them."""
    return np.asarray(np.linalg.pinv(matrix, rcond=1e-9, hermitian=True), dtype=np.float64)


def _about(baseline: Baseline, found: Sequence[int]) -> list[int]:
    """Return the other rows of the postures in which rows were found, and of those read next to them."""
    order, pose = history_order(baseline.rows), baseline.rows.pose
    at = np.flatnonzero(np.isin(order, found))
    beside = np.concatenate([np.maximum(at - 1, 0), at, np.minimum(at + 1, len(order) - 1)])
    near = np.isin(pose, pose[order[beside]])
    near[list(found)] = False
    return np.flatnonzero(near).tolist()


def _unit_columns(some: Sequence[Hypothesis], white: Whitened) -> Array:
    """Return columns (n, c) that vary as some shapes do, each shape of unit size a value; the main ones."""
    parts = [np.zeros((white.gap.size, 0))]
    for one in whitened(some, white):
        # what the fit absorbs of a shape, and one that moves nothing, would drown the rest in rounding
        left = white.project_out(one.columns)
        size = np.linalg.norm(left)
        if size > ROUNDING * max(float(np.linalg.norm(one.columns)), 1.0):
            parts.append(left * np.sqrt(white.gap.size) / size)
    columns = np.concatenate(parts, axis=1)
    values, vectors = np.linalg.eigh(columns.T @ columns)
    return np.asarray(columns @ vectors[:, values > MAIN * values.max(initial=0.0)])


def _some_shapes(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return a few shapes of every candidate, for many are near others: the first, the freest, the last."""
    chosen: list[Hypothesis] = []
    for places in by_candidate(hypotheses).values():
        freest = max(places, key=lambda at: len(hypotheses[at].shape.parameters))
        chosen += [hypotheses[at] for at in sorted({places[0], freest, places[-1]})]
    return chosen
