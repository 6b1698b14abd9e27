"""benchmarks.models_study: the invented KR500 is what it is said to be, and what it shows of the models."""

import numpy as np
import pytest

from benchmarks import fuzzy_six_joints, ir663_models, kr500_grid
from benchmarks.models_study import cubes_figure, grid_table, table_4, table_5


@pytest.fixture(scope="module")
def rows() -> dict[str, float]:
    """Return mean errors, mm, by model, of the two coarsest grids and few measurements."""
    found = kr500_grid.study(kr500_grid.bench(kr500_grid.published), (600, 300), (27,))
    assert len(grid_table("KR500", found).rows) == len(found) == 11
    points, sizes = cubes_figure(found).axes
    assert [len(np.asarray(line.get_xdata())) for line in points.lines] == [128] * 5
    assert [label.get_text() for label in sizes.get_xticklabels()] == ["whole", "600", "300"]
    return {f"{row.name}, {row.measurements}": 1e3 * row.mean for row in found}


def test_the_invented_machine_has_the_gap_of_the_paper(rows: dict[str, float]) -> None:
    assert rows["none, 0"] == pytest.approx(0.2567, abs=0.002)
    assert rows["one stiffness, 27"] == pytest.approx(0.1049, abs=0.006)


def test_cubes_of_it_do_about_as_the_papers_did(rows: dict[str, float]) -> None:
    assert rows["2 cubes of 600 mm, 42"] == pytest.approx(0.0989, abs=0.01)
    assert rows["16 cubes of 300 mm, 183"] == pytest.approx(0.0761, abs=0.01)


def test_a_smooth_correction_needs_27_measurements_for_what_128_cubes_do_with_1059(
    rows: dict[str, float],
) -> None:
    assert rows["gaussian process, random poses, 27"] < 0.0581 / 2
    assert rows["gray box, random poses, 27"] < 0.0581


def test_the_machine_of_usual_size_leaves_little_to_correct() -> None:
    bench = kr500_grid.bench(kr500_grid.usual)
    found = {row.name: 1e3 * row.mean for row in kr500_grid.study(bench, (), ())}
    assert found["one stiffness"] < 0.03 * found["none"]


def test_table_4_is_exact() -> None:
    assert table_4() < 1e-12


def test_fuzzy_leaves_less_than_the_parametric_model_of_an_ir663_with_ball_screws() -> None:
    found = ir663_models.table_5("ir663-screws", share=0.25)
    fresh = found.split.new_pose
    left = {one.name: 1e3 * (one.rms(fresh) or np.inf) for one in found.judged}
    assert left["fuzzy"] < 0.6 * left["parametric"]
    assert left["gray box"] < 1.2 * left["gaussian process"] < 1.5 * 0.035
    assert len(table_5("ir663-screws", found, 0.25).rows) == 7


def test_six_joints_are_many_for_rules_that_know_nothing_of_the_machine() -> None:
    left = {one.name: one.position for one in fuzzy_six_joints.study((60,))}
    assert left["parametric"] < 0.05
    assert left["parametric"] < 0.2 * left["fuzzy"] < 0.2
