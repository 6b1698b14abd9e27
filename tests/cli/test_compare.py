"""`beamstiff compare` as users run it: tables, JSON, pictures, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot, write_measurements
from tests.cli.conftest import CRANE_DATA, Refused, Run
from tests.cli.test_fitted_models import leaning


@pytest.fixture
def data(folder: Path) -> str:
    """Write readings of an IR-663 under two loads, whose axis 8 is softer the further it leans."""
    loads = np.array([-size * np.eye(6)[axis] for size in (300.0, 900.0) for axis in (0, 2)])
    write_measurements(leaning(24, 0, loads), folder / "data.csv", load_robot("ir663"))
    return "data.csv"


def test_models_are_shown_by_held_out_rows_and_by_load(run: Run, told: Run, folder: Path, data: str) -> None:
    result = run(f"compare ir663 {data} --seed 3 --json one.json")
    assert (result.exit_code, result.stderr) == (0, "")
    both = json.loads((folder / "one.json").read_text()), told(f"compare ir663 {data} --seed 3")
    first, again = ([{**one, "seconds": 0.0} for one in found["models"]] for found in both)
    assert first == again
    for text in ("fitted (36)", "new pose (12)", "new load (36)", "new pose and load (12)", "300 N", "900 N"):
        assert text in result.stdout
    for name in ("rigid", "nominal", "parametric", "fuzzy", "grid", "gray box", "gaussian process"):
        assert f"\n{name} " in result.stdout
    assert "Noise floor: 0.0173 mm RMS." in result.stdout


def test_json_holds_every_model_and_the_split(succeed: Run, data: str) -> None:
    result = succeed(f"compare ir663 {data} --json - --models 'parametric,gray box' --fit-load 900")
    found = json.loads(result.stdout)
    assert found["format"] == "beamstiff-compare/1"
    assert found["split"]["fitted"] == 36
    assert found["split"]["loads_held_out"] == pytest.approx([300.0])
    parametric, gray = found["models"]
    assert (parametric["name"], gray["name"]) == ("parametric", "gray box")
    assert gray["unseen"]["rms_mm"] < 0.6 * parametric["unseen"]["rms_mm"]
    assert gray["unseen"]["rows"] == gray["unseen"]["answered"] == 60
    assert [one["load"] for one in gray["by_load"]] == pytest.approx([300.0, 900.0])
    assert set(gray["by_kind"]) == {"fitted", "new_pose", "new_load", "new_pose_and_load"}


def test_cubes_have_the_size_that_was_asked_for(run: Run, data: str) -> None:
    assert "cubes of 250 mm" in run(f"compare ir663 {data} --models grid --cube 0.25m").stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--models", "fuzy"], "there is no model 'fuzy' (did you mean 'fuzzy'?)"),
        (["--share", "1.5"], "share of poses to hold out: found 1.5"),
        (["--fit-load", "0.5kN"], "found no load of 500 N, expected one of 300, 900 N"),
        (["--cube", "-3mm"], "--cube: found '-3mm', expected a length above 0"),
        (["--cube", "250"], "--cube: found '250', expected a length with its unit, such as 300mm"),
        (["--cube", "3kg"], "--cube: "),
        (["--seed", "-1"], "--seed: found -1"),
        (["--models", "grid", "--rules", "a.png"], "--rules: expected fuzzy among the models"),
        (["--figure", "a.gif"], "a.gif: found the ending 'gif'"),
        (["--figure", "data.csv"], "would overwrite the input data.csv"),
        (["./data.csv"], "./data.csv: is given twice, its rows would count twice"),
        (["--fit-load", "nan"], "--fit-load: found 'nan'"),
        (["--parameters", "J99.bending"], "no stiffness parameter 'J99.bending'"),
    ],
)
def test_what_cannot_be_is_refused(refused: Refused, data: str, options: list[str], message: str) -> None:
    refused(["compare", "ir663", data, *options], message)


def test_absolute_positions_are_refused(refused: Refused, folder: Path) -> None:
    (folder / "absolute.csv").write_text("q2,q8,fx,x,y,z\n0,0.7,900,1.5,0,1.2\n0.1,0.7,900,1.5,0,1.2\n")
    says = "absolute.csv: holds absolute positions; compare needs displacements"
    refused("compare ir663 absolute.csv --share 0", says)


# `beamstiff compare-runs` on a crane whose answers are known by hand


def test_a_drive_that_became_softer_is_named_in_the_table_and_in_the_json(succeed: Run, folder: Path) -> None:
    # across the arm 1/radial + 1 m^2/torsional = 0.5 + 1 um/N before; 1.2 um/N of the drive afterwards
    (folder / "later.csv").write_text(CRANE_DATA.replace(",1.5", ",1.7").replace("1.5,0", "1.7,0"))
    result = succeed("compare-runs crane.yaml crane.csv later.csv --json out.json")
    assert "Something changed" in result.stdout
    told = json.loads((folder / "out.json").read_text())
    drive = told["parameters"]["1/J1.torsional"]
    assert drive["changed"] is told["changed"] is True
    assert drive["a"] == pytest.approx(1e-6)
    assert drive["b"] == pytest.approx(1.2e-6)
    # sigma 0.01 mm; two rows of 1 kN with 1 mm per unit each campaign (sensitivity 1000 N m times 1 m)
    assert drive["std"] == pytest.approx(2**0.5 * 1e-5 / (2**0.5 * 1000))


def test_the_same_table_again_has_not_changed(told: Run, folder: Path) -> None:
    (folder / "later.csv").write_text(CRANE_DATA)
    found = told("compare-runs crane.yaml crane.csv later.csv")
    assert found["changed"] is False
    assert found["p"] == pytest.approx(1.0)


def test_bad_input_is_refused(folder: Path, refused: Refused) -> None:
    (folder / "points.csv").write_text("q1 [deg],x,y,z\n0,1,0,0\n90,0,1,0\n-40,0.766,-0.643,0\n")
    refused("compare-runs crane.yaml crane.csv points.csv", "expected the same kind of readings")
    refused("compare-runs crane.yaml crane.csv crane.csv --level 5", "--level: found 5")
    refused("compare-runs crane.yaml crane.csv missing.csv", "missing.csv")
