"""Rows that share one unloaded reading, unknown to the table, are told; nothing else is taken for it."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.shared_reading import shared_reading
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, kr240
from tests.diagnosis.planted import backlash, campaign, diagnosed, plan

OPTION = "# unloaded_reading: shared"


def off_by(error: Array, name: str | None = "backlash") -> Diagnosis:
    """Return the diagnosis of play with readings that are off by more (N, 3), m."""
    result = diagnosed(name)
    measured = result.baseline.measured.copy()
    measured[:, :3] += error
    return replace(result, baseline=replace(result.baseline, measured=measured))


def of_each_posture(seed: int = 0) -> Array:
    """Return the error of an unloaded reading for the rows of each posture, (N, 3), m."""
    rng = np.random.default_rng(seed)
    return POSITION * rng.standard_normal((len(plan().q), 3))[plan().pose]


@pytest.mark.parametrize("seed", range(5))
def test_an_error_that_the_rows_of_a_posture_share_is_told_with_the_line_that_states_it(seed: int) -> None:
    assert OPTION in shared_reading(off_by(of_each_posture(seed)))


def test_where_it_is_stated_nothing_is_told() -> None:
    result = off_by(of_each_posture())
    stated = replace(result.baseline, sharing=plan().pose.astype(np.int64))
    assert shared_reading(replace(result, baseline=stated)) == ""


@pytest.mark.parametrize("name", [None, "backlash", "link_bending", "hysteresis", "thermal_drift"])
def test_independent_readings_share_nothing_whatever_the_cause(name: str | None) -> None:
    assert shared_reading(diagnosed(name)) == ""


def test_an_error_that_grows_with_the_load_is_no_unloaded_reading() -> None:
    along = plan().wrench[:, :3] / 1500.0
    assert shared_reading(off_by(2.0 * np.abs(of_each_posture()) * along)) == ""


def test_an_error_far_above_the_scatter_is_no_reading_of_the_same_instrument() -> None:
    assert shared_reading(off_by(10.0 * of_each_posture())) == ""


def test_a_diagnosis_notes_it() -> None:
    rows = campaign(plan(), backlash)
    moved = rows.displacement.copy()
    moved[:, :3] += of_each_posture()
    assert any(OPTION in one for one in diagnose(kr240(), replace(rows, displacement=moved)).notes)


def test_a_law_of_the_load_that_the_library_lacks_is_no_unloaded_reading() -> None:
    assert shared_reading(diagnosed("one_sided_drive")) == ""
