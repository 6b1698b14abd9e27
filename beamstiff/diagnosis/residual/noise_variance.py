"""How much of the gap's variance is noise: its scale for positions and rotations, beside all that could be.

The whitened gap is taken as Gaussian, with the fitted parameters free (restricted likelihood)::

    y ~ N(T b, diag(f^2) + v^2 K + a^2 C C^T)

f the noise of positions and of rotations against the sigma counted with, K the unknown, C the columns of the
library, each of unit size. f, v and a maximise the likelihood and a prior of f.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

WINSOR = 6.0  # medians of the gap's size, at which values are cut: a few wrong rows must not make noise
MEDIAN = 0.6744897501960817  # of the size of a standard normal variable
LIMITS = ((-4.0, 4.0), (-4.0, 4.0), (-9.0, 9.0), (-9.0, 9.0))  # of the logarithms
JITTER = 1e-9  # against columns that depend on one another


@dataclass(frozen=True)
class Variance:
    """Estimated scales.

    `noise`: (2,) array; of positions and rotations, standard deviations over the sigma counted with.
    `unknown`, `library`: variances.
    """

    noise: Array
    unknown: float
    library: float


@dataclass(frozen=True)
class Precision:
    """The inverse covariance ``diag(own) - factor^T factor``, fitted parameters taken out."""

    own: Array  # (n,)
    factor: Array  # (c + t, n)

    def times(self, values: Array) -> Array:
        """Return its product with values (n,)."""
        return self.own * values - self.factor.T @ (self.factor @ values)


def precision(white: Whitened, columns: Array, variance: Variance) -> tuple[Precision, float]:
    """Return the inverse covariance, and half its log determinant with that of the fitted parameters."""
    rotation = (white.component >= 3).astype(np.intp)
    own = 1.0 / (variance.noise[rotation] ** 2 + variance.unknown * white.unknown)
    weighted = own[:, None] * columns
    inner = np.eye(columns.shape[1]) / variance.library + columns.T @ weighted
    inner[np.diag_indices_from(inner)] *= 1.0 + JITTER
    root = np.linalg.cholesky(inner)
    factor = solve_triangular(root, weighted.T, lower=True, check_finite=False)
    log = (
        0.5 * np.log(own).sum()
        - np.log(np.diag(root)).sum()
        - 0.5 * columns.shape[1] * np.log(variance.library)
    )
    if white.tangent.shape[1]:
        toward = own[:, None] * white.tangent - factor.T @ (factor @ white.tangent)
        rest = white.tangent.T @ toward
        rest[np.diag_indices_from(rest)] *= 1.0 + JITTER
        fitted = np.linalg.cholesky(rest)
        factor = np.concatenate([factor, solve_triangular(fitted, toward.T, lower=True, check_finite=False)])
        log -= np.log(np.diag(fitted)).sum()
    return Precision(own, factor), float(log)


def estimate(white: Whitened, columns: Array, width: float, sound: bool = False) -> Variance:
    """Return the scales of noise, unknown and library.

    `columns`: (n, c) array; of the library, each of unit size a value.
    `width`: standard deviation of the logarithm of the noise scales, before the data.
    `sound`: whether wrong rows have been taken out already.
    """
    gap = white.gap
    if not sound:
        left = white.project_out(gap[:, None])[:, 0]
        most = WINSOR * max(float(np.median(np.abs(left))) / MEDIAN, 1e-9)
        gap = white.gap - left + np.clip(left, -most, most)
    rotation = white.component >= 3
    typical = max(float(np.median(np.abs(white.project_out(gap[:, None])))) / MEDIAN, 1e-3) ** 2

    def loss(theta: Array) -> tuple[float, Array]:
        f, v, a = np.exp(theta[:2]), float(np.exp(theta[2])), float(np.exp(theta[3]))
        inverse, half = precision(white, columns, Variance(f, v, a))
        weighed = inverse.times(gap)
        value = -half + 0.5 * float(gap @ weighed) + 0.5 * float((theta[:2] ** 2).sum()) / width**2
        diagonal = inverse.own - (inverse.factor**2).sum(axis=0)
        by_own = 0.5 * (diagonal - weighed**2)
        seen = columns.T @ weighed
        through = inverse.factor @ columns
        trace = float((inverse.own[:, None] * columns**2).sum() - (through**2).sum())
        slope = np.array(
            [
                float(by_own[~rotation].sum()) * 2 * f[0] ** 2,
                float(by_own[rotation].sum()) * 2 * f[1] ** 2,
                float((by_own * white.unknown).sum()) * v,
                0.5 * (trace - float((seen**2).sum())) * a,
            ]
        )
        slope[:2] += theta[:2] / width**2
        return value, slope

    start = np.array([0.0, 0.0, np.log(0.1 * typical + 1e-3), np.log(0.1 * typical / 10 + 1e-4)])
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=LIMITS, options={"maxiter": 25})
    theta = found.x
    return Variance(np.exp(theta[:2]), float(np.exp(theta[2])), float(np.exp(theta[3])))
