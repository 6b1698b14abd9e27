"""A mistake of the table is the first thing that a page says."""

from dataclasses import replace

from beamstiff.diagnosis.result import Diagnosis
from beamstiff.identification.result import Identification
from beamstiff.measure import Measurements
from beamstiff.report.diagnosis_text import summary
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.identification import identification_html
from beamstiff.report.html.provenance import Provenance
from beamstiff.robot.description import Robot
from tests.report.html.test_page import Outline

FIRST = "Mind first: "


def test_loads_of_the_wrong_sign_stand_before_the_verdict(
    diagnosed: Diagnosis, diagnosis_page: str, source: Provenance
) -> None:
    rows = diagnosed.baseline.rows
    turned = replace(diagnosed.baseline, rows=replace(rows, wrench=-rows.wrench))
    text = "".join(Outline(diagnosis_html(replace(diagnosed, baseline=turned), source)).text)
    assert 0 < text.index("the tool moved against its load") < text.index(summary(diagnosed).splitlines()[0])
    assert FIRST not in "".join(Outline(diagnosis_page).text)


def test_and_before_what_was_identified(
    identified: Identification, robot: Robot, rows: Measurements, source: Provenance
) -> None:
    turned = replace(rows, wrench=-rows.wrench)
    text = "".join(Outline(identification_html(identified, robot, turned, source)).text)
    assert text.index("the tool moved against its load") < text.index("Position residual")
