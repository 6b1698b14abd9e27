"""Errors on rows left out of the fit, against leave-one-out residuals in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import build_identification
from beamstiff.identification.validation import held_out, position_rms, without_folds
from tests.identification.campaigns import kr240, measured, rows, sensitivities, white

ROBOT = kr240()
SPREAD = np.repeat([3e-5, 5e-5], 3)


def test_each_pose_left_out_is_missed_by_its_leave_one_out_residual() -> None:
    """Least squares without the rows i misses them by ``(1 - H_ii)^-1 e_i`` (Cook and Weisberg 1982, 2.1)."""
    table = rows(ROBOT, 9, 2)
    data = measured(ROBOT, table, white(table, 1))
    statement = build_identification(ROBOT, data)
    found = refit(statement.objective, statement.parameters.begin)
    a = (sensitivities(ROBOT, table) / SPREAD[:, None]).reshape(-1, 6)
    y = (data.displacement / SPREAD).ravel()
    hat = a @ np.linalg.solve(a.T @ a, a.T)
    rest = y - hat @ y
    out = held_out(statement.objective, data.pose, 9, found)
    for pose in range(9):
        at = np.flatnonzero(np.repeat(data.pose == pose, 6))
        expected = np.linalg.solve(np.eye(12) - hat[np.ix_(at, at)], rest[at]).reshape(2, 6) * SPREAD
        np.testing.assert_allclose(out.residual[data.pose == pose], expected, rtol=1e-5, atol=1e-10)
    assert out.rms == pytest.approx(np.sqrt((out.gap**2).mean()))
    assert out.rms > position_rms(statement.problem, statement.parameters.stiffness(found))


def test_rows_of_a_load_are_left_out_together() -> None:
    table = rows(ROBOT, 12)
    table = replace(table, wrench=table.wrench[np.arange(12) % 3])
    statement = build_identification(ROBOT, measured(ROBOT, table, white(table, 2)))
    begin = refit(statement.objective, statement.parameters.begin)
    folds = [out for out, _, _ in without_folds(statement.objective, statement.problem.load, 10, begin)]
    assert sorted(tuple(np.flatnonzero(out)) for out in folds) == [
        (at, at + 3, at + 6, at + 9) for at in range(3)
    ]


def test_what_was_not_measured_has_no_error() -> None:
    table = rows(ROBOT, 9)
    data = measured(ROBOT, table, white(table, 3))
    data.displacement[2] = np.nan
    data.displacement[4, :3] = np.nan
    statement = build_identification(ROBOT, data)
    out = held_out(statement.objective, statement.problem.pose, 9, statement.parameters.begin)
    assert np.flatnonzero(np.isnan(out.gap)).tolist() == [2, 4]
    assert out.rms == pytest.approx(np.sqrt(np.nanmean(out.gap**2)))


def test_too_few_groups_leave_nothing_to_hold_out() -> None:
    table = rows(ROBOT, 3)
    statement = build_identification(ROBOT, measured(ROBOT, table))
    begin = statement.parameters.begin
    assert held_out(statement.objective, np.array([0, 0, 1]), 5, begin) is None
    assert held_out(statement.objective, statement.problem.pose, 0, begin) is None
    with pytest.raises(BeamstiffError, match="found 2 groups of rows and 5 folds"):
        list(without_folds(statement.objective, np.array([0, 0, 1]), 5, begin))
    single = build_identification(ROBOT, measured(ROBOT, rows(ROBOT, 1, 3)), ["J1.torsional"])
    assert held_out(single.objective, np.array([0, 1, 2]), 3, single.parameters.begin) is not None
