import json
from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.candidate import Estimate
from beamstiff.diagnosis.residual.baseline import predict
from beamstiff.measure.table import Measurements
from tests.diagnosis.machines import POSITION, arm_at, at_random, close, kr240, rows_of
from tests.diagnosis.planted import backlash, diagnosed, plan

NAMES = ["link_bending", "backlash", "hysteresis", "load_error"]


@pytest.mark.parametrize("name", [None, *NAMES])
def test_a_report_has_every_key_of_the_format(name: str | None) -> None:
    report = diagnosed(name).to_dict()
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["format"] == "beamstiff-diagnosis/1"
    assert set(report["gap"]) >= {"rms_mm", "noise_mm", "explainable"}
    assert set(report["where"]) >= {"components", "directions", "loads", "poses"}
    assert all({"component", "share"} <= set(item) for item in report["where"]["components"])
    for item in report["which"]:
        assert set(item) >= {"effect", "component", "probability", "parameters"}
        assert set(item) >= {"rms_after_mm", "shrink", "shrink_interval"}
        low, high = item["shrink_interval"]
        assert 0 <= low <= high <= 1
        assert all(set(one) >= {"value", "std", "unit"} for one in item["parameters"].values())
    assert set(report["verdict"]) >= {"effect", "component", "probability", "indistinguishable"}
    assert all({"q", "wrench", "separates"} <= set(item) for item in report["next"])
    assert all(set(item) == {"effect", "component", "why"} for item in report["untestable"])


@pytest.mark.parametrize("name", [None, *NAMES, "outliers"])
def test_probabilities_sum_to_1_and_none_and_unknown_are_among_them(name: str | None) -> None:
    which = diagnosed(name).to_dict()["which"]
    shares = [item["probability"] for item in which]
    assert sum(shares) == pytest.approx(1)
    assert shares == sorted(shares, reverse=True)
    by_effect = {item["effect"]: item for item in which}
    assert by_effect["unknown"]["component"] is None
    assert by_effect["unknown"]["shrink"] == 0
    assert "none" in by_effect or "outliers" in by_effect


def test_the_explainable_share_is_what_is_not_noise() -> None:
    gap = diagnosed("backlash").to_dict()["gap"]
    assert gap["explainable"] == pytest.approx(1 - (gap["noise_mm"] / gap["rms_mm"]) ** 2)
    assert gap["noise_mm"] == pytest.approx(1e3 * np.sqrt(3) * POSITION, rel=0.15)
    assert diagnosed(None).to_dict()["gap"]["explainable"] < 0.1


def test_the_shrink_is_what_the_format_says_it_is() -> None:
    found = diagnosed("backlash").verdict.shrink
    expected = 1 - (found.after**2 - found.noise**2) / (found.before**2 - found.noise**2)
    assert found.shrink == pytest.approx(min(expected, 1.0))


def test_a_size_that_no_machine_has_is_flagged_not_hidden() -> None:
    usual = Estimate("half_width", 2e-4, 1e-5, "rad", (1e-5, 1e-3))
    assert usual.plausible
    assert not replace(usual, value=-0.1).plausible
    assert replace(usual, value=-0.009, std=0.005).plausible  # it may be small
    assert not replace(usual, value=-0.1, std=0.06).plausible  # so badly known it is no evidence


def test_the_size_of_the_effect_is_found() -> None:
    estimates = diagnosed("backlash").verdict.estimates
    assert [one.name for one in estimates] == ["half_width"]
    assert estimates[0].value == pytest.approx(3e-4, rel=0.1)
    assert estimates[0].plausible


def fresh(count: int = 10) -> Measurements:
    return at_random(kr240(), count, seed=99)


@pytest.mark.parametrize("name", [None, *NAMES])
def test_shifts_of_rows_never_seen_are_predicted_whatever_was_measured_there(name: str | None) -> None:
    found, rows = diagnosed(name), fresh()
    before, after = found.predict_shift(rows)
    assert before.shape == after.shape == (10, 6)
    close(before, predict(found.baseline.robot, rows))
    assert (name is None) == np.array_equal(before, after)
    blank = replace(rows, displacement=np.full((10, 6), np.nan))
    for one, other in zip((before, after), found.predict_shift(blank), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_the_effect_closes_the_gap_on_rows_never_seen() -> None:
    found, new = diagnosed("backlash"), plan(10, seed=50)
    rows = rows_of(kr240(), new.q, new.wrench, pose=new.pose, step=new.step, time=new.time)
    true = new.elastic + backlash(new)
    before, after = (np.sqrt(((true - one)[:, :3] ** 2).mean()) for one in found.predict_shift(rows))
    assert after < 0.2 * before


def test_absolute_rows_are_predicted_as_they_are_measured() -> None:
    q = fresh().q
    arm = arm_at(q)
    rows = rows_of(kr240(), q, np.zeros((10, 6)), position=arm.tip, rotation=np.zeros((10, 3)))
    before, _ = diagnosed(None).predict_shift(rows)
    np.testing.assert_allclose(before[:, :3], arm.tip, atol=1e-9)  # it carries nothing


@pytest.mark.parametrize("name", ["link_bending", "backlash"])
def test_python_has_what_the_terminal_and_the_written_robot_have(name: str) -> None:
    result = diagnosed(name)
    report, robot = result.to_dict(), result.robot
    assert result.causes == report["causes"]
    assert [one["effect"] for one in result.causes] == [one.effect for one in robot.effects]
    assert robot.fitted_rows == " ".join(result.fitted_rows)
    for one, (given, value) in result.fitted_stiffness.items():
        assert given == result.baseline.nominal.parameter(one)
        assert value == robot.parameter(one) == report["fitted"][one]["value"]
    assert {*result.fitted} == {*result.fitted_stiffness} != set()
    for one, fitted in result.fitted.items():
        assert (fitted.given, fitted.value) == result.fitted_stiffness[one]
        assert fitted.std == result.stiffness_std(one, fitted.value)
        assert fitted.to_dict() == report["fitted"][one]
    assert any(fitted.std for fitted in result.fitted.values())
    assert all(result.fitted_stiffness[one][0] == result.fitted_stiffness[one][1] for one in result.kept)
    assert diagnosed(None).causes == []


@pytest.mark.parametrize("name", [None, "backlash"])
def test_the_table_of_residuals_has_what_the_fitted_model_and_the_cause_leave(name: str | None) -> None:
    result = diagnosed(name)
    table = result.to_frame()
    assert len(table) == len(result.baseline.rows)
    left = table[["residual_x", "residual_y", "residual_z"]].to_numpy()
    np.testing.assert_allclose(left, result.baseline.gap[:, :3], atol=1e-15)
    beside = [f"residual_{axis}_with_causes" for axis in "xyz"]
    assert {*beside} <= {*table} if name else not any("causes" in one for one in table)
    if name:  # noise is left
        after = np.sqrt(np.square(table[beside].to_numpy()).sum(axis=1).mean())
        assert after == pytest.approx(result.noise, rel=0.1)
