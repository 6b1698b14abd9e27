import json
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot, read_measurements
from beamstiff.report.deflection import without_rounding
from beamstiff.robot.parts import Mass
from beamstiff.robot.writer import save_robot
from tests.cli.conftest import Refused, Run

# by hand, from the crane's stiffness: across the arm 1 kN moves 0.5 mm + 1 mm and turns 1 mrad
BY_HAND = 1e-3 * np.array(
    [[0, 1.5, 0, 0, 0, 1], [0.5, 0, 0, 0, 0, 0], [1.5, 0, 0, 0, 0, -1], [0.5, 0.5, 0, 0, 0, 0]]
)


def test_every_row_gets_the_displacement_computed_by_hand(run: Run) -> None:
    result = run("deflect crane.yaml crane.csv --json -")
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert list(answer) == ["displacement"]
    np.testing.assert_allclose(answer["displacement"], BY_HAND, atol=1e-15)


def test_loads_alone_are_enough(told: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text("q1 [deg],fy [kN]\n0,1\n0,-2\n")
    answer = told("deflect crane.yaml loads.csv")
    np.testing.assert_allclose(answer["displacement"], [BY_HAND[0], -2 * BY_HAND[0]], atol=1e-15)


def test_one_load_needs_no_table(told: Run, run: Run) -> None:
    for q in ("--q q1=0deg ", ""):  # which is the reference posture
        answer = told(f"deflect crane.yaml {q}--wrench fy=1kN")
        np.testing.assert_allclose(answer["displacement"], [BY_HAND[0]], atol=1e-15)
    turned = told("deflect crane.yaml --q q1=90deg --wrench fx=-1kN")["displacement"][0]
    np.testing.assert_allclose(turned, 1e-3 * np.array([-1.5, 0, 0, 0, 0, 1]), atol=1e-15)
    warned = run("deflect ir663 --q q2=60deg,q8=45deg --wrench fz=-1").stderr
    assert "q2: 1.0472 rad lies outside the limits" in warned


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("", "found neither DATA nor --wrench nor --weight, expected a table of loads, or one load"),
        ("crane.csv --wrench fy=1kN", "found DATA beside --wrench or --weight"),
        ("crane.csv --weight", "found DATA beside --wrench or --weight"),
        ("crane.csv --q q1=0.1", "--q: goes with --wrench or --weight; DATA has its own joint values"),
        ("--wrench fy=1kN --q q7=0.1", "--q: unknown joint variable 'q7'"),
        ("--wrench fq=1kN", "--wrench: unknown component 'fq'"),
    ],
)
def test_a_table_or_one_load(refused: Refused, options: str, said: str) -> None:
    refused(f"deflect crane.yaml {options}", said)


def test_weight_needs_no_table(told: Run, folder: Path) -> None:
    """Truth: a mass m on the tip of a compliance C moves it by ``C m g``, and a pull down adds to it."""
    robot = load_robot(folder / "crane.yaml")
    laden = robot.model_copy(update={"masses": (Mass(node=robot.tcp, mass=100.0),), "gravity": (0, -9.81, 0)})
    save_robot(laden, folder / "laden.yaml")
    answer = told("deflect laden.yaml --weight --q q1=0deg")
    np.testing.assert_allclose(answer["displacement"], [-0.981 * BY_HAND[0]], atol=1e-6)  # second order
    assert answer["pose"][0][1] == answer["displacement"][0][1]
    more = told("deflect laden.yaml --weight --wrench fy=-1kN --q q1=0deg")
    np.testing.assert_allclose(more["displacement"], [-1.981 * BY_HAND[0]], atol=2e-6)


def test_what_is_compliant_is_told_by_its_share_of_the_strain_energy(succeed: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text("q1 [deg],fy [kN]\n0,0.5\n0,1\n")  # by hand: 1 mm and 0.5
    said = " ".join(succeed("deflect crane.yaml loads.csv").stdout.split())
    assert "in loads.csv:3, where the tool moves most: J1.torsional 67 %, J1.radial 33 % of" in said


def test_a_turn_that_no_linear_model_holds_for_is_told(run: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text("q1 [deg],fy [kN]\n0,100\n")  # turns 0.1 rad, by hand
    assert "the tool turns by up to 0.1 rad" in run("deflect crane.yaml loads.csv").stderr
    (folder / "loads.csv").write_text("q1 [deg],fy [kN]\n0,49\n")
    assert "the tool turns" not in run("deflect crane.yaml loads.csv").stderr


def test_preload_takes_in_what_the_load_does_to_the_stiffness(succeed: Run, told: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text("q1,fx [kN],fy [kN]\n0,-100,1\n0,100,1\n")
    answer = told("deflect crane.yaml loads.csv --preload")
    turns = [1e3 / (1e6 - 1e5), 1e3 / (1e6 + 1e5)]
    np.testing.assert_allclose(np.array(answer["displacement"])[:, 5], turns, rtol=1e-9)
    succeed("deflect crane.yaml loads.csv --preload --out predicted.csv")
    assert "--preload" in (folder / "predicted.csv").read_text().splitlines()[0]


def test_absolute_rows_get_the_position_by_hand(told: Run, succeed: Run, folder: Path) -> None:
    (folder / "seen.csv").write_text(
        "q1 [deg],fy [kN],x [m],y [m],z [m]\n0,0,1,0,0\n0,1,1,0.0016,0\n90,0,,,\n"
    )
    answer = told("deflect crane.yaml seen.csv")
    still = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    moved = np.array([np.zeros(6), BY_HAND[0], np.zeros(6)])
    moved[1, 0] = np.cos(BY_HAND[0][5]) - 1  # the tip goes on a circle of 1 m
    np.testing.assert_allclose(answer["displacement"], moved, atol=1e-9)
    np.testing.assert_allclose(np.array(answer["pose"])[:, :3], np.array(still) + moved[:, :3], atol=1e-9)
    said = succeed("deflect crane.yaml seen.csv --out predicted.csv").stdout
    assert "at most 0.1 mm" in said
    again = succeed("verify crane.yaml predicted.csv").stdout
    assert "Position error 0 mm" in again
    assert " 0.000 mm" in again
    assert "noise" not in again  # the table states none


def test_point_and_load_point_need_not_be_the_tcp(told: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text(
        "q1,fy,point,load_point\n0,1000,hub,tip\n0,1000,tip,hub\n0,1000,hub,hub\n"
    )
    answer = told("deflect crane.yaml loads.csv")
    # at the hub: 0.5 mm from the radial stiffness; the load at the tip turns it, a load at the hub does not
    expected = 1e-3 * np.array([[0, 0.5, 0, 0, 0, 1], [0, 0.5, 0, 0, 0, 0], [0, 0.5, 0, 0, 0, 0]])
    np.testing.assert_allclose(answer["displacement"], expected, atol=1e-15)


def test_the_table_written_is_read_back_as_measurements(succeed: Run, folder: Path) -> None:
    succeed("deflect crane.yaml crane.csv --out predicted.csv")
    table = read_measurements(folder / "predicted.csv", load_robot(folder / "crane.yaml"))
    np.testing.assert_allclose(table.displacement, BY_HAND, atol=1e-15)
    np.testing.assert_allclose(np.degrees(table.q[:, 0]), [0, 0, 90, 45], atol=1e-12)
    assert "crane.csv" in table.metadata["source"]


def test_people_see_measured_beside_predicted_and_the_gap(run: Run, folder: Path) -> None:
    table = (folder / "crane.csv").read_text().replace("90,1000,0,1.5,0", "90,1000,0,1.6,0")
    (folder / "crane.csv").write_text(table)
    result = run("deflect crane.yaml crane.csv")
    assert "measured dx [mm]" in result.stdout
    assert "RMS 0.05 mm, at most 0.1 mm, over 4 rows" in result.stdout


def test_a_likely_mistake_of_unit_is_noted(succeed: Run, folder: Path) -> None:
    (folder / "loads.csv").write_text("q1,fy\n90,1000\n")
    result = succeed("deflect crane.yaml loads.csv")
    assert result.stderr.startswith("note: loads.csv:2: q1: 90 rad is more than two turns")
    assert result.stderr.count("\n") == 1


def test_a_rotation_that_is_rounding_is_shown_as_none() -> None:
    moved = np.array([[1e-3, 0, 2e-9, 3e-19, 0, -1e-18], [0, 1e-4, 0, 0, 0, 1e-9]])
    expected = np.array([[1e-3, 0, 2e-9, 0, 0, 0], [0, 1e-4, 0, 0, 0, 1e-9]])
    np.testing.assert_array_equal(without_rounding(moved), expected)


def test_the_deformed_structure_is_written_for_paraview(run: Run, folder: Path) -> None:
    def moved(*more: str) -> list[float]:
        result = run("deflect crane.yaml crane.csv --vtu shape.vtu", *more)
        assert (result.exit_code, result.stderr) == (0, "")
        text = (folder / "shape.vtu").read_text().partition('Name="displacement"')[2]
        return [float(value) for value in text.splitlines()[3].split()]  # of the tip, the third node

    np.testing.assert_allclose(moved(), BY_HAND[0, :3], atol=1e-15)  # the first of those that move most
    np.testing.assert_allclose(moved("--line", "6"), BY_HAND[3, :3], atol=1e-15)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--vtu", "shape.vtk"), "found the ending '.vtk', expected .vtu"),
        (
            ("--vtu", "shape.vtu", "--line", "7"),
            "--line 7: is no row of crane.csv, expected a line from 3 to 6",
        ),
        (("--line", "3"), "--line: goes with --vtu"),
        (("--vtu", "crane.csv"), "would overwrite the input crane.csv"),
    ],
)
def test_structures_that_are_refused(refused: Refused, options: tuple[str, ...], message: str) -> None:
    refused(["deflect", "crane.yaml", "crane.csv", *options], message)
