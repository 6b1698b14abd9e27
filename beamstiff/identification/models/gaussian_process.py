"""Gaussian processes of joint compliances taught by measured displacements.

Linear-Gaussian about the parametric fit, linearised again where the readings lead. The spreads, lengths and
the noise maximise the evidence of linear readings ``y = U x + noise``, with mild priors against what few
readings cannot determine (Rasmussen and Williams, 2006, eqs 2.30, 5.8, 5.9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve
from scipy.optimize import minimize

from beamstiff.identification.models.configuration import Begin, begin_with
from beamstiff.identification.problem import Problem
from beamstiff.measure.table import Measurements
from beamstiff.model.gaussian_process import (
    Covariance,
    GaussianProcessStiffness,
    matern,
    prior_of_readings,
    readings_root,
    taught,
)
from beamstiff.model.varying import displaced_with_slopes
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

ROUNDS = 3  # of linearising again
MOST = 600  # readings that spreads and lengths are found from

# priors of the logarithms of spreads, lengths and the noise over what is stated: mean, standard deviation
SPREAD, LENGTH, NOISE = (np.log(0.1), 1.5), (0.0, 0.7), (0.0, 2.0)
LOWEST, HIGHEST = -7.0, 3.0  # of spreads and lengths
LOUDEST = 7.0  # of the noise
ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class GaussianProcessFit:
    """A fitted Gaussian process model."""

    model: GaussianProcessStiffness
    noise: float  # standard deviation of the whitened readings; 1 where they are as stated
    evidence: float  # logarithm of the density of the readings


def fit_gaussian_process(
    robot: Robot, table: Measurements, parameters: Sequence[str] | None = None, seed: int = 0
) -> GaussianProcessFit:
    """Teach joint compliances that vary with the configuration from measured displacements.

    `table`: displacements, loaded minus unloaded. `parameters`: springs that may vary; default
    ``robot.identify``. `seed`: of the choice of readings that spreads and lengths are found from, where there
    are very many.
    """
    start = begin_with(robot, table, parameters)
    problem = start.problem
    postures = np.unique(table.q, axis=0)
    covariance = _first(start, postures)
    change, noise = np.zeros((len(postures), len(start.parameters))), 1.0
    for _ in range(ROUNDS):
        readings = _linearised(problem, start.compliance, change)
        few = _chosen(readings, np.random.default_rng(seed))
        covariance, noise = most_evident(few, postures, covariance, noise, problem.sigma_known)
        root, weights = taught(covariance, postures, readings.posture, readings.slopes, readings.value, noise)
        cross = covariance.between(postures, postures)[:, :, readings.posture]
        change = ((cross * readings.slopes.T[:, None]) @ weights).T
    more = max(noise**2 - 1.0, 0.0) if problem.sigma_known else 0.0
    variance = np.where(problem.used, problem.sigma**2, 0.0).sum(axis=0)
    misfit = np.sqrt(more * variance / np.maximum(problem.used.sum(axis=0), 1))
    model = GaussianProcessStiffness(
        robot=start.robot,
        parameters=start.parameters,
        compliance=start.compliance,
        covariance=covariance,
        postures=postures,
        posture_of=readings.posture,
        slopes=readings.slopes,
        root=root,
        weights=weights,
        misfit=misfit,
        value=readings.value,
        noise=noise,
    )
    evidence = -0.5 * float(readings.value @ weights) - float(np.log(np.diagonal(root)).sum())
    evidence -= 0.5 * readings.rest / noise**2 + readings.lost * float(np.log(noise))
    evidence -= 0.5 * (readings.value.size + readings.lost) * float(np.log(2 * np.pi))
    return GaussianProcessFit(model, noise, evidence)


def _first(start: Begin, postures: Array) -> Covariance:
    """Return the covariance that the search begins with."""
    robot, names = start.robot, [variable.name for variable in start.robot.actuated]
    of_joint = {f"{j.name}.torsional": j.variable for j in robot.joints if j.variable in names}
    own = [names.index(str(of_joint[p])) if p in of_joint else -1 for p in start.parameters]
    span = np.maximum(np.ptp(postures, axis=0), 1e-9)
    scale = np.array([1.0 if v.kind == "angle" else s for v, s in zip(robot.actuated, span, strict=True)])
    spread = np.full(len(own), np.exp(SPREAD[0]))
    ones = np.ones(len(names))
    return Covariance(np.array(own, dtype=np.int64), scale, 1.0, ones, spread, spread)


def _linearised(problem: Problem, compliance: Array, change: Array) -> LinearReadings:
    """Return the readings about changes (P, m), those of a posture turned into at most m + 1."""
    pose = problem.model.pose
    predicted, slopes = displaced_with_slopes(problem.model, compliance * np.exp(change[pose]))
    used = problem.used
    of_row = pose[np.nonzero(used)[0]]
    felt = problem.whitening @ slopes[used]
    gap = problem.whitening @ (problem.measured - predicted)[used]
    value = gap + np.einsum("nj,nj->n", felt, change[of_row])
    m = felt.shape[1]
    rows, ids, rest, lost = [], [], 0.0, 0
    for posture in np.unique(of_row):
        own = of_row == posture
        block = np.column_stack([felt[own], value[own]])
        if len(block) > m:  # orthogonal: the same noise; what is below the first m rows is no change's
            block = np.asarray(np.linalg.qr(block, mode="r"))
            rest += float((block[m:] ** 2).sum())
            lost += int(own.sum()) - m
            block = block[:m]
        rows.append(block)
        ids.append(np.full(len(block), posture))
    every = np.concatenate(rows)
    return LinearReadings(every[:, -1], every[:, :-1], np.concatenate(ids), rest, lost)


def _chosen(readings: LinearReadings, random: np.random.Generator) -> LinearReadings:
    """Return the readings of so many postures that their covariance is inverted quickly."""
    postures = random.permutation(np.unique(readings.posture))
    held = np.cumsum([(readings.posture == one).sum() for one in postures])
    keep = np.isin(readings.posture, postures[held <= max(MOST, int(held[0]))])
    share = keep.mean()
    return replace(
        readings,
        value=readings.value[keep],
        slopes=readings.slopes[keep],
        posture=readings.posture[keep],
        rest=readings.rest * share,
        lost=round(readings.lost * share),
    )


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
        return np.asarray(np.log(np.concatenate([own.own_spread, own.spread, *ends])))

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
        weighted = np.stack([inner * np.outer(u, u) for u in readings.slopes.T])
        by_posture = np.add.reduceat(np.add.reduceat(weighted, first, axis=1), first, axis=2)
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


def _by_log_length(distance: Array) -> Array:
    """Return the derivative of the Matern covariance by the logarithm of its length, ``-r k'(r)``."""
    scaled = np.sqrt(5.0) * distance
    return np.asarray(scaled**2 * (1.0 + scaled) / 3.0 * np.exp(-scaled))


def most_evident(
    readings: LinearReadings, postures: Array, begin: Covariance, noise: float, sigma_known: bool
) -> tuple[Covariance, float]:
    """Return covariance and noise of most evidence; a noise that is stated (`sigma_known`) may grow only."""
    evidence = Evidence(readings, postures, begin)
    start = evidence.theta(noise)
    bounds = [(LOWEST, HIGHEST)] * (len(start) - 1) + [(0.0 if sigma_known else LOWEST, LOUDEST)]
    low, high = np.array(bounds).T
    start = np.clip(start, low, high)
    found = minimize(
        evidence, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": ITERATIONS}
    )
    return evidence.at(found.x)
