"""What the README and the pages behind it show is what happens."""

import doctest
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from beamstiff import load_robot, read_measurements
from beamstiff.cli.main import app
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import rotation_from_vector

REPOSITORY = Path(__file__).resolve().parents[2]
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
PAGES = {
    name: (REPOSITORY / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("demo", "formats")
}


def block(mark: str) -> str:
    """Return the code block after a comment that marks it."""
    found = re.search(rf"<!-- {mark} -->\n```\w*\n(.*?)```", "\n".join(PAGES.values()), re.DOTALL)
    assert found is not None, f"docs: no block marked {mark}"
    return found[1]


@pytest.fixture
def crane(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder, the present one, with the robot and the table of the page on formats."""
    (tmp_path / "crane.yaml").write_text(block("robot"), encoding="utf-8")
    (tmp_path / "crane.csv").write_text(block("data"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_python_of_the_readme_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPOSITORY)
    session = "\n".join(re.findall(r"```pycon\n(.*?)```", README, re.DOTALL))
    example = doctest.DocTestParser().get_doctest(session, {}, "README.md", "README.md", 0)
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example)
    assert runner.summarize(verbose=False) == (0, len(example.examples))
    assert len(example.examples) > 5


def test_the_readme_is_a_page() -> None:
    """Of at most 900 words, tables and code among them, whose links lead somewhere."""
    assert len(README.split()) <= 900
    for link in re.findall(r"\]\(([^)]+)\)", README):
        assert (REPOSITORY / link).exists(), link


def test_robot_and_table_of_the_formats_are_read(crane: Path) -> None:
    robot = load_robot(crane / "crane.yaml")
    assert (robot.name, len(read_measurements(crane / "crane.csv", robot))) == ("crane", 6)
    assert len(block("robot").splitlines()) <= 32
    assert len(block("data").splitlines()) <= 10


def test_the_angles_of_the_formats_are_where_its_robot_stands(crane: Path) -> None:
    robot = load_robot(crane / "crane.yaml")
    (crane / "angles.csv").write_text(block("angles"), encoding="utf-8")
    table = read_measurements(crane / "angles.csv", robot)
    kinematics = compile_kinematics(robot)
    poses = pose_of(kinematics, posture(kinematics, table.q), robot.tcp)
    np.testing.assert_allclose(table.position, poses[:, :3, 3], atol=1e-5)
    np.testing.assert_allclose(rotation_from_vector(table.rotation), poses[:, :3, :3], atol=1e-9)
    turned = Rotation.from_euler("ZYX", [[0, -30, 90], [60, 20, 90]], degrees=True)
    np.testing.assert_allclose(poses[:, :3, :3], turned.as_matrix(), atol=1e-9)


def test_the_table_of_the_formats_is_what_its_robot_does(crane: Path) -> None:
    runner, files = CliRunner(), [str(crane / "crane.yaml"), str(crane / "crane.csv")]
    found = json.loads(runner.invoke(app, ["identify", *files, "--json", "-"]).stdout)
    stiffness = {name: item["value"] for name, item in found["parameters"].items()}
    # the table is rounded to 0.01 mm of some tenths: a few percent
    assert stiffness == pytest.approx({"J1.torsional": 2e6, "J2.torsional": 1e6}, rel=0.1)
    assert found["rms_mm"] < 0.01


def commands() -> list[str]:
    blocks = re.findall(r"```\n(.*?)```", "\n".join((README, *PAGES.values())), re.DOTALL)
    lines = (line for text in blocks for line in text.splitlines() if line.startswith("beamstiff "))
    return list(dict.fromkeys(lines))


@pytest.mark.parametrize("command", commands())
def test_commands_of_the_readme_work(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = [
        str(REPOSITORY / word) if word.startswith("examples/") else word for word in shlex.split(command)[1:]
    ]
    result = CliRunner().invoke(app, arguments)
    assert (result.exit_code, result.stderr) == (0, "")


def test_the_readme_names_every_command() -> None:
    for command in app.registered_commands:
        name = command.callback.__name__.replace("_", "-")
        assert f"`beamstiff {name} " in README
