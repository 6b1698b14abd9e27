"""Rows to fit and rows to judge by: whole poses, whole loads."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError
from beamstiff.identification.models.split import KINDS, load_levels, position_errors, split_rows
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements, make_measurements


def rows(poses: int, loads: list[float], component: int = 2) -> Measurements:
    wrench = np.zeros((poses * len(loads), 6))
    wrench[:, component] = np.tile(loads, poses)
    q = np.repeat(np.arange(float(poses)), len(loads))[:, None]
    return make_measurements(["q1"], q, tcp="tip", wrench=wrench, source="campaign.csv")


@given(st.integers(4, 30), st.integers(0, 100))
def test_whole_poses_are_held_out(poses: int, seed: int) -> None:
    table = rows(poses, [300.0, 900.0])
    split = split_rows(table, 0.25, seed=seed)
    assert len(np.unique(table.pose[split.new_pose])) == round(0.25 * poses)
    assert not np.isin(table.pose[split.new_pose], table.pose[~split.new_pose]).any()


def test_a_pose_that_several_tables_hold_is_held_out_in_all() -> None:
    table = concatenate([rows(8, [load]) for load in (300.0, 600.0, 900.0)])
    split = split_rows(table)
    assert split.new_pose.sum() == 3 * 2
    assert not np.isin(table.q[split.new_pose], table.q[~split.new_pose]).any()


def test_the_largest_load_is_held_out_where_there_are_several() -> None:
    split = split_rows(rows(8, [300.0, -900.0, 600.0]))
    assert split.loads == (300.0, 600.0, 900.0)
    assert np.array_equal(split.new_load, split.level == 2)
    assert not split_rows(rows(8, [300.0])).new_load.any()


def test_one_load_alone_may_be_fitted() -> None:
    split = split_rows(rows(8, [300.0, 600.0, 900.0, 1100.0]), fit_load=900)
    assert np.array_equal(~split.new_load, split.level == 2)
    for load in (950.0, float("nan"), float("inf"), 0.0, -900.0):
        said = rf"campaign.csv: found no load of {load:.4g} N, expected one of 300, 600"
        with pytest.raises(BeamstiffError, match=said):
            split_rows(rows(8, [300.0, 600.0]), fit_load=load)


def test_without_a_share_no_pose_is_held_out() -> None:
    split = split_rows(rows(8, [300.0, 900.0]), 0.0)
    assert np.bincount(split.kind, minlength=len(KINDS)).tolist() == [8, 0, 8, 0]


def test_loads_of_any_size_fall_into_quarters() -> None:
    level, loads, unit = load_levels(rows(1, np.geomspace(10, 1000, 40).tolist()))
    assert np.bincount(level).tolist() == [10] * 4
    assert list(loads) == sorted(loads)
    assert unit == "N"


def test_moments_alone_are_loads_too() -> None:
    assert load_levels(rows(2, [50.0, 100.0], component=4))[1:] == ((50.0, 100.0), "N m")


@pytest.mark.parametrize("share", [-0.1, 1.0, float("nan")])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(BeamstiffError, match=r"share of poses to hold out: found"):
        split_rows(rows(8, [300.0]), share)


def test_too_few_poses_to_hold_some_out_are_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"campaign.csv: found 1 poses, expected more"):
        split_rows(rows(1, [300.0, 900.0]))


def test_errors_are_of_what_was_measured() -> None:
    seen = np.array([[3e-3, np.nan, 4e-3], [np.nan] * 3])
    table = make_measurements(["q1"], [[0.0], [1.0]], tcp="tip", displacement=seen)
    assert np.allclose(position_errors(table, np.zeros((2, 6))), [5e-3, np.nan], equal_nan=True)
    unanswered = np.full((2, 6), np.nan)
    assert np.isnan(position_errors(table, unanswered)).all()
