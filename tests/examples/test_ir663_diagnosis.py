"""The diagnosis of the IR-663 says what it should, honestly, and draws its figures."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from tests.examples.scripts import run_script

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Return what the example prints with all its details, and its figure."""
    figure = tmp_path_factory.mktemp("ir663") / "new" / "ir663_identification.png"
    return run_script("ir663_diagnosis", figure, "--details", COLUMNS="80", NO_COLOR="1"), figure


@pytest.fixture
def text(run: tuple[str, Path]) -> str:
    """Return what it prints, on one line."""
    return " ".join(run[0].split())


def test_stiffness_comes_with_uncertainty_and_what_cannot_be_bounded_is_said(text: str) -> None:
    assert re.search(r"J12\.torsional q2 1\.72e\+06 \S+ \S+ [0-9.]+ % N\*m/rad", text)
    assert re.search(r"J18\.torsional q8 1\.56e\+06 > \S+ - - N\*m/rad", text)
    assert "No upper bound from these data for J18.torsional:" in text


def test_the_gap_stands_beside_the_papers_and_is_that_of_an_independent_prototype(text: str) -> None:
    # notes on the data: axis 2 with a spring along the coupler leaves 0.114 mm RMS on these 12 values, two
    # constant drive springs 0.26 mm; axis 8 adds nothing to the first
    fitted = re.search(r"identified here (0\.\d+) the 12 published values, fitted", text)
    assert fitted is not None
    assert float(fitted[1]) == pytest.approx(0.114, abs=0.003)
    assert "the paper's beam model 0.110 its readings, 300 to 1100 N" in text
    assert "are not the same quantity" in text


def numbers(text: str, row: str, count: int) -> list[float]:
    """Return the numbers of a row of a table."""
    found = re.search(re.escape(row) + r"(?: \(!\))?(?: yes| no)?" + count * r" (0\.\d{3})", text)
    assert found is not None, row
    return [float(value) for value in found.groups()]


def test_the_diagnosis_is_a_set_that_no_cause_of_is_sure(text: str) -> None:
    assert "no confident verdict is possible" in text
    assert "Undecided: unknown (" in text
    assert "Indistinguishable from tool-compliance with these data: " in text
    table = text[text.index("Residual with each cause") : text.index("Each cause is added")]
    assert len(re.findall(r" yes 0\.\d", table)) >= 2
    assert all(float(value) < 0.6 for value in re.findall(r" (?:yes|no) (0\.\d{3})", table))
    assert "bearing-tilt at" in table
    assert "actuator-lever at q2" in table


def test_causes_refitted_leave_what_whole_models_with_them_leave(text: str) -> None:
    # a compliance between flange and tool, alike in all directions, is one along x for loads along x
    _, fitted, tested = numbers(text, "tool-compliance", 3)
    whole = numbers(text, "and a constant one along x", 2)
    assert [fitted, tested] == pytest.approx(whole, abs=0.005)
    # all radial springs around the loop show as one
    assert numbers(text, "bearing-tilt at th3", 3)[1] == pytest.approx(
        numbers(text, "and a third along the coupler", 2)[0], abs=0.005
    )


def test_whole_models_leave_what_others_found(text: str) -> None:
    for row, within in (
        ("and a third along the coupler", 0.003),
        ("and both of these", 0.003),
        ("and a constant one along x", 0.02),  # theirs has rigid links
    ):
        fitted, _, theirs = numbers(text, row, 3)
        assert fitted == pytest.approx(theirs, abs=within)


def test_what_to_measure_next_is_said(text: str) -> None:
    assert re.search(r"- load along x at q2 = -?\d+ deg, q8 = \d+ deg: -450, -900, -450, -900, -450 N", text)
    assert "- To check tool-compliance: " in text


def test_the_figure_is_drawn(text: str, run: tuple[str, Path]) -> None:
    figure = run[1]
    assert figure.name in text
    pixels = imread(figure)
    assert pixels.shape[0] > 600
    assert pixels.shape[1] > 1200
    # more than a white sheet: ink in each of the four columns of panels
    for column in np.array_split(pixels[..., :3].min(axis=2) < 0.5, 4, axis=1):
        assert column.mean() > 0.002
    beside = imread(figure.with_name("ir663_diagnosis.png"))
    assert beside.shape[1] > 1200
    assert (beside[..., :3].min(axis=2) < 0.5).mean() > 0.02


def test_the_data_are_those_shared(shared_path) -> None:
    shared = shared_path("data/ir663_compliance_xx.csv").read_text(encoding="utf-8")
    assert (REPOSITORY / "examples" / "data" / "ir663_compliance_xx.csv").read_text(
        encoding="utf-8"
    ) == shared
