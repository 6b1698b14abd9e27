"""The pages of docs/ say what happens: commands and Python run, links lead somewhere, pictures are there."""

import doctest
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from beamstiff import __version__, load_robot
from beamstiff.cli.main import app
from beamstiff.robot.urdf.writer import robot_to_urdf
from tests.printed import prints

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
PAGES = [*DOCS.glob("*.md"), *REPOSITORY.glob("*.md")]
LARGEST = 200_000  # bytes of a picture in the repository


def sessions(page: str) -> Iterator[tuple[str, str]]:
    """Yield the commands of a page, each with what it is said to print."""
    text = (DOCS / page).read_text(encoding="utf-8").replace("\\\n", "")  # one command over two lines
    for block in re.findall(r"```console\n(.*?)```", text, re.DOTALL):
        for session in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, printed = session.partition("\n")
            yield command, printed


def test_the_commands_of_the_tutorial_print_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(REPOSITORY / "examples")
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    for name, content in re.findall(r"<!-- ([\w.]+) -->\n```\n(.*?)```", text, re.DOTALL):
        (tmp_path / name).write_text(content, encoding="utf-8")
    ran = 0
    for command, printed in sessions("tutorial.md"):
        result = CliRunner().invoke(app, shlex.split(command)[1:], prog_name="beamstiff")
        assert result.exit_code == 0, f"{command}: {result.stderr}"
        assert prints(printed, result.stdout), f"{command} prints\n{result.stdout}"
        ran += 1
    assert ran == 6
    for name in ("tests.csv", "real.yaml", "next.csv", "report.html", "corrected.csv"):
        assert (tmp_path / name).stat().st_size > 0


def test_the_campaign_of_the_tutorial_is_what_its_example_simulates() -> None:
    from examples.tutorial_campaign import FILE, campaign

    assert FILE.read_text(encoding="utf-8") == campaign()


def write_foreign_files(folder: Path) -> None:
    """Write what the page begins with: a maker's URDF, and the tutorial's table as another program has it."""
    robot = load_robot("kr240-2")
    rigid = robot.with_parameters(dict.fromkeys(robot.identify, np.inf))
    text = re.sub("<beamstiff.*?</beamstiff>", "", robot_to_urdf(rigid), flags=re.DOTALL)
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    table = (REPOSITORY / "examples" / "data" / "tutorial_campaign.csv").read_text(encoding="utf-8")
    rows = [line for line in table.splitlines() if not line.startswith(("#", "q1"))]
    lines = ["A1;A2;A3;A4;A5;A6;Fx;Fy;Fz;dX;dY;dZ", *(line.replace(",", ";") for line in rows)]
    (folder / "export.csv").write_text("\n".join(lines), encoding="utf-8")


def test_the_python_of_the_pages_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(REPOSITORY / "examples")
    write_foreign_files(tmp_path)
    blocks = re.findall(r"```pycon\n(.*?)```", (DOCS / "python.md").read_text(encoding="utf-8"), re.DOTALL)
    example = doctest.DocTestParser().get_doctest("\n".join(blocks), {}, "python.md", "python.md", 0)
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example)
    assert runner.summarize(verbose=False) == (0, len(example.examples))
    assert {"robot.png", "values.png", "fit.png"} <= {path.name for path in tmp_path.iterdir()}


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ +(.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("https://", "http://")):
            continue
        name, _, anchor = target.partition("#")
        if name == "contributing.md":
            name = "../CONTRIBUTING.md"  # which that page includes
        there = (page.parent / name).resolve() if name else page
        assert there.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(there), f"{page.name}: no heading for {target}"


def test_pictures_are_small() -> None:
    assert max(path.stat().st_size for path in DOCS.rglob("*.png")) < LARGEST


@pytest.mark.parametrize(
    "page",
    [
        "stiffness",
        "maps",
        "planning",
        "identification",
        "calibration",
        "models",
        "diagnosis",
        "exam",
        "compensation",
    ],
)
def test_a_method_has_its_picture(page: str) -> None:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    assert f"(pictures/{page}.png)" in text
    assert (DOCS / "pictures" / f"{page}.png").exists()


def test_every_page_is_in_the_table_of_contents() -> None:
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {
        line.strip() for block in re.findall(r"{toctree}(.*?)```", index, re.DOTALL) for line in block.split()
    }
    assert {page.stem for page in DOCS.glob("*.md")} - {"index"} <= listed


def test_the_citation_names_this_version_and_licence() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == __version__
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["license"] == "BSD-3-Clause"


def test_the_changelog_begins_with_what_is_unreleased() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## .*$", text, re.MULTILINE)[0] == "## [Unreleased]"
