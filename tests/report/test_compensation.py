"""What is told of a corrected path."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from beamstiff.compensation.follow import NO_POSTURE
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
from beamstiff.report.html.compensation import compensation_html
from beamstiff.report.html.provenance import provenance
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
    said = "from the base as the real robot taught it, which is 5.0 mm (at the first point) and 0.50 deg from"
    assert said in compensation_text(taught)
    away = still.copy()  # where the turn moves it by 100 mm * 0.5 deg more
    away[:, 0, 3] = 0.1
    farther = replace(result, correction=replace(result.correction, taught_base=replace(base, poses=away)))
    assert "is 5.7 mm (at the first point) and 0.50 deg" in compensation_text(farther)
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


def common(result: Compensated, far: float, differs: float) -> Compensated:
    """Return a path all of whose targets are reached, `far` off, and so much in another way each, m."""
    before = np.zeros((3, 6))
    before[:, 2], before[:, 0] = -far, differs * np.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])
    after = np.zeros((3, 6))
    correction = replace(result.correction, before=before, reasons={})
    return replace(
        result, correction=correction, after=after, common=np.tile(before[:, :3].mean(axis=0), (3, 1))
    )


def test_the_headline_says_how_much_differs_along_the_path_where_the_robot_may_have_taught_the_base(
    result: Compensated,
) -> None:
    found = common(result, 8.3e-3, 0.54e-3)
    assert found.differs_mm == pytest.approx(0.54)
    said = compensation_verdict(found)
    assert said.headline.startswith(
        "Predicted error along the path: 8.3 mm against a measured base, 0.54 mm or more if the robot itself "
        "touched off the workpiece; after correction 0 mm, plus "
    )
    assert "give the three points with --base-taught" in said.action
    assert (
        "0.54 mm or more instead of 8.3 mm. If the workpiece was measured by other means, use" in said.action
    )
    assert said.action.endswith("Run the corrected path and measure a few targets.")
    page = compensation_html(found, found.machine.controller, provenance([], 0, []))
    assert "RMS against a measured base; 0.54 mm or more if the robot touched off" in page
    assert "0.54 mm or more if the robot itself touched off the workpiece" in page
    for other in (replace(found, common=None), common(result, 0.5e-3, 1e-3)):
        assert other.differs_mm is None
        assert "base" not in compensation_verdict(other).headline + compensation_verdict(other).action


def test_a_real_robot_whose_error_is_not_explained_is_doubtful(result: Compensated) -> None:
    real = result.machine.real.model_copy(update={"unexplained": "the base has play"})
    said = compensation_verdict(replace(result, machine=replace(result.machine, actual=real)))
    assert "Doubtful" not in said.doubt  # nothing is corrected before all targets are within reach
    correction = replace(result.correction, reasons={})
    said = compensation_verdict(
        replace(result, machine=replace(result.machine, actual=real), correction=correction)
    )
    assert said.doubt == "Doubtful: what the real robot's file leaves looks as if the base has play."
    assert said.action.startswith("Mend that, measure and diagnose again")


def test_what_is_reachable_in_another_configuration_is_not_to_be_moved(result: Compensated) -> None:
    def action(*reasons: str) -> str:
        refused = replace(result.correction, reasons=dict(enumerate(reasons)))
        return compensation_verdict(replace(result, correction=refused)).action

    misstated, far = f"{NO_POSTURE} S 2; reachable as S 6", "out of reach by 3 mm"
    keep = "; --unreachable keep leaves them as they are."
    assert action(far, far) == f"Move these targets{keep}"
    posture = "Correct the configuration of {} in the program, or choose the posture with --q"
    assert action(misstated, misstated) == posture.format("these targets") + keep
    assert action(misstated, far) == posture.format("1 of these targets") + f", and move the others{keep}"


def test_the_table_fits_a_terminal_of_100_columns(result: Compensated) -> None:
    names = tuple(f"weld_seam_{row}" for row in range(3))
    correction = replace(result.correction, path=replace(result.correction.path, names=names))
    lines = shown(compensation_table(replace(result, correction=correction))).splitlines()
    assert max(len(line.rstrip()) for line in lines if "─" not in line) <= 100
    assert all(name in "".join(lines) for name in names)
    assert re.findall(r"[a-z]+,", lines[1]) == [
        *("force,", "before,", "before,", "after,", "after,", "moved,", "turned,")
    ]
    assert lines[2].split() == ["target", "line", "N", *["mm", "deg"] * 3]


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
