import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff import load_robot, read_measurements
from beamstiff.cli.main import app
from beamstiff.diagnosis.effects import EFFECTS
from tests.cli.conftest import CRANE, Refused, Run

# Nothing but the drive gives way, yet the readings for half a load and for both signs do not go with it.
LOAD_CYCLE = "\n".join(
    [
        "# sigma_position: 0.01 mm",
        "q1 [deg],fy,dx [mm],dy [mm],dz [mm]",
        *(
            f"{q},{force},0,{1.5e-3 * force + (0.3 if force > 0 else -0.3):.4f},0"
            for q in (0, 10, -10)
            for force in (200, 400, 800, 400, 200, -200, -400, -800, -400, -200)
        ),
    ]
)


def test_a_diagnosis_is_printed_with_its_limits_and_repeats(run: Run, succeed: Run, folder: Path) -> None:
    result = succeed("diagnose crane.yaml crane.csv --seed 3 --json out.json")
    for part in (
        "Too few rows to say anything",
        "Which effect",
        "What these data cannot show",
        "payload-error",
    ):
        assert part in result.stdout
    assert "note: only 7 values beyond those fitted" in result.stderr
    assert all(line.startswith("note: ") for line in result.stderr.strip().splitlines())
    written = json.loads((folder / "out.json").read_text(), parse_constant=pytest.fail)
    assert written["format"] == "beamstiff-diagnosis/1"
    piped = run("diagnose crane.yaml crane.csv --seed 3 --json -")
    assert written.pop("written_by").startswith("beamstiff-output sha256=")
    assert json.loads(piped.stdout, parse_constant=pytest.fail) == written


def test_a_quiet_diagnosis_prints_nothing(run: Run) -> None:
    result = run("diagnose crane.yaml crane.csv --quiet")
    assert (result.exit_code, result.output) == (0, "")


@pytest.fixture(scope="module")
def cycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the diagnosis of the load cycle, `out.json`, and `next.csv`."""
    folder = tmp_path_factory.mktemp("cycle")
    (folder / "crane.yaml").write_text(CRANE, encoding="utf-8")
    (folder / "cycle.csv").write_text(LOAD_CYCLE, encoding="utf-8")
    words = ["diagnose", *("crane.yaml", "cycle.csv", "--next", "next.csv", "--json", "out.json")]
    words = [str(folder / word) if "." in word else word for word in words]
    assert CliRunner().invoke(app, words, prog_name="beamstiff").exit_code == 0
    return folder


def test_what_to_measure_next_is_a_table_to_fill_in(cycle: Path) -> None:
    proposed = json.loads((cycle / "out.json").read_text())["next"]
    crane = load_robot(cycle / "crane.yaml")
    rows = read_measurements(cycle / "next.csv", crane, require_measured=False)
    assert len(rows) == len(proposed) > 0
    assert rows.q[:, 0].tolist() == pytest.approx([item["q"]["q1"] for item in proposed])
    low, high = crane.actuated[0].limits
    assert (rows.q >= low).all()
    assert (rows.q <= high).all()


def test_what_was_measured_next_joins_the_rest(run: Run, folder: Path, cycle: Path, refused: Refused) -> None:
    sigma, header, *lines = LOAD_CYCLE.splitlines()
    halves = {"first.csv": lines[:10], "then.csv": lines[10:]}
    for name, some in halves.items():
        (folder / name).write_text("\n".join([sigma, header, *some]) + "\n", encoding="utf-8")
    both = run("diagnose crane.yaml first.csv then.csv --json -")
    found, expected = (
        json.loads(text)["verdict"] for text in (both.stdout, (cycle / "out.json").read_text())
    )
    assert (found["effect"], found["component"]) == (expected["effect"], expected["component"])
    assert found["probability"] == pytest.approx(expected["probability"], abs=1e-6)
    refused("diagnose crane.yaml first.csv first.csv", "given twice")


PLACED = "q1,fy,x,y,z\n0,100,1,0,0\n0.1,100,1,0.1,0\n0.1,10,1,0.1,0\n"


def test_where_positions_were_measured_positions_are_proposed(succeed: Run, folder: Path) -> None:
    (folder / "placed.csv").write_text(PLACED, encoding="utf-8")
    succeed("diagnose crane.yaml placed.csv --next next.csv")
    rows = read_measurements(folder / "next.csv", load_robot(folder / "crane.yaml"), require_measured=False)
    assert rows.kind == "absolute"
    assert not rows.measured_mask.any()
    assert set(np.abs(rows.wrench).max(axis=1)) == {0.0, 50.0, 100.0}


def test_where_there_is_nothing_to_propose_the_diagnosis_stands(succeed: Run, folder: Path) -> None:
    (folder / "placed.csv").write_text(PLACED, encoding="utf-8")
    others = ",".join(name for name in EFFECTS if name != "backlash")
    named = ["--without", others, "--next", "next.csv", "--json", "out.json"]
    assert "next.csv was not written" in succeed("diagnose crane.yaml placed.csv", *named).stderr
    assert not (folder / "next.csv").exists()
    assert json.loads((folder / "out.json").read_text())["next"] == []


def test_effects_ruled_out_by_other_means_are_no_candidates(told: Run, cycle: Path) -> None:
    candidates = json.loads((cycle / "out.json").read_text())["which"]
    assert {"backlash", "hardening", "bearing-tilt"} <= {item["effect"] for item in candidates}
    table = str(cycle / "cycle.csv")
    candidates = told("diagnose crane.yaml", table, "--without", "backlash,hardening:q1")["which"]
    assert not {"backlash", "hardening"} & {item["effect"] for item in candidates}
    assert sum(item["probability"] for item in candidates) == pytest.approx(1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["crane.csv", "--without", "backlsh"], "'backlsh' (did you mean 'backlash'?)"),
        (["crane.csv", "--without", "backlash,"], "--without: found 'backlash,'"),
        (["crane.csv", "--figure", "a.bmp"], "found the ending 'bmp'"),
        (["crane.csv", "--json", "crane.yaml"], "would overwrite the input"),
        (["crane.csv", "--json", "a.json", "--next", "a.json"], "would overwrite the output"),
        (["nobody.csv"], "nobody.csv"),
        (["empty.csv"], "empty.csv"),
        (["elbow.csv"], "q2"),
    ],
)
def test_bad_input_is_refused(refused: Refused, folder: Path, arguments: list[str], message: str) -> None:
    (folder / "empty.csv").write_text("q1,fy,dx,dy,dz\n")
    (folder / "elbow.csv").write_text("q2,fy,dx,dy,dz\n0,100,0,1e-3,0\n")
    refused(["diagnose", "crane.yaml", *arguments], message)


def test_a_component_that_an_effect_cannot_have_is_refused_by_name(succeed: Run, refused: Refused) -> None:
    says = "backlash has no component 'q9' on this robot"
    refused("diagnose crane.yaml crane.csv --without backlash:q9", says)
    succeed("diagnose crane.yaml crane.csv --without backlash:q1")


def test_a_robot_that_names_nothing_to_fit_is_fitted_alike_by_both_commands(run: Run, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text()
    (folder / "bare.yaml").write_text(text.replace("identify: [J1.torsional]\n", ""))
    shown = "note: robot 'crane' names nothing under `identify:`: the stiffness of its joints "
    for command in ("identify", "diagnose"):
        named, bare = (run(f"{command} {robot} crane.csv --json -") for robot in ("crane.yaml", "bare.yaml"))
        assert f"{shown}about or along their axes is fitted: J1.torsional" in bare.stderr
        assert shown not in named.stderr
        one, other = (json.loads(result.stdout) for result in (named, bare))
        assert one.pop("notes") == [note for note in other.pop("notes") if "names nothing" not in note]
        assert one == other


def test_of_a_rigid_robot_nothing_is_fitted(succeed: Run, folder: Path, refused: Refused) -> None:
    stiff = re.sub('"[0-9]e6 N.*?"', "rigid", (folder / "crane.yaml").read_text())
    (folder / "rigid.yaml").write_text(stiff.replace("identify: [J1.torsional]\n", ""))
    refused("identify rigid.yaml crane.csv", "nothing is compliant, the joints J1 are rigid")
    shown = succeed("diagnose rigid.yaml crane.csv")
    assert "all drives are rigid in this file, so that no stiffness is fitted" in shown.stderr


REVERSED = """\
# sigma_position: 0.01 mm
q1 [deg],fx,fy,dx [mm],dy [mm]
0,0,-1000,0,1.5
0,-1000,0,0.5,0
2000,0,1000,0,1
90,-1000,0,1.5,0
"""


@pytest.mark.parametrize("command", ["identify", "diagnose", "deflect"])
def test_mistakes_of_a_table_are_said_first(run: Run, told: Run, folder: Path, command: str) -> None:
    (folder / "bad.csv").write_text(REVERSED.replace("q1 [deg]", "q1"))
    lines = run(f"{command} crane.yaml bad.csv").stderr.splitlines()
    assert "bad.csv: the tool moved against its load in 3 of 4 rows" in lines[0]
    assert "more than two turns; if the column is in degrees, write q1 [deg]" in lines[1]
    assert len(set(lines)) == len(lines)  # and they are said once
    if command != "deflect":
        facts = told(f"{command} crane.yaml bad.csv")
        assert f"note: {facts['notes'][0]}" == lines[0]


@pytest.mark.parametrize("command", ["identify", "diagnose", "deflect"])
def test_an_error_that_they_may_have_led_to_says_so_in_its_line(run: Run, folder: Path, command: str) -> None:
    (folder / "tall.yaml").write_text((folder / "crane.yaml").read_text().replace('"1 m"', "1e160"))
    (folder / "kilo.csv").write_text((folder / "crane.csv").read_text().replace("fx,fy", "fx [MN],fy [MN]"))
    result = run(f"{command} tall.yaml kilo.csv")
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ")
    assert "; it may come from this: kilo.csv:3: a load of 1e+09 N or N m is large for a robot" in line


def test_what_to_measure_next_stays_in_the_region(succeed: Run, folder: Path, refused: Refused) -> None:
    (folder / "cycle.csv").write_text(LOAD_CYCLE)
    succeed("diagnose crane.yaml cycle.csv --next next.csv --region y=-0.3m:300mm,x=0:2")
    rows = read_measurements(folder / "next.csv", load_robot(folder / "crane.yaml"), require_measured=False)
    assert rows.units == {"q1": "deg"}
    assert (abs(rows.q) <= 0.305).all()  # the arm is 1 m long, along x at q1 = 0
    other = "diagnose crane.yaml cycle.csv --next other.csv"
    refused(f"{other} --region y=0.3:0.1", "expected the lower end first")
