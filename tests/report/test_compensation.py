"""What is told of a corrected path."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from beamstiff.compensation.formats import krl
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import Frames
from beamstiff.compensation.path_correction import DEFORMATION, EFFECTS, GEOMETRY
from beamstiff.compensation.process.load import Constant
from beamstiff.compensation.rewrite import Compensated, compensate_program, size_of
from beamstiff.compensation.taught_base import TaughtBase
from beamstiff.report.compensation import (
    compensation_figure,
    compensation_table,
    compensation_text,
    compensation_verdict,
    uncorrected_table,
)
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import rotation_from_vector, transform


@pytest.fixture(scope="module")
def result() -> Compensated:
    """Return a corrected path of three targets, the second out of reach."""
    text = "".join(f"LIN {{X 1500,Y {y},Z 900,A 0,B 110,C 0}}\n" for y in (-100, 9000, 100))
    load = Constant((0.0, 0.0, -900.0, 0.0, 0.0, 0.0))
    return compensate_program(krl.read(text, "a.src"), Machine(load_robot("kr500")), load)


def shown(table: object) -> str:
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_sizes_are_root_mean_square_and_largest() -> None:
    errors = np.zeros((2, 6))
    errors[0, :2], errors[1, 5] = [3e-3, 4e-3], np.radians(0.5)
    size = size_of(errors)
    assert size.rms_mm == pytest.approx(5 / np.sqrt(2))
    assert size.max_mm == pytest.approx(5)
    assert size.max_deg == pytest.approx(0.5)
    assert size_of(errors[:0]).max_mm == 0


def test_the_text_counts_what_could_be_followed(result: Compensated) -> None:
    text = compensation_text(result)
    assert text.startswith("Predicted error of the tool at 2 targets: RMS 0.")
    assert "99." in text
    assert "position alone" not in text
    assert text.endswith(
        ". The corrected positions are in the base frame of the robot, like the original ones."
    )
    shifted = Frames(base=np.diag([1.0, -1.0, -1.0, 1.0]))
    moved = replace(result, machine=replace(result.machine, frames=shifted))
    assert "positions are in the frame of the path, like the original ones." in compensation_text(moved)


def test_the_text_says_how_far_off_the_real_robot_taught_the_base(result: Compensated) -> None:
    turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(0.5)]))
    still = np.tile(np.eye(4), (3, 1, 1))
    base = TaughtBase(still, np.zeros((3, 6)), transform(turn, np.array([0.003, 0.004, 0.0])))
    taught = replace(result, correction=replace(result.correction, taught_base=base))
    said = "from the base as the real robot taught it, which is 5.0 mm (at its origin) and 0.50 deg from"
    assert said in compensation_text(taught)
    np.testing.assert_allclose(
        taught.to_dict()["base_taught"], [0.003, 0.004, 0, 0, 0, np.radians(0.5)], atol=1e-15
    )
    assert "base_taught" not in result.to_dict()


def test_the_headline_says_what_the_error_comes_from(result: Compensated) -> None:
    assert compensation_verdict(result).causes == ""  # one robot: it differs in nothing but its deformation
    assert result.to_dict()["before_by_part"] == {}
    size = result.correction.before
    found = replace(result, parts={GEOMETRY: 0.5 * size, DEFORMATION: 0.3 * size, EFFECTS: 0.2 * size})
    reached = replace(found, correction=replace(found.correction, reasons={}))
    said = compensation_verdict(reached).causes
    assert re.search(r"geometry of the real robot \S+ mm, deformation under weight and load \S+ mm, ", said)
    assert "may cancel in part" in said
    told = found.to_dict()["before_by_part"]
    assert told["geometry"]["rms_mm"] == pytest.approx(0.5 * found.to_dict()["before"]["rms_mm"])
    assert {*told} == {"geometry", "weight_and_load", "effects"}
    still = replace(reached, parts={GEOMETRY: 0.5 * size, DEFORMATION: 0.3 * size})
    assert "cancel" not in compensation_verdict(still).causes


def test_every_target_that_is_not_corrected_stands_in_a_table(result: Compensated) -> None:
    lost = shown(uncorrected_table(result))
    assert "out of reach by" in lost
    assert lost.count("LIN") == 1
    assert shown(compensation_table(result)).count("LIN") == 3


def test_no_target_is_promised_closer_than_a_controller_resolves(result: Compensated) -> None:
    table = shown(compensation_table(result))
    assert "under 0.001" in table
    assert not re.search(r"\de-\d|0\.000\d", table)


def test_the_picture_shows_path_commands_and_what_is_lost(result: Compensated) -> None:
    left, right = compensation_figure(result, "title").axes
    labels = [text.get_text() for text in left.get_legend().get_texts()]
    assert labels == ["target", "without compensation", "compensated", "commands", "out of reach"]
    assert right.get_yscale() == "log"
    before = right.lines[0].get_ydata()
    np.testing.assert_allclose(
        before, 1e3 * np.linalg.norm(result.correction.before[[0, 2], :3], axis=1), rtol=1e-12
    )
