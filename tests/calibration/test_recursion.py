"""The pose-by-pose recursion of the paper, without and with memory."""

import numpy as np
import pytest

from beamstiff.calibration.estimate import estimate
from beamstiff.calibration.recursion import recursion
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
