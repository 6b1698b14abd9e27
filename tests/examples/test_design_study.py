"""The design study compares what it says it does, and draws its figure."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from beamstiff import compile_structure, load_robot, posture, tcp_compliance
from tests.examples.scripts import run_script

TABLES = (("kg", "x", "y", "z"), ("deflection", "walls", "bridge", "ram", "guides, drives"))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Return what the study prints, and its figure."""
    figure = tmp_path_factory.mktemp("study") / "new" / "figure.png"
    return run_script("design_study", figure, COLUMNS="80"), figure


@pytest.fixture(scope="module")
def rows(study: tuple[str, Path]) -> dict[str, dict[str, float]]:
    """Return both tables: by design, its numbers by column."""
    found: dict[str, dict[str, float]] = {}
    for line in study[0].splitlines():
        name, *numbers = re.split(r"\s{2,}", line.strip())
        if numbers and re.fullmatch(r"[0-9.]+", numbers[0]):
            [columns] = (columns for columns in TABLES if len(columns) == len(numbers))
            found.setdefault(name, {}).update(zip(columns, map(float, numbers), strict=True))
    return found


def test_it_compares_seven_designs_whose_shares_add_up(rows: dict[str, dict[str, float]]) -> None:
    assert len(rows) == 7
    for row in rows.values():
        assert sum(row[part] for part in TABLES[1][1:]) == pytest.approx(100, abs=2)


def test_the_first_row_is_the_machine_that_comes_along(rows: dict[str, dict[str, float]]) -> None:
    robot = load_robot("gantry")
    structure = compile_structure(robot)
    q = [sum(variable.limits or ()) / 2 for variable in robot.actuated]
    stiffness = 1e-6 / np.diagonal(tcp_compliance(structure, posture(structure.kinematics, q))[0])
    assert [rows["as it is"][axis] for axis in "xyz"] == pytest.approx(stiffness[:3], abs=0.05)


def test_each_change_does_what_mechanics_says(rows: dict[str, dict[str, float]]) -> None:
    before = rows["as it is"]
    aluminium, ram = rows["bridge of aluminium"], rows["ram 320 mm, 30 mm walls"]
    rails, tie = rows["saddle's rails 600 mm apart"], rows["tie between the rear posts"]
    # the bridge is 2.4 m of 0.4 x 0.5 m box with 15 mm walls; steel 7850, aluminium 2700 kg/m^3
    area = 0.4 * 0.5 - 0.37 * 0.47
    assert before["kg"] - aluminium["kg"] == pytest.approx(2.4 * area * (7850 - 2700), abs=1.0)
    # a third of the modulus: three times the bridge's part of the deflection
    parts = [row["deflection"] * row["bridge"] for row in (aluminium, before)]
    assert parts[0] / parts[1] == pytest.approx(3.0, rel=0.05)
    assert rails["kg"] == before["kg"]
    assert rails["x"] > before["x"]
    assert rails["y"] == pytest.approx(before["y"], abs=0.1), "it turns about the bridge: not with y"
    assert tie["y"] > 1.05 * before["y"]
    assert tie["x"] == pytest.approx(before["x"], rel=0.01)
    assert ram["ram"] < before["ram"]
    assert min(rows.values(), key=lambda row: row["deflection"]) == rows["bridge, ram and rails together"]


def test_the_figure_is_drawn(study: tuple[str, Path]) -> None:
    text, figure = study
    assert str(figure) in " ".join(text.split())
    pixels = imread(figure)[:, :, :3]
    assert pixels.shape[0] > 600
    halves = np.split(pixels[:, : pixels.shape[1] // 2 * 2], 2, axis=1)
    assert all((half < 0.9).any(axis=2).mean() > 0.01 for half in halves)
