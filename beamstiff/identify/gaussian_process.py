"""Gaussian processes of joint compliances taught by measured displacements.

Linear-Gaussian about the parametric fit, linearised again where the readings lead; the spreads, lengths and
the noise maximise the evidence, with mild priors against what few readings cannot tell (Rasmussen and
Williams, 2006, eqs 2.30, 5.8, 5.9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky
from scipy.optimize import minimize

from beamstiff.errors import BeamstiffError
from beamstiff.identify.configuration import Begin, begin_with
from beamstiff.identify.problem import Problem
from beamstiff.measure.table import Measurements
from beamstiff.model.gaussian_process import COMMON, Covariance, GaussianProcessStiffness, matern
from beamstiff.model.varying import displaced_with_slopes
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

ROUNDS = 3  # of linearising again
MOST = 600  # readings that spreads and lengths are found from
# priors of the logarithms of spreads, of lengths, of the noise beyond what is stated: mean, std
SPREAD, LENGTH, NOISE = (np.log(0.15), 1.5), (np.log(1.0), 0.7), (0.0, 2.0)
LOWEST, HIGHEST = -7.0, 3.0  # of these logarithms


@dataclass(frozen=True, eq=False)
class GaussianProcessFit:
    """A fitted Gaussian process model.

    Attributes
    ----------
    model : GaussianProcessStiffness
    noise : float
        Standard deviation of the whitened readings; 1 where they are as stated.
    evidence : float
        Logarithm of the density of the readings.
    """

    model: GaussianProcessStiffness
    noise: float
    evidence: float


@dataclass(frozen=True, eq=False)
class _Readings:
    """Whitened readings, linear in the logarithms of their posture, noise of unit variance.

    Attributes
    ----------
    value : (n,) array
    slopes : (n, m) array
    posture : (n,) int array
    rest : float
        Sum of squares that no change of the posture's compliances could explain.
    lost : int
        Readings that these squares are of.
    """

    value: Array
    slopes: Array
    posture: NDArray[np.int64]
    rest: float
    lost: int


def fit_gaussian_process(
    robot: Robot, table: Measurements, parameters: Sequence[str] | None = None, seed: int = 0
) -> GaussianProcessFit:
    """Teach joint compliances that vary with the configuration from measured displacements.

    Parameters
    ----------
    robot : Robot
    table : Measurements
        Displacements, loaded minus unloaded.
    parameters : sequence of str, optional
        Springs that may vary; default ``robot.identify``.
    seed : int
        Of the choice of readings that spreads and lengths are found from, where there are very many.

    Raises
    ------
    BeamstiffError
        When the data cannot carry the identification of the parametric model.

    Examples
    --------
    >>> from beamstiff import load_robot
    >>> from beamstiff.measure import make_measurements
    >>> from beamstiff.model.linear import predict_displacements
    >>> robot, random = load_robot("kr240-2"), np.random.default_rng(0)
    >>> names = [variable.name for variable in robot.actuated]
    >>> q, wrench = random.uniform(-1, 1, (20, 6)), 800 * random.normal(size=(20, 6))
    >>> still = make_measurements(names, q, tcp=robot.tcp, wrench=wrench)
    >>> seen = predict_displacements(robot, still)[:, :3] + 3e-5 * random.normal(size=(20, 3))
    >>> rows = make_measurements(
    ...     names, q, tcp=robot.tcp, wrench=wrench, displacement=seen, sigma_position=3e-5
    ... )
    >>> model = fit_gaussian_process(robot, rows).model
    >>> far, near = (model.logarithms(q[:1] + turn)[1][0] for turn in (3.0, 0.0))
    >>> bool((np.diag(far) > np.diag(near)).all())
    True
    """
    start = begin_with(robot, table, parameters)
    problem = start.problem
    if problem.disturbance is not None:
        raise BeamstiffError(f"{problem.source}: errors of the inputs are not part of this fit")
    postures = np.unique(table.q, axis=0)
    covariance = _first(start, postures)
    change, noise = np.zeros((len(postures), len(start.parameters))), 1.0
    for _ in range(ROUNDS):
        readings = _linearised(problem, start.compliance, change)
        few = _chosen(readings, np.random.default_rng(seed))
        covariance, noise = _most_evident(few, postures, covariance, noise, problem.sigma_known)
        root, weights = _solved(readings, postures, covariance, noise)
        cross = covariance.between(postures, postures)[:, :, readings.posture]
        change = ((cross * readings.slopes.T[:, None]) @ weights).T
    size = np.array(
        [
            np.median(problem.sigma[:, at][problem.used[:, at]]) if problem.used[:, at].any() else 0.0
            for at in range(6)
        ]
    )
    misfit = size * np.sqrt(max(noise**2 - 1.0, 0.0)) if problem.sigma_known else 0.0 * size
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


def _linearised(problem: Problem, compliance: Array, change: Array) -> _Readings:
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
    return _Readings(every[:, -1], every[:, :-1], np.concatenate(ids), rest, lost)


def _chosen(readings: _Readings, random: np.random.Generator) -> _Readings:
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
    readings: _Readings, postures: Array, covariance: Covariance, noise: float
) -> tuple[Array, Array]:
    """Return the Cholesky factor of the readings' covariance, and its inverse times the readings."""
    total = noise**2 * np.eye(len(readings.value))
    own = covariance.between(postures, postures)
    for of_spring, slopes in zip(own, readings.slopes.T, strict=True):
        total += of_spring[np.ix_(readings.posture, readings.posture)] * np.outer(slopes, slopes)
    root = cholesky(total, lower=True)
    return root, cho_solve((root, True), readings.value)


def _most_evident(
    readings: _Readings, postures: Array, begin: Covariance, noise: float, sigma_known: bool
) -> tuple[Covariance, float]:
    """Return the covariance and noise of most evidence, by L-BFGS over the logarithms of their values."""
    m, count = len(begin.own), len(begin.scale)
    at = postures[readings.posture]
    apart = (at[:, None] - at) / begin.scale
    squares = apart**2
    products = readings.slopes.T[:, :, None] * readings.slopes.T[:, None, :]
    common = COMMON**2 * products.sum(axis=0)
    n = len(readings.value)
    about = np.array([SPREAD] * (2 * m) + [LENGTH] * (count + 1) + [NOISE])

    def negative(theta: Array) -> tuple[float, Array]:
        a, b = np.exp(theta[:m]), np.exp(theta[m : 2 * m])
        own_length, lengths, s = np.exp(theta[2 * m]), np.exp(theta[2 * m + 1 : -1]), np.exp(theta[-1])
        distance = np.sqrt(squares @ lengths**-2)
        whole, whole_slope = _matern_with_slope(distance)
        total = common + np.einsum("j,jab->ab", b**2, products) * whole
        parts = []
        for j, own in enumerate(begin.own):
            value, slope = _matern_with_slope(np.abs(apart[:, :, own]) / own_length if own >= 0 else distance)
            parts.append(
                (value * products[j], slope * products[j]) if own >= 0 else (0.0 * total, 0.0 * total)
            )
            total = total + a[j] ** 2 * parts[-1][0]
        try:
            root = cholesky(total + s**2 * np.eye(n), lower=True)
        except np.linalg.LinAlgError:
            return np.inf, np.zeros_like(theta)
        inverse = cho_solve((root, True), np.eye(n))
        alpha = inverse @ readings.value
        cost = 0.5 * float(readings.value @ alpha) + float(np.log(np.diagonal(root)).sum())
        cost += 0.5 * readings.rest / s**2 + readings.lost * float(np.log(s))
        inner = inverse - np.outer(alpha, alpha)  # d cost = 1/2 sum(inner * d total)
        gradient = np.zeros_like(theta)
        for j, (value, slope) in enumerate(parts):
            gradient[j] = a[j] ** 2 * float((inner * value).sum())
            gradient[2 * m] += 0.5 * a[j] ** 2 * float((inner * slope).sum())
        faded = inner * np.einsum("j,jab->ab", b**2, products)
        gradient[m : 2 * m] = b**2 * np.einsum("ab,jab->j", inner * whole, products)
        # slope is -d k / d log r * ... : k'(r) r = -slope, r^2 = sum (apart / l)^2
        share = faded * np.divide(whole_slope, distance**2, out=np.zeros_like(distance), where=distance > 0)
        gradient[2 * m + 1 : -1] = 0.5 * np.einsum("ab,abv->v", share, squares) / lengths**2
        gradient[-1] = s**2 * float(np.trace(inner)) - readings.rest / s**2 + readings.lost
        away = (theta - about[:, 0]) / about[:, 1]
        return cost + 0.5 * float(away @ away), gradient + away / about[:, 1]

    start = np.log(
        np.concatenate([begin.own_spread, begin.spread, [begin.own_length], begin.lengths, [noise]])
    )
    bounds = [(LOWEST, HIGHEST)] * (len(start) - 1) + [(0.0 if sigma_known else LOWEST, HIGHEST + 4)]
    low, high = np.array(bounds).T
    found = minimize(
        negative,
        np.clip(start, low, high),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": 60},
    )
    a, b, own_length, lengths = np.split(np.exp(found.x[:-1]), [m, 2 * m, 2 * m + 1])
    changed = replace(begin, own_spread=a, spread=b, own_length=float(own_length[0]), lengths=lengths)
    return changed, float(np.exp(found.x[-1]))


def _matern_with_slope(distance: Array) -> tuple[Array, Array]:
    """Return the covariance and its derivative by the logarithm of the length, ``-r k'(r)``."""
    scaled = np.sqrt(5.0) * distance
    return matern(distance), scaled**2 * (1.0 + scaled) / 3.0 * np.exp(-scaled)
