import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.figures import new_figure, save_figure
from beamstiff.report.residuals import AFTER, BEFORE, residual_figure
from beamstiff.robot.description import Robot

MEASURED = make_measurements(
    ["q1"],
    [[0.0], [0.1], [0.2]],
    tcp="tip",
    displacement=[
        [1e-3, np.nan, 0, np.nan, np.nan, 2e-3],
        [2e-3, np.nan, 0, 0, 0, 0],
        [3e-3, np.nan, 1e-3, 0, 0, 0],
    ],
)


def fitted(predicted: Any, start: Robot | None = None) -> Any:
    """Return what stands for an identification."""
    turning = SimpleNamespace(variables=())
    return SimpleNamespace(predicted=np.asarray(predicted), start=start, robot=turning)


def test_residuals_of_every_measured_value_and_no_other_stand_over_load_and_posture() -> None:
    figure = residual_figure(fitted(np.full((3, 6), 0.5e-3)), MEASURED, "arm")
    # no row is loaded: what varies is the posture
    assert [axes.get_xlabel() for axes in figure.axes] == ["q1, deg", "pose", "q1, deg", "pose"]
    pushed = replace(MEASURED, wrench=np.outer([1.0, 2.0, 3.0], [1.0, 0, 0, 0, 0, 0]))
    loaded = residual_figure(fitted(np.full((3, 6), 0.5e-3)), pushed)
    assert [axes.get_xlabel() for axes in loaded.axes] == ["force, N", "pose", "q1, deg", "pose"]
    shown = [axes.lines[0].get_ydata() for axes in figure.axes]
    np.testing.assert_allclose(shown[0], np.hypot([0.5, 1.5, 2.5], [0.5, 0.5, 0.5]))
    np.testing.assert_allclose(shown[2], [1.5, np.sqrt(0.75), np.sqrt(0.75)])
    np.testing.assert_allclose(figure.axes[1].lines[0].get_xdata(), [0, 1, 2])
    assert figure.axes[2].get_ylabel() == "size of the rotation residual, mrad"


def test_the_robot_as_described_is_drawn_beside_the_identified_one() -> None:
    robot = load_robot("cantilever")
    push = make_measurements([], np.zeros((2, 0)), tcp=robot.tcp, wrench=[[0, 0, -9.0, 0, 0, 0]] * 2)
    moved = predict_displacements(robot, push)
    rows = replace(push, displacement=moved + np.array([1e-3, 0, 0, 0, 0, 0]))
    lines = residual_figure(fitted(rows.displacement, robot), rows).axes[0].lines
    assert [line.get_label() for line in lines] == [BEFORE, AFTER]
    np.testing.assert_allclose(lines[0].get_ydata(), 1.0)
    np.testing.assert_allclose(lines[1].get_ydata(), 0.0)


def test_a_table_of_positions_has_no_residual_of_displacements() -> None:
    table = make_measurements(["q1"], [[0.0]], tcp="tip", position=[[1.0, 2.0, 3.0]])
    with pytest.raises(BeamstiffError, match="no measured displacement"):
        residual_figure(fitted(np.zeros((1, 6))), table)


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG\r\n"), ("svg", b"<?xml"), ("pdf", b"%PDF-")])
def test_the_same_figure_gives_the_same_file(tmp_path: Path, ending: str, head: bytes) -> None:
    files = [tmp_path / f"{name}.{ending}" for name in "ab"]
    for file in files:
        save_figure(residual_figure(fitted(np.full((3, 6), 0.5e-3)), MEASURED), file)
    one, other = (file.read_bytes() for file in files)
    assert one.startswith(head)
    assert one == other


def test_an_unknown_kind_is_refused_and_nothing_written(tmp_path: Path) -> None:
    for name in ("a.jpeg", "a", "a.png.txt"):
        with pytest.raises(BeamstiffError, match="expected a figure as png, svg, pdf"):
            save_figure(new_figure(1, 1), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_figures_leave_pyplot_alone() -> None:
    script = "import sys, beamstiff.report.residuals; print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "matplotlib.pyplot" not in result.stdout.split()
