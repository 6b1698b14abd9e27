"""Monte Carlo sensitivity against the propagation of small errors through least squares; its study."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from beamstiff import BeamstiffError, load_robot
from beamstiff.identification.bootstrap import number_of_tests
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.refit import refit
from beamstiff.identification.sensitivity import Sensitivity, sensitivity
from beamstiff.identification.statement import build_identification
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from benchmarks.coverage_study import ALL_RADIAL, ir663
from benchmarks.sensitivity_study import ERRORS as PAPER
from benchmarks.sensitivity_study import campaign, print_number, print_sensitivity
from tests.identification.campaigns import (
    compliances,
    kr240,
    measured,
    rows,
    sensitivities,
    shared_covariance,
)

ROBOT = kr240()
SPREAD = np.repeat([3e-5, 5e-5], 3)
ERRORS = InputErrors(load=15.0, angle=0.003, hold_angle=2e-5)


def study(shared: bool = False, repetitions: int = 400) -> Sensitivity:
    table = measured(ROBOT, rows(ROBOT, 8, 2, shared=shared))
    statement = build_identification(ROBOT, table)
    theta = refit(statement.objective, statement.parameters.begin)
    return sensitivity(statement, table, theta, ERRORS, repetitions, seed=1)


def gains(shared: bool) -> np.ndarray:
    """Return ``(A' S^-1 A)^-1 A' S^-1`` (6, 6N), relative to the compliances."""
    table = rows(ROBOT, 8, 2, shared=shared)
    a = sensitivities(ROBOT, table).reshape(-1, 6)
    covariance = shared_covariance(table) if shared else np.diag(np.tile(SPREAD**2, 16))
    weight = np.linalg.inv(covariance)
    return np.linalg.solve(a.T @ weight @ a, a.T @ weight) / compliances(ROBOT)[:, None]


@pytest.mark.parametrize("shared", [False, True])
def test_errors_of_each_source_scatter_as_least_squares_propagates_them(shared: bool) -> None:
    table, gain, c = rows(ROBOT, 8, 2, shared=shared), gains(shared), compliances(ROBOT)
    found = study(shared)
    assert found.sources == ("readings", "load", "angle", "hold_angle", "all")
    readings = shared_covariance(table) if shared else np.diag(np.tile(SPREAD**2, 16))
    # the load is read to 15 N: the row moves in proportion
    moved = (sensitivities(ROBOT, table) @ c) * (15.0 / np.linalg.norm(table.wrench[:, :3], axis=1))[:, None]
    load = np.zeros_like(readings)
    for row in range(16):
        at = slice(6 * row, 6 * row + 6)
        load[at, at] = np.outer(moved[row], moved[row])
    angle = np.zeros_like(readings)
    for joint in range(6):
        step = 1e-5 * np.eye(6)[joint]
        plus, minus = (sensitivities(ROBOT, replace(table, q=table.q + sign * step)) @ c for sign in (1, -1))
        by_angle = 0.003 * (plus - minus) / 2e-5
        for pose in range(8):
            at = (by_angle * (table.pose == pose)[:, None]).ravel()
            angle += np.outer(at, at)
    kinematics = compile_kinematics(ROBOT)
    jacobian = twist_jacobian(kinematics, posture(kinematics, table.q), ROBOT.tcp)
    hold = np.zeros_like(readings)
    for row in range(16):
        at = slice(6 * row, 6 * row + 6)
        hold[at, at] = 4e-10 * jacobian[row] @ jacobian[row].T
    every = (readings, load, angle, hold, readings + load + angle + hold)
    for source, covariance in zip(found.spread, every, strict=True):
        expected = np.sqrt(np.diagonal(gain @ covariance @ gain.T))
        np.testing.assert_allclose(source, expected, rtol=0.11)  # 400 draws tell it to 3.5 %
        assert np.median(source / expected) == pytest.approx(1, abs=0.04)
    assert np.abs(found.bias[-1] / found.spread[-1]).max() < 0.15


def test_sums_that_are_known_scatter_too() -> None:
    robot, campaign = load_robot("ir663"), ir663("", ("J12.torsional", "J18.torsional", *ALL_RADIAL))
    statement = build_identification(robot, campaign.rows, campaign.parameters)
    begin = np.log(statement.problem.model.start)[statement.parameters.first]
    found = sensitivity(statement, campaign.rows, begin, InputErrors(force=2.0), 60)
    assert found.sources == ("readings", "force", "all")
    assert found.sums.shape == (3, 60, 2)
    at = found.relations.index("1/J18.radial + 1/J99.radial + 1/J1010.radial")
    true = sum(1 / robot.parameter(f"J{joint}.radial") for joint in (18, 99, 1010))
    assert found.sums[0, :, at].mean() == pytest.approx(true, rel=0.1)
    assert found.sums[1, :, at].std() < found.sums[0, :, at].std()


def test_without_errors_of_the_inputs_the_readings_stand_alone() -> None:
    table = measured(ROBOT, rows(ROBOT, 5))
    statement = build_identification(ROBOT, table)
    found = sensitivity(statement, table, statement.parameters.begin, InputErrors(), 5)
    assert found.sources == ("readings",)
    np.testing.assert_allclose(1 / found.true, compliances(ROBOT))


def test_another_table_no_noise_or_one_repetition_are_refused() -> None:
    table = measured(ROBOT, rows(ROBOT, 8))
    statement = build_identification(ROBOT, table)
    theta = statement.parameters.begin
    with pytest.raises(BeamstiffError, match="found 5 rows, expected the 8"):
        sensitivity(statement, rows(ROBOT, 5), theta, ERRORS)
    with pytest.raises(BeamstiffError, match="found 1 repetitions"):
        sensitivity(statement, table, theta, ERRORS, 1)
    silent = measured(ROBOT, rows(ROBOT, 8, sigma=False))
    unknown = build_identification(ROBOT, silent, ROBOT.identify[:5])
    with pytest.raises(BeamstiffError, match="no noise"):
        sensitivity(unknown, silent, unknown.parameters.begin, ERRORS)


def test_errors_by_source_and_number_of_tests_are_printed_beside_the_paper() -> None:
    console = Console(width=140, record=True, file=io.StringIO())
    statement, tests, theta = campaign(10)
    found = sensitivity(statement, tests, theta, PAPER, 60)
    spread = dict(zip(found.sources, 3 * found.spread, strict=True))
    assert (spread["angle"] < 0.001).all()
    assert (spread["hold_angle"] > np.array([8, 8, 9, 2, 2, 5]) / 100).all()
    print_sensitivity(console, found)
    statement, _, theta = campaign(23)
    by_number = number_of_tests(statement, theta, orders=20)
    assert max(count or 99 for count in by_number.enough(0.1).values()) <= 8  # the paper: stable above six
    print_number(console, by_number)
    text = console.export_text()
    assert "paper, %" in text
    assert "within 10 % from" in text
