"""What a calibration changed, told apart: geometry, and the stiffness of drives."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import diagnose
from beamstiff.measure.table import make_measurements
from beamstiff.report.diagnosis_text import verdict
from tests.calibration.test_positioner import ARM, positioner

WEIGHT = 60 * 9.81  # N, along -y
CENTRE = np.array([0.1, 0.0, 0.05])  # m, of what weighs
SEEN = np.array([0.25, 0.1, 0.2])  # m, of the reflector
NOISE = 2e-5  # m


def test_drives_that_are_softer_than_described_are_told_beside_the_geometry() -> None:
    rng = np.random.default_rng(3)
    q = np.column_stack([rng.uniform(-1.0, 1.0, 60), rng.uniform(-3.0, 3.0, 60)])
    tilt = Rotation.from_rotvec(q[:, :1] * [0, 0, 1.0]) * Rotation.from_euler("x", -90, degrees=True)
    axis = tilt.apply([0, 0, 1.0])
    lever = (tilt * Rotation.from_rotvec(q[:, 1:] * [0, 0, 1.0])).apply(CENTRE)
    torque = (axis * np.cross(lever, [0, -WEIGHT, 0])).sum(axis=1)
    body = tilt * Rotation.from_rotvec((q[:, 1:] + torque[:, None] / 5e3) * [0, 0, 1.0])
    position = body.apply(SEEN) + tilt.apply([0, 0, ARM + 2e-3]) + NOISE * rng.standard_normal((60, 3))
    rows = make_measurements(["q1", "q2"], q, tcp="table", position=position, sigma_position=NOISE)
    robot = positioner().model_copy(update={"identify": ("J2.torsional",)})
    found = diagnose(robot, rows)
    changed = found.recalibration
    assert changed.stiff is not None
    assert changed.after == pytest.approx(np.sqrt(3) * NOISE, rel=0.15)
    # what 0.9 of the sag is, less what zeros and frames take up of it
    sag = 0.9 * np.hypot(*SEEN[:2]) * np.std(torque / 5e3)
    assert 0.2 * sag < changed.stiff < 1.1 * sag
    assert "drive stiffness" in verdict(found).headline
