"""Tables that are too large to be diagnosed whole."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis import diagnose as module
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.residual.baseline import predict
from beamstiff.measure.rows import in_runs
from tests.diagnosis.machines import at_random, elbow, kr240


@pytest.mark.parametrize("rows", [40, 41, 97, 400])
def test_runs_hold_whole_postures_in_their_order_and_no_more_rows_than_asked_for(rows: int) -> None:
    table = at_random(kr240(), 400, seed=1)
    pose = np.arange(400) // 4
    table = replace(table, pose=pose)
    found = in_runs(table, rows)
    assert len(found) <= max(rows, 40)
    assert (np.bincount(found.pose)[np.unique(found.pose)] == 4).all()
    assert (np.diff(found.rows) > 0).all()
    if rows < 400:
        assert found.pose.max() - found.pose.min() > 70  # from one end to the other


def test_of_a_large_table_a_part_is_diagnosed_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_ROWS", 60)
    robot = elbow()
    rows = at_random(robot, 120, seed=2)
    noise = 1e-5 * np.random.default_rng(0).standard_normal((120, 6))
    found = diagnose(robot, replace(rows, displacement=predict(robot, rows) + noise))
    assert found.notes[0] == "60 of 120 rows are diagnosed: ten runs of postures, spread over the table"
    assert len(found.baseline.rows) == 60
