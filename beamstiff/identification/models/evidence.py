"""What readings say of the spreads and lengths of Gaussian processes: their evidence, with its gradient.

Of linear readings ``y = U x + noise`` (Rasmussen and Williams, 2006, eqs 5.8 and 5.9), with mild priors
against what few readings cannot tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky
from scipy.optimize import minimize

from beamstiff.model.gaussian_process import Covariance, matern
from beamstiff.se3 import Array

# priors of the logarithms of spreads, lengths and the noise over what is stated: mean, standard deviation
SPREAD, LENGTH, NOISE = (np.log(0.1), 1.5), (0.0, 0.7), (0.0, 2.0)
LOWEST, HIGHEST = -7.0, 3.0  # of spreads and lengths
LOUDEST = 7.0  # of the noise
ITERATIONS = 60
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class LinearReadings:
    """Whitened readings, linear in the logarithms of their posture, noise of unit variance."""

    value: Array  # (n,)
    slopes: Array  # (n, m)
    posture: NDArray[np.int64]  # (n,): ascending
    rest: float  # sum of squares that no change of the posture's compliances could explain
    lost: int  # readings that these squares are of


@dataclass(frozen=True, eq=False)
class Evidence:
    """Minus the logarithm of the evidence, and of the priors, as a function of logarithms."""

    readings: LinearReadings
    postures: Array  # (P, A)
    covariance: Covariance  # says what drives what; its spreads and lengths are left open

    @property
    def priors(self) -> Array:
        """Mean and standard deviation of each logarithm: own spreads, spreads, own length, lengths, noise."""
        m, count = len(self.covariance.own), len(self.covariance.scale)
        return np.array([SPREAD] * (2 * m) + [LENGTH] * (1 + count) + [NOISE])

    def theta(self, noise: float) -> Array:
        """Return the logarithms of the covariance as it is, and of a noise."""
        own = self.covariance
        ends = np.array([own.own_length]), own.lengths, np.array([noise])
        result: Array = np.log(np.concatenate([own.own_spread, own.spread, *ends]))
        return result

    def at(self, theta: Array) -> tuple[Covariance, float]:
        """Return the covariance and the noise at logarithms."""
        m = len(self.covariance.own)
        a, b, own_length, lengths, noise = np.split(np.exp(theta), [m, 2 * m, 2 * m + 1, len(theta) - 1])
        changed = replace(
            self.covariance, own_spread=a, spread=b, own_length=float(own_length[0]), lengths=lengths
        )
        return changed, float(noise[0])

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the value and its gradient."""
        prior, noise = self.at(theta)
        readings, m = self.readings, len(prior.own)
        present, of = np.unique(readings.posture, return_inverse=True)
        at = self.postures[present]
        total = prior_of_readings(prior.between(at, at), readings.slopes, of)
        root = readings_root(total, noise)
        inverse = cho_solve((root, True), np.eye(len(total)))
        alpha = inverse @ readings.value
        cost = 0.5 * float(readings.value @ alpha) + float(np.log(np.diagonal(root)).sum())
        cost += 0.5 * readings.rest / noise**2 + readings.lost * float(np.log(noise))
        # the cost changes by half the sum of inner times the change of total: (m, P, P) by posture
        inner = inverse - np.outer(alpha, alpha)
        first = np.flatnonzero(np.diff(of, prepend=-1))
        by_posture = np.stack([_summed(inner * np.outer(u, u), first) for u in readings.slopes.T])
        apart = (at[:, None] - at) / prior.scale
        squares = (apart / prior.lengths) ** 2
        distance = np.sqrt(squares.sum(axis=2))
        gradient = np.zeros_like(theta)
        for j, own in enumerate(prior.own):
            if own >= 0:
                along, weight = np.abs(apart[:, :, own]) / prior.own_length, prior.own_spread[j] ** 2
                gradient[j] = weight * float((by_posture[j] * matern(along)).sum())
                gradient[2 * m] += 0.5 * weight * float((by_posture[j] * _by_log_length(along)).sum())
        gradient[m : 2 * m] = prior.spread**2 * np.tensordot(by_posture, matern(distance), 2)
        slope = _by_log_length(distance) * np.tensordot(prior.spread**2, by_posture, 1)
        share = np.divide(slope, distance**2, out=np.zeros_like(distance), where=distance > 0)
        gradient[2 * m + 1 : -1] = 0.5 * np.tensordot(share, squares, 2)
        gradient[-1] = noise**2 * float(np.trace(inner)) - readings.rest / noise**2 + readings.lost
        mean, std = self.priors.T
        away = (theta - mean) / std
        return cost + 0.5 * float(away @ away), gradient + away / std


def prior_of_readings(covariances: Array, slopes: Array, of: NDArray[np.intp]) -> Array:
    """Return the covariance (n, n) of readings without noise, from those of the logarithms (m, P, P).

    `slopes` (n, m). `of` (n,): posture of each reading, among the P.
    """
    total = np.zeros((len(slopes), len(slopes)))
    for own, slope in zip(covariances, slopes.T, strict=True):
        total += own[np.ix_(of, of)] * np.outer(slope, slope)
    return total


def _summed(values: Array, first: NDArray[np.intp]) -> Array:
    """Return the sums of blocks of a matrix, (P, P), that begin at rows and columns `first`."""
    return np.add.reduceat(np.add.reduceat(values, first, axis=0), first, axis=1)


def readings_root(total: Array, noise: float) -> Array:
    """Return the lower Cholesky factor of the readings' covariance (n, n) with noise added.

    Where the noise is next to nothing, a little of the rounding of the rest stands in for it.
    """
    n = len(total)
    variance = noise**2 + ROUNDING * float(np.trace(total)) / n
    return cholesky(total + variance * np.eye(n), lower=True)


def _by_log_length(distance: Array) -> Array:
    """Return the derivative of the Matern covariance by the logarithm of its length, ``-r k'(r)``."""
    scaled = np.sqrt(5.0) * distance
    result: Array = scaled**2 * (1.0 + scaled) / 3.0 * np.exp(-scaled)
    return result


def most_evident(
    readings: LinearReadings, postures: Array, begin: Covariance, noise: float, sigma_known: bool
) -> tuple[Covariance, float]:
    """Return the covariance and the noise of most evidence.

    `postures` (P, A). `noise`: to begin with. `sigma_known`: it is stated: the readings may scatter
    more, not less.
    """
    evidence = Evidence(readings, postures, begin)
    start = evidence.theta(noise)
    bounds = [(LOWEST, HIGHEST)] * (len(start) - 1) + [(0.0 if sigma_known else LOWEST, LOUDEST)]
    low, high = np.array(bounds).T
    start = np.clip(start, low, high)
    found = minimize(
        evidence, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": ITERATIONS}
    )
    return evidence.at(found.x)
