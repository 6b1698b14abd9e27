"""Whose fault it is that a tag seems to move: the camera's, its mount's, or the robot's."""

import numpy as np
import pytest

from beamstiff import diagnose
from beamstiff.calibration.corrected import corrected
from beamstiff.measure.reader import parse_measurements
from beamstiff.se3 import rotation_from_vector, transform
from tests.seen_by_camera import rigid_arm, seen

OFF = transform(rotation_from_vector(np.array([0.004, -0.003, 0.005])), np.array([0.002, -0.001, 0.002]))


@pytest.mark.parametrize(
    ("where", "cause", "verdict"),
    [
        ("on robot", {"off": OFF}, "hand-eye:null"),
        ("on robot", {"scale": 0.006}, "camera-scale:null"),
        ("on robot", {"real": {"q3": 3e-3}}, "q3"),
        ("on robot", {}, "none:null"),
        ("fixed", {"off": OFF}, "hand-eye:null"),
        ("fixed", {"scale": 0.006}, "camera-scale:null"),
    ],
)
def test_the_right_party_is_named(where: str, cause: dict, verdict: str) -> None:
    robot = rigid_arm()
    real = corrected(robot, cause.pop("real"), np.zeros((1, 6))) if "real" in cause else None
    found = diagnose(robot, parse_measurements(seen(robot, real, where=where, noise=0.05, **cause), robot))
    # near one posture the zero of an encoder and its curve are one
    assert found.verdict.key == verdict or found.verdict.component == verdict
    assert not found.next  # where the camera sees the tag is not known
