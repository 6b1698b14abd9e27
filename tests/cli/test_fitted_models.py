"""A fitted model from `identify` or `compare` to the commands that follow it, by files alone."""

import json
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot, write_measurements
from beamstiff.compensation.follow import solve
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array
from tests.cli.conftest import Refused, Run

SIGMA = 1e-5
LOADS = np.array([[-900.0, 0, 0, 0, 0, 0], [0, 0, -900.0, 0, 0, 0]])
PATH = "x [mm],y [mm],z [mm],fx [N],fz [N]\n1700,0,1200,-500,-600\n1800,0,1250,-500,-600\n"


def leaned(robot: Robot, rows: Measurements) -> Array:
    """Return how an IR-663 moves (N, 3) whose axis 8 is softer the further it leans."""
    soft = robot.with_parameters({"J18.torsional": 0.5 * robot.parameter("J18.torsional")})
    stiff, softer = (predict_displacements(one, rows)[:, :3] for one in (robot, soft))
    return stiff + ((rows.q[:, 1:] - 0.6) / 0.3) ** 2 * (softer - stiff)


def leaning(count: int, seed: int, loads: Array = LOADS) -> Measurements:
    """Return readings of it under each of some loads, at poses drawn anew."""
    robot, random = load_robot("ir663"), np.random.default_rng(seed)
    q = np.repeat(random.uniform([-0.2, 0.6], [0.4, 0.9], (count, 2)), len(loads), axis=0)
    rows = {"tcp": "n7", "wrench": np.tile(loads, (count, 1)), "sigma_position": SIGMA}
    seen = leaned(robot, make_measurements(["q2", "q8"], q, **rows))
    seen = seen + SIGMA * random.standard_normal(seen.shape)
    return make_measurements(["q2", "q8"], q, displacement=seen, **rows)


@pytest.fixture
def data(folder: Path) -> Path:
    for name, seed in (("data.csv", 0), ("fresh.csv", 1)):
        write_measurements(leaning(30, seed), folder / name, load_robot("ir663"))
    (folder / "path.csv").write_text(PATH)
    return folder


@pytest.mark.usefixtures("data")
@pytest.mark.parametrize("kind", ["fuzzy", "grid", "gray-box", "gaussian-process"])
def test_every_command_follows_the_model_that_identify_wrote(succeed: Run, told: Run, kind: str) -> None:
    found = succeed(f"identify ir663 data.csv --model {kind} --out model.yaml --folds 0")
    assert "mm RMS on 16 held-out rows" in found.stderr
    assert f"Model of elasticity: {kind.replace('-', ' ')}" in succeed("show model.yaml").stdout
    checked = told("verify model.yaml fresh.csv")
    springs = told("identify ir663 data.csv --out springs.yaml")["rms_mm"]
    assert checked["after_mm"] < 0.5 * springs
    assert checked["causes"][0]["cause"] == f"model:{kind.replace('-', ' ')}"
    assert ("std" in told("deflect model.yaml fresh.csv")) == (kind == "gaussian-process")
    grid = ["--grid", "q2=5deg:15deg:2", "--grid", "q8=40deg:48deg:2", "--quantity", "deflection"]
    softer, stiffer = (
        told(f"map {robot}", *grid, "--wrench", "fx=-900N")["quantities"]["deflection"]["max"]
        for robot in ("model.yaml", "springs.yaml")
    )
    assert softer > 1.02 * stiffer
    if kind == "grid":
        few = ",".join(name for name in EFFECTS if name != "backlash")  # whatever the causes, the gap is one
        assert told("diagnose model.yaml fresh.csv --without", few)["gap"]["rms_mm"] < 0.5 * springs
    corrected = succeed("compensate ir663 path.csv --actual model.yaml --out out.csv")
    assert f"follows the robot's model ({kind.replace('-', ' ')}), fitted to data.csv" in corrected.stderr


def test_commands_of_a_model_bring_the_real_tool_to_its_targets(succeed: Run, data: Path) -> None:
    """Judged by the machine itself, whose compliance the model has never been told."""
    succeed("identify ir663 data.csv --model gaussian-process --out gauss.yaml")
    succeed("identify ir663 data.csv --out springs.yaml")
    robot = load_robot("ir663").model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    left = {}
    for name in ("gauss", "springs"):
        weightless(data / f"{name}.yaml")
        succeed(f"compensate ir663 path.csv --actual {name}.yaml --out {name}.csv")
        left[name] = _error(robot, data / f"{name}.csv")
    assert left["gauss"] < 0.3 * left["springs"]


def weightless(file: Path) -> None:
    file.write_text(file.read_text().replace("gravity: [0, 0, -9.81]", "gravity: [0, 0, 0]"))


def _error(robot: Robot, commands: Path) -> float:
    """Return how far the leaning machine's tool ends from the targets, at worst, m."""
    kinematics = compile_kinematics(robot)
    read = [np.loadtxt(text.splitlines()[1:], delimiter=",") for text in (PATH, _table(commands))]
    meant, sent = (1e-3 * rows[:, :3] for rows in read)
    targets = np.tile(np.eye(4), (len(sent), 1, 1))
    targets[:, :3, 3] = sent
    q = solve(kinematics, targets, np.tile([0.1, 0.75], (len(sent), 1)), restarts=0).q
    wrench = np.zeros((len(q), 6))
    wrench[:, [0, 2]] = read[0][:, 3:5]
    rows = make_measurements(["q2", "q8"], q, tcp="n7", wrench=wrench)
    at = posture(kinematics, q).node_positions[:, kinematics.node_index["n7"]] + leaned(robot, rows)
    return float(np.linalg.norm(at - meant, axis=1).max())


def _table(file: Path) -> str:
    return "\n".join(line for line in file.read_text().splitlines() if not line.startswith("#"))


def test_compare_writes_the_model_that_is_best_on_held_out_rows(succeed: Run, told: Run, data: Path) -> None:
    said = succeed("compare ir663 data.csv --out best.yaml --json all.json").stdout
    models = json.loads((data / "all.json").read_text())["models"]
    best = min((one for one in models if one["name"] not in ("rigid", "nominal")), key=_unseen)
    assert f"best.yaml (model {best['name']}, best on held-out rows" in said
    assert told("verify best.yaml fresh.csv")["causes"][0]["cause"] == f"model:{best['name']}"


def _unseen(one: dict) -> float:
    return one["unseen"]["rms_mm"]


def test_a_model_that_is_worse_than_springs_says_so(succeed: Run, data: Path) -> None:
    """Of a machine that is what the springs say, rules that know nothing of it do worse on fresh poses."""
    robot = load_robot("ir663")
    q = np.repeat(np.random.default_rng(3).uniform([-0.2, 0.6], [0.4, 0.9], (20, 2)), 2, axis=0)
    still = make_measurements(["q2", "q8"], q, tcp="n7", wrench=np.tile(LOADS, (20, 1)))
    seen = predict_displacements(robot, still)[:, :3] + SIGMA * np.random.default_rng(4).standard_normal(
        (40, 3)
    )
    rows = make_measurements(
        ["q2", "q8"], q, tcp="n7", wrench=still.wrench, displacement=seen, sigma_position=SIGMA
    )
    write_measurements(rows, data / "springs.csv", robot)
    both = (
        succeed("identify ir663 springs.csv --model fuzzy"),
        succeed("compare ir663 springs.csv --models parametric,fuzzy"),
    )
    for said in both:
        assert "the model fuzzy is worse than constant springs" in said.stderr


def test_cubes_get_kinematics_of_their_own_from_positions(succeed: Run, told: Run, data: Path) -> None:
    robot = load_robot("ir663")
    q = np.random.default_rng(6).uniform([-0.2, 0.6], [0.4, 0.9], (40, 2))
    kinematics = compile_kinematics(robot)
    at = posture(kinematics, q + np.array([1e-3, -5e-4])).node_positions[:, kinematics.node_index["n7"]]
    rows = make_measurements(["q2", "q8"], q, tcp="n7", position=at, sigma_position=SIGMA)
    write_measurements(rows, data / "still.csv", robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    succeed("identify ir663 data.csv --model grid --positions still.csv --out grid.yaml")
    assert "kinematics:" in (data / "grid.yaml").read_text()
    weightless(data / "grid.yaml")
    checked = told("verify grid.yaml still.csv")
    assert checked["after_mm"] < 0.02 < 1.0 < checked["before_mm"]


@pytest.mark.usefixtures("data")
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--model", "cubes"], "--model: found 'cubes', expected fuzzy, grid, gray box, gaussian process"),
        (["--cube", "300mm"], "--model: is missing"),
        (["--model", "grid", "--cube", "300"], "--cube: found '300', expected a length with its unit"),
        (["--model", "fuzzy", "--positions", "data.csv"], "goes with the model grid"),
        (["--model", "grid", "--positions", "data.csv"], "holds displacements, expected absolute positions"),
    ],
)
def test_what_makes_no_model_is_refused(refused: Refused, options: list[str], says: str) -> None:
    refused(["identify", "ir663", "data.csv", *options], says)
