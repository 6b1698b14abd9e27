"""A robot and a result show themselves: as figures, where rich prints, in Jupyter."""

import io
import pickle
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import beamstiff
from beamstiff import BeamstiffError, Robot, calibrate, identify, load_robot, read_measurements
from beamstiff.calibration.corrected import corrected
from beamstiff.identification.result import Identification
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.diagnosis.planted import diagnosed

DATA = Path(__file__).resolve().parents[2] / "examples" / "data" / "ir663_compliance_xx.csv"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("ir663")


@pytest.fixture(scope="module")
def measured(robot: Robot) -> Measurements:
    return read_measurements(DATA, robot)


@pytest.fixture(scope="module")
def found(robot: Robot, measured: Measurements) -> Identification:
    return identify(robot, measured)


def printed(thing: object, width: int = 100) -> str:
    console = Console(file=io.StringIO(), width=width, record=True)
    console.print(thing)
    return console.export_text()


def test_a_robot_draws_itself_in_a_posture(robot: Robot) -> None:
    figure = robot.plot(q={"q2": 0.1, "q8": 0.8})
    other = robot.plot(q={"q2": 0.5, "q8": 0.8})
    assert len(figure.axes[0].lines) == len(robot.rigids) + len(robot.beams) + len(robot.struts)
    ends = [np.concatenate([line.get_xydata() for line in one.axes[0].lines]) for one in (figure, other)]
    assert np.abs(ends[0] - ends[1]).max() > 0.1  # m: the arm has moved
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["cantilever", "gantry", "tripod", "kr500"])
def test_every_kind_of_robot_draws_itself_where_its_loops_close(name: str) -> None:
    assert load_robot(name).plot().axes[0].get_title() == name


def test_an_unknown_variable_is_named(robot: Robot) -> None:
    with pytest.raises(BeamstiffError, match="'q9' is no actuated variable, expected q2, q8"):
        robot.plot(q={"q9": 0.0})


def test_an_identification_draws_its_values_or_its_rows(
    found: Identification, measured: Measurements
) -> None:
    labels = [text.get_text() for text in found.plot().axes[0].get_yticklabels()]
    assert labels[::-1] == [f"{item.name}, {item.unit}" for item in found.parameters]
    assert "residual" in found.plot(measured=measured).axes[0].get_ylabel()


def test_rich_and_jupyter_show_the_same_table(found: Identification) -> None:
    for shown in (printed(found), found._repr_html_()):
        for word in ("J12.torsional", "1.36e+06", "3.805e+06", "0.113 mm RMS on the 12 fitted rows"):
            assert word in shown
    assert max(map(len, printed(found, 60).splitlines())) <= 60


def test_a_robot_is_told_as_the_command_show_tells_it(robot: Robot) -> None:
    assert "Closed loops" in printed(robot)
    assert "four_bar" in robot._repr_html_()


def test_a_robot_says_what_the_command_show_notes() -> None:
    rigid = load_robot("kr500").with_parameters({f"J{k}.torsional": np.inf for k in range(1, 7)})
    for shown in (str(rigid), rigid._repr_html_()):
        assert "Mind: no compliance: the joints J1, J2, J3, J4, J5, J6 are rigid" in " ".join(shown.split())
    assert "Mind" not in str(load_robot("kr500"))


def test_names_from_files_run_nothing_and_are_no_markup() -> None:
    odd = load_robot("cantilever").model_copy(update={"name": "<script>alert(1)</script>[/red] $x"})
    assert "<script>" not in odd._repr_html_()
    assert "&lt;script&gt;" in odd._repr_html_()
    assert "[/red]" in printed(odd)
    assert odd.plot()._repr_png_().startswith(b"\x89PNG")


def test_a_diagnosis_shows_itself_too() -> None:
    result = diagnosed("backlash")
    assert len(result.plot().axes) == len(beamstiff.plot(result).axes) == 4
    assert "Which effect" in result._repr_html_()
    assert "Which effect" in printed(result)


def test_a_calibration_draws_its_errors_and_its_changes() -> None:
    arm = load_robot("kr500").with_parameters({f"J{k}.torsional": np.inf for k in range(1, 7)})
    q = np.random.default_rng(0).uniform(-1, 1, (20, 6))
    real = compile_kinematics(corrected(arm, {"q2": 1e-3, "f3.d": 5e-4}, q))
    seen = posture(real, q).node_positions[:, real.node_index["n6b"]]
    seen += 1e-5 * np.random.default_rng(1).standard_normal(seen.shape)
    rows = make_measurements([f"q{k}" for k in range(1, 7)], q, tcp="n6b", position=seen)
    found = calibrate(arm, rows, ["q2", "q3", "f3.d", "f4.d"], folds=0)
    errors, degrees, millimetres = found.plot().axes
    before, after = (line.get_xdata() for line in errors.lines)
    assert min(before) > 10 * max(after)
    assert [text.get_text() for text in degrees.get_yticklabels()] == ["q2", "q3"]
    assert [text.get_text() for text in millimetres.get_yticklabels()] == ["f3.d", "f4.d"]
    assert found._repr_html_().count("f3.d") > 0


def test_what_is_unknown_is_refused() -> None:
    with pytest.raises(BeamstiffError, match="found int, expected a robot or a result"):
        beamstiff.plot(3)


def test_a_result_is_still_plain_data(found: Identification, robot: Robot) -> None:
    assert pickle.loads(pickle.dumps(found)).rms == found.rms
    assert robot.model_copy() == robot
    assert "plot" not in robot.model_dump()
