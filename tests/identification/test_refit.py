"""Refits find what the trust region finds, whatever the loss; priors, ties and bounds hold in them too."""

import numpy as np
import pytest

from beamstiff.identification.minimise import minimise
from beamstiff.identification.objective import Loss
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import build_identification
from tests.identification.campaigns import kr240, measured, rows, sensitivities, white

ROBOT = kr240()


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
