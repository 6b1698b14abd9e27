"""What a diagnosis makes of a decomposition: sizes that add up, and nothing named of another robot."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import diagnose, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.report.diagnosis_text import verdict
from tests.diagnosis.decomposition.test_decompose import POSES, UR10, found, read


def test_what_is_left_is_what_the_told_causes_do_not_close() -> None:
    decomposition = found("approach", "gear")[0].decomposition
    assert decomposition is not None
    # as beside a law outside the library that was counted before them, and is not told
    behind = [replace(one, rms_after=0.1 * one.rms_after) for one in decomposition.causes]
    told = diagnosis_of(replace(decomposition, causes=tuple(behind))).decomposition
    assert told is not None
    explainable, closed = told.rms**2 - told.noise**2, 0.0
    for one in told.causes:
        closed += one.closes
        assert one.rms_after**2 == pytest.approx(told.rms**2 - closed * explainable, abs=1e-18)


def test_of_readings_of_another_robot_nothing_is_named() -> None:
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    longer = {"f3.d": 0.15, "f4.d": -0.11, "f5.r": 0.12, "f4.alpha": 0.1}
    other = corrected(robot, longer, np.zeros((1, 6)))
    result = diagnose(robot, read(other, rng.uniform(-2.5, 2.5, (POSES, 6)), ("gear",), rng))
    assert result.verdict.effect == "unknown"
    assert not result.to_dict()["causes"]
    (note,) = (one for one in result.notes if "no machine is built so far from its drawing" in one)
    assert "f5.r by 120 mm" in note
    assert verdict(result).action.startswith("Check that robot file and table are of one robot")
    alike, _ = found("approach", "gear")
    assert not [one for one in alike.notes if "from its drawing" in one]


def test_the_order_of_rows_without_times_is_told_where_it_decides() -> None:
    def told(*effects: str) -> bool:
        return any("not every row has a time t" in note for note in found(*effects)[0].notes)

    assert told("approach", "gear")
    assert not told("gear")


def test_a_wrist_far_off_its_drawing_that_moves_the_tool_little_is_no_other_robot() -> None:
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    wrist = corrected(robot, {"f5.alpha": 0.12}, np.zeros((1, 6)))  # the tool is 0.15 m from that axis
    result = diagnose(robot, read(wrist, rng.uniform(-2.5, 2.5, (POSES, 6)), ("gear",), rng))
    assert result.recalibration is not None
    (turned,) = (one for one in result.recalibration.changes if one.parameter.name == "f5.alpha")
    assert turned.by == pytest.approx(0.12, abs=2e-3)
    assert not [one for one in result.notes if "from its drawing" in one]
    assert result.verdict.key == "angle-curve:q3"


def test_a_stated_noise_far_beyond_the_readings_is_no_agreement() -> None:
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    rows = read(robot, rng.uniform(-2.5, 2.5, (40, 6)), (), rng)
    result = diagnose(robot, replace(rows, sigma=1e3 * rows.sigma, sigma_position=1e-2))
    told = verdict(result)
    assert told.level == "doubtful"
    assert "times what the readings scatter" in told.headline
    assert told.action.startswith("State the noise of the instrument")
