"""Refits against the trust region and least squares; the scatter of draws against the sandwich estimate."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, load_robot
from beamstiff.identification.bootstrap import blocks_of, bootstrap, without_leverage
from beamstiff.identification.minimise import minimise
from beamstiff.identification.objective import Loss
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import Statement, build_identification
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from benchmarks.coverage_study import ALL_RADIAL, ir663
from tests.identification.campaigns import kr240, measured, rows, sensitivities, white

ROBOT = kr240()
SPREAD = np.repeat([3e-5, 5e-5], 3)


def whitened(table: Measurements) -> tuple[np.ndarray, np.ndarray]:
    return (sensitivities(ROBOT, table) / SPREAD[:, None]).reshape(-1, 6), (
        table.displacement / SPREAD
    ).ravel()


def fitted(data: Measurements) -> tuple[Statement, np.ndarray]:
    statement = build_identification(ROBOT, data)
    return statement, refit(statement.objective, statement.parameters.begin)


def test_a_pose_that_is_drawn_twice_counts_twice() -> None:
    """The table with that pose twice in it, and without the one not drawn, gives the same."""
    table = rows(ROBOT, 8, 3, shared=True)
    data = measured(ROBOT, table, white(table, 1))
    statement, theta = fitted(data)
    often = np.array([2, 1, 0, 1, 1, 1, 1, 1])
    drawn = np.concatenate([np.flatnonzero(data.pose == pose) for pose in np.repeat(np.arange(8), often)])
    copies = np.repeat(np.arange(8), 3)  # numbers that keep the two copies' unloaded readings apart
    again = subset(data, drawn)
    again = make_measurements(
        again.variables,
        again.q,
        tcp=ROBOT.tcp,
        wrench=again.wrench,
        displacement=again.displacement,
        sigma_position=3e-5,
        sigma_rotation=5e-5,
        pose=copies,
        shared_unloaded=True,
    )
    by_counts = refit(statement.objective, theta, np.repeat(often[data.pose], 6).astype(float))
    np.testing.assert_allclose(by_counts, fitted(again)[1], atol=1e-7)


def test_residuals_freed_of_leverage_leave_the_optimum_where_it_is() -> None:
    table = rows(ROBOT, 5, 2, shared=True)
    statement, theta = fitted(measured(ROBOT, table, white(table, 9)))
    group, poses = blocks_of(statement.objective, statement.problem.pose)
    freed = without_leverage(statement.objective, theta, group)
    np.testing.assert_allclose(refit(freed, theta), theta, atol=1e-7)
    assert poses == 5
    assert freed.cost(theta) > statement.objective.cost(theta)


def test_refits_by_counts_are_weighted_least_squares() -> None:
    table = rows(ROBOT, 9)
    data = measured(ROBOT, table, white(table, 2))
    statement, theta = fitted(data)
    a, y = whitened(data)
    counts = np.repeat(np.random.default_rng(0).integers(0, 3, 9), 6).astype(float)
    expected = np.linalg.solve(a.T @ (counts[:, None] * a), a.T @ (counts * y))
    np.testing.assert_allclose(np.exp(-refit(statement.objective, theta, counts)), expected, rtol=1e-6)


def test_the_scatter_over_draws_is_the_sandwich_estimate() -> None:
    """``(A'A)^-1 sum_g A_g' e_g e_g' A_g (A'A)^-1`` over poses g, without leverage (Bell, McCaffrey 2002)."""
    table = rows(ROBOT, 80)
    noise = white(table, 3) * np.where(np.arange(80) % 4 == 0, 4.0, 1.0)[:, None]  # not as the table states
    data = measured(ROBOT, table, noise)
    statement, theta = fitted(data)
    a, y = whitened(data)
    inverse = np.linalg.inv(a.T @ a)
    compliance = inverse @ a.T @ y
    scores = np.empty((80, 6))
    for pose, (of_pose, rest) in enumerate(
        zip(a.reshape(80, 6, 6), (y - a @ compliance).reshape(80, 6), strict=True)
    ):
        value, vectors = np.linalg.eigh(np.eye(6) - of_pose @ inverse @ of_pose.T)
        scores[pose] = of_pose.T @ (vectors / np.sqrt(value)) @ vectors.T @ rest
    sandwich = inverse @ scores.T @ scores @ inverse
    found = bootstrap(statement, theta, 4000, seed=1)
    assert found.undetermined == 0
    assert found.poses == 80
    np.testing.assert_allclose(found.spread, np.sqrt(np.diagonal(sandwich)) / compliance, rtol=0.06)
    normal = 1 / compliance[0] * (1 + np.array([-1.96, 1.96]) * found.spread[0])
    np.testing.assert_allclose(found.intervals["J1.torsional"], normal, rtol=0.005)


def test_the_same_seed_draws_the_same_poses() -> None:
    table = rows(ROBOT, 10)
    statement, theta = fitted(measured(ROBOT, table, white(table, 4)))
    first, again, other = (bootstrap(statement, theta, 20, seed).stiffness for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_springs_that_only_act_together_get_an_interval_of_their_sum() -> None:
    robot, campaign = load_robot("ir663"), ir663("", ("J12.torsional", "J18.torsional", *ALL_RADIAL))
    statement = build_identification(robot, campaign.rows, campaign.parameters)
    problem, truth = statement.problem, statement.problem.model.start
    noise = problem.sigma * np.random.default_rng(7).standard_normal(problem.sigma.shape)
    statement = statement.measuring(np.where(problem.used, problem.model.predict(truth) + noise, 0.0))
    theta = refit(statement.objective, statement.parameters.begin)
    found = bootstrap(statement, theta, 200)
    sums = {"1/J12.radial + 1/J33.radial", "1/J18.radial + 1/J99.radial + 1/J1010.radial"}
    assert set(found.intervals) == {"J12.torsional", "J18.torsional", *sums}
    assert set(found.relations) == sums
    low, high = found.intervals["1/J18.radial + 1/J99.radial + 1/J1010.radial"]
    assert low < sum(1 / robot.parameter(f"J{joint}.radial") for joint in (18, 99, 1010)) < high


def test_draws_that_leave_a_parameter_open_are_told_and_not_counted() -> None:
    """Joint 1 is loaded in one pose of five only: a third of the draws miss it."""
    table = rows(ROBOT, 5)
    wrench = np.tile([0.0, 0, -1000, 0, 0, 0], (5, 1))  # along axis 1: it feels nothing
    wrench[0] = [700, 700, -300, 0, 0, 50]
    table = make_measurements(
        table.variables,
        table.q,
        tcp=ROBOT.tcp,
        wrench=wrench,
        displacement=np.zeros((5, 6)),
        sigma_position=3e-5,
        sigma_rotation=5e-5,
    )
    data = measured(ROBOT, table, white(table, 8))
    statement = build_identification(ROBOT, data, ["J1.torsional", "J2.torsional"])
    theta = refit(statement.objective, statement.parameters.begin)
    found = bootstrap(statement, theta, 600)
    assert found.undetermined / 600 == pytest.approx((1 - 1 / 5) ** 5, abs=0.06)
    assert len(found.stiffness) == 600 - found.undetermined


def test_too_few_poses_or_repetitions_are_refused() -> None:
    statement, theta = fitted(measured(ROBOT, rows(ROBOT, 3, 2)))
    with pytest.raises(BeamstiffError, match="found 3 poses, expected 4"):
        bootstrap(statement, theta)
    statement, theta = fitted(measured(ROBOT, rows(ROBOT, 6)))
    with pytest.raises(BeamstiffError, match="1 repetitions"):
        bootstrap(statement, theta, 1)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
@pytest.mark.parametrize("seed", range(3))
def test_refits_end_where_the_trust_region_does(loss: Loss, seed: int) -> None:
    table = rows(ROBOT, 10)
    noise = white(table, seed) * np.where(np.arange(10) % 5 == 0, 20.0, 1.0)[:, None]  # two bad rows
    objective = build_identification(ROBOT, measured(ROBOT, table, noise), loss=loss).objective
    begin = objective.parameters.begin
    found, expected = refit(objective, begin), minimise(objective, begin=begin)
    assert objective.cost(found) <= expected.cost * (1 + 1e-8)
    np.testing.assert_allclose(found, expected.theta, atol=1e-4 if loss == "huber" else 1e-5)
    assert np.abs(objective.gradient(found)[1]).max() < 1e-3


def test_refits_keep_priors_ties_and_bounds() -> None:
    table = rows(ROBOT, 10)
    objective = build_identification(
        ROBOT,
        measured(ROBOT, table, white(table, 4)),
        ties=[["J4.torsional", "J5.torsional"]],
        priors={"J2.torsional": (8e6, 1.01)},
        bounds={"J1.torsional": (None, 3.7e6)},
    ).objective
    theta = refit(objective, objective.parameters.begin)
    np.testing.assert_allclose(theta, minimise(objective).theta, atol=1e-6)
    stiffness = objective.parameters.stiffness(theta)
    assert stiffness[0] == pytest.approx(3.7e6, rel=1e-6)
    assert stiffness[3] / stiffness[4] == pytest.approx(5.6 / 6.6)
    assert 6.6e6 < stiffness[1] < 8e6


def test_a_spring_as_good_as_rigid_stops_at_its_bound_where_least_squares_finds_less_than_none() -> None:
    stiff = ROBOT.with_parameters({"J1.torsional": 1e15})
    table, spread = rows(ROBOT, 10), np.repeat([3e-5, 5e-5], 3)
    a = (sensitivities(ROBOT, table) / spread[:, None]).reshape(-1, 6)
    below = 0
    for seed in range(8):
        data = measured(stiff, table, white(table, seed))
        free = np.linalg.lstsq(a, (data.displacement / spread).ravel())[0]
        objective = build_identification(ROBOT, data).objective
        theta = refit(objective, objective.parameters.begin)
        if free[0] < 0:
            below += 1
            assert theta[0] == pytest.approx(objective.parameters.upper[0], abs=1e-6)
            free = np.concatenate([[0.0], np.linalg.lstsq(a[:, 1:], (data.displacement / spread).ravel())[0]])
        np.testing.assert_allclose(np.exp(-theta), free, rtol=1e-6, atol=1e-14)
    assert 0 < below < 8
