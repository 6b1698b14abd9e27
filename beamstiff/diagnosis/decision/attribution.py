"""How much of the gap each place could make, and how far all of them together could close it.

Each place's free law has a variance of its own, found by its marginal likelihood (automatic relevance
determination: MacKay, Network 6 (1995) 469), so that what one place explains the others need not. What a
cause explains is its own place's, as far as that cause is probable; the free laws share what is left.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri

from beamstiff.diagnosis.inference.component_subspaces import ComponentSubspace
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

ROUNDS, SETTLED = 60, 0.02  # of the variances' logarithms
SAMPLES = 200
SLIGHT = 0.005  # share that is not told


@dataclass(frozen=True)
class Attribution:
    """The gap attributed to places; n whitened values, m modes of all places.

    `of`: (m,) int array; place of each mode.
    `columns`: (n, m) array.
    `precision`: (p,) array; inverse variance of each place's modes, per sigma.
    `mean`: (m,) array.
    `covariance`: (m, m) array.
    """

    places: tuple[str, ...]
    of: NDArray[np.intp]
    columns: Array
    precision: Array
    mean: Array
    covariance: Array


def attribute(white: Whitened, laws: Sequence[ComponentSubspace], noise: float) -> Attribution:
    """Return the gap attributed to the places of the laws, `noise` times the sigma counted with."""
    places = tuple(dict.fromkeys(law.place for law in laws))
    of = np.concatenate(
        [np.zeros(0, dtype=np.intp), *(np.full(law.modes.shape[1], places.index(law.place)) for law in laws)]
    )
    columns = np.concatenate([np.zeros((white.gap.size, 0)), *(law.modes for law in laws)], axis=1)
    y = white.project_out(white.gap[:, None])[:, 0]
    gram, toward = columns.T @ columns, columns.T @ y
    precision = np.full(len(places), 10.0 * len(places) * columns.shape[0] / max(float(y @ y), 1.0))
    count = np.bincount(of, minlength=len(places))
    mean, covariance = np.zeros(of.size), np.zeros((of.size, of.size))
    for _ in range(ROUNDS if of.size else 0):
        covariance = _inverse(gram / noise**2 + np.diag(precision[of]))
        mean = covariance @ toward / noise**2
        before = precision
        free = count - precision * np.bincount(of, np.diag(covariance), len(places))
        square = np.bincount(of, mean**2, len(places))
        precision = np.clip(np.maximum(free, 1e-9) / np.maximum(square, 1e-12), 1e-6, 1e9)
        if np.abs(np.log(precision / before)).max() < SETTLED:
            break
    return Attribution(places, of, columns, precision, mean, covariance)


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a symmetric positive definite matrix, by Cholesky: half the work of any."""
    factor, failed = dpotrf(matrix, lower=True)
    if failed:
        return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    lower = np.tril(dpotri(factor, lower=True)[0])
    result: Array = lower + np.tril(lower, -1).T
    return result


@dataclass(frozen=True)
class Explanation:
    """A cause: its probability, and the share of the explainable gap that it makes at each of its places."""

    probability: float
    share: Mapping[str, float]


def shares(
    found: Attribution, white: Whitened, noise: float, causes: Sequence[Explanation], seed: int
) -> list[dict[str, Any]]:
    """Return the share of the explainable gap of each place, with a 90 % interval, the largest first.

    The average over the causes, each with its probability, and over what the free laws could do as well.
    """
    y = white.project_out(white.gap[:, None])[:, 0]
    if not found.places or not y.any():
        return []
    rng = np.random.default_rng(seed)
    # variances of what the rows show and of what they do not lie many decades apart: rounding may make some
    # negative
    values, vectors = np.linalg.eigh(0.5 * (found.covariance + found.covariance.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = found.mean + rng.standard_normal((SAMPLES, found.mean.size)) @ root.T
    drawn = np.concatenate([found.mean[None], drawn])
    explained = np.stack(
        [
            ((drawn[:, found.of == k] @ found.columns[:, found.of == k].T) ** 2).sum(axis=1)
            for k in range(len(found.places))
        ],
        -1,
    )
    total = max(float(y @ y) - noise**2 * white.freedom, 1e-12)
    free = explained / np.maximum(explained.sum(axis=1, keepdims=True), total)
    places = list(dict.fromkeys([*found.places, *(place for one in causes for place in one.share)]))
    free = np.pad(free, ((0, 0), (0, len(places) - len(found.places))))
    own = np.array(
        [[one.share.get(place, 0.0) for place in places] for one in causes] + [[0.0] * len(places)]
    )
    chance = np.array([one.probability for one in causes])
    chance = np.append(chance, max(1.0 - chance.sum(), 0.0)) / max(float(chance.sum()), 1.0)
    left = 1.0 - own.sum(axis=1, keepdims=True)
    mean = chance @ (own + left * free[0])
    cause = rng.choice(len(chance), SAMPLES, p=chance)
    low, high = np.quantile(own[cause] + left[cause] * free[1:], [0.05, 0.95], axis=0)
    return [
        {
            "component": places[k],
            "share": float(mean[k]),
            "interval": [float(min(low[k], mean[k])), float(max(high[k], mean[k]))],
        }
        for k in np.argsort(-mean, kind="stable").tolist()
        if mean[k] > SLIGHT
    ]


def ceiling(found: Attribution, white: Whitened, fold: NDArray[np.intp], sigma: Array, noise: float) -> float:
    """Return the RMS position gap, m, that all free laws together leave on postures they did not see.

    `fold`: (N,) int array; which fold holds each row's posture out; -1 for rows that do not count.
    `sigma`: (N, 6) array; standard deviations that the baseline counts with.
    `noise`: scale of the noise against them.
    """
    own = np.concatenate([white.tangent, found.columns], axis=1)
    columns, gap = (
        white.unwhiten(own),
        white.unwhiten(white.gap[:, None])[:, 0],
    )  # in units of what was measured
    scale = noise * sigma[white.used]
    columns, gap = columns / scale[:, None], gap / scale
    ridge = np.concatenate([np.full(white.tangent.shape[1], 1e-9), found.precision[found.of]])
    row, component = np.nonzero(white.used)
    left = np.zeros_like(gap)
    for k in np.unique(fold[fold >= 0]):
        train, test = fold[row] != k, fold[row] == k
        gram = columns[train].T @ columns[train] + np.diag(ridge)
        left[test] = gap[test] - columns[test] @ np.linalg.solve(gram, columns[train].T @ gap[train])
    position = component < 3
    square = ((left * scale)[position] ** 2).sum()
    return float(np.sqrt(square / max(np.unique(row[position]).size, 1)))
