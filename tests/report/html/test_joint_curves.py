"""The curve on the page is the one that was planted."""

import numpy as np
import pytest

from beamstiff.report.html.joint_curves import joint_curves
from tests.diagnosis.decomposition.test_decompose import GEAR, NOISE, POSES, found
from tests.diagnosis.planted import diagnosed


def test_the_error_of_a_joint_is_drawn_over_the_angles_that_were_read() -> None:
    (figure,) = joint_curves(found("gear")[0])
    curve, marks = figure.traces
    for trace in (curve, marks):
        planted = 1e3 * GEAR * np.cos(2 * np.radians(trace["x"]))
        np.testing.assert_allclose(trace["y"], planted, atol=1e3 * 3 * NOISE)  # levers of about 1 m
    assert len(marks["x"]) == POSES
    assert (curve["x"][0], curve["x"][-1]) == pytest.approx((min(marks["x"]), max(marks["x"])))


def test_without_such_a_cause_nothing_is_drawn() -> None:
    assert not list(joint_curves(diagnosed("backlash")))
