"""Sensitivity indices against what a hand calculation gives."""

import numpy as np
import pytest

from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.parameters import known_parameters
from beamstiff.calibration.sensitivity import sensitivity_indices
from tests.calibration.machines import measured, serial, within


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
