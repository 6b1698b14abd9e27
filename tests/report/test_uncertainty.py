"""Tables and the figure of uncertainty show the numbers of the results they are given."""

import io

import numpy as np
from rich.console import Console

from beamstiff.identification.compare import Comparison, Score
from beamstiff.identification.number_of_tests import NumberOfTests
from beamstiff.identification.sensitivity import Sensitivity
from beamstiff.identification.validation import HeldOut, Repeatability
from beamstiff.measure.table import make_measurements
from beamstiff.report.tables import Table
from beamstiff.report.uncertainty import (
    comparison_table,
    held_out_table,
    number_of_tests_figure,
    repeatability_text,
    sensitivity_table,
)


def shown(table: Table) -> list[list[str]]:
    """Return the table's lines as words."""
    console = Console(width=200, file=io.StringIO(), record=True)
    console.print(table)
    return [line.split() for line in console.export_text().splitlines() if line.strip()]


def score(name: str, aicc: float, bic: float, held_out: float | None) -> Score:
    return Score(name, 3, -10.0, 20.0, aicc, bic, 0.5, held_out, 1e-4, 1.5e-4, None, np.ones(3))


def test_models_are_compared_with_the_best_one() -> None:
    scores = (score("rigid", 30.0, 33.0, -12.0), score("bending", 24.5, 34.0, -9.5))
    lines = shown(comparison_table(Comparison(scores, 48, "campaign.csv")))
    assert "campaign.csv," in lines[0]
    assert lines[-2] == ["rigid", "3", "5.5", "0.50", "0.0", "-2.5", "0.1000", "0.1500", "-"]
    assert lines[-1] == ["bending", "3", "0.0", "0.50", "1.0", "0.0", "0.1000", "0.1500", "-"]


def test_what_could_not_be_computed_is_a_dash() -> None:
    one = Score("one", 3, -10.0, 20.0, np.inf, 33.0, np.nan, None, 1e-4, None, None, np.ones(3))
    lines = shown(comparison_table(Comparison((one,), 4, "campaign.csv")))
    assert lines[-1] == ["one", "3", "-", "-", "0.0", "-", "0.1000", "-", "-"]


def test_scatter_is_shown_by_parameter_and_source() -> None:
    stiffness = np.array([[[100.0], [125.0]], [[100.0], [50.0]]])
    sums = np.array([[[1.0], [3.0]], [[2.0], [2.0]]])
    found = Sensitivity(("k",), ("1/a + 1/b",), ("readings", "load"), stiffness, sums, np.array([100.0]))
    head, *lines = shown(sensitivity_table(found))[1:]
    assert " ".join(head) == "parameter readings, % size of load, %"
    # compliances over the true one: 1, 0.8 and 1, 2; two values deviate by their distance over root 2
    assert lines[-2] == ["k", "14.1", "70.7"]
    assert lines[-1] == ["1/a", "+", "1/b", "70.7", "0"]


def test_the_pose_that_is_missed_most_stands_first() -> None:
    measured = make_measurements(
        ["q1"],
        [[0.0], [0.1], [0.1]],
        tcp="n",
        displacement=[[1e-3, 0, 0], [0, 2e-3, 0], [0, 0, 2e-3]],
        source="campaign.csv",
    )
    residual = np.full((3, 6), np.nan)
    residual[:, :3] = [[1e-4, 0, 0], [0, 3e-4, 0], [0, 0, 1e-4]]
    lines = shown(held_out_table(HeldOut(np.array([0, 1, 1]), residual), measured))
    assert lines[-2] == ["campaign.csv:2", "2", f"{np.sqrt(0.05):.4f}", f"{50 * np.sqrt(0.05):.1f}"]
    assert lines[-1] == ["campaign.csv:1", "1", "0.1000", "10.0"]


def test_repeatability_is_told_in_a_sentence() -> None:
    sigma = np.array([2e-5, 2e-5, 2e-5, np.nan, np.nan, np.nan])
    text = repeatability_text(Repeatability(4, sigma, np.array([8, 8, 8, 0, 0, 0]), 0.013))
    assert "4 states agree to 1.3 % of the displacement" in text
    assert "0.02 mm" in text


def test_the_figure_shows_every_value_over_its_final_one() -> None:
    stiffness = np.array([[[2.0, 1.0], [1.0, 2.0]], [[3.0, np.nan], [1.0, 2.0]]])
    found = NumberOfTests(
        ("a", "b"), (), np.array([1, 5]), stiffness, np.zeros((2, 2, 0)), np.array([1.0, 2.0])
    )
    figure = number_of_tests_figure(found)
    assert [axes.get_title() for axes in figure.axes] == ["a", "b"]
    of_a, of_b = ({line.get_label(): line.get_xydata() for line in axes.lines} for axes in figure.axes)
    np.testing.assert_allclose(of_a["one order"], [[1, 2], [5, 1]])
    np.testing.assert_allclose(of_b["one order"], [[1, 0.5], [5, 1]])
