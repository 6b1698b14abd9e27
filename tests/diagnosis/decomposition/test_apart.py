"""Gross errors of reading are left out before causes are sought; what effects leave is none."""

import re
from dataclasses import replace

import pytest

from beamstiff import Robot, diagnose
from beamstiff.diagnosis.decomposition.apart import places_apart, rows_apart
from beamstiff.diagnosis.decomposition.decompose import OPEN
from beamstiff.diagnosis.decomposition.open_model import open_as_determined
from beamstiff.diagnosis.notes import each_off_by
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.rows import without_rows
from beamstiff.measure.table import Measurements
from tests.diagnosis.decomposition.test_decompose import table
from tests.diagnosis.planted import base_compliance, campaign, kr240, plan

CAUSES = ("approach", "gear", "slip")


def with_wrong(*causes: str, wrong: dict[int, float] | None = None) -> tuple[Robot, Measurements]:
    """Return a robot and its positions, some of them wrong by so many m along x."""
    robot, rows = table(causes, 60)
    position = rows.position.copy()
    for row, by in (wrong or {}).items():
        position[row, 0] += by
    return robot, replace(rows, position=position)


def apart(robot: Robot, rows: Measurements) -> list[int]:
    return rows_apart(open_as_determined(robot, rows, False, OPEN, False)[0]).tolist()


@pytest.mark.parametrize("causes", [(), ("gear",), ("slip",), ("friction",), CAUSES])
def test_no_cause_makes_a_row_stand_apart(causes: tuple[str, ...]) -> None:
    assert apart(*with_wrong(*causes)) == []


@pytest.mark.parametrize(
    "wrong", [{7: 0.05}, {7: 0.02}, {7: 0.05, 41: -0.03}, {7: 0.05, 41: -0.01}, {0: 0.5}]
)
def test_gross_errors_stand_apart_beside_causes(wrong: dict[int, float]) -> None:
    assert apart(*with_wrong(*CAUSES, wrong=wrong)) == sorted(wrong)


def test_what_many_rows_have_is_no_gross_error() -> None:
    assert apart(*with_wrong(*CAUSES, wrong=dict.fromkeys(range(0, 60, 12), 0.05))) == []


def test_a_diagnosis_with_a_gross_error_is_the_one_without_the_row() -> None:
    robot, rows = with_wrong(*CAUSES, wrong={7: 0.05})
    found = diagnose(robot, rows)
    place = rows.place(7)
    assert found.outliers == (place,)
    assert any(note.startswith(f"left out: {place}.") for note in found.notes)
    named = [cause.key for cause in diagnose(*with_wrong(*CAUSES)).decomposition.causes]
    assert [cause.key for cause in found.decomposition.causes] == named
    assert found.to_dict()["outliers"] == [place]


def test_a_displacement_that_is_wrong_stands_apart_whatever_rows_share_its_unloaded_reading() -> None:
    rows = campaign(plan(10), base_compliance)
    wrong = rows.displacement.copy()
    wrong[12, 0] += 0.02
    assert places_apart(fit_baseline(kr240(), rows)) == ()
    assert places_apart(fit_baseline(kr240(), replace(rows, displacement=wrong))) == (rows.place(12),)


def test_a_row_that_is_left_out_is_said_with_how_far_it_is_off() -> None:
    rows = campaign(plan(), base_compliance)
    wrong = rows.displacement.copy()
    wrong[12, 2] -= 0.01
    rows = replace(rows, displacement=wrong)
    (by,) = each_off_by(fit_baseline(kr240(), without_rows(rows, [rows.place(12)])), rows, [rows.place(12)])
    assert re.fullmatch(r"dz off by (10[.][0-3]|9[.][7-9].) mm", by)
    found = diagnose(kr240(), rows)
    told = next(note for note in found.notes if note.startswith("left out"))
    size = re.search(rf"{re.escape(rows.place(12))} \(dz off by (\S+) mm\)", told)
    assert size is not None
    assert float(size[1]) == pytest.approx(10.0, abs=0.3)
