"""``--html`` of the commands."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from beamstiff.cli.main import app
from tests.cli.conftest import CRANE, CRANE_DATA
from tests.report.html.test_page import Outline


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane.yaml").write_text(CRANE, encoding="utf-8")
    (tmp_path / "crane.csv").write_text(CRANE_DATA, encoding="utf-8")
    return tmp_path


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, [*arguments], prog_name="beamstiff")


@pytest.mark.parametrize("command", ["diagnose", "identify"])
def test_the_report_holds_what_json_writes_and_says_where_it_comes_from(folder: Path, command: str) -> None:
    result = run(
        command, "crane.yaml", "crane.csv", "--json", "out.json", "--html", "out.html", "--seed", "7"
    )
    assert result.exit_code == 0, result.output
    outline = Outline((folder / "out.html").read_text(encoding="utf-8"))
    assert json.loads(outline.scripts["result"]) == json.loads((folder / "out.json").read_text())
    text = "".join(outline.text)
    assert f"beamstiff {command} crane.yaml crane.csv --json out.json --html out.html --seed 7" in text
    for name in ("crane.yaml", "crane.csv"):
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() in text


@pytest.mark.parametrize("command", ["diagnose", "identify"])
@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("missing/out.html", "there is no folder"),
        ("crane.csv", "--html crane.csv: would overwrite the input crane.csv"),
        ("-", "--html: found -"),
    ],
)
def test_a_report_that_cannot_be_written_is_refused_before_any_work(
    folder: Path, command: str, path: str, message: str
) -> None:
    result = run(command, "crane.yaml", "crane.csv", "--html", path)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""
    assert (folder / "crane.csv").read_text(encoding="utf-8") == CRANE_DATA


def test_absolute_rows_are_reported_as_deviations(folder: Path) -> None:
    lines = ["# sigma_position: 0.01 mm", "q1 [deg],fx,fy,x,y,z"]
    lines += [
        f"{q1},{fx},{fy},{x},{y},0"
        for q1, fx, fy, x, y in (
            (0, 0, 1000, 1.0, 0.0015),
            (0, 1000, 0, 1.0005, 0),
            (90, 1000, 0, 0.0015, 1.0),
            (90, 0, -1000, 0, 0.9995),
            (0, 0, -1000, 1.0, -0.0015),
            (180, 0, 1000, -1.0, 0.0015),
        )
    ]
    (folder / "crane.csv").write_text("\n".join(lines), encoding="utf-8")
    result = run("diagnose", "crane.yaml", "crane.csv", "--html", "out.html")
    assert result.exit_code == 0, result.output
    outline = Outline((folder / "out.html").read_text(encoding="utf-8"))
    assert "deviation from the nominal pose" in "".join(outline.text)
    held = json.loads(outline.scripts["figures"])
    assert max(held["shared"]["measured_1"]) == pytest.approx(1.5, rel=1e-3)  # mm
