"""How well each hypothesis predicts the gap: its evidence, size and complexity paid for.

For a shape with columns A (whitened, in realistic sizes) and parameters drawn from ``N(0, u^2)``, noise
scale s and a share of the unknown K, the gap y is Gaussian, ``y ~ N(T b, s^2 (1 + r^2 K) + u^2 A A^T)``, b
free: in the axes of `whitened` all sums are weighted ones, and with the eigenvalues g of ``A^T M A`` the
density is closed in s and u. Parameters that cannot be negative come from the upper half of the normal, which
weighs the density by twice the probability that they are not. It is averaged over s, u and r (Bayesian model
averaging; MacKay, Neural Comp. 4 (1992) 415), and tempered in `diagnosis.decision.tempering`.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

SHARES = np.array([0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0])  # r, of the noise
COARSE = np.array([0.0, 0.06, 0.25, 1.0, 4.0])  # the same where many second causes are weighed
MAGNITUDES = np.linspace(-1.0, 1.0, 9)  # log u over log spread
EXACT = 0.3  # prior that a shape is exactly right
SWEEPS = 8  # of the search for a bound
SURELY = 6.0  # standard deviations above nothing: less than 1e-9 is lost
AMISS, FACTOR = 0.12, 2.0  # what it is off by otherwise, of its own size; within this factor


@dataclass(frozen=True)
class NoisePrior:
    """Prior of the noise scale s against the stated sigma: values and their log weights, (S,)."""

    value: Array
    log_weight: Array


@dataclass(frozen=True)
class Evidence:
    """Log evidence of everything.

    `hypotheses`: (H,) array.
    `exact`: (H,) array; with each shape taken as exactly right.
    `magnitude`: (H,) array; size u that fits best, in realistic sizes.
    `residual_fraction`: (H,) array; share of the gap's size that a shape leaves to the unknown, whatever was
        expected of it.
    """

    hypotheses: Array
    exact: Array
    magnitude: Array
    residual_fraction: Array
    none: float
    unknown: float


@dataclass(frozen=True, eq=False)
class Stack:
    """Hypotheses with one number of columns, side by side.

    `index`: (h,) int array; their places among all.
    `count`: columns of each, c.
    `columns`: (n, h c) array.
    `positive`: (h, c) bool array; parameters that cannot be negative.
    `grams`: dict of float to (h, c, c) array; ``A^T W A`` by the share of the unknown that the weights W
        belong to, kept: the same hypotheses are weighed again and again, beside other causes.
    """

    index: NDArray[np.intp]
    count: int
    columns: Array
    positive: NDArray[np.bool_]
    grams: dict[float, Array] = field(default_factory=dict)

    def gram(self, share: float, weight: Array) -> Array:
        """Return ``A^T W A`` (h, c, c) for the weights (n,) of a share of the unknown."""
        if share not in self.grams:
            each = self.columns.reshape(len(weight), self.index.size, self.count).transpose(1, 0, 2)
            self.grams[share] = each.transpose(0, 2, 1) @ (weight[:, None] * each)
        return self.grams[share]


def stacks_of(hypotheses: Sequence[Hypothesis]) -> list[Stack]:
    """Return hypotheses side by side."""
    by_count: dict[int, list[int]] = defaultdict(list)
    for at, one in enumerate(hypotheses):
        by_count[one.columns.shape[1]].append(at)
    return [
        Stack(
            np.array(places),
            count,
            np.concatenate([hypotheses[at].columns for at in places], axis=1),
            np.array(
                [[one.positive for one in hypotheses[at].shape.parameters] for at in places], dtype=bool
            ),
        )
        for count, places in by_count.items()
    ]


def evidence(
    white: Whitened,
    hypotheses: Sequence[Hypothesis],
    scales: NoisePrior,
    shares: Array = SHARES,
    stacks: Sequence[Stack] | None = None,
) -> Evidence:
    """Return the log evidence of no effect, the unknown, and each hypothesis.

    `shares`: (R,) array; of the unknown, in sigma.
    `stacks`: the hypotheses side by side, where they are weighed several times in the same axes.
    """
    stacks = stacks_of(hypotheses) if stacks is None else stacks
    spread = np.array([one.shape.prior_factor for one in hypotheses])
    logs = _log_densities(white, stacks, spread, scales, shares, white.gap[:, None])[..., 0]  # (R, 1 + H, U)
    flat = logs[:, 0, 0]
    span = np.log(spread)
    amplitude = np.empty(len(hypotheses))
    for stack in stacks:
        left_of = (white.project_out(stack.columns) ** 2).sum(axis=0).reshape(-1, stack.count).sum(axis=1)
        amplitude[stack.index] = np.sqrt(left_of / max(white.freedom, 1))
    size = np.maximum(amplitude, 1e-9)[:, None] * np.exp(span[:, None] * MAGNITUDES)  # (H, U), in sigma
    weights = _share_weights(size, shares)  # (R, H, U)
    joint = logs[:, 1:] + np.log(np.maximum(weights, 1e-300))
    averaged = logsumexp(joint, axis=(0, 2)) - np.log(MAGNITUDES.size)
    unknown = logsumexp(flat[1:]) - np.log(len(shares) - 1)
    of_size = np.exp(joint - logsumexp(joint, axis=(0, 2))[:, None])  # (R, H, U)
    freely = np.exp(logs[:, 1:] - logsumexp(logs[:, 1:], axis=(0, 2))[:, None])
    whole = np.sqrt((white.project_out(white.gap[:, None]) ** 2).sum() / max(white.freedom, 1))
    left = (freely.sum(axis=2) * shares[:, None]).sum(axis=0) / (whole or 1.0)
    best = MAGNITUDES[np.argmax(of_size.sum(axis=0), axis=1)]
    return Evidence(
        hypotheses=averaged,
        exact=logsumexp(logs[0, 1:], axis=1) - np.log(MAGNITUDES.size),
        magnitude=np.exp(span * best),
        residual_fraction=left,
        none=float(flat[0]),
        unknown=float(unknown),
    )


def _share_weights(size: Array, shares: Array) -> Array:
    """Return the prior of the shares of the unknown beside an effect of some size, (R, ...)."""
    off = np.exp(-0.5 * (np.log(shares[1:, None, None] / (AMISS * size)) / np.log(FACTOR)) ** 2)
    total = off.sum(axis=0)
    inside = total > 1e-6
    off = np.where(inside, (1 - EXACT) * off / np.where(inside, total, 1.0), 0.0)
    faint = ~inside & (AMISS * size > shares[-1])
    off[-1] = np.where(faint, 1 - EXACT, off[-1])
    return np.concatenate([1.0 - off.sum(axis=0)[None], off])


@dataclass(frozen=True)
class Conditioned:
    """What the gaps say beside a share of the unknown, the fitted parameters integrated out.

    `weight`: (n,) array; W, of the values.
    `half`: (t + m, n) array; ``M = W - half^T half``.
    `total`: (d,) array; ``y^T M y`` of gaps.
    `toward`: (n, d) array; ``M y``.
    `constant`: (S,) array; log density of a gap of nothing, by noise scale.
    """

    share: float
    weight: Array
    half: Array
    total: Array
    toward: Array
    constant: Array

    def projected(self, stack: Stack) -> tuple[Array, Array]:
        """Return ``A^T M A`` (h, c, c) and ``A^T M y`` (h, c, d)."""
        shape = (stack.index.size, stack.count)
        left = (self.half @ stack.columns).reshape(len(self.half), *shape).transpose(1, 0, 2)  # (h, t, c)
        toward = (stack.columns.T @ self.toward).reshape(*shape, -1)
        return stack.gram(self.share, self.weight) - left.transpose(0, 2, 1) @ left, toward


def _conditioned(white: Whitened, scales: NoisePrior, share: float, gaps: Array) -> Conditioned:
    weight = 1.0 / (1.0 + share**2 * white.unknown)
    n, t = white.tangent.shape
    # nuisance columns are fitted too, with a variance of its own: free columns have none to pay for
    own = np.concatenate([white.tangent, share * white.nuisance], axis=1)
    fitted = own.T @ (weight[:, None] * own)
    fitted[np.arange(t, len(fitted)), np.arange(t, len(fitted))] += 1.0
    chol = np.linalg.cholesky(fitted)
    half = np.asarray(np.linalg.solve(chol, own.T * weight), dtype=np.float64)
    determinant = -0.5 * (-np.log(weight).sum() + 2 * np.log(np.diag(chol)).sum())
    seen = half @ gaps
    return Conditioned(
        share=share,
        weight=weight,
        half=half,
        total=(weight[:, None] * gaps**2).sum(axis=0) - (seen**2).sum(axis=0),
        toward=weight[:, None] * gaps - half.T @ seen,
        constant=determinant - (n - t) * np.log(scales.value) + scales.log_weight,
    )


def _log_densities(
    white: Whitened, stacks: Sequence[Stack], spread: Array, scales: NoisePrior, shares: Array, gaps: Array
) -> Array:
    """Return log densities (R, 1 + H, U, d) of gaps (n, d); the first is that of no effect, for any u."""
    given = [_conditioned(white, scales, share, gaps) for share in shares.tolist()]
    total, constant = (
        np.stack([getattr(one, name) for one in given])[:, None, None] for name in ("total", "constant")
    )
    share_s = np.exp(scales.log_weight - logsumexp(scales.log_weight))
    middle = float(np.exp(share_s @ np.log(scales.value)))

    def averaged(left: Array, loss: Array) -> Array:
        """Average over s: what is left (R, ..., S, d), complexity (R, ..., S, 1 or d)."""
        inner = constant[..., None] - loss - 0.5 * left / scales.value[:, None] ** 2
        return np.asarray(logsumexp(inner, axis=-2))

    result = np.empty((len(given), 1 + spread.size, MAGNITUDES.size, gaps.shape[1]))
    result[:, :1] = averaged(total[..., None, :], np.zeros((scales.value.size, 1)))
    for stack in stacks:
        grams, toward = zip(*(one.projected(stack) for one in given), strict=True)
        eigenvalues, projected, vectors = _along_eigenvectors(np.stack(grams), np.stack(toward))
        sizes = spread[stack.index, None] ** MAGNITUDES  # (h, U)
        upper = np.zeros((len(given), *sizes.shape, gaps.shape[1]))
        signed = np.flatnonzero(stack.positive.any(axis=1))
        if signed.size:
            flat = [
                some[:, signed].reshape(-1, *some.shape[2:]) for some in (eigenvalues, projected, vectors)
            ]
            positive = np.tile(stack.positive[signed], (len(given), 1))
            relative = np.tile(sizes[signed] / middle, (len(given), 1))
            above = _log_upper(positive, flat[0], flat[1], flat[2], relative, middle)
            upper[:, signed] = above.reshape(len(given), signed.size, *above.shape[1:])
        # of many gaps one size at a time, to save memory
        for k in np.split(np.arange(MAGNITUDES.size), 1 if gaps.shape[1] == 1 else MAGNITUDES.size):
            ratio = (sizes[:, k, None] / scales.value) ** 2  # (h, k, S)
            grown = ratio[..., None] * eigenvalues[:, :, None, None]  # (R, h, k, S, c)
            loss = 0.5 * np.log1p(grown).sum(axis=-1)[..., None]
            explained = (ratio[..., None] / (1 + grown)) @ projected[:, :, None] ** 2  # (R, h, k, S, d)
            left = total[..., None, :] - explained
            result[:, 1 + stack.index[:, None], k] = averaged(left, loss - upper[:, :, k, None])
    return result


def _along_eigenvectors(grams: Array, toward: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues of A^T M A (..., c), A^T M y along the vectors (..., c, d), and these."""
    if grams.shape[-1] == 1:
        return np.maximum(grams[..., 0], 0.0), toward, np.ones_like(grams)
    values, vectors = np.linalg.eigh(grams)
    return np.maximum(values, 0.0), vectors.swapaxes(-1, -2) @ toward, vectors


def _log_upper(
    positive: NDArray[np.bool_],
    eigenvalues: Array,
    projected: Array,
    vectors: Array,
    sizes: Array,
    scale: float,
) -> Array:
    """Return by how much the density grows (h, U, d), log, as some parameters (h, c) cannot be negative.

    Twice the probability that each is not, given the gap and a noise scale, and given that those before it
    are not: what is known to be positive is taken for normal again, with its new mean and variance (Mendell
    and Elston, Biometrics 30 (1974) 41); and at most the probability that a sum of them is not (`_farthest`),
    for far out that is far too much. Of several gaps, which are compared with each other only, as if the
    parameters were independent. `eigenvalues` (h, c), `projected` (h, c, d) as of `_projected`; `sizes`
    (h, U) over the noise scale.
    """
    ratio = sizes[:, :, None] ** 2
    factor = ratio / (1.0 + ratio * eigenvalues[:, None])  # (h, U, c), variance along the vectors, / scale^2
    mean = vectors[:, None] @ (factor[..., None] * projected[:, None]) / scale  # (h, U, c, d)
    result = np.zeros((*sizes.shape, projected.shape[2]))
    result += np.log(2.0) * positive.sum(axis=1)[:, None, None]
    if projected.shape[2] > 1:
        variance = (vectors[:, None] ** 2 @ factor[..., None])[..., 0]
        for k in np.flatnonzero(positive.any(axis=0)).tolist():
            above = mean[:, :, k] / np.sqrt(np.maximum(variance[..., k], 1e-300))[..., None]
            result += np.where(positive[:, None, None, k], log_ndtr(above), 0.0)
        return result
    covariance = (vectors[:, None] * factor[:, :, None]) @ vectors[:, None].swapaxes(-1, -2)
    spread = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 1e-300))
    # where all are positive for sure, as most are, nothing is lost
    doubtful = (positive[:, None] & (mean[..., 0] < SURELY * spread)).any(axis=-1)  # (h, U)
    which = np.nonzero(doubtful)[0]
    pull = -(vectors @ projected)[which, :, 0] / scale  # -V^-1 m
    result[doubtful, 0] += _log_not_negative(
        mean[doubtful, :, 0], covariance[doubtful], pull, positive[which]
    )
    return result


def _log_not_negative(mean: Array, covariance: Array, pull: Array, positive: NDArray[np.bool_]) -> Array:
    """Return the log probability that none of the positive parameters of normal ones (r, c) is negative."""
    bound = _farthest(mean, covariance, pull, positive)
    result = np.zeros(len(mean))
    for k in np.flatnonzero(positive.any(axis=0)).tolist():
        spread = np.sqrt(np.maximum(covariance[:, k, k], 1e-300))
        above = mean[:, k] / spread
        part = log_ndtr(above)
        result += np.where(positive[:, k], part, 0.0)
        hazard = np.exp(-0.5 * above**2 - 0.5 * np.log(2.0 * np.pi) - part)
        hazard = np.where(positive[:, k], hazard, 0.0)
        toward = covariance[..., k] / spread[:, None]
        mean = mean + toward * hazard[:, None]
        lost = np.clip(hazard * (hazard + above), 0.0, 1.0)[:, None, None]
        covariance = covariance - lost * toward[:, :, None] * toward[:, None, :]
    return np.minimum(result, bound)


def _farthest(mean: Array, covariance: Array, pull: Array, positive: NDArray[np.bool_]) -> Array:
    """Return a bound of the log probability that no positive parameter is negative, (r,).

    It is at most that of any sum of them with weights a >= 0 being positive, least where a is the pull of the
    bounds on the likeliest point within them: ``V a + m >= 0``, found by Gauss and Seidel's method from the
    `pull` (r, c) that would bring all to nothing.
    """
    weight = np.where(positive, np.maximum(pull, 0.0), 0.0)
    places = np.flatnonzero(positive.any(axis=0)).tolist()
    for _ in range(SWEEPS if len(places) > 1 else 1):
        before = weight.copy()
        for k in places:
            own = np.maximum(covariance[:, k, k], 1e-300)
            others = (covariance[:, k] * weight).sum(axis=-1) - own * weight[:, k]
            weight[:, k] = np.where(positive[:, k], np.maximum(-(mean[:, k] + others) / own, 0.0), 0.0)
        if np.array_equal(weight, before):
            break
    middle = (weight * mean).sum(axis=-1)
    spread = np.sqrt(np.maximum(((covariance @ weight[..., None])[..., 0] * weight).sum(axis=-1), 1e-300))
    return np.where(middle < 0, log_ndtr(middle / spread), 0.0)


def log_weights(hypotheses: Sequence[Hypothesis], found: Evidence) -> Array:
    """Return the log of prior times evidence of each hypothesis, (H,)."""
    return np.log([one.prior for one in hypotheses]) + found.hypotheses


def logsumexp(values: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """Return the log of a sum of exponentials: `scipy.special` has it for more kinds of input, slower."""
    most = values.max(axis=axis, keepdims=True)
    result: Array = np.log(np.exp(values - most).sum(axis=axis)) + np.squeeze(most, axis=axis)
    return result
