"""Repeats of planted noise and drift."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, predict
from beamstiff.diagnosis.residual.repeats import Repeats, independent, repeats
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, at_random, cycles, elbow

POSES, TIMES = 40, 6


def campaign(**more: Any) -> Measurements:
    """Return forty postures, each read six times under one load."""
    timed = {"time": 60.0 * np.arange(POSES * TIMES)} | more
    return cycles(elbow(), POSES, np.ones(TIMES), seed=3, **timed)


def read(rows: Measurements, noise: Array) -> Repeats:
    """Return the repeats of readings of the model and noise (N, 6)."""
    there: Baseline = fit_baseline(elbow(), replace(rows, displacement=predict(elbow(), rows) + noise))
    return repeats(there)


def scatter(position: float = 1.0, rotation: float = 1.0) -> Array:
    sigma = np.repeat([position * POSITION, rotation * ROTATION], 3)
    return np.random.default_rng(8).standard_normal((POSES * TIMES, 6)) * sigma


@pytest.mark.parametrize(("position", "rotation"), [(1.0, 1.0), (2.0, 0.5)])
def test_the_noise_is_what_repeats_scatter_by(position: float, rotation: float) -> None:
    found = read(campaign(), scatter(position, rotation))
    assert found.freedom.tolist() == [3 * POSES * (TIMES - 1)] * 2
    assert found.noise == pytest.approx([position, rotation], rel=4 / np.sqrt(2 * 600))
    assert (found.likely < 1e-6).tolist() == [position != 1.0, rotation != 1.0]


def test_what_the_model_lacks_does_not_count_as_noise() -> None:
    lacking = np.repeat(np.random.default_rng(1).standard_normal((POSES, 6)), TIMES, axis=0) * 1e-3
    assert read(campaign(), scatter() + lacking).noise == pytest.approx([1.0, 1.0], rel=0.12)


def test_what_is_systematic_counts_once_however_often_it_is_read() -> None:
    there = fit_baseline(elbow(), campaign(displacement=np.zeros((POSES * TIMES, 6))))
    values = POSES * TIMES * 6
    noise = np.random.default_rng(2).standard_normal((POSES * TIMES, 6))
    lacking = np.repeat(np.random.default_rng(1).standard_normal((POSES, 6)), TIMES, axis=0)
    assert independent(there, noise.ravel()) == pytest.approx(values, rel=0.1)
    assert independent(there, lacking.ravel()) == pytest.approx(values / TIMES)
    both = (lacking + noise).ravel()  # a mean keeps 1 + 1/6 of the variance 2
    assert independent(there, both) == pytest.approx(values / TIMES * 2.0 / (1.0 + 1.0 / TIMES), rel=0.1)


def test_an_unloaded_reading_that_repeats_share_is_noise_as_well() -> None:
    reading = np.random.default_rng(5).standard_normal((POSES, 6)) * np.repeat([POSITION, ROTATION], 3)
    noise = (scatter() - np.repeat(reading, TIMES, axis=0)) / np.sqrt(2.0)
    assert read(campaign(shared_unloaded=True), noise).noise == pytest.approx([1.0, 1.0], rel=0.12)


def test_a_steady_drift_is_found_with_its_slope() -> None:
    slope = 1e-7  # m/s: a sigma in five minutes
    drift = np.zeros((POSES * TIMES, 6))
    drift[:, 1] = slope * 60.0 * np.arange(POSES * TIMES)
    found = read(campaign(), 0.5 * scatter() + drift)
    assert found.steady[0] < 1e-6
    assert found.drift[0] == pytest.approx(slope, rel=0.1)
    assert found.steady[1] > 1e-3


def test_the_slope_is_the_same_where_rows_share_an_unloaded_reading() -> None:
    drift = np.zeros((POSES * TIMES, 6))
    drift[:, 0] = 1e-7 * 60.0 * np.arange(POSES * TIMES)
    found = read(campaign(shared_unloaded=True), 0.5 * scatter() + drift)
    assert found.drift[0] == pytest.approx(1e-7, rel=0.1)


def test_readings_without_drift_have_none() -> None:
    assert (read(campaign(), scatter()).steady > 1e-3).all()


def test_without_repeats_or_times_nothing_is_said_of_them() -> None:
    once = at_random(elbow(), 12, seed=3, sigma_position=POSITION, sigma_rotation=ROTATION)
    found = repeats(fit_baseline(elbow(), once))
    assert not found.freedom.any()
    assert np.isnan(found.noise).all()
    timeless = read(campaign(time=None), scatter())
    assert np.isnan(timeless.drift).all()
    assert (timeless.steady == 1.0).all()
