"""Options of `beamstiff identify`: several tables, methods, what is known beforehand, groups, Ctrl-C."""

import json
from pathlib import Path
from typing import Any

import pytest

from beamstiff import load_robot
from beamstiff.identification.minimise import Search
from tests.cli.conftest import Refused, Run

BOTH = ("--parameters", "J1.torsional,J1.radial")


@pytest.fixture
def answer(told: Run) -> Run:
    """Return a function that gives the JSON of an identification of the crane."""
    return lambda *words: told("identify crane.yaml", *words)


def value(found: dict[str, Any], name: str = "J1.torsional") -> float:
    return found["parameters"][name]["value"]


@pytest.fixture
def wrong(folder: Path) -> Path:
    """Give the crane a wrong torsional stiffness, which its data are to put right."""
    path = folder / "crane.yaml"
    path.write_text(path.read_text().replace('torsional: "1e6', 'torsional: "3e5'))
    return folder


@pytest.fixture
def series(folder: Path) -> Path:
    """Return the folder, with loads that turn the crane's joint and push it at once."""
    (folder / "across.csv").write_text(
        "# sigma_position: 0.01 mm\nq1 [deg],fx,fy,dx [mm],dy [mm]\n"
        "0,0,1000,0,1.5\n0,0,2000,0,3.01\n90,1000,0,1.5,0\n90,-1000,0,-1.49,0\n"
    )
    return folder


def test_several_tables_count_together(run: Run, answer: Run, wrong: Path) -> None:
    lines = (wrong / "crane.csv").read_text().splitlines(keepends=True)
    (wrong / "one.csv").write_text("".join(lines[:4]))
    (wrong / "two.csv").write_text("".join([*lines[:2], *lines[4:]]))
    whole, parts = answer("crane.csv"), answer("one.csv", "two.csv")
    for key in ("value", "std"):
        one, other = (found["parameters"]["J1.torsional"][key] for found in (parts, whole))
        assert one == pytest.approx(other, rel=1e-9)
    assert "on the 4 fitted rows" in " ".join(run("identify crane.yaml one.csv two.csv").stdout.split())


@pytest.mark.parametrize("method", ["levenberg-marquardt", "linear", "slsqp", "bobyqa", "crs2", "genetic"])
@pytest.mark.usefixtures("wrong")
def test_methods_find_the_same(answer: Run, method: str) -> None:
    found = answer("crane.csv", "--method", method, "--seed", "1", "--evaluations", "2000")
    assert value(found) == pytest.approx(1e6, rel=1e-5)
    assert found["method"] == method


@pytest.mark.usefixtures("wrong")
def test_fixed_parameters_stay_and_tied_ones_keep_their_ratio(answer: Run) -> None:
    found = answer("crane.csv", *BOTH, "--fix", "J1.radial")
    assert list(found["parameters"]) == ["J1.torsional"]
    found = answer("crane.csv", *BOTH, "--tie", "J1.torsional,J1.radial")
    assert value(found, "J1.radial") / value(found) == pytest.approx(2e6 / 3e5)


def test_bounds_hold_with_their_units(answer: Run, wrong: Path) -> None:
    found = answer("crane.csv", "--bound", "J1.torsional=:8e8 N*mm/rad", "--out", "found.yaml")
    assert load_robot(wrong / "found.yaml").parameter("J1.torsional") == pytest.approx(8e5)
    assert any("largest value allowed" in note for note in found["notes"])


@pytest.mark.usefixtures("wrong")
def test_a_prior_pulls_as_much_as_it_is_sure(answer: Run) -> None:
    sure, unsure = (
        value(answer("crane.csv", "--prior", f"J1.torsional=2e6:{times}")) for times in ("1.0001", "100")
    )
    assert sure == pytest.approx(2e6, rel=1e-2)
    assert unsure == pytest.approx(1e6, rel=1e-3)


def test_a_robust_loss_bears_a_bad_row(answer: Run, wrong: Path) -> None:
    (wrong / "bad.csv").write_text((wrong / "crane.csv").read_text() + "-90,-1000,0,-4.5,0\n")
    plain, robust = (value(answer("bad.csv", "--loss", loss)) for loss in ("linear", "huber"))
    assert abs(robust / 1e6 - 1) < 0.1 < abs(plain / 1e6 - 1)


@pytest.mark.usefixtures("wrong")
def test_errors_of_the_inputs_widen_the_uncertainty(answer: Run) -> None:
    without = answer("crane.csv")["parameters"]["J1.torsional"]["std"]
    found = answer("crane.csv", "--input-error", "load=10N,angle=0.01deg")
    assert found["parameters"]["J1.torsional"]["std"] > 1.2 * without


def test_the_error_of_the_loads_may_stand_in_the_table(answer: Run, wrong: Path) -> None:
    table = (wrong / "crane.csv").read_text()
    (wrong / "stated.csv").write_text(f"# sigma_load: 0.01 kN\n{table}")
    asked = answer("crane.csv", "--input-error", "load=10N")
    assert answer("stated.csv")["parameters"] == asked["parameters"]


def test_bootstrap_intervals_come_along(run: Run, answer: Run, wrong: Path) -> None:
    rows = "".join(f"{angle},0,1000,0,1.5\n" for angle in (0, 0.01, 0.02, 0.03))
    head = "".join((wrong / "crane.csv").read_text().splitlines(keepends=True)[:2])
    (wrong / "poses.csv").write_text(head + rows.replace("1.5\n", "1.51\n", 2).replace("1.5\n", "1.49\n"))
    found = answer("poses.csv", "--bootstrap", "50", "--seed", "3")
    low, high = found["bootstrap"]["intervals"]["J1.torsional"]
    assert low < value(found) < high
    assert found["bootstrap"]["poses"] == 4
    again = answer("poses.csv", "--bootstrap", "50", "--seed", "3")
    assert again["bootstrap"] == found["bootstrap"]
    assert "bootstrap 95 %" in run("identify crane.yaml poses.csv --bootstrap 20").stdout


@pytest.mark.usefixtures("series")
def test_groups_are_told_with_what_would_part_them(run: Run, answer: Run) -> None:
    found = answer("across.csv", *BOTH)
    [group] = found["degenerate"]
    assert group["parameters"] == ["J1.torsional", "J1.radial"]
    assert group["relation"] == "1/J1.torsional + 1/J1.radial"
    assert group["value"] == pytest.approx(1.5e-6, rel=5e-3)
    assert "to identify them, measure" in group["separate"]
    for item in found["parameters"].values():
        assert (item["value"], item["identifiable"]) == (None, False)
        assert 0 < item["lower_bound"] < 1 / 1.5e-6
    text = " ".join(run("identify crane.yaml across.csv", *BOTH).stdout.split())
    assert "1/J1.torsional + 1/J1.radial 1.50" in text
    assert "J1.torsional and J1.radial act in series: lump them into one (--reduce)" in text
    assert "No upper bound" not in text


def test_the_reduced_robot_has_one_spring_for_the_group(answer: Run, series: Path) -> None:
    found = answer("across.csv", *BOTH, "--reduce", "reduced.yaml")
    robot = load_robot(series / "reduced.yaml")
    [lumped] = found["reduced"]["lumped"]
    assert (lumped["kept"], lumped["rigid"]) == ("J1.torsional", ["J1.radial"])
    assert robot.identify == ("J1.torsional",)
    assert robot.parameter("J1.radial") == float("inf")
    assert robot.parameter("J1.torsional") == pytest.approx(1 / found["degenerate"][0]["value"])
    assert "J1.torsional stands for the whole of a group" in (series / "reduced.yaml").read_text()


def test_what_is_never_loaded_is_said_and_what_would_load_it(run: Run, folder: Path) -> None:
    (folder / "along.csv").write_text(
        "# sigma_position: 0.01 mm\nq1 [deg],fx,fy,dx [mm],dy [mm]\n0,1000,0,0.5,0\n0,2000,0,1,0\n"
    )
    result = run("identify crane.yaml along.csv", *BOTH)
    assert "note: J1.torsional is never loaded: its stiffness cannot be identified" in result.stderr
    assert "all 2 rows are of one pose" in result.stderr
    assert "to identify it, measure" in " ".join(result.stdout.split())


def test_ctrl_c_gives_the_best_so_far(run: Run, wrong: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    note = Search.note

    def stopped(search: Search, theta: Any, cost: float) -> None:
        note(search, theta, cost)
        if search.evaluations > 100:
            raise KeyboardInterrupt

    monkeypatch.setattr(Search, "note", stopped)
    result = run("identify crane.yaml crane.csv --method isres --json best.json --out b.yaml")
    assert result.exit_code == 130
    assert "Stopped by hand: the best values so far" in " ".join(result.stdout.split())
    found = json.loads((wrong / "best.json").read_text())
    assert found["interrupted"] is True
    assert found["rms_held_out_mm"] is None
    assert load_robot(wrong / "b.yaml").parameter("J1.torsional") != 3e5


@pytest.mark.usefixtures("wrong")
def test_ctrl_c_after_the_fit_leaves_the_fit(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("beamstiff.functions.identify.with_separations", stopped)
    result = run("identify crane.yaml crane.csv --json -")
    assert result.exit_code == 130
    assert value(json.loads(result.stdout)) == pytest.approx(1e6)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--method", "genetik"], ["--method: found 'genetik'", "did you mean 'genetic'"]),
        (["--loss", "l1"], ["--loss: found 'l1'", "expected linear, soft_l1"]),
        (["--use", "rotations"], ["--use: found 'rotations'", "did you mean 'rotation'"]),
        (["--use", "rotation"], ["crane.csv", "no measured components of rotation"]),
        (["--folds", "-1"], ["--folds: found -1", "0 or more"]),
        (["--folds", "1"], ["--folds: found 1", "2 or more, or 0"]),
        (["--seed", "-1"], ["--seed: found -1"]),
        (["--bootstrap", "-3"], ["--bootstrap: found -3"]),
        (["--evaluations", "0"], ["--evaluations: found 0", "1 or more"]),
        (["--population", "2"], ["--population: found 2", "5 or more"]),
        (["--fix", "J1.torsional"], ["all parameters (J1.torsional) are fixed"]),
        (["--fix", "J1.torsion"], ["J1.torsion", "did you mean 'J1.torsional'"]),
        (["--fix", ""], ["--fix: found ''"]),
        (["--tie", "J1.torsional"], ["--tie: found 'J1.torsional'", "two or more"]),
        (["--bound", "J1.torsional"], ["--bound: found 'J1.torsional'", "NAME=LOW:HIGH"]),
        (["--bound", "J1.torsional=:"], ["--bound: J1.torsional: found no end"]),
        (["--bound", "J1.torsional=1e5 N/m:"], ["--bound: J1.torsional", "'N/m'", "N*m/rad"]),
        (["--bound", "J1.torsional=-1:"], ["--bound: J1.torsional", "positive"]),
        (["--bound", "J1.torsional=2e6:1e6"], ["J1.torsional", "low < high"]),
        (["--bound", "J2.torsional=1:"], ["--bound", "'J2.torsional'", "did you mean"]),
        (
            ["--bound", "J1.torsional=1:", "--bound", "J1.torsional=2:"],
            ["--bound: J1.torsional is given twice"],
        ),
        (["--prior", "J1.torsional=1e6"], ["--prior: found 'J1.torsional=1e6'", "VALUE:FACTOR"]),
        (["--prior", "J1.torsional=1e6:0.5"], ["J1.torsional", "0.5", "above 1"]),
        (["--prior", "J1.torsional=1e6:x"], ["--prior: J1.torsional: factor", "'x'"]),
        (["--prior", "J1.torsional=:2"], ["--prior: J1.torsional: found no value"]),
        (["--input-error", "lod=1N"], ["--input-error: found 'lod=1N'", "load"]),
        (["--input-error", "load=1mm"], ["--input-error: load", "'mm'"]),
        (["--input-error", "load=1N,load=2N"], ["--input-error: load is given twice"]),
        (["--input-error", "load=-1N"], ["load", "-1"]),
        (["--reduce", "crane.yaml"], ["--reduce crane.yaml: would overwrite the input"]),
        (["--reduce", "a.yaml", "--out", "a.yaml"], ["would overwrite the output"]),
        (["crane.csv"], ["crane.csv: is given twice"]),
        (["metres.csv"], ["metres.csv:3: dy: the tool would have moved 1.5 m", "in mm, and read in m?"]),
        (["microns.csv"], ["conflicting units?", "microns.csv", "crane.csv"]),
    ],
)
def test_nonsense_is_refused(refused: Refused, folder: Path, arguments: list[str], says: list[str]) -> None:
    (folder / "metres.csv").write_text((folder / "crane.csv").read_text().replace(" [mm]", ""))
    (folder / "microns.csv").write_text((folder / "crane.csv").read_text().replace("[mm]", "[um]"))
    refused(["identify", "crane.yaml", "crane.csv", *arguments], says)
