import os
import subprocess
import sys
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.robot import library

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture
def three_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a package folder whose library holds three robots and a file that is none."""
    robots = tmp_path / "beamstiff" / "robots"
    robots.mkdir(parents=True)
    for name in ("kr500.yaml", "cantilever.yaml", "ir663.yaml", "README.md"):
        (robots / name).write_text("beamstiff: 1\n", encoding="utf-8")
    monkeypatch.setattr(library, "_PACKAGE", tmp_path / "beamstiff")
    return tmp_path / "beamstiff"


def test_a_checkout_offers_the_files_of_its_robots_folder() -> None:
    files = sorted((REPOSITORY / "robots").glob("*.yaml"), key=lambda file: file.stem)
    assert library._robots_folder(library._PACKAGE) == REPOSITORY / "robots"
    assert library.robot_names() == [file.stem for file in files]
    assert [library.robot_path(file.stem) for file in files] == files


def test_names_are_sorted_and_leave_out_what_is_no_robot(three_robots: Path) -> None:
    assert library.robot_names() == ["cantilever", "ir663", "kr500"]
    assert library.robot_path("ir663") == three_robots / "robots" / "ir663.yaml"


@pytest.mark.usefixtures("three_robots")
def test_an_unknown_name_is_answered_with_a_close_one_and_all_there_are() -> None:
    with pytest.raises(BeamstiffError, match=r"'ir666'.*did you mean 'ir663'.*cantilever, ir663, kr500"):
        library.robot_path("ir666")


@pytest.mark.usefixtures("three_robots")
@pytest.mark.parametrize("name", ["", ".", "../robots/ir663", "ir663.yaml", "README"])
def test_a_path_is_not_a_name(name: str) -> None:
    with pytest.raises(BeamstiffError, match="no robot of this name"):
        library.robot_path(name)


def test_the_folder_inside_the_package_wins_over_the_one_beside_it(three_robots: Path) -> None:
    (three_robots.parent / "robots").mkdir()
    assert library.robot_path("kr500").parent == three_robots / "robots"


def test_an_installation_without_robots_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_PACKAGE", tmp_path)
    with pytest.raises(BeamstiffError, match=r"robots that come with beamstiff are missing"):
        library.robot_names()


@pytest.mark.slow  # builds and installs a wheel, which fetches the build backend
def test_a_wheel_carries_the_robots(tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(tmp_path)]
    subprocess.run([*pip, str(REPOSITORY)], check=True)
    script = "from beamstiff.robot.library import *; print(*map(robot_path, robot_names()), sep='\\n')"
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, env=environment, cwd=tmp_path, check=True, capture_output=True, text=True)
    files = sorted((REPOSITORY / "robots").glob("*.yaml"), key=lambda file: file.stem)
    assert (tmp_path / "beamstiff" / "robots" / "README.md").is_file()
    assert run.stdout.split() == [str(tmp_path / "beamstiff" / "robots" / file.name) for file in files]
