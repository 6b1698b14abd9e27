"""Likelihoods against scipy's multivariate normal; criteria by their definitions; the right model wins."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from beamstiff import BeamstiffError
from beamstiff.identification.compare import compare, log_likelihood
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.statement import state_identification
from tests.identification.campaigns import kr240, measured, rows, sensitivities, shared_covariance, white

ROBOT = kr240()
WRIST = ["J4.torsional", "J5.torsional", "J6.torsional"]


def test_the_likelihood_is_that_of_the_multivariate_normal() -> None:
    table = rows(ROBOT, 4, 3, shared=True)
    data = measured(ROBOT, table, white(table, 1))
    statement = state_identification(ROBOT, data)
    stiffness = statement.problem.model.start * 1.03
    predicted = (sensitivities(ROBOT, data) @ (1 / stiffness)).ravel()
    normal = multivariate_normal(predicted, shared_covariance(data))
    assert log_likelihood(statement.problem, stiffness) == pytest.approx(
        normal.logpdf(data.displacement.ravel()), rel=1e-10
    )


def test_errors_of_the_inputs_are_part_of_the_likelihood() -> None:
    table = rows(ROBOT, 6)
    data = measured(ROBOT, table, white(table, 2))
    statement = state_identification(ROBOT, data, errors=InputErrors(load=40.0))
    start = statement.problem.model.start
    moved = sensitivities(ROBOT, data) @ (1 / start)
    share = 40.0 / np.linalg.norm(data.wrench[:, :3], axis=1)
    spread = np.diag(np.repeat([3e-5, 5e-5], 3) ** 2)
    expected = sum(
        multivariate_normal(row, spread + s**2 * np.outer(row, row)).logpdf(seen)
        for row, s, seen in zip(moved, share, data.displacement, strict=True)
    )
    assert log_likelihood(statement.problem, start) == pytest.approx(expected, rel=1e-8)


def test_criteria_are_as_defined() -> None:
    table = rows(ROBOT, 8)
    statement = state_identification(ROBOT, measured(ROBOT, table, white(table, 3)))
    tied = state_identification(ROBOT, measured(ROBOT, table, white(table, 3)), ties=[WRIST])
    found = compare({"free": statement, "tied": tied})
    assert found.components == 48
    for name, count in (("free", 6), ("tied", 4)):
        score = found[name]
        assert score.count == count
        assert score.aic == pytest.approx(2 * count - 2 * score.log_likelihood)
        assert score.aicc == pytest.approx(score.aic + 2 * count * (count + 1) / (48 - count - 1))
        assert score.bic == pytest.approx(count * np.log(48) - 2 * score.log_likelihood)
    assert found["free"].log_likelihood >= found["tied"].log_likelihood  # one lies within the other
    ratio = np.exp(-0.5 * (found["free"].aicc - found["tied"].aicc))
    assert found["free"].weight / found["tied"].weight == pytest.approx(ratio)
    assert found["free"].weight + found["tied"].weight == pytest.approx(1)


def test_noise_that_is_not_stated_is_one_more_value() -> None:
    table = rows(ROBOT, 8, sigma=False)
    data = measured(ROBOT, table, white(table, 4))
    found = compare({"five": state_identification(ROBOT, data, ROBOT.identify[:5], components="position")})
    a = sensitivities(ROBOT, data)[:, :3, :5].reshape(-1, 5)
    y = data.displacement[:, :3].ravel()
    squares = float(np.linalg.lstsq(a, y)[1][0])
    expected = -0.5 * 24 * (np.log(2 * np.pi * squares / 24) + 1)  # joint 6 moves nothing that is measured
    assert found["five"].count == 6
    assert found["five"].log_likelihood == pytest.approx(expected, rel=1e-9)
    assert found["five"].held_out is not None
    assert found["five"].held_out < found["five"].log_likelihood


def test_a_model_that_lacks_what_gives_way_loses_and_one_with_too_much_gains_nothing() -> None:
    """Machines whose wrist drives keep the published ratio, drive 2 half as stiff as published."""
    wins = {"tied": 0, "free": 0, "without joint 2": 0}
    unseen = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        values = {name: ROBOT.parameter(name) * 0.8 for name in WRIST}
        values["J2.torsional"] = 0.5 * ROBOT.parameter("J2.torsional")
        table = rows(ROBOT, 6)
        data = measured(ROBOT.with_parameters(values), table, white(table, int(random.integers(2**31))))
        found = compare(
            {
                "free": state_identification(ROBOT, data),
                "tied": state_identification(ROBOT, data, ties=[WRIST]),
                "without joint 2": state_identification(ROBOT, data, fixed=["J2.torsional"]),
            }
        )
        wins[found.best.name] += 1
        unseen.append(found["tied"].held_out - found["free"].held_out)
        assert found["without joint 2"].weight < 1e-6
        assert found["without joint 2"].rms_held_out > 2 * found["tied"].rms_held_out
        assert min(found.scores, key=lambda score: score.bic).name != "without joint 2"
    assert wins["without joint 2"] == 0
    assert wins["tied"] > wins["free"]
    assert np.mean(unseen) > 0


def test_models_that_cannot_be_compared_are_refused() -> None:
    table = rows(ROBOT, 8)
    data = measured(ROBOT, table, white(table, 5))
    one = state_identification(ROBOT, data)
    with pytest.raises(BeamstiffError, match="found no model"):
        compare({})
    with pytest.raises(BeamstiffError, match="'huber' in 'robust'"):
        compare({"one": one, "robust": state_identification(ROBOT, data, loss="huber")})
    with pytest.raises(BeamstiffError, match="one, other are of different data"):
        compare({"one": one, "other": state_identification(ROBOT, measured(ROBOT, table))})
    position = state_identification(ROBOT, data, ROBOT.identify[:5], components="position")
    with pytest.raises(BeamstiffError, match="different data"):
        compare({"one": one, "position": position})
