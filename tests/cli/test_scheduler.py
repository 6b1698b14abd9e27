"""`--processes`, `--scheduler`: the same answers, and one line where there is nobody to give them."""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Refused, Run
from tests.exam.standins import always_none

NOBODY = "tcp://127.0.0.1:9"
POSES = """\
# sigma_position: 0.01 mm
q1 [deg],fx,fy,dx [mm],dy [mm]
0,0,1000,0,1.51
0.01,0,1000,0,1.5
0.02,0,1000,0,1.49
90,1000,0,1.51,0
"""


@pytest.fixture
def identified(run: Run, folder: Path) -> Callable[..., dict[str, Any]]:
    (folder / "poses.csv").write_text(POSES)

    def answer(*arguments: str) -> dict[str, Any]:
        result = run("identify crane.yaml poses.csv --json -", *arguments)
        assert (result.exit_code, result.stderr) == (0, "")
        return json.loads(result.stdout)

    return answer


def test_a_bootstrap_and_several_searches_say_the_same_anywhere(
    succeed: Run, folder: Path, identified: Callable[..., dict[str, Any]], scheduler: str
) -> None:
    what = ("--method", "crs2", "--searches", "3", "--evaluations", "200", "--bootstrap", "12")
    told = succeed("identify crane.yaml poses.csv", *what, "--json", "alone.json").stdout
    assert "3 of 3 searches ended there" in " ".join(told.split())
    alone = json.loads((folder / "alone.json").read_text())
    assert alone.pop("written_by")
    assert identified(*what, "--processes", "2") == alone
    assert identified(*what, "--scheduler", scheduler) == alone


def test_an_exam_says_the_same_anywhere(
    succeed: Run, folder: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)
    what = ["exam", "crane.yaml", "--cases", "4", "--classes", "null,load-error", "--no-compare"]
    tables = []
    for name, where in (("a", []), ("b", ["--processes", "2"]), ("c", ["--scheduler", scheduler])):
        succeed(*what, "--json", f"{name}.json", *where)
        tables.append(json.loads((folder / f"{name}.json").read_text()))
        tables[-1].pop("seconds", None)
    assert tables[0] == tables[1] == tables[2]


@pytest.mark.parametrize(
    "arguments",
    [
        ["identify", "crane.yaml", "crane.csv", "--bootstrap", "50"],
        ["exam", "kr240-2", "--cases", "2", "--classes", "null"],
        ["map", "crane.yaml", "--grid", "q1=0:1:5", "--out", "map.nc"],
    ],
)
def test_a_scheduler_that_does_not_answer_is_refused_in_one_line_within_10_seconds(
    run: Run, folder: Path, arguments: list[str]
) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is missing (extra `cluster`)")
    begun = time.monotonic()
    result = run(*arguments, "--scheduler", NOBODY, "--json", "a.json")
    assert time.monotonic() - begun < 10
    assert (result.exit_code, result.stdout) == (2, "")
    errors = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert errors == [f"error: --scheduler {NOBODY}: does not answer; start one: dask scheduler"]
    assert sorted(path.name for path in folder.iterdir()) == ["crane.csv", "crane.yaml"]


def test_without_dask_it_is_said_how_to_install_it(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = run("identify crane.yaml crane.csv --bootstrap 50 --scheduler", NOBODY)
    assert result.exit_code == 2
    assert result.stderr.endswith("dask.distributed is not installed: pip install 'beamstiff[cluster]'\n")


def test_where_nothing_is_spread_it_is_said(succeed: Run) -> None:
    result = succeed("identify crane.yaml crane.csv --processes 2")
    assert result.stderr == ("note: one search is one process: only bootstrap and searches are spread\n")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--searches", "0"], "--searches: found 0"),
        (["--searches", "2"], "--searches: found the method trust-region, expected isres"),
        (["--bootstrap", "9", "--processes", "0"], "--processes"),
        (["--bootstrap", "9", "--processes", "2", "--scheduler", NOBODY], "expected one of them"),
        (["--bootstrap", "9", "--scheduler", "10.0.0.5"], "found '10.0.0.5', expected tcp://host:port"),
    ],
)
def test_what_makes_no_sense_is_refused(refused: Refused, arguments: list[str], says: str) -> None:
    refused(["identify", "crane.yaml", "crane.csv", *arguments], says)
