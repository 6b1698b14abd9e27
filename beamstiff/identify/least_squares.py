"""Nonlinear least squares in the logarithms of the stiffness values, with exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from beamstiff.errors import BeamstiffError
from beamstiff.identify.problem import Problem, state_problem
from beamstiff.identify.result import Identification, Parameter
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness import parameter_unit
from beamstiff.se3 import Array

SPAN = 1e8  # a stiffness is sought within this factor of its start, either way
# a relative uncertainty above this (one sigma, on a log scale) is no upper bound any more
UNBOUNDED = 1.0


def identify(
    robot: Robot, measurements: Measurements, parameters: Sequence[str] | None = None, folds: int = 5
) -> Identification:
    """Identify stiffness values from measured displacements by weighted least squares.

    Parameters
    ----------
    robot : Robot
        Its present stiffness values are the start.
    measurements : Measurements
        Displacements, loaded minus unloaded.
    parameters : sequence of str, optional
        Stiffness values to identify; default ``robot.identify``.
    folds : int
        Folds, by pose, of the held-out error.

    Raises
    ------
    BeamstiffError
        When the data cannot carry the identification; the message says what is missing.
    """
    problem = state_problem(robot, measurements, parameters)
    stiffness, evaluations = fit(problem)
    residual, jacobian = problem.jacobian(stiffness)
    names, freedom = problem.model.parameters, problem.count - stiffness.size
    chi_square = float(residual @ residual) / max(freedom, 1)
    # a stated noise that the residual exceeds is no measure of the uncertainty: the model's error counts too
    factor = max(chi_square, 1.0) if problem.sigma_known else chi_square
    information = jacobian.T @ jacobian
    scale = np.sqrt(np.maximum(np.diagonal(information), np.finfo(float).tiny))
    unloaded = [name for name, value in zip(names, np.diagonal(information), strict=True) if value <= 0.0]
    if unloaded:
        raise BeamstiffError(
            f"{measurements.source}: {unloaded[0]} is never loaded: its stiffness cannot be identified "
            "from these rows"
        )
    covariance = (
        factor * np.linalg.pinv(information / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    )
    found = tuple(
        _parameter(robot, name, value, float(np.sqrt(covariance[at, at])))
        for at, (name, value) in enumerate(zip(names, stiffness, strict=True))
    )
    predicted = problem.model.predict(stiffness)
    return Identification(
        parameters=found,
        covariance=covariance,
        stiffness=stiffness,
        rms=position_rms(problem, stiffness),
        rms_held_out=_held_out(problem, measurements.pose, folds),
        chi_square=chi_square,
        evaluations=evaluations,
        predicted=predicted,
    )


def fit(problem: Problem) -> tuple[Array, int]:
    """Return the stiffness values (m,) of the least weighted squares, and the number of evaluations."""
    start: Array = np.log(problem.model.start)

    def residuals(theta: Array) -> Array:
        return problem.residuals(np.exp(theta))

    def jacobian(theta: Array) -> Array:
        return problem.jacobian(np.exp(theta))[1]

    solution = least_squares(
        residuals,
        start,
        jac=jacobian,
        bounds=(start - np.log(SPAN), start + np.log(SPAN)),
        x_scale="jac",
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    if not solution.success or not np.isfinite(solution.cost):
        raise BeamstiffError(f"the identification did not converge: {solution.message}")
    return np.exp(solution.x), int(solution.nfev)


def position_rms(problem: Problem, stiffness: Array) -> float:
    """Return the root mean square over rows of the norm of the position residual, m."""
    gap = np.where(problem.used, problem.measured - problem.model.predict(stiffness), 0.0)[:, :3]
    rows = problem.used[:, :3].any(axis=1)
    return float(np.sqrt((gap[rows] ** 2).sum(axis=1).mean())) if rows.any() else 0.0


def _parameter(robot: Robot, name: str, value: float, log_std: float) -> Parameter:
    unit = parameter_unit(robot, name)
    if log_std < UNBOUNDED:
        return Parameter(name, unit, value, value * log_std, True)
    # one-sided, on the compliance: c < c_hat + 1.645 sigma_c
    return Parameter(name, unit, None, None, False, lower_bound=value / (1 + 1.645 * log_std))


def _held_out(problem: Problem, pose: Integers, folds: int) -> float | None:
    """Return the RMS on poses not fitted, m; None where the other poses are too few to fit without them."""
    poses = np.unique(pose)
    if poses.size < 3:
        return None
    square, count = 0.0, 0
    for fold in range(min(folds, poses.size)):
        out = np.isin(pose, poses[fold::folds])[:, None]
        training = replace(problem, used=problem.used & ~out)
        testing = replace(problem, used=problem.used & out)
        if training.count < problem.model.start.size:
            return None
        try:
            stiffness, _ = fit(training)
        except BeamstiffError:
            return None
        rows = int(testing.used[:, :3].any(axis=1).sum())
        square += position_rms(testing, stiffness) ** 2 * rows
        count += rows
    return float(np.sqrt(square / count)) if count else None
