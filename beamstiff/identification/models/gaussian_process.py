"""Gaussian processes of joint compliances taught by measured displacements.

Linear-Gaussian about the parametric fit, linearised again where the readings lead; the spreads, lengths and
the noise maximise the evidence, with mild priors against what few readings cannot tell (Rasmussen and
Williams, 2006, eqs 2.30, 5.8, 5.9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve

from beamstiff.identification.models.configuration import Begin, begin_with
from beamstiff.identification.models.evidence import (
    SPREAD,
    LinearReadings,
    most_evident,
    prior_of_readings,
    readings_root,
)
from beamstiff.identification.problem import Problem
from beamstiff.measure.table import Measurements
from beamstiff.model.gaussian_process import Covariance, GaussianProcessStiffness
from beamstiff.model.varying import displaced_with_slopes
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

ROUNDS = 3  # of linearising again
MOST = 600  # readings that spreads and lengths are found from


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
        root, weights = _solved(readings, postures, covariance, noise)
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
    )
    told = -0.5 * float(readings.value @ weights) - float(np.log(np.diagonal(root)).sum())
    told -= 0.5 * readings.rest / noise**2 + readings.lost * float(np.log(noise))
    told -= 0.5 * (readings.value.size + readings.lost) * float(np.log(2 * np.pi))
    return GaussianProcessFit(model, noise, told)


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


def _solved(
    readings: LinearReadings, postures: Array, covariance: Covariance, noise: float
) -> tuple[Array, Array]:
    """Return the Cholesky factor of the readings' covariance, and its inverse times the readings."""
    own = covariance.between(postures, postures)
    total = prior_of_readings(own, readings.slopes, readings.posture)
    root = readings_root(total, noise)
    return root, cho_solve((root, True), readings.value)
