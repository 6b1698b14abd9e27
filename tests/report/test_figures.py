import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure import make_measurements
from beamstiff.report.figures import new_figure, save_figure
from beamstiff.report.parity import parity_figure

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


def test_parity_shows_every_measured_value_and_no_other() -> None:
    predicted = np.full((3, 6), 0.5e-3)
    figure = parity_figure(MEASURED, predicted, "arm")
    positions, rotations = figure.axes
    shown = {line.get_label(): line.get_xydata() for line in positions.lines}
    assert list(shown) == ["dx", "dz", "equal"]
    np.testing.assert_allclose(shown["dx"], [[1, 0.5], [2, 0.5], [3, 0.5]])
    assert [len(line.get_xydata()) for line in rotations.lines] == [2, 2, 3, 2]
    assert positions.get_xlabel() == "measured displacement, mm"
    assert rotations.get_ylabel() == "predicted rotation, mrad"


def test_equal_values_lie_on_the_diagonal_in_the_middle_of_equal_axes() -> None:
    axes = parity_figure(MEASURED, np.nan_to_num(MEASURED.displacement)).axes[0]
    assert axes.get_xlim() == axes.get_ylim()
    for line in axes.lines:
        x, y = line.get_xydata().T
        np.testing.assert_allclose(x, y)


def test_a_table_of_positions_has_no_parity() -> None:
    table = make_measurements(["q1"], [[0.0]], tcp="tip", position=[[1.0, 2.0, 3.0]])
    with pytest.raises(BeamstiffError, match="no measured displacement"):
        parity_figure(table, np.zeros((1, 6)))


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG\r\n"), ("svg", b"<?xml"), ("pdf", b"%PDF-")])
def test_the_same_figure_gives_the_same_file(tmp_path: Path, ending: str, head: bytes) -> None:
    files = [tmp_path / f"{name}.{ending}" for name in "ab"]
    for file in files:
        save_figure(parity_figure(MEASURED, np.full((3, 6), 0.5e-3)), file)
    one, other = (file.read_bytes() for file in files)
    assert one.startswith(head)
    assert one == other


def test_an_unknown_kind_is_refused_and_nothing_written(tmp_path: Path) -> None:
    for name in ("a.jpeg", "a", "a.png.txt"):
        with pytest.raises(BeamstiffError, match="expected a figure as png, svg, pdf"):
            save_figure(new_figure(1, 1), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_figures_leave_pyplot_alone() -> None:
    script = "import sys, beamstiff.report.parity; print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "matplotlib.pyplot" not in result.stdout.split()
