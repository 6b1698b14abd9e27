"""Joint compliances that vary with the configuration, from measured displacements.

Springs follow weights phi of the configuration (the cube of the workspace, the firing of fuzzy rules)::

    log c_j(q) = log c_j + g_j + sum_r phi_r(q) x_jr        x_j ~ N(0, tau_j^2 R)

The hierarchical prior shrinks what few readings say towards the common value, by as much as the readings
themselves ask for: tau_j and the noise maximise the evidence (MacKay, "Bayesian interpolation", 1992). Where
springs only act together (joints 4 and 6 of a stretched wrist) it is the prior that parts their sum. R is the
correlation of the weights: none between cubes, that of neighbours between rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from beamstiff.errors import BeamstiffError
from beamstiff.identify.problem import Problem, state_problem
from beamstiff.identify.stiffness import identify
from beamstiff.measure.table import Measurements
from beamstiff.model.varying import displaced, displaced_with_slopes
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

COMMON = 1.0  # standard deviation of g, the logarithm of a change common to all: the start may be off by e
SPREADS = (1e-3, 3.0)  # of tau
FIRST = 0.3
ROUNDS, CLOSE = 40, 2e-3
LARGEST = 3.0  # of a step, in logarithms


@dataclass(frozen=True, eq=False)
class Varying:
    """Compliances by weight, R weights and m springs.

    Attributes
    ----------
    change : (R, m) array
        Logarithms of the factors on the start, ``g_j + x_jr``.
    std : (R, m) array
        Standard deviations of them.
    spread : (m,) array
        tau: how much the logarithms differ between weights.
    common : (m,) array
        g.
    noise : float
        Standard deviation of the whitened residuals; 1 where they are as stated.
    effective : float
        Values that the readings determine (MacKay's gamma).
    evidence : float
        Logarithm of the density of the readings, by Laplace's method: compares weights.
    """

    change: Array
    std: Array
    spread: Array
    common: Array
    noise: float
    effective: float
    evidence: float


@dataclass(frozen=True, eq=False)
class Begin:
    """Where corrections of a parametric model begin.

    Attributes
    ----------
    robot : Robot
        With the stiffness that fits best everywhere.
    parameters : tuple of str
        The m springs that the readings feel.
    compliance : (m,) array
        One over their stiffness.
    problem : Problem
    """

    robot: Robot
    parameters: tuple[str, ...]
    compliance: Array
    problem: Problem


def begin_with(robot: Robot, table: Measurements, parameters: Sequence[str] | None = None) -> Begin:
    """Identify one stiffness for all configurations, and keep the springs that the readings feel.

    Raises
    ------
    BeamstiffError
        As `identify`.
    """
    found = identify(robot, table, parameters, folds=0)
    felt = [not item.silent for item in found.parameters]
    names = tuple(item.name for item, own in zip(found.parameters, felt, strict=True) if own)
    return Begin(found.robot, names, 1.0 / found.stiffness[felt], state_problem(found.robot, table, names))


def fit_varying(
    problem: Problem,
    weights: Array,
    compliance: Array,
    correlation: Array | None = None,
    spread: Array | None = None,
) -> Varying:
    """Fit compliances that vary with weights of the configuration.

    Parameters
    ----------
    problem : Problem
        N rows, m springs.
    weights : (N, R) array
        phi: of each row, not negative, summing to one.
    compliance : (m,) array
        Start of all.
    correlation : (R, R) array, optional
        Of the changes by weight, positive definite; default none.
    spread : (m,) array, optional
        tau; default by evidence.

    Raises
    ------
    BeamstiffError
        When weights do not fit, or the fit does not converge.
    """
    rows, m = problem.used.shape[0], len(problem.model.parameters)
    if weights.shape[0] != rows or np.abs(weights.sum(axis=1) - 1).max(initial=0.0) > 1e-9:
        raise BeamstiffError(
            f"{problem.source}: found weights of shape {weights.shape}, expected a row that sums to one for "
            f"each of {rows}"
        )
    count = weights.shape[1]
    turn: Array = np.eye(count)  # x = turn @ z
    if correlation is not None:
        turn = np.asarray(np.linalg.cholesky(correlation), dtype=np.float64)
    to_rows = sparse.hstack([sparse.csr_array(np.ones((rows, 1))), sparse.csr_array(weights @ turn)]).tocsr()
    tau = np.full(m, FIRST) if spread is None else np.asarray(spread, dtype=np.float64)
    noise, free, state = 1.0, spread is None, np.zeros((count + 1, m))
    residual, jacobian = _linear(problem, to_rows, compliance, state)
    for _ in range(ROUNDS):
        prior = _prior(tau, count)
        gram = (jacobian.T @ jacobian).toarray() / noise**2
        factor = cho_factor(gram + np.diag(1.0 / prior**2))
        right = jacobian.T @ residual / noise**2 - state.T.ravel() / prior**2
        step = cho_solve(factor, right).reshape(m, count + 1).T
        state, residual, jacobian, moved = _advance(
            problem, to_rows, compliance, state, step, (prior, noise), residual, jacobian
        )
        covariance = cho_solve(factor, np.eye(prior.size))
        known = (1.0 - np.diagonal(covariance) / prior**2).reshape(m, count + 1)
        old = np.append(tau, noise)
        if free:
            tau = np.sqrt((state[1:] ** 2).sum(axis=0) / np.maximum(known[:, 1:].sum(axis=1), 1e-9))
            tau = np.clip(tau, *SPREADS)
        noise = _noise(problem, residual, float(known.sum()))
        if moved < CLOSE and np.abs(np.log(np.append(tau, noise) / old)).max() < 10 * CLOSE:
            break
    return Varying(
        change=turn @ state[1:] + state[0],
        std=_std(covariance, turn),
        spread=tau,
        common=state[0],
        noise=noise,
        effective=float(known.sum()),
        evidence=_evidence(residual, state, (prior, noise), factor[0]),
    )


def _std(covariance: Array, turn: Array) -> Array:
    """Return the standard deviations (R, m) of ``g_j + x_jr``."""
    each = len(turn) + 1
    sums = np.hstack([np.ones((each - 1, 1)), turn])
    blocks = covariance.reshape(-1, each, covariance.shape[0] // each, each)
    own = np.stack([blocks[at, :, at] for at in range(len(blocks))])
    result: Array = np.sqrt(np.maximum(((sums @ own) * sums).sum(axis=2), 0.0)).T
    return result


def _prior(tau: Array, count: int) -> Array:
    """Return the prior standard deviations of g and x, spring by spring, (m (R + 1),)."""
    return np.concatenate([np.append(COMMON, np.full(count, one)) for one in tau])


def _linear(
    problem: Problem, to_rows: sparse.csr_array, compliance: Array, state: Array
) -> tuple[Array, sparse.csr_array]:
    """Return whitened residuals (n,), and derivatives (n, m (R + 1)) of the predictions by g and x."""
    there = compliance * np.exp(np.asarray(to_rows @ state))
    predicted, slopes = displaced_with_slopes(problem.model, there)
    used = problem.used
    residual: Array = problem.whitening @ (problem.measured - predicted)[used]
    of_row = to_rows[np.nonzero(used)[0]]
    felt = slopes[used]  # (n, m)
    columns = [sparse.diags_array(felt[:, at]) @ of_row for at in range(felt.shape[1])]
    return residual, (problem.whitening @ sparse.hstack(columns)).tocsr()


def _advance(
    problem: Problem,
    to_rows: sparse.csr_array,
    compliance: Array,
    state: Array,
    step: Array,
    weights: tuple[Array, float],
    residual: Array,
    jacobian: sparse.csr_array,
) -> tuple[Array, Array, sparse.csr_array, float]:
    """Return state, residuals and derivatives after a step that lowers the cost, and how far it went."""
    prior, noise = weights

    def cost(at: Array, rest: Array) -> float:
        return float(rest @ rest) / noise**2 + float(((at.T.ravel() / prior) ** 2).sum())

    share = min(1.0, LARGEST / max(float(np.abs(step).max()), 1e-300))
    before = cost(state, residual)
    while share > 1e-6:
        there = state + share * step
        values = compliance * np.exp(np.asarray(to_rows @ there))
        rest = problem.whitening @ (problem.measured - displaced(problem.model, values))[problem.used]
        if cost(there, rest) <= before:
            residual, jacobian = _linear(problem, to_rows, compliance, there)
            return there, residual, jacobian, float(np.abs(share * step).max())
        share /= 2
    return state, residual, jacobian, 0.0


def _evidence(residual: Array, state: Array, weights: tuple[Array, float], root: Array) -> float:
    """Return the logarithm of the evidence by Laplace's method; root: a Cholesky factor at the optimum."""
    prior, noise = weights
    squares = float(residual @ residual) / noise**2 + float(((state.T.ravel() / prior) ** 2).sum())
    sizes = 2 * float(np.log(np.diagonal(root)).sum() + np.log(prior).sum())
    return -0.5 * (squares + sizes + residual.size * float(np.log(2 * np.pi * noise**2)))


def _noise(problem: Problem, residual: Array, effective: float) -> float:
    """Return the standard deviation of the whitened residuals: not below 1 where the noise is stated."""
    freedom = max(residual.size - effective, 0.05 * residual.size, 1.0)
    found = float(np.sqrt(residual @ residual / freedom))
    return max(found, 1.0 if problem.sigma_known else 1e-9)
