"""A campaign from its folder. Truth: the crane of 1 m on a joint, whose answers are known by hand."""

import json
import random
import shutil
import signal
import sys
import tempfile
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from beamstiff.cli.main import app
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.table import Measurements
from beamstiff.robot.reader import load_robot
from benchmarks.kill_study import Command, ended, start
from tests.cli.conftest import CRANE, CRANE_DATA, Refused, Run

KILLS = 3
pytestmark = pytest.mark.usefixtures("remembering")


def asked(folder: Path, name: str) -> Measurements:
    """Return a table of proposed rows."""
    text, crane = (folder / name).read_text(), load_robot(folder / "crane.yaml")
    return parse_measurements(text, crane, require_measured=False)


def test_a_campaign_goes_from_a_plan_to_a_diagnosis_of_all_batches(folder: Path, run: Run, told: Run) -> None:
    begun = told("campaign new cell crane.yaml --rows 6 --region z=-1m:1m")
    assert begun["rows"] == 0
    assert begun["batches"] == []
    assert begun["proposed"] == 6
    assert run("campaign next cell --out first.csv").exit_code == 0
    assert len(asked(folder, "first.csv")) == 6
    found = told("campaign add cell crane.csv")
    alone = json.loads(run("diagnose crane.yaml crane.csv --json -").stdout)
    assert found["diagnosis"]["verdict"] == alone["verdict"]
    assert found["rows"] == 4
    assert found["leading"].partition(":")[0] == alone["verdict"]["effect"]
    assert 0.0 <= found["settles"] <= 1.0
    assert [one["source"] for one in found["batches"]] == ["crane.csv"]
    assert told("campaign status cell") == found


def test_what_is_proposed_can_be_filled_in_and_added(folder: Path, run: Run, told: Run) -> None:
    told("campaign new cell crane.yaml")
    found = told("campaign add cell crane.csv")
    assert found["proposed"] > 0
    assert run("campaign next cell --out next.csv").exit_code == 0
    assert len(asked(folder, "next.csv")) == found["proposed"] <= 10


def test_loads_pull_where_they_can(folder: Path, run: Run, told: Run) -> None:
    told("campaign new cell crane.yaml --directions x,-z")
    for rows in (6, 0):
        assert run("campaign next cell --out next.csv").exit_code == 0
        rows_asked = asked(folder, "next.csv")
        assert (rows_asked.wrench[:, [0, 2]] * [1, -1] >= 0.0).all()
        assert not rows_asked.wrench[:, 1].any()
        if rows:
            told("campaign add cell crane.csv")


def test_a_batch_is_withdrawn_and_may_come_back(folder: Path, run: Run, told: Run) -> None:
    told("campaign new cell crane.yaml")
    (folder / "wrong.csv").write_text(CRANE_DATA.replace("1.5", "9.5"), encoding="utf-8")
    right = told("campaign add cell crane.csv")
    assert told("campaign add cell wrong.csv")["rows"] == 8
    less = told("campaign remove cell 2")
    assert less["diagnosis"] == right["diagnosis"]
    assert [one["withdrawn"] for one in less["batches"]] == [False, True]
    assert told("campaign add cell wrong.csv")["rows"] == 8


def test_a_campaign_refuses_what_it_cannot_use(folder: Path, told: Run, refused: Refused) -> None:
    refused("campaign status cell", ["cell", "campaign.json", "campaign new"])
    refused("campaign new cell", ["campaign new", "a ROBOT"])
    refused("campaign new cell crane.yaml --directions u", ["--directions", "'u'"])
    told("campaign new cell crane.yaml")
    refused("campaign new cell crane.yaml", ["cell", "a campaign already"])
    refused("campaign add cell", ["campaign add", "tables"])
    refused("campaign status cell 1", ["campaign status", "'1'", "nothing"])
    refused("campaign remove cell 1", ["cell", "'1'", "none"])
    refused("campaign add cell none.csv", ["none.csv"])
    refused("campaign status cell --out o.csv", ["--out", "campaign next"])
    (folder / "empty.csv").write_text("q1,fx,dx\n0,1,\n", encoding="utf-8")
    refused("campaign add cell empty.csv", ["empty.csv"])
    told("campaign add cell crane.csv")
    refused("campaign add cell crane.csv", ["crane.csv", "batch 1 already"])
    head = folder / "cell" / "campaign.json"
    head.write_text("{}", encoding="utf-8")
    refused("campaign status cell", ["campaign.json", "no campaign"])
    (folder / "mine").mkdir()
    (folder / "mine" / "notes.txt").write_text("mine", encoding="utf-8")
    refused("campaign new mine crane.yaml", ["notes.txt", "an empty folder"])


def in_folder(folder: Path, *words: str) -> Any:
    with chdir(folder):
        return CliRunner().invoke(app, ["campaign", *words], prog_name="beamstiff")


@pytest.mark.skipif(sys.platform != "linux", reason="copies of a process, killed")
@pytest.mark.parametrize(
    "words", [("new", "cell", "crane.yaml"), ("add", "cell", "crane.csv"), ("remove", "cell", "1")]
)
def test_a_kill_at_any_moment_loses_nothing(words: tuple[str, ...], tmp_path: Path) -> None:
    command, draw = Command(words[0], ("campaign", *words)), random.Random(words[0])

    def laid_out(folder: Path) -> None:
        (folder / "crane.yaml").write_text(CRANE, encoding="utf-8")
        (folder / "crane.csv").write_text(CRANE_DATA, encoding="utf-8")
        for before in (("new", "cell", "crane.yaml"), ("add", "cell", "crane.csv")):
            if before == words:
                return
            assert in_folder(folder, *before).exit_code == 0

    begun, whole = tmp_path / "begun", tmp_path / "whole"
    begun.mkdir()
    laid_out(begun)
    shutil.copytree(begun, whole)
    assert ended(start(command, whole, count_to=tmp_path / "count")) == 0, (tmp_path / "stderr").read_text()
    operations = int((tmp_path / "count").read_text())
    for _ in range(KILLS):
        with tempfile.TemporaryDirectory(dir=tmp_path) as root:
            folder = shutil.copytree(begun, Path(root, "here"))
            head = folder / "cell" / "campaign.json"
            before = head.read_bytes() if head.exists() else b""
            assert ended(start(command, folder, die_at=draw.randint(1, operations))) in (0, -signal.SIGKILL)
            done = (whole / "cell" / "campaign.json").read_bytes()
            now = head.read_bytes() if head.exists() else b""
            assert now in (before, done)  # all of it, or nothing
            if now == before:
                assert in_folder(folder, *words).exit_code == 0
            found = in_folder(folder, "status", "cell")
            assert found.exit_code == 0, found.output
            assert head.read_bytes() == done
            for name in ("robot.yaml", "diagnosis.json"):
                assert (folder / "cell" / name).read_bytes() == (whole / "cell" / name).read_bytes()
            left = {path.name for path in (folder / "cell").iterdir()}
            assert left == {path.name for path in (whole / "cell").iterdir()}
            assert (folder / "crane.csv").read_text(encoding="utf-8") == CRANE_DATA
