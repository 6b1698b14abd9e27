"""Joint compliances that vary with the configuration, from measured displacements.

Springs follow weights phi of the configuration (the cube of the workspace, the firing of fuzzy rules)::

    log c_j(q) = log c_j + g_j + sum_r phi_r(q) x_jr        x_j ~ N(0, tau_j^2 R)

The hierarchical prior shrinks what few readings say towards the common value, by as much as the readings
themselves ask for: tau_j and the noise maximise the evidence (MacKay, "Bayesian interpolation", 1992). Where
springs are identifiable only in combination (joints 4 and 6 of a stretched wrist) it is the prior that parts
their sum. R is the correlation of the weights: none between cubes, that of neighbours between rules.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.problem import Problem, build_problem
from beamstiff.identification.wind_up import without_encoders
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
    """Compliances by weight, R weights and m springs."""

    change: Array  # (R, m): logarithms of the factors on the start, ``g_j + x_jr``
    std: Array  # (R, m): standard deviations of them
    spread: Array  # (m,): tau: how much the logarithms differ between weights
    common: Array  # (m,): g
    noise: float  # standard deviation of the whitened residuals; 1 where they are as stated
    evidence: float  # logarithm of the density of the readings, by Laplace's method: compares weights


@dataclass(frozen=True, eq=False)
class Begin:
    """Where corrections of a parametric model begin."""

    robot: Robot  # with the stiffness that fits best everywhere
    parameters: tuple[str, ...]  # the m springs that the readings feel
    compliance: Array  # (m,): theirs, about one over the stiffness
    problem: Problem


def begin_with(robot: Robot, table: Measurements, parameters: Sequence[str] | None = None) -> Begin:
    """Identify one stiffness for all configurations, and keep the springs that the readings feel.

    One as good as rigid begins where a reading would just show it: in places it may be compliant.
    """
    found = identify(robot, table, parameters, folds=0)
    felt = [not item.silent for item in found.parameters]
    names = tuple(item.name for item, own in zip(found.parameters, felt, strict=True) if own)
    compliance = 1.0 / found.stiffness[felt]
    problem = build_problem(found.robot, without_encoders(table), names)
    _, slopes = displaced_with_slopes(problem.model, np.tile(compliance, (len(table), 1)))
    shown = np.abs(problem.whitening @ slopes[problem.used]).max(axis=0)  # standard deviations
    compliance = compliance / np.where(shown > 0, np.minimum(shown, 1.0), 1.0)
    return Begin(found.robot, names, compliance, problem)


def fit_varying(
    problem: Problem,
    weights: Array,
    compliance: Array,
    correlation: Array | None = None,
    spread: Array | None = None,
) -> Varying:
    """Fit compliances that vary with weights of the configuration.

    `problem`: N rows, m springs. `weights` (N, R): phi: of each row, not negative, summing to one; equal in
    rows of one pose. `compliance` (m,): start of all. `correlation` (R, R): of the changes by weight,
    positive definite; default none. `spread` (m,): tau; default by evidence.
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
    fit = _Fit(problem, np.hstack([np.ones((rows, 1)), weights @ turn]), compliance)
    tau = np.full(m, FIRST) if spread is None else np.asarray(spread, dtype=np.float64)
    noise, free, state = 1.0, spread is None, np.zeros((count + 1, m))
    residual = fit.residual(state)
    for _ in range(ROUNDS):
        prior = np.concatenate([np.append(COMMON, np.full(count, one)) for one in tau])
        gram, slope = fit.normal_equations(state)
        factor = cho_factor(gram / noise**2 + np.diag(1.0 / prior**2))
        right = slope / noise**2 - state.T.ravel() / prior**2
        step = cho_solve(factor, right).reshape(m, count + 1).T
        state, residual, moved = fit.advance(state, step, residual, prior, noise)
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
        evidence=_evidence(residual, state, (prior, noise), factor[0]),
    )


def _std(covariance: Array, turn: Array) -> Array:
    """Return the standard deviations (R, m) of ``g_j + x_jr``."""
    each = len(turn) + 1
    sums = np.hstack([np.ones((each - 1, 1)), turn])
    blocks = covariance.reshape(-1, each, covariance.shape[0] // each, each)
    own = np.stack([blocks[at, :, at] for at in range(len(blocks))])
    return np.asarray(np.sqrt(np.maximum(((sums @ own) * sums).sum(axis=2), 0.0)).T)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Residuals, and their normal equations in g and x, spring by spring: m (R + 1) values."""

    problem: Problem
    weights: Array  # (N, R + 1): of g and x in every row, equal in those of a pose
    compliance: Array  # (m,)

    def residual(self, state: Array) -> Array:
        """Return the whitened residuals (n,) at g and x (R + 1, m)."""
        predicted = displaced(self.problem.model, self._compliances(state))
        return self.problem.whitening @ (self.problem.measured - predicted)[self.problem.used]

    def normal_equations(self, state: Array) -> tuple[Array, Array]:
        """Return ``J^T J`` and ``J^T r``, J the derivatives of the whitened predictions."""
        problem = self.problem
        predicted, slopes = displaced_with_slopes(problem.model, self._compliances(state))
        felt = problem.whitening @ slopes[problem.used]  # (n, m); whitening joins rows of one pose only
        residual = problem.whitening @ (problem.measured - predicted)[problem.used]
        pose = problem.model.pose[np.nonzero(problem.used)[0]]
        order = np.argsort(pose, kind="stable")
        first = np.flatnonzero(np.diff(pose[order], prepend=-1))
        felt, residual = felt[order], residual[order]
        m = felt.shape[1]
        squares = np.add.reduceat((felt[:, :, None] * felt[:, None, :]).reshape(-1, m * m), first)
        moments = np.add.reduceat(felt * residual[:, None], first)
        own = self.weights[np.unique(problem.model.pose, return_index=True)[1]][pose[order][first]]
        blocks = own.T @ (squares.T[:, :, None] * own)  # (m m, R + 1, R + 1)
        each = own.shape[1]
        gram = blocks.reshape(m, m, each, each).swapaxes(1, 2).reshape(m * each, m * each)
        slope: Array = (moments.T @ own).ravel()
        return gram, slope

    def advance(
        self, state: Array, step: Array, residual: Array, prior: Array, noise: float
    ) -> tuple[Array, Array, float]:
        """Return state and residuals after a step that lowers the cost, and how far it went."""

        def cost(at: Array, rest: Array) -> float:
            return float(rest @ rest) / noise**2 + float(((at.T.ravel() / prior) ** 2).sum())

        share = min(1.0, LARGEST / max(float(np.abs(step).max()), 1e-300))
        before = cost(state, residual)
        while share > 1e-6:
            there = state + share * step
            rest = self.residual(there)
            if cost(there, rest) <= before:
                return there, rest, float(np.abs(share * step).max())
            share /= 2
        return state, residual, 0.0

    def _compliances(self, state: Array) -> Array:
        return self.compliance * np.exp(self.weights @ state)


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
