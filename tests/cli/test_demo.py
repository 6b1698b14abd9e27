"""`beamstiff demo` finds the hidden fault and writes a report."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from beamstiff.cli.main import app


def test_the_demo_finds_the_fault_and_writes_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["demo"])
    assert result.exit_code == 0, result.output
    assert "Gap of 0.40 mm on 14 postures, 100 % explained by base-compliance" in result.stdout
    assert len(result.stdout.splitlines()) <= 24  # a screen
    assert (tmp_path / "beamstiff-demo" / "measurements.csv").is_file()
    assert (tmp_path / "beamstiff-demo" / "report.html").stat().st_size > 100_000


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    result = CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "taken")])
    assert result.exit_code == 2
    assert "cannot be made" in result.stderr


@pytest.mark.parametrize("name", ["measurements.csv", "report.html"])
def test_what_the_demo_did_not_write_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    result = CliRunner().invoke(app, ["demo", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"
    assert [path.name for path in tmp_path.iterdir()] == [name]
