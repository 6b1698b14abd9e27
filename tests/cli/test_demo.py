"""`beamstiff demo` finds the hidden fault, decides it, and corrects a program for it."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from beamstiff.cli.demo import FILES
from beamstiff.cli.main import app
from beamstiff.exam.demonstration import FAULT, SIGMA
from tests.cli.demo_text import BLOCK, PAGE, demo_text
from tests.printed import prints

SCREEN = 40  # lines


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demo")


@pytest.fixture(scope="module")
def printed(folder: Path) -> str:
    return demo_text(folder)


def test_the_demo_prints_what_its_page_shows_on_one_screen(printed: str) -> None:
    shown = BLOCK.search(PAGE.read_text(encoding="utf-8"))
    assert prints(shown[2], printed), f"`make readme` writes what the demo prints now:\n{printed}"
    assert len(printed.splitlines()) <= SCREEN


def test_what_is_proposed_decides_and_the_cause_is_the_hidden_fault(printed: str) -> None:
    text = " ".join(printed.split())
    first, second = re.findall(r"Gap of [0-9.]+ mm(?: after calibration)?, (.*?) (?:2\.|Gap on)", text)
    assert first.startswith("likeliest cause: link-bending at link2 (or ")
    assert second == "100 % explained by link-bending at link2"
    assert (FAULT.effect, FAULT.component) == ("link-bending", "link2")


def test_fresh_postures_and_the_machine_itself_confirm_it(printed: str) -> None:
    text = " ".join(printed.split())
    [(without, with_it)] = re.findall(r"([0-9.]+) mm RMS without the cause, ([0-9.]+) mm with", text)
    assert float(without) > 4e3 * SIGMA
    noise = 1e3 * SIGMA * 3**0.5  # of three axes
    assert float(with_it) ** 2 - noise**2 < 0.02 * (float(without) ** 2 - noise**2)
    [(before, after)] = re.findall(r"([0-9.]+) mm RMS from its targets .*?, ([0-9.]+) mm RMS with", text)
    assert float(after) < 0.05 * float(before)


def test_all_files_are_written(folder: Path, printed: str) -> None:
    assert printed
    assert {path.name for path in (folder / "beamstiff-demo").iterdir()} >= {*FILES.values()}
    assert (folder / "beamstiff-demo" / "report.html").stat().st_size > 100_000


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    result = CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "taken")])
    assert result.exit_code == 2
    assert "cannot be made" in result.stderr


@pytest.mark.parametrize("name", FILES.values())
def test_what_the_demo_did_not_write_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    result = CliRunner().invoke(app, ["demo", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"
    assert [path.name for path in tmp_path.iterdir()] == [name]
