"""What `calibrate` says of itself in the robot file: the parameters it fitted, and how sure each is."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, calibrate, load_robot, save_robot
from beamstiff.diagnosis.decomposition.known import calibrated_covariance
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.robot.yaml_edit import robot_yaml
from tests.calibration.machines import machine, machined, measured, serial, within


@pytest.fixture(scope="module")
def found():
    rows = measured(machine(serial(False), machined(serial(), 3)), within(serial(), 40, 1))
    return calibrate(serial(False), rows, compliances=["J2.torsional"], folds=0)


def test_the_robot_lists_base_reflectors_zeros_and_frames_that_were_fitted(found) -> None:
    names = [item.name for item in found.robot.calibrated]
    assert names == [item.name for item in found.parameters if item.std and item.name != "J2.torsional"]
    assert {"base.x", "ball.x", "q2", "f3.d"} <= set(names)


def test_a_file_keeps_their_covariance(found, tmp_path: Path) -> None:
    save_robot(found.robot, tmp_path / "calibrated.yaml")
    again = load_robot(tmp_path / "calibrated.yaml")
    names = [item.name for item in found.parameters]
    at = [names.index(item.name) for item in again.calibrated]
    expected = found.covariance[np.ix_(at, at)]
    std = np.sqrt(np.diag(expected))
    assert calibrated_covariance(again) / np.outer(std, std) == pytest.approx(
        expected / np.outer(std, std), abs=0.01
    )


def test_another_calibration_replaces_the_list_and_keeps_the_comments(found, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    first = found.robot.model_copy(update={"calibrated": found.robot.calibrated[:3]})
    text = robot_to_yaml(first)
    file.write_text(text.replace("fixed:", "# the pedestal was levelled in May\nfixed:") + "# end of file\n")
    written = robot_yaml(found.robot, file)
    assert "# the pedestal was levelled in May" in written
    assert "# end of file" in written
    assert parse_robot(written, "robot.yaml") == found.robot


def spoiled(found, line: str) -> Robot:
    text = robot_to_yaml(found.robot.model_copy(update={"calibrated": ()}))
    return parse_robot(f"{text}calibrated:\n  - {{name: base.x, std: 1.0e-05}}\n  - {line}\n", "robot.yaml")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{name: base.y, std: 0}", "expected a positive number"),
        ("{name: base.y, std: .nan}", "std"),
        ("{name: base.y, std: 1.0e-05, correlation: [1.5]}", "expected a correlation from -1 to 1"),
        ("{name: base.y, std: 1.0e-05, correlation: [0.1, 0.2]}", "one for each of the 1 before it"),
        ("{name: base.x, std: 1.0e-05}", "duplicate name 'base.x'"),
    ],
)
def test_what_no_calibration_can_have_found_is_refused(found, line: str, said: str) -> None:
    with pytest.raises(BeamstiffError, match=said):
        spoiled(found, line)


def test_what_a_second_calibration_holds_stays_known(found) -> None:
    robot = found.robot.model_copy(update={"identify": ()})
    rows = measured(machine(serial(False), machined(serial(), 3)), within(serial(), 40, 1))
    again = calibrate(robot, rows, ["base", "ball"], folds=0).robot
    names = [item.name for item in again.calibrated]
    assert sorted(names) == sorted(item.name for item in found.robot.calibrated)
    old, new = calibrated_covariance(found.robot), calibrated_covariance(again)
    kept = [
        item.name for item in found.robot.calibrated if item.name.partition(".")[0] not in ("base", "ball")
    ]
    before = [[item.name for item in found.robot.calibrated].index(name) for name in kept]
    after = [names.index(name) for name in kept]
    assert new[np.ix_(after, after)] == pytest.approx(old[np.ix_(before, before)])
