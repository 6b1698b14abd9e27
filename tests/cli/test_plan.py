import json
from pathlib import Path

import numpy as np
import pytest

from beamstiff import BeamstiffError, load_robot, read_measurements
from tests.cli.conftest import Refused, Run

CRANE = ("plan", "crane.yaml", "--candidates", "40")


def test_the_expected_error_is_that_of_a_crane_by_hand(told: Run) -> None:
    """A force across the arm of 1 m turns it by F / k: one reading of F / k, read to sigma."""
    answer = told(*CRANE, "--tests", "9", "--force", "2kN", "--load", "mz=2000", "--sigma-position", "0.01mm")
    assert list(answer) == [
        "parameters", "left_out", "criterion", "value", "efficiency", "random", "enough", "seed", "tests"
    ]  # fmt: skip
    found = answer["parameters"]["J1.torsional"]
    # each test: the tip moves by 2000 N m / 1e6 N m/rad * 1 m = 2 mm, relative error 0.01 / 2, nine of them
    assert found["relative_std"] == pytest.approx(0.01 / 2 / 3, rel=1e-9)
    assert found["std"] == pytest.approx(1e6 * 0.01 / 2 / 3, rel=1e-9)
    assert (found["value"], found["unit"]) == (1e6, "N*m/rad")
    assert answer["efficiency"] == pytest.approx(1.0, rel=1e-6)
    assert [len(answer["tests"]), answer["tests"][0]["wrench"]] == [9, [0, 0, 0, 0, 0, 2000]]


def test_loads_across_the_arm_are_chosen_and_not_along_it_or_its_axis(told: Run) -> None:
    answer = told(*CRANE, "--tests", "6")
    for test in answer["tests"]:
        across = np.array([-np.sin(test["q"]["q1"]), np.cos(test["q"]["q1"])])
        assert abs(across @ test["wrench"][:2]) > 900
        assert test["wrench"][2:] == [0, 0, 0, 0]
    assert answer["random"]["median_worst"] > 1.2 * answer["parameters"]["J1.torsional"]["relative_std"]


def test_the_table_written_is_filled_in_and_identified(succeed: Run, told: Run, folder: Path) -> None:
    """A crane that is softer than the plan took it to be is found within the errors that the plan expects."""
    succeed(*CRANE, "--tests", "5", "--directions", "x,-y", "--out", "plan.csv", "--seed", "3")
    crane = load_robot(folder / "crane.yaml")
    with pytest.raises(BeamstiffError, match="no measured value"):
        read_measurements(folder / "plan.csv", crane)
    softer = crane.with_parameters({"J1.torsional": 7e5})
    lines = (folder / "plan.csv").read_text().splitlines()
    head = next(at for at, line in enumerate(lines) if not line.startswith("#"))
    names = lines[head].split(",")
    assert {"dx [mm]", "dy [mm]", "dz [mm]"} <= set(names)
    assert "rx [rad]" not in names
    for at in range(head + 1, len(lines)):
        cells = dict(zip(names, lines[at].split(","), strict=True))
        assert cells["dx [mm]"] == cells["dy [mm]"] == ""
        q = np.radians(float(cells["q1 [deg]"]))
        assert cells["q1 [deg]"] == f"{np.degrees(q):.1f}".removesuffix(".0")  # as a pendant takes it
        force = np.array([float(cells["fx [N]"]), float(cells["fy [N]"])])
        across = np.array([-np.sin(q), np.cos(q)])
        moved = force / softer.parameter("J1.radial") + across * (across @ force) / 7e5
        cells |= {"dx [mm]": f"{1e3 * moved[0]:.17g}", "dy [mm]": f"{1e3 * moved[1]:.17g}", "dz [mm]": "0"}
        lines[at] = ",".join(cells.values())
    (folder / "filled.csv").write_text("\n".join(lines) + "\n")
    answer = told("identify crane.yaml filled.csv")
    assert answer["parameters"]["J1.torsional"]["value"] == pytest.approx(7e5, rel=1e-6)


def test_whole_poses_take_all_loads(told: Run) -> None:
    answer = told(*CRANE, "--poses", "3", "--directions", "x,y")
    assert len(answer["tests"]) == 6
    assert [test["pose"] for test in answer["tests"]] == [0, 0, 1, 1, 2, 2]


def test_what_cannot_be_identified_is_told_and_the_rest_is_planned(succeed: Run, told: Run) -> None:
    result = succeed("plan kr240-2 --candidates 60 --json plan.json")
    assert "Cannot be identified: J6.torsional is never loaded by these tests." in result.stdout
    answer = json.loads(Path("plan.json").read_text())
    assert list(answer["left_out"]) == ["J6.torsional"]
    assert list(answer["parameters"]) == [f"J{at}.torsional" for at in range(1, 6)]
    more = ["--moment", "200Nm", "--sigma-rotation", "0.05mrad"]
    answer = told("plan kr240-2 --candidates 60", *more)
    assert (answer["left_out"], len(answer["parameters"])) == ({}, 6)


def test_of_a_robot_that_names_nothing_the_drives_are_planned_for(succeed: Run, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text()
    (folder / "bare.yaml").write_text(text.replace("identify: [J1.torsional]\n", ""))
    bare, named = (succeed("plan", f"{name}.yaml", "--tests", "6") for name in ("bare", "crane"))
    assert bare.stdout == named.stdout
    assert "names nothing under `identify:`: the stiffness of its joints" in bare.stderr
    assert bare.stderr.endswith(named.stderr)


def test_a_rigid_robot_is_told_to_be_rigid(refused: Refused, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text()
    start, end = text.index("     stiffness:"), text.index("fixed:")
    bare = f"{text[:start]}     stiffness: {{}}}}\n{text[end:]}".replace("identify: [J1.torsional]\n", "")
    (folder / "rigid.yaml").write_text(bare)
    refused("plan rigid.yaml", ["nothing is compliant, the joints J1 are rigid"])


@pytest.mark.parametrize("criterion", ["D", "a", "E"])
def test_people_see_errors_certificate_and_how_many_are_enough(succeed: Run, criterion: str) -> None:
    result = succeed(f"plan ir663 --candidates 80 --criterion {criterion}")
    assert result.stderr == "note: --out FILE writes the tests as a table to fill in\n"
    text = " ".join(result.stdout.split())
    for part in (
        "J12.torsional 1.72e+06",
        "20 tests at",
        "Chosen from 240 tests",
        f"Criterion {criterion.upper()}: ",
        "No other 20 tests would be more than ",
        "Of 200 random choices of 20 tests the median has a worst std of",
        "more only average the noise",
        "For each value to have at most a given std, tests needed: about",
    ):
        assert part in text


def test_the_seed_makes_the_plan(run: Run) -> None:
    same, again, other = (run(*CRANE, "--seed", seed, "--json", "-").stdout for seed in ("1", "1", "2"))
    assert same == again
    assert same != other


def test_the_region_holds_the_tcp(told: Run) -> None:
    answer = told(*CRANE, "--region", "x=0.2:700mm,y=-2:0")
    q = np.array([test["q"]["q1"] for test in answer["tests"]])
    assert ((np.cos(q) >= 0.2) & (np.cos(q) <= 0.7) & (np.sin(q) <= 0)).all()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--tests", "0"], ["--tests: found 0", "1 to 500"]),
        (["--poses", "501"], ["--poses: found 501", "1 to 500"]),
        (["--tests", "121"], ["120 candidates for 121 tests"]),
        (["--candidates", "0"], ["--candidates: found 0"]),
        (["--seed", "-1"], ["--seed: found -1"]),
        (["--criterion", "G"], ["--criterion: found 'G'", "D, A, E"]),
        (["--force", "900 kg"], ["--force", "'kg'", "force"]),
        (["--force", "-900N"], ["--force: found '-900N'", "--directions"]),
        (["--force", "0"], ["--force and --moment", "expected a load"]),
        (["--moment", "5 N"], ["--moment", "'N'", "moment"]),
        (["--directions", "x,u"], ["--directions", "'u'", "x, y or z"]),
        (["--directions", ""], ["--directions"]),
        (["--load", "fx"], ["--load: found 'fx'", "fz=-900N"]),
        (["--load", "fx=0"], ["load of zero"]),
        (["--load", "fu=1"], ["--load", "'fu'", "fx, fy"]),
        (["--sigma-position", "0"], ["--sigma-position", "positive"]),
        (["--sigma-position", "1 deg"], ["--sigma-position", "'deg'"]),
        (["--sigma-rotation", "nan"], ["--sigma-rotation", "nan"]),
        (["--parameters", "J1.tosional"], ["J1.tosional"]),
        (["--parameters", "J1.torsional,J1.torsional"], ["twice"]),
        (["--region", "x=1"], ["--region: found 'x=1'", "two ends"]),
        (["--region", "u=1:2"], ["--region: found 'u=1:2'"]),
        (["--region", "x=2:1"], ["--region: found 'x=2:1'", "lower end first"]),
        (["--region", "z=5:6"], ["in the region", "make it larger"]),
        (["--load", "fz=1000"], ["J1.torsional", "never loaded"]),
        (["--json", "crane.yaml"], ["would overwrite the input"]),
        (["--tests", "4", "--poses", "3"], ["--tests: found beside --poses"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_plan_that_cannot_be_is_refused(refused: Refused, options: list[str], says: list[str]) -> None:
    refused([*CRANE, "--out", "plan.csv", *options], says)


def test_a_robot_that_names_nothing_to_identify_is_refused(refused: Refused) -> None:
    refused("plan cantilever --out plan.csv", "identify")


def test_progress_is_for_terminals_only(succeed: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "choosing tests from" not in succeed(*CRANE, "--out", "plan.csv").stderr
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes it for a terminal then
    monkeypatch.setenv("TERM", "xterm")
    assert "choosing tests from" in succeed(*CRANE, "--out", "plan.csv").stderr


def test_time_for_moving_is_told_and_wants_a_speed(told: Run, refused: Refused) -> None:
    answer = told(*CRANE, "--tests", "6", "--speed", "30deg/s")
    q = np.array([test["q"]["q1"] for test in answer["tests"]])
    moving = answer["moving_s"]
    assert moving["chosen"] == pytest.approx(np.abs(np.diff(q)).sum() / np.radians(30))
    assert moving["chosen"] <= moving["most_telling"]
    refused([*CRANE, "--speed", "30deg"], "--speed: found '30deg', expected a speed such as 30deg/s")
