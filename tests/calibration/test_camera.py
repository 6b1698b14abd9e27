"""Hand-eye, scale and zeros from the poses of a tag that a camera sees."""

import numpy as np
import pytest

from beamstiff import calibrate
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.statement import build_calibration
from beamstiff.calibration.validation import errors_on, in_base_frame
from beamstiff.measure.reader import parse_measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import rotation_from_vector, transform
from tests.seen_by_camera import poses, rigid_arm, seen

SOUGHT = ["base", "target", "offsets", "camera"]
OFF = transform(rotation_from_vector(np.array([0.02, -0.01, 0.03])), np.array([0.004, -0.003, 0.005]))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return rigid_arm()


@pytest.mark.parametrize("where", ["on robot", "fixed"])
def test_derivatives_are_those_of_the_residual(robot: Robot, where: str) -> None:
    rows = parse_measurements(seen(robot, where=where, off=OFF, scale=0.01), robot)
    problem = build_calibration(robot, rows, SOUGHT).problem
    theta = np.random.default_rng(0).normal(0, 1e-5, len(problem.parameters))
    at = build_calibration(robot, rows, SOUGHT).begin + theta
    _, slopes = problem.linearised(at)
    for number, step in enumerate(1e-6 * np.eye(len(at))):
        found = (problem.residuals(at - step) - problem.residuals(at + step)) / 2e-6
        scale = np.abs(found).max()
        # to first order in what is left: some 30 mrad
        np.testing.assert_allclose(slopes[:, number], found, atol=0.05 * scale)


@pytest.mark.parametrize("where", ["on robot", "fixed"])
def test_hand_eye_scale_and_zeros_are_found(robot: Robot, where: str) -> None:
    real = corrected(robot, {"q2": 2e-3, "q4": -1e-3}, np.zeros((1, 6)))
    rows = parse_measurements(seen(robot, real, where=where, off=OFF, scale=0.01), robot)
    found = calibrate(robot, rows, SOUGHT, folds=0)
    change = {one.name: one.change for one in found.parameters}
    assert change["camera.scale"] == pytest.approx(0.01, abs=1e-9)
    assert change["q2"] == pytest.approx(2e-3, abs=1e-9)
    assert change["q4"] == pytest.approx(-1e-3, abs=1e-9)
    assert found.after.position_rms is not None
    assert found.after.position_rms < 1e-9
    there = in_base_frame(found, rows)
    sits = poses(found.robot, rows.q)
    np.testing.assert_allclose(there.position, sits[:, :3, 3], atol=1e-8)
    other = parse_measurements(seen(robot, real, where=where, off=OFF, scale=0.01, seed=5), robot)
    assert errors_on(found, other).position_rms == pytest.approx(0.0, abs=1e-8)


def test_a_robot_of_free_lengths_holds_the_scale(robot: Robot) -> None:
    rows = parse_measurements(seen(robot, noise=0.05), robot)
    found = calibrate(robot, rows, folds=0)
    assert "camera.scale" not in found.identifiability.identified
    assert found.noise == pytest.approx(1.0, abs=0.15)
