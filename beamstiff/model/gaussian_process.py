"""A physical model with Gaussian processes: joint compliances that vary smoothly with the configuration.

The logarithm of each spring's compliance is a Gaussian process over the joint values (Rasmussen and Williams,
"Gaussian processes for machine learning", 2006, chapter 2)::

    log c_j(q) = log c_j + x_j(q)      cov(x_j(q), x_j(q')) = w^2 + a_j^2 k(q_j - q_j') + b_j^2 k(q - q')

a value common to all configurations, a part that follows the joint's own angle (levers, gears) and a part
that follows the whole posture. k is the Matern covariance 5/2: twice differentiable. To first order
displacements are linear in x, so that what readings say of x is Gaussian too, and exact but for that order.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular

from beamstiff.measure.arrays import finite
from beamstiff.model.varying import displaced_with_slopes, ports_at
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

COMMON = 1.0  # w: the start may be off by e
AT_ONCE = 500  # rows predicted together
ROUNDING = 1e-12


def matern(distance: Array) -> Array:
    """Return the Matern covariance 5/2 at scaled distances.

    >>> matern(np.array([0.0, 1.0])).round(4)
    array([1.   , 0.524])
    """
    scaled = np.sqrt(5.0) * distance
    result: Array = (1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled)
    return result


@dataclass(frozen=True, eq=False)
class Covariance:
    """Prior of the logarithms of m compliances over A joint values."""

    own: NDArray[np.int64]  # (m,): joint value that each spring turns or slides with; -1 where it has none
    scale: Array  # (A,), rad or m: what joint values are divided by first: 1 for angles
    own_length: float  # over which the part of the own angle varies
    lengths: Array  # (A,): over which the part of the posture varies, by each joint value
    # own_spread, spread, (m,): a and b
    own_spread: Array
    spread: Array

    def between(self, one: Array, other: Array) -> Array:
        """Return the covariances (m, P, R) of postures (P, A) and (R, A)."""
        apart = (one[:, None] - other) / self.scale
        whole = matern(np.sqrt(((apart / self.lengths) ** 2).sum(axis=2)))
        result = np.empty((len(self.own), len(one), len(other)))
        for at, own in enumerate(self.own):
            result[at] = COMMON**2 + self.spread[at] ** 2 * whole
            if own >= 0:
                result[at] += self.own_spread[at] ** 2 * matern(np.abs(apart[:, :, own]) / self.own_length)
        return result

    @property
    def variance(self) -> Array:
        """Prior variance of each logarithm, (m,)."""
        return COMMON**2 + self.spread**2 + np.where(self.own >= 0, self.own_spread**2, 0.0)


def prior_of_readings(covariances: Array, slopes: Array, of: NDArray[np.intp]) -> Array:
    """Return the covariance (n, n) of readings without noise, from those of the logarithms (m, P, P).

    `slopes` (n, m). `of` (n,): posture of each reading, among the P.
    """
    total = np.zeros((len(slopes), len(slopes)))
    for own, slope in zip(covariances, slopes.T, strict=True):
        total += own[np.ix_(of, of)] * np.outer(slope, slope)
    return total


def readings_root(total: Array, noise: float) -> Array:
    """Return the lower Cholesky factor of the readings' covariance (n, n) with noise added.

    Where the noise is next to nothing, a little of the rounding of the rest stands in for it.
    """
    n = len(total)
    variance = noise**2 + ROUNDING * float(np.trace(total)) / n
    return cholesky(total + variance * np.eye(n), lower=True)


def taught(
    covariance: Covariance, postures: Array, of: NDArray[np.intp], slopes: Array, value: Array, noise: float
) -> tuple[Array, Array]:
    """Return the Cholesky factor of the readings' covariance, and its inverse times the readings (n,)."""
    own = covariance.between(postures, postures)
    root = readings_root(prior_of_readings(own, slopes, of), noise)
    return root, cho_solve((root, True), value)


@dataclass(frozen=True, eq=False)
class GaussianProcessStiffness:
    """A robot whose compliances follow Gaussian processes that readings have taught, as a `Model`."""

    robot: Robot
    parameters: tuple[str, ...]  # m springs that vary
    compliance: Array  # (m,): about which they do, m/N or rad/(N m)
    covariance: Covariance
    postures: Array  # (P, A): that were measured
    posture_of: NDArray[np.int64]  # (n,): posture of each reading
    slopes: Array  # (n, m): of the readings, by the logarithms
    root: Array  # (n, n): Lower Cholesky factor of the readings' covariance
    weights: Array  # (n,): its inverse times the readings
    # (6,): standard deviation, m and rad, of what the readings scatter beyond their stated noise
    misfit: Array
    value: Array  # (n,): the readings, whitened
    noise: float  # their standard deviation, so whitened

    def logarithms(self, q: ArrayLike) -> tuple[Array, Array]:
        """Return the mean (N, m) and covariance (N, m, m) of the logarithms' changes x in postures (N, A)."""
        at = finite(q, "joint values", -1, len(self.robot.actuated))
        m = len(self.parameters)
        cross = self.covariance.between(at, self.postures)[:, :, self.posture_of] * self.slopes.T[:, None]
        mean = (cross @ self.weights).T
        solved = solve_triangular(self.root, cross.reshape(-1, len(self.weights)).T, lower=True)
        known = solved.T.reshape(m, len(at), -1)
        taught = np.einsum("inr,jnr->nij", known, known)
        return mean, np.diag(self.covariance.variance) - taught

    def compliances(self, q: ArrayLike) -> Array:
        """Return the compliances (N, m) of the springs in postures (N, A), the median of each."""
        return self.compliance * np.exp(self.logarithms(q)[0])

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return displacements (N, 6), base frame, m and rad."""
        return self.predict_with_std(q, wrench)[0]

    def predict_with_std(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """Return displacements and their standard deviations, (N, 6) both, m and rad.

        The latter are of the displacement itself, without the noise of a further reading: far from all
        readings they grow to those of the prior.
        """
        joints, load = np.asarray(q, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
        poses, pose = np.unique(joints, axis=0, return_inverse=True)
        parts = [self.logarithms(poses[at : at + AT_ONCE]) for at in range(0, len(poses), AT_ONCE)]
        mean, covariance = (np.concatenate(part)[pose.reshape(-1)] for part in zip(*parts, strict=True))
        model = ports_at(self.robot, self.parameters, joints, load)
        predicted, slopes = displaced_with_slopes(model, self.compliance * np.exp(mean))
        variance = np.einsum("nij,njk,nik->ni", slopes, covariance, slopes)
        return predicted, np.sqrt(np.maximum(variance, 0.0) + self.misfit**2)
