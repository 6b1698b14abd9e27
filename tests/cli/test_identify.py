import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from beamstiff import load_robot
from tests.cli.conftest import Refused, Run


@pytest.fixture
def wrong_start(folder: Path) -> str:
    """Return the crane with a wrong torsional stiffness, which its data are to put right."""
    text = (folder / "crane.yaml").read_text().replace('torsional: "1e6', 'torsional: "3e5')
    (folder / "wrong.yaml").write_text(text)
    return "wrong.yaml"


def test_the_stiffness_that_made_the_data_is_found(run: Run, wrong_start: str) -> None:
    result = run(f"identify {wrong_start} crane.csv --json -")
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    # the contract's keys, and more
    assert {"parameters", "degenerate", "rms_mm", "rms_held_out_mm"} <= set(answer)
    assert list(answer["parameters"]) == ["J1.torsional"]
    found = answer["parameters"]["J1.torsional"]
    assert found["value"] == pytest.approx(1e6, rel=1e-6)
    # two rows bear on k with 1 mm each, read to 0.01 mm
    assert found["std"] == pytest.approx(1e6 * 0.01 / 2**0.5, rel=1e-6)
    assert (found["unit"], found["identifiable"]) == ("N*m/rad", True)
    assert answer["degenerate"] == []
    assert answer["rms_mm"] == pytest.approx(0, abs=1e-6)
    assert answer["rms_held_out_mm"] == pytest.approx(0, abs=1e-6)


def test_parameters_may_be_chosen(run: Run, wrong_start: str) -> None:
    result = run(f"identify {wrong_start} crane.csv --parameters J1.torsional,J1.radial --json -")
    found = json.loads(result.stdout)["parameters"]
    assert {name: item["value"] for name, item in found.items()} == pytest.approx(
        {"J1.torsional": 1e6, "J1.radial": 2e6}, rel=1e-6
    )
    again = run(f"identify {wrong_start} crane.csv --parameters J1.torsional --parameters J1.radial --json -")
    assert again.stdout == result.stdout


def test_what_the_data_do_not_bound_gets_a_lower_bound_and_no_value(run: Run, folder: Path) -> None:
    stiff = (folder / "crane.csv").read_text().replace("1.5", "0.5")  # as if the joint did not turn at all
    (folder / "stiff.csv").write_text(stiff)
    result = run("identify crane.yaml stiff.csv --json found.json")
    found = json.loads((folder / "found.json").read_text())["parameters"]["J1.torsional"]
    assert (found["value"], found["std"], found["identifiable"]) == (None, None, False)
    # 1.96 standard deviations of the compliance: two rows of 1 kN at 1 m, read to 0.01 mm
    assert found["lower_bound"] == pytest.approx(1e3 / (1.960 * 1e-5 / 2**0.5), rel=1e-3)
    assert "No upper bound from these data for J1.torsional:" in " ".join(result.stdout.split())


def test_the_robot_written_carries_the_identified_stiffness(run: Run, folder: Path, wrong_start: str) -> None:
    assert run(f"identify {wrong_start} crane.csv --out found.yaml").exit_code == 0
    before, after = load_robot(folder / wrong_start), load_robot(folder / "found.yaml")
    assert after.parameter("J1.torsional") == pytest.approx(1e6, rel=1e-6)
    assert after.with_parameters({"J1.torsional": 3e5}) == before
    assert (folder / "found.yaml").read_text().startswith("# Stiffness of J1.torsional identified")


@pytest.mark.parametrize(("name", "head"), [("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.PDF", b"%PDF")])
def test_the_figure_is_of_the_kind_that_its_name_says(run: Run, folder: Path, name: str, head: bytes) -> None:
    assert run(f"identify crane.yaml crane.csv --figure {name}").exit_code == 0
    assert (folder / name).read_bytes().startswith(head)


def test_people_get_start_value_uncertainty_and_gap(run: Run, wrong_start: str) -> None:
    text = " ".join(run(f"identify {wrong_start} crane.csv").stdout.split())
    for part in (
        "J1.torsional q1 3e+05 1e+06 7.1e+03 0.7 %",
        "0.000 mm RMS on the 4 fitted rows",
        "0.000 mm on held-out poses",
    ):
        assert part in text


def test_a_practice_campaign_is_identified(run: Run, shared_path: Callable[[str], Path]) -> None:
    robot, data = shared_path("practice/kr240.yaml"), shared_path("practice/set-00a8e433.csv")
    result = run("identify", str(robot), str(data), "--json", "-")
    assert result.exit_code == 0
    answer = json.loads(result.stdout, parse_constant=pytest.fail)
    assert set(answer["parameters"]) == set(load_robot(robot).identify)
    assert 0 < answer["rms_mm"] < answer["rms_held_out_mm"] * 1.5


def test_what_was_predicted_without_noise_is_identified(run: Run, folder: Path) -> None:
    """Its standard deviations are rounding, and smaller than what the optimum is off by rounding."""
    rows = [
        f"{10 * at},{-90 + 11 * at},{17 * at},{40 - 9 * at},{20 + 8 * at},5,500,-300,-900" for at in range(8)
    ]
    header = ",".join(f"q{at} [deg]" for at in range(1, 7)) + ",fx,fy,fz"
    (folder / "loads.csv").write_text("\n".join([header, *rows]) + "\n")
    assert run("deflect kr240-2 loads.csv --out predicted.csv").exit_code == 0
    result = run("identify kr240-2 predicted.csv --parameters J1.torsional,J2.torsional --json -")
    assert result.exit_code == 0, result.stderr
    assert "no residual is left: the standard deviations say nothing" in result.stderr
    robot = load_robot("kr240-2")
    for name, found in json.loads(result.stdout)["parameters"].items():
        assert found["value"] == pytest.approx(robot.parameter(name), rel=1e-6)


def test_of_a_file_with_remarks_only_the_identified_number_changes(succeed: Run, folder: Path) -> None:
    """Of every bundled robot: tests/robot/test_yaml_edit.py."""
    rows = (folder / "crane.yaml").read_text().replace("1e6 N*m/rad", "3e5 N*m/rad").splitlines()
    mine = "\n".join(f"{row}  # my own: {at}" if row[-1:] == "}" else row for at, row in enumerate(rows))
    (folder / "mine.yaml").write_text(f"{mine}\n# the end\n", encoding="utf-8")
    succeed("identify mine.yaml crane.csv --out found.yaml")
    heads, first, kept = (folder / "found.yaml").read_text(encoding="utf-8").partition("beamstiff: 1\n")
    assert all(line.startswith("# ") for line in heads.splitlines())
    number = re.compile(r'torsional: "[^"]*"')
    assert number.sub("", first + kept) == number.sub("", f"{mine}\n# the end\n")
    assert load_robot(folder / "found.yaml").parameter("J1.torsional") == pytest.approx(1e6)


def test_a_front_of_position_against_rotation_has_a_table_data_and_a_picture(
    run: Run, folder: Path, refused: Refused
) -> None:
    head = "# sigma_position: 0.01 mm\n# sigma_rotation: 0.001 deg\n"
    rows = "q1,fy,mz,dx,dy,dz,rx,ry,rz\n0,1000,0,0,1.1e-3,0,0,0,1.2e-3\n0.5,0,500,0,4e-4,0,0,0,7e-4\n"
    (folder / "turned.csv").write_text(head + rows)
    asked = ("crane.yaml", "turned.csv", "--pareto", "4", "--front", "f.png", "--json", "f.json")
    result = run("identify", *asked)
    assert result.exit_code == 0, result.stderr
    points = json.loads((folder / "f.json").read_text())["pareto"]
    assert 2 <= len(points) <= 4
    assert points[0]["rms_mm"] < points[-1]["rms_mm"]
    assert points[0]["rms_deg"] > points[-1]["rms_deg"]
    assert set(points[0]["stiffness"]) == {"J1.torsional"}
    assert "Position against rotation" in result.stdout
    assert (folder / "f.png").read_bytes().startswith(b"\x89PNG")
    says = "--front: found no points to draw, expected --pareto N"
    refused("identify crane.yaml turned.csv --front f.png", says)
