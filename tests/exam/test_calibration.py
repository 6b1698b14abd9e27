import numpy as np
import pytest

from beamstiff.exam.names import NONE, UNKNOWN
from beamstiff.exam.score import brier, calibration_error, reliability
from tests.exam.answered import answered


def test_the_calibration_error_by_hand() -> None:
    # 0.8 to 0.9: four at 0.85, three right; 1.0: one, wrong
    records = [answered("backlash:q3", "backlash:q3", p=0.85)] * 3
    records += [answered("backlash:q3", "hardening:q3", p=0.85), answered("none", "hardening:q3", p=1.0)]
    bins = reliability(records)
    assert [(b.low, b.said, b.right.value) for b in bins] == [(0.8, 0.85, 0.75), (0.9, 1.0, 0.0)]
    assert calibration_error(records).value == pytest.approx((4 * 0.10 + 1 * 1.0) / 5)


def test_right_is_the_effect_none_of_a_null_and_unknown_of_what_has_no_name() -> None:
    right = [
        answered("backlash:q3", "backlash:q3"),
        answered("none", NONE),
        answered("stiffness-ripple:q2", UNKNOWN, kind="outside"),
        answered("backlash:q3", UNKNOWN, kind="removed"),
        answered("backlash:q3", NONE, gap=0.2),
        answered("backlash:q3", "backlash:q3", gap=0.2),
    ]
    wrong = [
        answered("backlash:q3", NONE, gap=0.4),
        answered("stiffness-ripple:q2", NONE, kind="outside"),
        answered("none", UNKNOWN),
    ]
    assert calibration_error(right).value == 0.0
    assert calibration_error(wrong).value == 1.0
    assert brier(right).value == 0.0
    assert brier(wrong).value == 2.0


def test_the_brier_score_by_hand() -> None:
    probabilities = {"backlash:q3": 0.6, "hardening:q3": 0.3, "none": 0.1}
    record = answered("backlash:q3", "backlash:q3", probabilities=probabilities)
    assert brier([record]).value == pytest.approx(0.4**2 + 0.3**2 + 0.1**2)
    record = answered("hysteresis:q3", "backlash:q3", probabilities=probabilities)  # not even a candidate
    assert brier([record]).value == pytest.approx(1 + 0.6**2 + 0.3**2 + 0.1**2)


def test_probabilities_that_come_true_as_often_as_they_say_have_no_error() -> None:
    rng = np.random.default_rng(1)
    said = rng.uniform(size=20000)
    records = [
        answered("backlash:q3", "backlash:q3" if hit else "hardening:q3", p=float(p))
        for p, hit in zip(said, rng.uniform(size=said.size) < said, strict=True)
    ]
    error = calibration_error(records).value
    assert error is not None
    assert error < 0.015
    assert [round(b.low, 1) for b in reliability(records)] == [round(0.1 * k, 1) for k in range(10)]


def test_pairs_and_failures_are_not_judged() -> None:
    records = [answered("backlash:q3 hardening:q2", "backlash:q3"), answered("none", "failed")]
    assert reliability(records) == []
    assert brier(records).count == 0
    assert calibration_error(records).value is None
