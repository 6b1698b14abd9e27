"""Compliances by weights of the configuration: planted ones come back, few readings shrink to the common."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff import BeamstiffError
from beamstiff.identification.models.configuration import COMMON, begin_with, fit_varying
from beamstiff.identification.problem import Problem, build_problem
from beamstiff.model.ports import reduce_to_ports
from tests.identification.varying_machines import compliances, kr500, loads, nothing, postures, table


def halves(q: np.ndarray) -> np.ndarray:
    """Return the weights of two halves of the workspace, (N, 2)."""
    left = q[:, 0] > 0
    return np.stack([left, ~left], axis=1).astype(np.float64)


def of_halves(change: np.ndarray) -> Problem:
    q = np.repeat(postures(30), 2, axis=0)
    return build_problem(kr500(), table(q, loads(60), lambda q: halves(q) @ change, noise=0.0, sigma=1e-7))


def test_planted_compliances_of_halves_come_back() -> None:
    change = np.random.default_rng(1).normal(size=(2, 6)) * 0.4
    problem = of_halves(change)
    found = fit_varying(problem, halves(np.repeat(postures(30), 2, axis=0)), compliances())
    assert np.abs(found.change - change).max() < 2e-3
    assert (np.abs(found.change - change) < 5 * found.std + 1e-6).all()


def test_the_linear_case_is_the_gaussian_posterior_of_textbooks() -> None:
    """With changes so small that they are linear: mean and variance from dense covariances."""
    q = np.repeat(postures(8), 2, axis=0)
    weights, tau = halves(q), np.full(6, 1e-3)
    change = np.random.default_rng(2).normal(size=(2, 6)) * 1e-3
    problem = build_problem(kr500(), table(q, loads(16), lambda q: halves(q) @ change, noise=1e-7))
    found = fit_varying(problem, weights, compliances(), spread=tau)
    shares = reduce_to_ports(kr500(), table(q, loads(16), nothing), kr500().identify).by_compliance
    by_log = shares * compliances()  # (N, 6, 6)
    columns = np.einsum("nij,nr->nirj", by_log, weights).reshape(96, 12)
    measured = table(q, loads(16), lambda q: halves(q) @ change, noise=1e-7).displacement.ravel()
    gap = measured - by_log.sum(axis=2).ravel()
    prior = np.kron(COMMON**2 * np.ones((2, 2)) + 1e-6 * np.eye(2), np.eye(6))
    inverse = np.linalg.inv(columns @ prior @ columns.T + 1e-10 * np.eye(96))
    mean = prior @ columns.T @ inverse @ gap
    covariance = prior - prior @ columns.T @ inverse @ columns @ prior
    assert np.abs(found.change.ravel() - mean).max() < 1e-4
    assert np.allclose(found.std.ravel(), np.sqrt(np.diagonal(covariance)), rtol=2e-2)


def test_a_weight_without_readings_has_the_common_value_and_the_spread_of_the_others() -> None:
    q = np.repeat(postures(30), 2, axis=0)
    weights = np.concatenate([halves(q), np.zeros((60, 1))], axis=1)
    change = np.random.default_rng(1).normal(size=(2, 6)) * 0.4
    found = fit_varying(of_halves(change), weights, compliances(), spread=np.full(6, 0.3))
    assert np.abs(found.change[2] - found.common).max() < 1e-9
    assert (found.std[2] >= 0.3).all()
    assert (found.std[:2] < 0.1).all()


def test_where_nothing_varies_the_spread_vanishes() -> None:
    q = np.repeat(postures(40), 2, axis=0)
    problem = build_problem(kr500(), table(q, loads(80), nothing))
    found = fit_varying(problem, halves(q), compliances())
    assert (found.spread < 0.03).all()
    assert np.ptp(found.change, axis=0).max() < 0.02


@given(st.integers(0, 1000))
@settings(max_examples=8)
def test_intervals_hold_the_truth_as_often_as_they_say(seed: int) -> None:
    """36 values of 6 cells, three standard deviations: nearly all within, and not by being wide."""
    random = np.random.default_rng(seed)
    q = np.repeat(postures(36), 2, axis=0)
    cell = np.repeat(np.arange(36) % 6, 2)
    change = 0.2 * random.standard_normal((6, 6))
    rows = table(q, loads(72), lambda _: change[cell], seed=seed)
    found = fit_varying(build_problem(kr500(), rows), np.eye(6)[cell], compliances())
    away = np.abs(found.change - change) / found.std
    assert (away < 3.5).mean() > 0.9
    assert np.sqrt((away**2).mean()) > 0.5


def test_noise_that_was_understated_is_found() -> None:
    q = np.repeat(postures(40), 2, axis=0)
    problem = build_problem(kr500(), table(q, loads(80), nothing, noise=3e-5, sigma=1e-5))
    assert 2.7 < fit_varying(problem, halves(q), compliances()).noise < 3.3


def test_more_weights_than_the_readings_ask_for_have_less_evidence() -> None:
    q = np.repeat(postures(30), 2, axis=0)
    problem = build_problem(kr500(), table(q, loads(60), nothing))
    single, many = np.ones((60, 1)), np.eye(30)[np.repeat(np.arange(30), 2)]
    fits = [fit_varying(problem, weights, compliances()) for weights in (single, many)]
    assert fits[0].evidence > fits[1].evidence - 1.0
    change = np.random.default_rng(1).normal(size=(2, 6)) * 0.4
    both = [fit_varying(of_halves(change), weights, compliances()) for weights in (single, halves(q))]
    assert both[1].evidence > both[0].evidence + 100


def test_what_the_readings_do_not_feel_is_left_out() -> None:
    q = postures(20)
    push = np.tile([0, 0, -500.0, 0, 0, 0], (20, 1))
    start = begin_with(kr500(), table(q, push, nothing))
    assert "J1.torsional" not in start.parameters
    assert start.robot.parameter("J1.torsional") == kr500().parameter("J1.torsional")


def test_weights_that_do_not_sum_to_one_are_refused() -> None:
    problem = of_halves(np.zeros((2, 6)))
    with pytest.raises(
        BeamstiffError, match=r"found weights of shape \(60, 2\), expected a row that sums to"
    ):
        fit_varying(problem, np.ones((60, 2)), compliances())


def test_a_spring_that_fits_as_rigid_begins_where_a_reading_would_show_it() -> None:
    q, push = postures(30), loads(30)
    stiff = np.array([0, 0, -18.0, 0, 0, 0])  # joint 3 gives way by less than a nanometre
    start = begin_with(kr500(), table(q, push, lambda q: np.tile(stiff, (len(q), 1))))
    at = start.parameters.index("J3.torsional")
    model = start.problem.model
    moved = np.abs(model.by_compliance[:, :, at] * start.compliance[at]).max()
    assert 0.9e-5 < moved < 1e-4
