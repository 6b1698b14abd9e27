"""An instrument whose axes are scaled, or that is moved between two rows: named beside a calibration."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.diagnosis.decomposition.causes import Decomposition
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.measure.table import Measurements
from tests.diagnosis.test_absolute import NOISE, UR10, measured

SCALES = np.array([2e-4, -2e-4, 1e-4])
SHIFT = np.array([4e-4, -3e-4, 2e-4])
MOMENT = 47  # row before which the instrument is moved


@pytest.fixture(scope="module")
def steady() -> Measurements:
    """Return 80 positions of a rigid arm."""
    return measured(load_robot(UR10), None)


def found(rows: Measurements) -> Decomposition:
    return decompose(load_robot(UR10), rows)


@pytest.fixture(scope="module")
def scaled(steady: Measurements) -> Decomposition:
    return found(replace(steady, position=steady.position * (1.0 + SCALES)))


@pytest.fixture(scope="module")
def moved(steady: Measurements) -> Decomposition:
    later = np.arange(len(steady))[:, None] >= MOMENT
    return found(replace(steady, position=steady.position + np.where(later, SHIFT, 0.0)))


def test_axes_of_unlike_scales_are_named(scaled: Decomposition) -> None:
    (cause,) = scaled.every
    assert cause.key == "frame-misalignment:null"
    assert cause.shape == "scaled by axis and skewed"
    assert cause.closes > 0.95


def test_their_differences_are_known_and_their_mean_is_the_size_of_the_robot(scaled: Decomposition) -> None:
    (cause,) = scaled.every
    x, y, z, *_ = cause.theta[0] * cause.forms[0].sizes
    assert x - y == pytest.approx(SCALES[0] - SCALES[1], abs=3e-5)
    assert x - z == pytest.approx(SCALES[0] - SCALES[2], abs=3e-5)


def test_a_moved_instrument_is_named_with_the_row_and_the_way(moved: Decomposition) -> None:
    (cause,) = moved.every
    assert cause.key == "frame-misalignment:null"
    assert cause.shape == f"moved, after {moved.model.baseline.rows.place(MOMENT - 1)}"
    np.testing.assert_allclose((cause.theta[0] * cause.forms[0].sizes)[3:], SHIFT, atol=5e-5)


def test_where_it_was_moved_to_is_not_written(moved: Decomposition) -> None:
    assert not extended(diagnosis_of(moved)).effects


def test_the_robot_is_written_as_it_is_without_the_move(moved: Decomposition, steady: Measurements) -> None:
    robot = extended(diagnosis_of(moved))
    off = nominal_pose(robot, steady)[0] - steady.position
    off = np.linalg.norm(off - off.mean(axis=0), axis=1)
    assert np.sqrt((off**2).mean()) < 1.2 * np.sqrt(3.0) * NOISE


def test_nothing_is_told_of_an_instrument_that_stands(steady: Measurements) -> None:
    assert not found(steady).every
