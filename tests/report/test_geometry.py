"""Figures and tables of geometric calibration: what is drawn is what was found."""

import numpy as np
import pytest

from beamstiff.calibration.parameters import Parameter
from beamstiff.calibration.recursion import Recursion
from beamstiff.calibration.result import Found
from beamstiff.calibration.sensitivity import SensitivityIndices
from beamstiff.report.geometry import combination_text, parameters_table, recursion_figure, sensitivity_figure

UNITS = {"a": "m", "b": "m", "q": "rad"}


def test_combinations_are_in_mm_and_deg() -> None:
    # 1 mm of a looks like 0.5 mm of b and 0.001 rad = 0.0573 deg of q
    assert combination_text("a", {"b": 0.5, "q": -1.0}, UNITS) == "- 0.0573 q + 0.5 b"
    assert combination_text("q", {"a": 0.01}, UNITS) == "0.175 a"
    many = {f"p{k}": 1.0 for k in range(9)}
    assert combination_text("a", many, UNITS | dict.fromkeys(many, "m")).endswith("and 5 more")


def test_bars_are_mean_and_largest_by_kind() -> None:
    parameters = (Parameter("f3.d", "frame", "m", 1e-3, 2), Parameter("q2", "offset", "rad", 1e-3, 1))
    found = SensitivityIndices(
        parameters, np.array([[1.0, 2.0], [1.0, 4.0]]), np.array([[0.0, 1.0], [0.0, 1.0]])
    )
    figure = sensitivity_figure(found, "title")
    lengths, angles, _, turned = figure.axes
    assert [bar.get_height() for bar in angles.patches] == [4.0, 3.0]
    assert [bar.get_height() for bar in lengths.patches] == [1.0, 1.0]
    assert [bar.get_height() for bar in turned.patches] == [1.0, 1.0]
    assert [text.get_text() for text in angles.get_xticklabels()] == ["q2"]


@pytest.mark.parametrize("turned", [True, False])
def test_the_recursion_is_drawn_in_mm_and_deg(turned: bool) -> None:
    orientation = np.array([1e-2, 1e-3]) if turned else np.full(2, np.nan)
    way = Recursion(np.zeros((2, 3)), np.array([1e-3, 1e-4]), orientation)
    figure = recursion_figure({"each pose alone": way, "all poses so far": way}, "title")
    assert len(figure.axes) == 1 + turned
    assert figure.axes[0].lines[0].get_ydata() == pytest.approx([1.0, 0.1])
    if turned:
        assert figure.axes[1].lines[1].get_ydata() == pytest.approx(np.degrees([1e-2, 1e-3]))


def test_what_the_robot_file_gives_no_place_for_has_no_nominal_value() -> None:
    class Sought:
        parameters = (
            Found(Parameter("base.x", "base", "m", 1.0, 1), 0.0, 2.0, 1e-5),
            Found(Parameter("far.x", "target", "m", 1.0, 1), 0.05, 0.051, 1e-5),
            Found(Parameter("far.y", "target", "m", 1.0, 1), 0.0, 0.001, 1e-5),
            Found(Parameter("q2", "offset", "rad", 1e-3, 1), 0.0, 1e-3, 1e-5),
        )

    rows = parameters_table(Sought(), "found").rows
    assert [row[1] for row in rows] == ["-", "50.0000", "0.0000", "0.0000"]
    assert [row[3] for row in rows] == ["-", "1.0000", "1.0000", "0.0573"]
