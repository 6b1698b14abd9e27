"""How well each hypothesis predicts the gap: its evidence, size and complexity paid for.

For a shape with columns A (whitened, in realistic sizes) and parameters drawn from ``N(0, u^2)``, noise
scale s and a share of the unknown K, the gap y is Gaussian, ``y ~ N(T b, s^2 (1 + r^2 K) + u^2 A A^T)``, b
free: in the axes of `whitened` all sums are weighted ones, and with the eigenvalues g of ``A^T M A`` the
density is closed in s and u. It is averaged over s, u and r (Bayesian model averaging; MacKay, Neural Comp.
4 (1992) 415).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.gap.library import Hypothesis
from beamstiff.gap.whitened import Whitened
from beamstiff.se3 import Array

SHARES = np.array([0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0])  # r, of the noise
MAGNITUDES = np.linspace(-1.0, 1.0, 9)  # log u over log spread
EXACT = 0.3  # prior that a shape is exactly right
AMISS, FACTOR = 0.12, 2.0  # what it is off by otherwise, of its own size; within this factor


@dataclass(frozen=True)
class Scales:
    """Prior of the noise scale s against the stated sigma: values and their log weights, (S,)."""

    value: Array
    log_weight: Array


@dataclass(frozen=True)
class Evidence:
    """Log evidence of everything.

    Attributes
    ----------
    hypotheses : (H,) array
    exact : (H,) array
        With each shape taken as exactly right.
    magnitude : (H,) array
        Size u that fits best, in realistic sizes.
    left : (H,) array
        Share of the gap's size that a shape leaves to the unknown, whatever was expected of it.
    none, unknown : float
    """

    hypotheses: Array
    exact: Array
    magnitude: Array
    left: Array
    none: float
    unknown: float


@dataclass(frozen=True)
class _Group:
    """Shapes with one number of columns."""

    index: Array  # (h,) int
    eigenvalues: Array  # (h, c) of A^T M A
    projected: Array  # (h, c, d) of A^T M y


def evidence(
    white: Whitened, hypotheses: Sequence[Hypothesis], scales: Scales, shares: Array = SHARES
) -> Evidence:
    """Return the log evidence of no effect, the unknown, and each hypothesis."""
    logs = np.stack(
        [_given_share(white, hypotheses, scales, share, white.gap[:, None])[..., 0] for share in shares]
    )  # (R, 1 + H, U)
    flat = logs[:, 0, 0]
    span = np.array([np.log(one.shape.spread) for one in hypotheses])
    amplitude = np.array(
        [np.sqrt((white.leave(one.columns) ** 2).sum() / max(white.freedom, 1)) for one in hypotheses]
    )
    size = np.maximum(amplitude, 1e-9)[:, None] * np.exp(span[:, None] * MAGNITUDES)  # (H, U), in sigma
    weights = _share_weights(size, shares)  # (R, H, U)
    joint = logs[:, 1:] + np.log(np.maximum(weights, 1e-300))
    averaged = logsumexp(joint, axis=(0, 2)) - np.log(MAGNITUDES.size)
    unknown = logsumexp(flat[1:]) - np.log(len(shares) - 1)
    of_size = np.exp(joint - logsumexp(joint, axis=(0, 2))[:, None])  # (R, H, U)
    freely = np.exp(logs[:, 1:] - logsumexp(logs[:, 1:], axis=(0, 2))[:, None])
    whole = np.sqrt((white.leave(white.gap[:, None]) ** 2).sum() / max(white.freedom, 1))
    left = (freely.sum(axis=2) * shares[:, None]).sum(axis=0) / (whole or 1.0)
    best = MAGNITUDES[np.argmax(of_size.sum(axis=0), axis=1)]
    return Evidence(
        hypotheses=averaged,
        exact=logsumexp(logs[0, 1:], axis=1) - np.log(MAGNITUDES.size),
        magnitude=np.exp(span * best),
        left=left,
        none=float(flat[0]),
        unknown=float(unknown),
    )


def detection(white: Whitened, hypotheses: Sequence[Hypothesis], scales: Scales, gaps: Array) -> Array:
    """Return the log odds of any effect against none for gaps (n, d), (d,), each shape taken as exact."""
    logs = _given_share(white, hypotheses, scales, 0.0, gaps)
    prior = np.log([one.prior for one in hypotheses])
    some = logsumexp(logs[1:], axis=1) - np.log(MAGNITUDES.size)  # (H, d)
    result: Array = logsumexp(some + prior[:, None], axis=0) - logs[0, 0]
    return result


def _share_weights(size: Array, shares: Array) -> Array:
    """Return the prior of the shares of the unknown beside an effect of some size, (R, ...)."""
    off = np.exp(-0.5 * (np.log(shares[1:, None, None] / (AMISS * size)) / np.log(FACTOR)) ** 2)
    total = off.sum(axis=0)
    inside = total > 1e-6
    off = np.where(inside, (1 - EXACT) * off / np.where(inside, total, 1.0), 0.0)
    faint = ~inside & (AMISS * size > shares[-1])
    off[-1] = np.where(faint, 1 - EXACT, off[-1])
    return np.concatenate([1.0 - off.sum(axis=0)[None], off])


def _given_share(
    white: Whitened, hypotheses: Sequence[Hypothesis], scales: Scales, share: float, gaps: Array
) -> Array:
    """Return log densities (1 + H, U, d) of gaps (n, d); the first is that of no effect, for any u."""
    weight = 1.0 / (1.0 + share**2 * white.unknown)
    n, t = white.tangent.shape
    # what is loose is fitted too, with a variance of its own: free columns have none to pay for
    own = np.concatenate([white.tangent, share * white.loose], axis=1)
    fitted = own.T @ (weight[:, None] * own)
    fitted[np.arange(t, len(fitted)), np.arange(t, len(fitted))] += 1.0
    chol = np.linalg.cholesky(fitted)
    half = np.asarray(np.linalg.solve(chol, own.T * weight), dtype=np.float64)  # (t + m, n)
    determinant = -0.5 * (-np.log(weight).sum() + 2 * np.log(np.diag(chol)).sum())
    log_s = np.log(scales.value)
    seen = half @ gaps
    total = (weight[:, None] * gaps**2).sum(axis=0) - (seen**2).sum(axis=0)  # (d,)
    constant = determinant - (n - t) * log_s + scales.log_weight  # (S,)

    def averaged(left: Array, loss: Array) -> Array:
        """Average over s: what is left (..., S, d), complexity (..., S)."""
        inner = constant[:, None] - loss[..., None] - 0.5 * left / scales.value[:, None] ** 2
        return np.asarray(logsumexp(inner, axis=-2))

    result = np.empty((1 + len(hypotheses), MAGNITUDES.size, gaps.shape[1]))
    nothing = averaged(np.broadcast_to(total, (log_s.size, total.size)), np.zeros(log_s.size))
    result[0] = nothing
    for group in _groups(hypotheses, weight, half, gaps):
        spread = np.array([hypotheses[at].shape.spread for at in group.index])
        for k, magnitude in enumerate(MAGNITUDES):
            u = spread**magnitude  # (h,)
            ratio = (u[:, None] / scales.value) ** 2  # (h, S)
            grown = ratio[:, :, None] * group.eigenvalues[:, None]  # (h, S, c)
            loss = 0.5 * np.log1p(grown).sum(axis=2)
            factor = ratio[:, :, None] / (1 + grown)
            explained = factor @ group.projected**2  # (h, S, d)
            result[1 + group.index, k] = averaged(total - explained, loss)
    return result


def logsumexp(values: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """Return the log of a sum of exponentials: `scipy.special` has it for more kinds of input, slower."""
    most = values.max(axis=axis, keepdims=True)
    result: Array = np.log(np.exp(values - most).sum(axis=axis)) + np.squeeze(most, axis=axis)
    return result


def _groups(hypotheses: Sequence[Hypothesis], weight: Array, half: Array, gaps: Array) -> list[_Group]:
    by_count: dict[int, list[int]] = defaultdict(list)
    for at, one in enumerate(hypotheses):
        by_count[one.columns.shape[1]].append(at)
    result = []
    seen = half @ gaps
    for count, places in by_count.items():
        stacked = np.stack([hypotheses[at].columns for at in places])  # (h, n, c)
        flat = stacked.transpose(1, 0, 2).reshape(len(weight), -1)
        left = half @ flat  # (t, h c)
        weighted = weight[:, None] * flat
        toward = (weighted.T @ gaps - left.T @ seen).reshape(len(places), count, -1)
        if count == 1:
            own = ((weighted * flat).sum(axis=0) - (left**2).sum(axis=0))[:, None]
            values, projected = np.maximum(own, 0.0), toward
        else:
            gram = stacked.transpose(0, 2, 1) @ (weight[:, None] * stacked)
            parts = left.reshape(len(left), len(places), count).transpose(1, 0, 2)
            gram = gram - parts.transpose(0, 2, 1) @ parts
            values, vectors = np.linalg.eigh(gram)
            values = np.maximum(values, 0.0)
            projected = vectors.transpose(0, 2, 1) @ toward
        result.append(_Group(np.array(places), values, projected))
    return result
