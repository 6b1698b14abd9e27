"""Pictures of models side by side and of fuzzy rules: what they show is what there is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot, read_measurements
from beamstiff.diagnosis.changes import RunComparison
from beamstiff.identification.models.side_by_side import Models, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.table import make_measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance, rules_from_table
from beamstiff.model.linear import predict_displacements
from beamstiff.report.changes import changes_verdict
from beamstiff.report.compare import models_figure, models_table
from beamstiff.report.fuzzy import rules_figure

TABLE_4 = Path(__file__).resolve().parents[2] / "examples/data/ir663_compliance_xx.csv"


@pytest.fixture(scope="module")
def models() -> Models:
    robot, random = load_robot("ir663"), np.random.default_rng(0)
    q = np.repeat(random.uniform([-0.2, 0.6], [0.4, 0.9], (12, 2)), 2, axis=0)
    wrench = np.tile([[-300.0, 0, 0, 0, 0, 0], [0, 0, -900.0, 0, 0, 0]], (12, 1))
    still = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench)
    seen = predict_displacements(robot, still)[:, :3]
    table = make_measurements(
        ["q2", "q8"], q, tcp="n7", wrench=wrench, displacement=seen, sigma_position=1e-5
    )
    return fit_models(robot, table, split_rows(table, fit_load=300.0), ["rigid", "nominal", "parametric"])


def test_every_place_is_drawn_once_in_the_plane_in_which_the_robot_moves(models: Models) -> None:
    figure = models_figure(models, "ir663")
    panels = [axes for axes in figure.axes if axes.get_xlabel() == "x of the TCP, m"]
    assert [axes.get_title().split(":")[0] for axes in panels] == ["nominal", "parametric"]
    assert panels[0].get_ylabel() == "z of the TCP, m"
    drawn = np.concatenate([np.asarray(part.get_offsets()) for part in panels[0].collections])
    places = np.unique(models.position.round(9), axis=0)
    assert len(np.unique(drawn.round(9), axis=0)) == len(places) == 12
    assert np.allclose(np.unique(drawn.round(9), axis=0), places[:, [0, 2]], atol=1e-8)


def test_colours_are_the_errors(models: Models) -> None:
    nominal = models_figure(models, "ir663").axes[0]
    shown = np.concatenate([np.asarray(part.get_array()) for part in nominal.collections])
    assert np.isclose(shown.max(), 1e3 * models["nominal"].error[~models.split.fitted].max(), atol=1e-12)


def test_the_table_has_a_column_a_kind_of_row_and_a_row_a_model(models: Models) -> None:
    table = models_table(models, "ir663")
    assert [column.head for column in table.heads][:2] == ["model", "fitted (9)"]
    assert len(table.rows) == 3


def test_facts_are_in_millimetres(models: Models) -> None:
    rigid = models.to_dict()["models"][0]
    size = np.linalg.norm(models.table.displacement[:, :3], axis=1)[~models.split.fitted]
    assert np.isclose(rigid["unseen"]["rms_mm"], 1e3 * np.sqrt((size**2).mean()))
    assert np.isclose(rigid["unseen"]["max_mm"], 1e3 * size.max())


def table_4() -> FuzzyCompliance:
    return rules_from_table(read_measurements(TABLE_4, load_robot("ir663")), ["q2", "q8"])


def test_the_rule_surface_passes_through_the_conclusions() -> None:
    """Figure 13 of seed 003: the surface of C_xx, and three and four sets."""
    figure = rules_figure(table_4(), angles=("q2", "q8"))
    surface, first, second = figure.axes
    [corners] = surface.lines
    q2, q8, height = (np.asarray(part, dtype=float) for part in corners.get_data_3d())
    assert np.allclose(np.unique(q2), [-24.15, 1.37, 12.54, 36.83])
    assert np.allclose(np.unique(q8), [33.04, 48.63, 62.90])
    assert np.isclose(height.min(), 0.639e6 / 900)
    assert np.isclose(height.max(), 1.218e6 / 900)
    assert (len(first.lines), len(second.lines)) == (4, 3)
    degrees = np.stack([np.asarray(line.get_ydata()) for line in first.lines])
    assert np.allclose(degrees.sum(axis=0), 1.0)
    assert first.get_xlabel() == "q2, deg"


def test_campaigns_that_one_robot_fits_but_not_well_are_to_be_diagnosed() -> None:
    alike = RunComparison((), 0.0, (3,), 1.0, 0.05, False, (1.1, 0.9), ())
    assert changes_verdict(alike, ("a.csv", "b.csv")).action.startswith("Nothing to do")
    amiss = changes_verdict(replace(alike, noise=(9.3, 9.7)), ("a.csv", "b.csv"))
    assert amiss.level == "doubtful"
    assert "9.7 times the stated noise" in amiss.action
