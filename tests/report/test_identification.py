from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from beamstiff import Robot, identify, load_robot
from beamstiff.identification.result import Combination, Identification, Parameter
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.identification import combinations_text, identification_table, identification_text

PARTS: dict[str, Any] = {
    "nodes": [{"name": "a"}, {"name": "b"}],
    "joints": [
        {
            "name": "J1",
            "nodes": ["a", "b"],
            "frame": "base",
            "stiffness": {"radial": "rigid", "torsional": 1e6},
        }
    ],
}
JOINT = Robot(name="joint", **PARTS, fixed=["a"], tcp="b")
FOUND = Identification(
    parameters=(
        Parameter("J1.torsional", "N*m/rad", 1.5e6, 3e4, True),
        Parameter("J1.radial", "N/m", None, None, False, lower_bound=4e8),
    ),
    degenerate=(),
    covariance=np.eye(2),
    stiffness=np.array([1.5e6, 1e16]),
    robot=JOINT,
    rms=0.1e-3,
    rms_held_out=0.15e-3,
    rms_held_out_load=None,
    chi_square=1.0,
    method="trust-region",
    evaluations=7,
    message="converged",
    interrupted=False,
    predicted=np.zeros((2, 6)),
)


@pytest.fixture
def robot() -> Robot:
    return JOINT


def measured(sigma: float | None) -> Measurements:
    return make_measurements(
        ["q1"], [[0.0], [1.0]], tcp="b", displacement=np.zeros((2, 3)), sigma_position=sigma
    )


def printed(found: Identification, robot: Robot) -> list[list[str]]:
    console = Console(width=200)
    with console.capture() as capture:
        console.print(identification_table(found, robot))
    return [line.split() for line in capture.get().splitlines()]


def test_the_table_has_the_start_the_value_and_its_uncertainty(robot: Robot) -> None:
    rows = printed(FOUND, robot)
    assert ["J1.torsional", "1e+06", "1.5e+06", "3e+04", "2.0", "%", "N*m/rad"] in rows


def test_a_value_far_from_that_of_the_file_is_marked(robot: Robot) -> None:
    assert "(!)" not in identification_text(replace(FOUND, start=robot), measured(1e-5))
    stiff = robot.with_parameters({"J1.torsional": 1.5e8})
    text = identification_text(replace(FOUND, start=stiff), measured(1e-5))
    assert "(!) Far from the robot file: J1.torsional (100 times softer)." in text
    assert ["J1.torsional", "(!)"] in [row[:2] for row in printed(FOUND, stiff)]
    guess = stiff.model_copy(update={"unmeasured": ("J1.torsional",)})  # a start value is no statement
    assert "(!)" not in identification_text(replace(FOUND, start=guess), measured(1e-5))


def test_what_is_not_bounded_shows_its_lower_bound_and_no_value(robot: Robot) -> None:
    assert ["J1.radial", "rigid", ">", "4e+08", "-", "-", "N/m"] in printed(FOUND, robot)
    assert "No upper bound from these data for J1.radial:" in identification_text(FOUND, measured(1e-5))


@pytest.mark.parametrize(
    ("chi_square", "sigma", "says"),
    [
        (1.0, 35e-6, "1.00 times the stated noise (0.035 mm per axis): noise explains it"),
        (13.69, 35e-6, "3.7 times the stated noise (0.035 mm per axis): the model is incomplete"),
        (1.0, None, "states no sigma_position"),
    ],
)
def test_the_gap_is_compared_with_the_noise(chi_square: float, sigma: float | None, says: str) -> None:
    text = identification_text(replace(FOUND, chi_square=chi_square), measured(sigma))
    assert says in text
    assert "Position residual: 0.100 mm RMS on the 2 fitted rows, 0.150 mm on held-out poses." in text


def test_too_few_poses_to_hold_out_are_told() -> None:
    text = identification_text(replace(FOUND, rms_held_out=None), measured(None))
    assert "too few poses" in text


def told(*groups: Combination, nearly: tuple[Combination, ...] = ()) -> str:
    """Return on one line what is said of groups."""
    console = Console(width=200)
    with console.capture() as capture:
        for line in combinations_text(replace(FOUND, degenerate=groups, ill_determined=nearly)):
            console.print(line)
    return " ".join(capture.get().split())


def test_where_all_is_known_by_itself_nothing_is_said_of_groups() -> None:
    assert told() == ""


def test_springs_in_series_are_told_as_one_with_what_would_part_them() -> None:
    names = ("J1.radial", "J2.radial")
    group = Combination(
        names, "1/J1.radial + 1/J2.radial", 4e-9, 1e-10, "series", "m/N", "to identify them, measure x"
    )
    text = told(group)
    assert "1/J1.radial + 1/J2.radial 4e-09 1e-10 m/N 2.5e+08" in text
    assert "J1.radial and J2.radial act in series: lump them into one (--reduce)." in text
    assert "To identify them, measure x." in text


def test_a_sum_that_may_be_zero_is_as_stiff_as_its_bound_at_least() -> None:
    group = Combination(("a", "b"), "1/a + 1/b", 1e-9, 2e-9, "series", "m/N", "", (0.0, 5e-9))
    assert "1e-09 2e-09 m/N > 2e+08" in told(group)


def test_groups_without_a_sum_and_hardly_told_springs_are_named() -> None:
    mixed = Combination(("a", "b", "c"), "", None, None, "mixed", "N/m")
    near = Combination(("J4", "J6"), "1/J4 + 1/J6", 4e-6, 1e-8, "ill-determined", "rad/(N*m)")
    text = told(mixed, nearly=(near,))
    assert "a, b and c are identifiable only in combination, not as a simple sum." in text
    assert "J4 and J6 are hardly distinguishable with these data." in text
    assert "1/J4 + 1/J6 4e-06 1e-08 rad/(N*m) -" in text


def test_what_is_never_loaded_is_not_called_unbounded() -> None:
    silent = Parameter(
        "J1.axial", "N/m", None, None, False, lower_bound=0.0, reason="never loaded", silent=True
    )
    grouped = Combination(
        ("J1.radial", "J2.radial"), "1/J1.radial + 1/J2.radial", 4e-9, 1e-10, "series", "m/N"
    )
    found = replace(FOUND, parameters=(*FOUND.parameters, silent), degenerate=(grouped,))
    assert "No upper bound" not in identification_text(found, measured(1e-5))
    assert "never loaded; to identify it, measure y." in "".join(
        map(
            str,
            combinations_text(
                replace(
                    found, degenerate=(), parameters=(replace(silent, separate="to identify it, measure y"),)
                )
            ),
        )
    )


def test_rows_that_scatter_far_less_than_is_stated_are_no_proof_of_the_model() -> None:
    q = np.zeros((12, 1))
    rows = make_measurements(["q1"], q, tcp="b", displacement=np.zeros((12, 3)), sigma_position=0.02)
    text = identification_text(replace(FOUND, chi_square=2.5e-5), rows)
    assert "0.005 times the stated noise (20 mm per axis): the rows scatter far less than stated" in text
    assert "noise explains it" not in text


def test_of_a_fit_without_anything_left_over_nothing_good_is_said() -> None:
    robot = load_robot("ir663")
    push = [[-900.0, 0, 0, 0, 0, 0]]
    one = make_measurements(
        ["q2", "q8"],
        [[0.2, 0.8]],
        tcp="n7",
        wrench=push,
        displacement=[[-1e-3] + [np.nan] * 5],
        sigma_position=1e-5,
    )
    text = identification_text(identify(robot, one, ["J12.torsional"]), one)
    assert "on the one fitted row" in text
    assert "As many parameters as readings" in text
    assert "noise explains it" not in text
