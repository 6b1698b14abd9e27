"""`beamstiff calibrate` as it is typed: what it finds, writes and refuses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot, read_measurements, save_robot, write_measurements
from beamstiff.calibration.corrected import corrected
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.cli.conftest import Refused, Run

PLANTED = {"q2": 1e-3, "f3.d": 5e-4, "f4.alpha": -8e-4}


def readings(robot: Robot, count: int, seed: int) -> Measurements:
    """Return what a point tracker reads of a robot in its own base frame, to 0.01 mm."""
    rng = np.random.default_rng(seed)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = rng.uniform(low, high, (count, 6))
    kinematics = compile_kinematics(robot)
    seen = posture(kinematics, q).node_positions[:, kinematics.node_index["n6b"]]
    names = [variable.name for variable in robot.actuated]
    noisy = seen + 1e-5 * rng.standard_normal(seen.shape)
    return make_measurements(names, q, tcp="n6b", position=noisy, sigma_position=1e-5)


@pytest.fixture
def arm(folder: Path) -> str:
    """Return a rigid KR500 as it is drawn, beside what one with errors shows."""
    robot = load_robot("kr500").with_parameters({f"J{k}.torsional": np.inf for k in range(1, 7)})
    robot = robot.model_copy(update={"identify": ()})
    save_robot(robot, folder / "arm.yaml")
    real = corrected(robot, PLANTED, np.zeros((1, 6)))
    for name, count, seed in (("poses", 50, 1), ("fresh", 80, 2), ("few", 7, 3)):
        write_measurements(readings(real, count, seed), folder / f"{name}.csv", robot)
    return "arm.yaml"


def test_planted_errors_are_found_tested_and_written(run: Run, folder: Path, arm: str) -> None:
    options = ("--fix", "base", "--parameters", "q2,q3,f3.d,f4.alpha", "--test", "fresh.csv")
    result = run(f"calibrate {arm} poses.csv", *options, "--out", "found.yaml", "--json", "found.json")
    assert (result.exit_code, result.stderr) == (0, "")
    facts = json.loads((folder / "found.json").read_text())
    assert facts["identified"] == ["q2", "q3", "f3.d", "f4.alpha"]
    for name, value in PLANTED.items():
        item = facts["parameters"][name]
        assert abs(item["change"] - value) < 4 * item["std"]
        assert item["unit"] == ("m" if name == "f3.d" else "rad")
    assert facts["rms_mm"] == pytest.approx(0.01 * 3**0.5, rel=0.15)
    assert facts["rms_held_out_mm"] == pytest.approx(0.01 * 3**0.5, rel=0.2)
    assert facts["tests"]["fresh.csv"]["position_rms_mm"] == pytest.approx(0.01 * 3**0.5, rel=0.15)
    assert facts["nominal"]["position_mean_mm"] > 1
    found = load_robot(folder / "found.yaml")
    assert frame_expressions(found)["f3"]["d"].constant == pytest.approx(1.3005, abs=2e-5)
    assert re.fullmatch(r"1300\.\d{2,8} mm", str(found.frames[2].d)), "in the unit of the file"
    assert (folder / "found.yaml").read_text().startswith("# Geometry calibrated by beamstiff: 4 parameters")


def test_people_get_parameters_what_they_look_like_and_errors(run: Run, told: Run, arm: str) -> None:
    text = " ".join(run(f"calibrate {arm} poses.csv").stdout.split())
    for part in (
        "arm: calibrated geometry",
        "f3.d 1300.0000 1300.5",
        "f3.r 1 f2.r",
        "q1 - 1 base.rz",
        "held-out poses",
    ):
        assert part.replace("arm:", "kr500:") in text
    facts = told(f"calibrate {arm} poses.csv --folds 0")
    assert "q6" in facts["silent"]  # the flange's centre lies on axis 6
    assert f"{len(facts['silent'])} without influence on the readings" in text


def test_the_tracker_may_stand_anywhere(succeed: Run, folder: Path, arm: str, told: Run) -> None:
    robot = load_robot(folder / arm)
    rows = read_measurements(folder / "poses.csv", robot)
    turned = rows.position @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [5.0, -3.0, 0.2]
    write_measurements(replace(rows, position=turned), folder / "tracker.csv", robot)
    result = succeed(f"calibrate {arm} tracker.csv --readings base.csv --out found.yaml")
    place = re.search(
        r"Robot base in the measuring frame: \(([\d.]+), ([-\d.]+), ([\d.]+)\) mm", result.stdout
    )
    assert [float(value) for value in place.groups()] == pytest.approx([5000, -3000, 200], abs=0.05)
    facts = told("calibrate found.yaml base.csv --parameters q2 --folds 0")
    assert facts["nominal"]["position_rms_mm"] == pytest.approx(0.01 * 3**0.5, rel=0.3)
    assert facts["held_out"] is None


def test_another_table_is_moved_to_the_base(succeed: Run, folder: Path, arm: str, refused: Refused) -> None:
    robot = load_robot(folder / arm)
    away = np.array([5.0, -3.0, 0.2])
    for name in ("poses", "fresh"):
        rows = read_measurements(folder / f"{name}.csv", robot)
        write_measurements(replace(rows, position=rows.position + away), folder / f"{name}-away.csv", robot)
    succeed(f"calibrate {arm} poses-away.csv --folds 0 --apply-to fresh-away.csv=back.csv")
    back = read_measurements(folder / "back.csv", robot)
    there = read_measurements(folder / "fresh.csv", robot)
    np.testing.assert_allclose(back.position, there.position, atol=1e-4)  # to what the base is known
    np.testing.assert_array_equal(back.q, there.q)
    refused(f"calibrate {arm} poses-away.csv --apply-to fresh-away.csv", "expected CSV=CSV such as")


def test_tables_may_come_from_several_stations(folder: Path, arm: str, refused: Refused, told: Run) -> None:
    robot = load_robot(folder / arm)
    rows = read_measurements(folder / "fresh.csv", robot)
    write_measurements(replace(rows, position=rows.position + np.eye(3)[0]), folder / "moved.csv", robot)
    facts = told(f"calibrate {arm} poses.csv moved.csv --stations --folds 0")
    assert facts["rms_mm"] < 0.03
    assert facts["bases"][1][0][3] - facts["bases"][0][0][3] == pytest.approx(1.0, abs=1e-4)
    says = "it is not said where the robot stood"
    refused(f"calibrate {arm} poses.csv moved.csv --stations --test fresh.csv", says)


def test_priors_hold_a_parameter_or_a_group(run: Run, arm: str) -> None:
    options = ("--prior", "frames=1um", "--prior", "frames=1urad", "--prior", "f3.d=1mm", "--json", "-")
    facts = json.loads(run(f"calibrate {arm} poses.csv --fix base", *options).stdout)
    assert facts["parameters"]["f3.d"]["change"] == pytest.approx(5e-4, abs=1e-4)
    assert abs(facts["parameters"]["f2.d"]["change"]) < 1e-4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["few.csv"], "few.csv: 21 measured values in 7 poses for 51 parameters"),
        (["poses.csv", "--parameters", "f3.q"], "has no geometric parameter 'f3.q' (did you mean"),
        (["poses.csv", "--fix", "ofsets"], "(did you mean 'offsets'?)"),
        (["poses.csv", "--last", "f2.theta"], "'f2.theta' follows 'q2': its zero goes by the name 'q2'"),
        (["poses.csv", "--compliances", "J1.tilt"], "has no stiffness 'J1.tilt'"),
        (["poses.csv", "--prior", "f3.d"], "--prior: found 'f3.d', expected NAME=STD"),
        (
            ["poses.csv", "--prior", "f3.d=1deg"],
            "--prior: f3.d: found the unit 'deg', expected a unit of length",
        ),
        (["poses.csv", "--prior", "f3.d=0mm"], "--prior: f3.d: found '0mm', expected a positive standard"),
        (["poses.csv", "--prior", "fram=1mm"], "(did you mean 'frames'?)"),
        (["poses.csv", "--method", "newton"], "there is no method 'newton' (did you mean 'gauss-newton'?)"),
        (["poses.csv", "poses.csv"], "poses.csv: is given twice"),
        (["poses.csv", "./poses.csv"], "./poses.csv: is given twice"),
        (["poses.csv", "--test", "./poses.csv"], "--test: ./poses.csv: is fitted too"),
        (["poses.csv", "--out", "arm.yaml"], "--out arm.yaml: would overwrite the input arm.yaml"),
        (["poses.csv", "--sensitivity", "s.txt"], "s.txt: found the ending 'txt'"),
        (["nothing.csv"], "nothing.csv:"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    refused: Refused, folder: Path, arm: str, arguments: list[str], message: str
) -> None:
    head = (folder / "poses.csv").read_text().splitlines()[1]
    (folder / "nothing.csv").write_text(f"{head}\n" + "0," * head.count(",") + "\n")
    refused(["calibrate", arm, *arguments, "--json", "found.json"], message)


def test_displacements_hardly_show_geometry(refused: Refused) -> None:
    says = "crane.csv: found displacements (dx dy dz), expected absolute positions"
    refused("calibrate crane.yaml crane.csv", says)


def test_a_pose_that_cannot_close_is_named(refused: Refused, folder: Path) -> None:
    (folder / "bar.csv").write_text(
        "q2 [deg],q8 [deg],x,y,z\n5,50,1.7,0,1.2\n90,0,1.7,0,1.2\n10,45,1.6,0,1.2\n"
    )
    refused("calibrate ir663 bar.csv", "bar.csv:3: loop 'four_bar' cannot close at q2 = ")


def test_doubts_about_a_table_are_noted(run: Run, folder: Path, arm: str) -> None:
    text = (folder / "poses.csv").read_text().replace("sigma_position: 0.01 mm", "sigma_position: 0.01")
    (folder / "poses.csv").write_text(text)
    result = run(f"calibrate {arm} poses.csv --fix base --parameters q2")
    assert "note: poses.csv: sigma_position: 0.01 m is large" in result.stderr
