"""``--html`` of the commands."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from beamstiff.cli.main import app
from tests.cli.conftest import CRANE, CRANE_DATA
from tests.exam.standins import always_none
from tests.report.html.test_page import Outline


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane.yaml").write_text(CRANE, encoding="utf-8")
    (tmp_path / "crane.csv").write_text(CRANE_DATA, encoding="utf-8")
    return tmp_path


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, [*arguments], prog_name="beamstiff")


def told(folder: Path) -> dict[str, Any]:
    """Return what `--json` wrote, but for its seal."""
    found = json.loads((folder / "out.json").read_text())
    assert found.pop("written_by").startswith("beamstiff-output ")
    return found


PATH = "name,x,y,z,fx\na,1,0,0,100\nb,0.8,0.6,0,100\nc,0.6,0.8,0,100\n"
READINGS = (
    "# sigma_position: 0.01 mm\nq1 [deg],x,y,z\n0,1.001,0,0\n60,0.5,0.867,0\n90,0,1.001,0\n-30,0.867,-0.5,0\n"
)


@pytest.mark.parametrize(
    ("arguments", "files"),
    [
        ("diagnose crane.yaml crane.csv --seed 7", ("crane.yaml", "crane.csv")),
        ("identify crane.yaml crane.csv --seed 7", ("crane.yaml", "crane.csv")),
        ("deflect crane.yaml crane.csv", ("crane.yaml", "crane.csv")),
        ("compare crane.yaml many.csv --models nominal,parametric", ("crane.yaml", "many.csv")),
        ("calibrate crane.yaml readings.csv --parameters q1,tip.x", ("crane.yaml", "readings.csv")),
        ("compensate crane.yaml path.csv", ("crane.yaml", "path.csv")),
        ("exam crane.yaml --cases 2 --classes null,load-error", ("crane.yaml",)),
    ],
)
def test_every_report_holds_what_json_writes_and_says_where_it_comes_from(
    folder: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, files: tuple[str, ...]
) -> None:
    monkeypatch.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)
    for name, text in (("path.csv", PATH), ("readings.csv", READINGS), ("many.csv", many())):
        (folder / name).write_text(text, encoding="utf-8")
    result = run(*arguments.split(), "--json", "out.json", "--html", "out.html")
    assert result.exit_code == 0, result.output
    outline = Outline((folder / "out.html").read_text(encoding="utf-8"))
    assert json.loads(outline.scripts["result"]) == told(folder)
    text = "".join(outline.text)
    assert f"beamstiff {arguments} --json out.json --html out.html" in text
    for name in files:
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() in text
        refused = run(*arguments.split(), "--html", name)
        assert refused.exit_code == 2
        assert f"--html {name}: would overwrite the input" in refused.stderr


def many() -> str:
    """Return what the crane does in many postures."""
    lines = CRANE_DATA.splitlines()[:2]
    for q1 in range(0, 160, 20):
        c, s = np.cos(np.radians(q1)), np.sin(np.radians(q1))
        for force in (500.0, 1000.0):  # along the arm 0.5 mm a kN, across it 1.5
            lines.append(f"{q1},{-s * force},{c * force},{-1.5e-3 * s * force},{1.5e-3 * c * force}")
    return "\n".join(lines)


def test_a_path_that_is_refused_has_no_report_unless_its_targets_are_kept(folder: Path) -> None:
    (folder / "path.csv").write_text(f"{PATH}far,5,5,0,0\n", encoding="utf-8")
    command = ("compensate", "crane.yaml", "path.csv", "--out", "new.csv", "--html", "out.html")
    assert run(*command).exit_code == 2
    assert not (folder / "new.csv").exists()
    assert not (folder / "out.html").exists()
    assert run(*command, "--unreachable", "keep").exit_code == 0
    text = "".join(Outline((folder / "out.html").read_text(encoding="utf-8")).text)
    assert "1 of 4 targets cannot be corrected" in text
    assert "out of reach" in text


def test_of_a_path_out_of_reach_no_errors_are_told(folder: Path) -> None:
    (folder / "path.csv").write_text("name,x,y,z\na,5,5,0\nb,6,5,0\n", encoding="utf-8")
    command = ("compensate", "crane.yaml", "path.csv", "--unreachable", "keep", "--html", "out.html")
    assert run(*command).exit_code == 0
    outline = Outline((folder / "out.html").read_text(encoding="utf-8"))
    text = "".join(outline.text)
    assert "The robot can follow none of the targets" in text
    assert "0 mm" not in text.partition("Provenance")[0]
    assert not {"robot", "errors", "changes"} & set(outline.ids)


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
    page = (folder / "out.html").read_text(encoding="utf-8")
    assert ">dy measured, mm<" in page
    assert ">1.5<" in page  # mm: the deviation from the nominal pose
