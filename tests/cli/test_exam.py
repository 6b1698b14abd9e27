import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.exam.names import EFFECTS
from beamstiff.functions.examine import shares_of
from tests.cli.conftest import Refused, Run
from tests.exam.standins import always_none


@pytest.fixture(autouse=True)
def examined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)


def test_an_exam_prints_its_table_and_writes_it(run: Run, folder: Path) -> None:
    arguments = ["exam", "kr240-2", "--cases", "4", "--seed", "5", "--classes", "null,tool-compliance"]
    arguments.append("--no-compare")  # the next tests compare
    result = run(*arguments, "--json", "table.json", "--out", "results.jsonl", "--figure", "a.png")
    assert (result.exit_code, result.stderr) == (0, "")
    for part in ("false alarms on null data", "<= 0.05", "too few cases", "Confusion"):
        assert part in result.stdout
    table = json.loads((folder / "table.json").read_text(), parse_constant=pytest.fail)
    assert table["cases"] == 4
    assert table["exam"]["seed"] == 5
    assert table["headline"]["all"]["false alarms on null data"]["count"] == 2
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()]
    assert [next(iter(line)) for line in lines] == ["format", *["sealed", "record"] * 4]
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    # again: nothing is left to do, and the table is the same
    size = (folder / "results.jsonl").stat().st_size
    again = run(*arguments, "--json", "again.json", "--out", "results.jsonl")
    assert again.stdout.startswith(result.stdout[:200])
    assert (folder / "again.json").read_text() == (folder / "table.json").read_text()
    assert (folder / "results.jsonl").stat().st_size == size


def test_crowded_machines_are_examined_beside_the_control(run: Run, folder: Path) -> None:
    arguments = ["exam", "--crowded", "--cases", "1", "--seed", "1"]  # a clean machine
    result = run(*arguments, "--json", "table.json", "--out", "results.jsonl")
    assert (result.exit_code, result.stderr) == (0, "")
    for part in ("Crowded machines, all: 1 clean", "largest cause named first", ">= 0.85"):
        assert part in result.stdout
    table = json.loads((folder / "table.json").read_text(), parse_constant=pytest.fail)
    assert (table["cases"], table["kinds"]) == (1, {"clean": 1})
    figures = table["figures"]["all"]
    # the stand-in gives no causes, which is no answer here; the control names nothing, rightly
    clean = {who: one["value"] for who, one in figures["clean: nothing named"].items()}
    assert clean == {"diagnosis": 0.0, "plain stepwise regression": 1.0}
    assert figures["broke off"]["diagnosis"]["value"] == 1.0
    again = run(*arguments, "--json", "again.json", "--out", "results.jsonl")
    assert again.stdout == result.stdout.replace("table.json", "again.json")
    assert run("exam --cases 1 --seed 1 --out results.jsonl").exit_code == 2


def test_crowded_machines_are_those_of_a_robot_with_a_loop(succeed: Run, folder: Path) -> None:
    succeed("exam ir663 --crowded --no-compare --cases 3 --seed 1 --json table.json --out results.jsonl")
    assert (folder / "results.jsonl").read_text().count('"robot": "ir663"') == 3
    settings = json.loads((folder / "table.json").read_text())["exam"]
    assert settings["robots"] == {"ir663": 1.0}
    assert len(settings["robot"]) == 64


def test_a_plan_is_examined_on_its_own_poses_and_loads(succeed: Run, folder: Path) -> None:
    (folder / "plan.csv").write_text("q1 [deg],fy,dx,dy,dz\n0,900,,,\n0,-900,,,\n60,900,,,\n120,500,,,\n")
    result = succeed("exam crane.yaml --plan plan.csv --cases 4 --classes null,load-error")
    assert "plan.csv states no sigma_position; 0.03 mm is assumed" in " ".join(result.stderr.split())
    assert "What this plan could find" in result.stdout
    assert "load-error" in result.stdout


def test_effects_that_a_robot_cannot_have_are_left_out_and_said(succeed: Run, refused: Refused) -> None:
    result = succeed("exam crane.yaml --cases 2 --classes joint-coupling,load-error --no-compare")
    assert "crane cannot have joint-coupling" in result.stderr
    refused("exam crane.yaml --cases 2 --classes joint-coupling", "can have none of joint-coupling")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--plan", "crane.csv"], "a plan without a robot"),
        (["crane.yaml", "--classes", "backlsh"], "found 'backlsh' (did you mean 'backlash'?)"),
        (["crane.yaml", "--out", "crane.yaml"], "would overwrite the input"),
        (["crane.yaml", "--figure", "a.bmp"], "found the ending 'bmp'"),
        (["--cases", "0"], "--cases"),
        (["nobody"], "nobody"),
        (["--sets", "nowhere"], "labels.json"),
        (["crane.yaml", "--sets", "."], "expected the folder only"),
        (["--crowded", "--classes", "backlash"], "expected a robot and the cases' number only"),
        (["--crowded", "--figure", "a.png"], "of single effects, expected --json"),
    ],
)
def test_what_cannot_be_examined_is_refused(refused: Refused, arguments: list[str], message: str) -> None:
    refused(["exam", *arguments], message)


def test_classes_are_kinds_and_effects_in_equal_shares() -> None:
    assert shares_of(["null", "backlash"]) == ({"null": 1, "single": 1}, ("backlash",))
    assert shares_of(["single", "outside"]) == ({"outside": 1, "single": 18}, EFFECTS)
    assert shares_of(["pair"]) == ({"pair": 1}, EFFECTS)
    with pytest.raises(BeamstiffError, match="expected null, single, pair"):
        shares_of(["", "null"])


def test_reports_are_kept_in_a_folder(run: Run, folder: Path) -> None:
    words = ["crane.yaml", "--cases", "2", "--classes", "null", "--no-compare", "--reports", "reports"]
    result = run("exam", *words, "--quiet")
    assert (result.exit_code, result.stdout) == (0, "")
    names: Sequence[str] = sorted(path.name for path in (folder / "reports").iterdir())
    assert names == ["case-000000.json", "case-000001.json"]


@pytest.mark.slow
def test_labelled_campaigns_of_a_folder_are_examined(
    succeed: Run, folder: Path, shared_path: Callable[[str], Path]
) -> None:
    practice = shared_path("practice/labels.json").parent
    succeed("exam --sets", str(practice), "--json", "table.json")
    labels = json.loads((practice / "labels.json").read_text())
    table = json.loads((folder / "table.json").read_text())
    assert table["cases"] == len(labels)
    nulls = [label for label in labels.values() if label["effect"] == "none"]
    alarms = table["headline"]["all"]["false alarms on null data"]
    assert (alarms["value"], alarms["count"]) == (0.0, len(nulls))
