"""The pose-by-pose recursion of the paper, without and with memory; sensitivity indices by hand."""

import numpy as np
import pytest

from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.least_squares import estimate
from beamstiff.calibration.parameters import known_parameters
from beamstiff.calibration.recursion import recursion
from beamstiff.calibration.sensitivity import sensitivity_indices
from beamstiff.calibration.statement import build_calibration
from tests.calibration.machines import SIGMA, machine, machined, measured, serial, within

REAL = machine(serial(), machined(serial(), 3))


def test_with_memory_one_sweep_ends_at_the_estimate_of_all_poses() -> None:
    rows = measured(REAL, within(serial(), 40, 1))
    statement = build_calibration(serial(), rows)
    whole = estimate(statement.problem, statement.begin, statement.identified)
    way = recursion(statement.problem, statement.begin, statement.identified, sweeps=2, memory=True)
    assert len(way.theta) == 1 + 2 * 40
    best = float(np.sqrt((statement.problem.gap(whole.theta)[:, :3] ** 2).sum(axis=1).mean()))
    assert way.position[40] < 1.2 * best
    assert way.position[-1] == pytest.approx(best, rel=0.02)
    assert way.position[0] > 20 * best
    assert np.isnan(way.orientation).all()


def test_without_noise_forgetting_converges_too_but_more_slowly() -> None:
    exact = measured(
        machine(serial(), dict.fromkeys(["q2", "f3.d", "f4.alpha"], 1e-3)),
        within(serial(), 20, 2),
        noise=0.0,
        turned=True,
    )
    statement = build_calibration(serial(), exact, ["q2", "q3", "f3.d", "f4.d", "f4.alpha", "f2.d"])
    way = recursion(statement.problem, statement.begin, statement.identified, sweeps=6)
    assert way.position[-1] < 1e-3 * way.position[0]
    assert way.orientation[-1] < 1e-3 * way.orientation[0]


def test_with_noise_forgetting_keeps_it_moving() -> None:
    rows = measured(REAL, within(serial(), 40, 3))
    statement = build_calibration(serial(), rows)
    forgetful = recursion(statement.problem, statement.begin, statement.identified, sweeps=3)
    keen = recursion(statement.problem, statement.begin, statement.identified, sweeps=1, memory=True)
    assert keen.position[-1] < 2 * SIGMA
    assert forgetful.position[-1] > 2 * keen.position[-1]


def test_a_length_shifts_and_an_angle_turns_by_the_distance_from_its_axis() -> None:
    rows = measured(serial(), within(serial(), 12, seed=1), turned=True, noise=0.0)
    found = sensitivity_indices(build_geometry(serial(), rows, known_parameters(serial(), ["ball"], True)))
    at = {name: number for number, name in enumerate(found.names)}
    assert found.position[:, at["f3.d"]] == pytest.approx(np.ones(12))
    assert found.orientation[:, at["f3.d"]] == pytest.approx(np.zeros(12))
    # axis 1 is the base's z axis
    assert found.position[:, at["q1"]] == pytest.approx(np.hypot(*rows.position[:, :2].T))
    assert found.orientation[:, at["q1"]] == pytest.approx(np.ones(12))
    assert found.some(["q1"]).names == ("q1",)
    assert found.some(["q1"]).units == ("rad",)
