"""What is minimised: exact gradients, priors as more rows, robust losses that resist outliers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import huber

from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.objective import LOSSES, Objective
from beamstiff.identification.parameters import build_parameters
from beamstiff.identification.problem import build_problem
from beamstiff.measure.rows import subset
from tests.identification.campaigns import (
    POSITION,
    ROTATION,
    compliances,
    kr240,
    measured,
    rows,
    sensitivities,
    white,
)
from tests.identification.test_problem import any_data

NAMES = [f"J{at}.torsional" for at in range(1, 7)]
ROBUST = [name for name in LOSSES if name != "linear"]
seeds = st.integers(0, 2**32 - 1)


@cache
def objective_of(name: str = "kr240-2") -> Objective:
    """Return an objective with ties, a prior and a held value, of a robot with noisy data."""
    problem = build_problem(*any_data(name))
    names, start = problem.model.parameters, problem.model.start
    priors = {names[-1]: (1.1 * start[-1], 1.5)}
    stated = build_parameters(
        names, start, ties=[names[:2]], priors=priors, held=set(names[2:3]) - {names[-1]}
    )
    return Objective(problem, stated)


@pytest.mark.parametrize("loss", LOSSES)
@pytest.mark.parametrize("name", ["kr240-2", "ir663", "ir663-screws-beams"])
def test_gradients_are_differences_of_the_cost(name: str, loss: str) -> None:
    objective = replace(objective_of(name), loss=loss)
    theta = (
        objective.parameters.begin + np.random.default_rng(1).normal(size=objective.parameters.begin.size) / 3
    )
    cost, gradient = objective.gradient(theta)
    assert cost == pytest.approx(objective.cost(theta), rel=1e-13)
    for at in range(theta.size):
        unit = 1e-3 * np.eye(theta.size)[at]
        two, four = (
            (objective.cost(theta + n * unit) - objective.cost(theta - n * unit)) / (2e-3 * n) for n in (1, 2)
        )
        size = np.abs(gradient).max() + cost
        # a kink of the second derivative, Huber's, leaves a difference of the order of the step
        assert gradient[at] == pytest.approx(
            (4 * two - four) / 3, abs=(1e-4 if loss == "huber" else 1e-8) * size
        )


@given(seed=seeds)
def test_many_candidates_at_once_cost_what_they_cost_one_by_one(seed: int) -> None:
    for name in ("kr240-2", "ir663-screws-beams"):
        objective = replace(objective_of(name), loss="cauchy")
        thetas = objective.parameters.begin + np.random.default_rng(seed).normal(
            size=(7, objective.parameters.begin.size)
        )
        assert objective.costs(thetas) == pytest.approx([objective.cost(t) for t in thetas], rel=1e-12)


@pytest.mark.parametrize("loss", LOSSES)
def test_losses_are_slopes_of_one_another_and_squares_near_zero(loss: str) -> None:
    z = np.array([0.01, 0.1, 0.7, 1.5, 4.0, 100.0])
    value, slope, bend = LOSSES[loss](z)
    step = 1e-4 * z
    up, down = LOSSES[loss](z + step), LOSSES[loss](z - step)
    assert slope == pytest.approx((up[0] - down[0]) / (2 * step), rel=1e-6)
    assert bend == pytest.approx((up[1] - down[1]) / (2 * step), rel=1e-5, abs=1e-7)
    assert np.isfinite(value).all()
    assert LOSSES[loss](np.array([1e-7]))[0] == pytest.approx(1e-7, rel=1e-6)


def test_huber_is_that_of_scipy() -> None:
    residuals = np.linspace(-5, 5, 41)
    assert 0.5 * LOSSES["huber"](residuals**2)[0] == pytest.approx(huber(1.0, residuals), rel=1e-12)


# priors


def test_a_prior_in_a_linear_model_gives_the_closed_form_posterior() -> None:
    """One joint free, rigid links: ``d = a c + noise``, log c known to a factor; one equation is left."""
    robot, table = kr240(), rows(kr240(), 3)
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    data = measured(robot, table, white(table, 3))
    a = (sensitivities(robot, table).reshape(-1, 6) / spread[:, None])[:, 1]
    others = sensitivities(robot, table).reshape(-1, 6) @ (compliances(robot) * (np.arange(6) != 1))
    d = (data.displacement.ravel() - others) / spread
    known, factor = 1.4 * robot.parameter(NAMES[1]), 1.001
    found = identify(robot, data, [NAMES[1]], priors={NAMES[1]: (known, factor)}, folds=0)
    # of F(x) = |d - a e^-x|^2 / 2 + (x - log known)^2 / (2 s^2), by bisection of its derivative
    s = np.log(factor)

    def slope(x: float) -> float:
        c = np.exp(-x)
        return float(c * a @ (d - a * c)) + (x - np.log(known)) / s**2

    low, high = np.log(known) - 1, np.log(known) + 1
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope(middle) < 0 else (low, middle)
    assert np.log(found.stiffness[0]) == pytest.approx(low, abs=1e-9)
    without = identify(robot, data, [NAMES[1]], folds=0).stiffness[0]
    assert without < found.stiffness[0] < known  # between what the data say and what was known


def test_narrow_priors_give_the_gaussian_posterior_of_all_compliances() -> None:
    """Where the priors are narrow the model is linear in log c too: mean and covariance by Bayes' rule."""
    robot, table = kr240(), rows(kr240(), 4)
    table = replace(table, wrench=30 * table.wrench)  # so that the data are as sure as the priors
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    data = measured(robot, table, white(table, 6))
    truth = compliances(robot)
    s = 1e-4
    known = {name: ((1 + 2e-4 * (-1) ** at) / truth[at], 1 + s) for at, name in enumerate(NAMES)}
    found = identify(robot, data, priors=known, folds=0)
    a = -(sensitivities(robot, table).reshape(-1, 6) / spread[:, None]) * truth  # by log k, at the truth
    mean = np.log([known[name][0] * truth[at] for at, name in enumerate(NAMES)])
    noise = (data.displacement.ravel() / spread) - (
        sensitivities(robot, table).reshape(-1, 6) / spread[:, None]
    ) @ truth
    covariance = np.linalg.inv(a.T @ a + np.eye(6) / np.log1p(s) ** 2)
    expected = covariance @ (a.T @ noise + mean / np.log1p(s) ** 2)
    moved = np.log(found.stiffness * truth)
    assert moved == pytest.approx(expected, abs=2e-3 * s)
    assert (np.abs(moved - mean) > 0.02 * s).any()  # the data did say something


def test_a_prior_makes_known_what_the_data_do_not_tell() -> None:
    """Joint 6 turns about the tool: positions do not feel it."""
    robot, table = kr240(), rows(kr240(), 12)
    data = measured(robot, table, white(table, 2))
    found = identify(robot, data, components="position", priors={NAMES[5]: (3e5, 1.2)}, folds=0)
    assert found[NAMES[5]].value == pytest.approx(3e5, rel=1e-9)
    assert found[NAMES[5]].std == pytest.approx(3e5 * np.log(1.2), rel=1e-6)


# ties and held values


def test_tied_stiffness_is_that_of_the_summed_columns() -> None:
    """k4 = 2 k5: one compliance, whose column is the sum of both by their shares."""
    robot = kr240().with_parameters({NAMES[3]: 2e6, NAMES[4]: 1e6})
    table = rows(robot, 8)
    data = measured(robot, table, white(table, 9))
    found = identify(robot, data, ties=[[NAMES[3], NAMES[4]]], folds=0)
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    a = sensitivities(robot, table).reshape(-1, 6) / spread[:, None]
    together = np.column_stack([a[:, :3], a[:, 3] / 2 + a[:, 4], a[:, 5]])
    c = np.linalg.lstsq(together, data.displacement.ravel() / spread)[0]
    assert 1 / found.stiffness == pytest.approx([*c[:3], c[3] / 2, c[3], c[4]], rel=1e-7)


def test_fixed_stiffness_stays_and_the_others_are_fitted_beside_it() -> None:
    robot = kr240().with_parameters({NAMES[0]: 5e6})
    table = rows(robot, 8)
    data = measured(kr240(), table, white(table, 9))  # the true one is another
    found = identify(robot, data, fixed=[NAMES[0]], folds=0)
    assert found.robot.parameter(NAMES[0]) == 5e6
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    a = sensitivities(robot, table).reshape(-1, 6) / spread[:, None]
    c = np.linalg.lstsq(a[:, 1:], data.displacement.ravel() / spread - a[:, 0] / 5e6)[0]
    assert 1 / found.stiffness == pytest.approx(c, rel=1e-7)


# outliers


@pytest.mark.parametrize("loss", ROBUST)
def test_robust_losses_resist_outliers(loss: str) -> None:
    """One row in ten off by fifty standard deviations: near the fit without them; least squares is far."""
    robot, table = kr240(), rows(kr240(), 40)
    noise = white(table, 7)
    bad = np.arange(40) % 10 == 3
    clean = identify(robot, subset(measured(robot, table, noise), ~bad), folds=0)
    noise[bad] += 50 * np.repeat([POSITION, ROTATION], 3) * np.random.default_rng(1).choice([-1, 1], (4, 6))
    data = measured(robot, table, noise)
    std = np.sqrt(np.diagonal(clean.covariance))
    off = {
        name: np.abs(
            np.log(identify(robot, data, loss=name, folds=0).stiffness / clean.stiffness) / std
        ).max()
        for name in ("linear", loss)
    }
    assert off[loss] < 3
    assert off["linear"] > 3 * off[loss]


def test_priors_do_not_count_less_under_a_robust_loss() -> None:
    objective = replace(objective_of(), loss="cauchy")
    residuals = np.full(objective.problem.count + 6, 100.0)
    weights = objective.weights(residuals)
    assert (weights[: objective.problem.count] < 1e-2).all()
    assert (weights[objective.problem.count :] == 1).all()


def test_an_unknown_loss_is_named() -> None:
    table = measured(kr240(), rows(kr240(), 4))
    with pytest.raises(BeamstiffError, match="there is no loss 'tukey'; known: linear"):
        identify(kr240(), table, loss="tukey")
