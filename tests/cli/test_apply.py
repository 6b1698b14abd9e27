"""From a diagnosis to a robot with the effect, and on to the other commands."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff import load_robot
from beamstiff.cli.main import app
from tests.cli.conftest import CRANE, Run

NOISE = 1e-5  # m
TORSIONAL, HALF_WIDTH = 8e5, 3e-4  # N m/rad and rad; the model says 1e6 and none


def crane_with_backlash(seed: int) -> str:
    """Return a table of the crane with backlash, by hand; forces across the arm stiffen nothing."""
    rng = np.random.default_rng(seed)
    lines = [f"# sigma_position: {NOISE}", "q1,fx,fy,fz,dx,dy,dz"]
    for q in np.repeat(rng.uniform(-2.5, 2.5, 25), 4):
        across = np.array([-np.sin(q), np.cos(q)])
        push = rng.uniform(-1500, 1500)
        slip = push / TORSIONAL + HALF_WIDTH * np.tanh(push / 50.0)  # at 1 m
        moved = np.append(push / 2e6 * across + slip * across, 0.0) + NOISE * rng.standard_normal(3)
        force = push * across
        lines.append(",".join(repr(float(v)) for v in (q, *force, 0.0, *moved)))
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """Return how the diagnosis of the loads ended, and the folder with what it wrote."""
    where = tmp_path_factory.mktemp("applied")
    (where / "crane.yaml").write_text(CRANE)
    (where / "loads.csv").write_text(crane_with_backlash(1))
    with pytest.MonkeyPatch.context() as here:
        here.chdir(where)
        words = ["diagnose", "crane.yaml", "loads.csv", "--apply", "larger.yaml", "--json", "said.json"]
        return CliRunner().invoke(app, words, prog_name="beamstiff"), where


@pytest.fixture
def applied(diagnosed: tuple[Any, Path], folder: Path) -> Any:
    result, where = diagnosed
    shutil.copytree(where, folder, dirs_exist_ok=True)
    return result


def test_the_robot_with_the_effect_is_written(applied: Any, folder: Path) -> None:
    assert applied.exit_code == 0, applied.output
    assert "only the likeliest cause" not in applied.stderr
    assert "written: larger.yaml (the fitted stiffness, and backlash:q1 added)" in applied.stdout
    verdict = json.loads((folder / "said.json").read_text())["verdict"]
    assert (verdict["effect"], verdict["component"]) == ("backlash", "q1")
    text = (folder / "larger.yaml").read_text()
    assert text.startswith("# Stiffness fitted by beamstiff to loads.csv, and backlash:q1 added.\n")
    robot = load_robot(folder / "larger.yaml")
    assert robot.parameter("J1.torsional") == pytest.approx(TORSIONAL, rel=0.03)
    (play,) = robot.effects
    assert all(str(part.parameters["half_width"]).endswith(" mrad") for part in play.each)


@pytest.mark.usefixtures("applied")
def test_deflect_adds_the_effect_and_says_so(succeed: Run, told: Run, folder: Path) -> None:
    (folder / "new.csv").write_text(crane_with_backlash(2))
    said = " ".join(succeed("deflect larger.yaml new.csv").stdout.split())
    assert "where the tool moves most, effects in the robot file make: backlash:q1 " in said
    robots = ("crane.yaml", "larger.yaml")
    answers = {robot: np.array(told(f"deflect {robot} new.csv")["displacement"]) for robot in robots}
    rows = np.loadtxt((folder / "new.csv").read_text().splitlines()[2:], delimiter=",")
    left = {robot: np.abs(answer[:, :3] - rows[:, 4:]).max() for robot, answer in answers.items()}
    assert left["larger.yaml"] < 6 * NOISE < HALF_WIDTH < left["crane.yaml"]


@pytest.mark.usefixtures("applied")
def test_diagnose_and_identify_take_the_effect_for_known(succeed: Run, folder: Path) -> None:
    (folder / "new.csv").write_text(crane_with_backlash(3))
    again = succeed("diagnose larger.yaml new.csv --json again.json --apply same.yaml")
    assert json.loads((folder / "again.json").read_text())["verdict"]["effect"] == "none"
    assert "Already in the robot and included: backlash:q1." in again.stdout
    assert load_robot(folder / "same.yaml").effects == load_robot(folder / "larger.yaml").effects
    found = succeed("identify larger.yaml new.csv --json found.json --out identified.yaml")
    assert "The fit includes the robot's effects unchanged: backlash:q1." in found.stdout
    value = json.loads((folder / "found.json").read_text())["parameters"]["J1.torsional"]["value"]
    assert value == pytest.approx(TORSIONAL, rel=0.01)
    assert load_robot(folder / "identified.yaml").effects == load_robot(folder / "larger.yaml").effects


@pytest.mark.usefixtures("applied")
def test_what_leaves_the_effect_out_says_so(run: Run, succeed: Run) -> None:
    result = succeed("stiffness larger.yaml")
    assert "note: the stiffness includes, for small loads (1 N, 1 N m): backlash:q1" in result.stderr
    result = succeed("stiffness larger.yaml --preload")
    assert "note: the robot's effects (backlash:q1) are not part of its stiffness" in result.stderr
    shown = run("show larger.yaml --samples 10").stdout
    assert "Effect backlash:q1, flank within 0.03: half_width 0." in shown
    result = succeed("exam larger.yaml --cases 1 --classes null --no-compare")
    assert "note: the robot's effects (backlash:q1) are not part of the exam" in result.stderr


def test_a_robot_with_a_cause_that_is_just_likeliest_is_said_to_be_one(succeed: Run, folder: Path) -> None:
    (folder / "few.csv").write_text("\n".join(crane_with_backlash(1).splitlines()[:26]))
    result = succeed("diagnose crane.yaml few.csv --apply perhaps.yaml --json said.json")
    verdict = json.loads((folder / "said.json").read_text())["verdict"]
    assert 0.0 < verdict["probability"] < 0.6
    share = f"{100 * verdict['probability']:.0f} %"
    assert f"note: perhaps.yaml contains only the likeliest cause ({share})" in result.stderr


def test_where_nothing_is_found_the_fitted_robot_is_written(succeed: Run, folder: Path) -> None:
    crane = (folder / "crane.yaml").read_text()
    (folder / "soft.yaml").write_text(crane.replace("1e6 N*m/rad", "3e5 N*m/rad"))
    result = succeed("diagnose soft.yaml crane.csv --apply fitted.yaml")
    assert "written: fitted.yaml (the fitted stiffness, and no effect added)" in result.stdout
    robot = load_robot(folder / "fitted.yaml")
    assert robot.effects == ()
    assert robot.parameter("J1.torsional") == pytest.approx(1e6, rel=1e-3)
