"""`beamstiff doctor` names what is missing and what mends it; completion, help, colours of every command."""

import pytest
from typer.testing import CliRunner

from beamstiff import __version__
from beamstiff.cli import doctor
from beamstiff.cli.main import app
from tests.cli.conftest import Refused, Run


def test_it_says_versions_optional_parts_and_the_self_check(run: Run) -> None:
    result = run("doctor")
    assert (result.exit_code, result.stderr) == (0, "")
    for word in (__version__, "numpy", "scipy", "numba", "Self check: right", "show ir663"):
        assert word in result.stdout


def test_json_holds_the_same(told: Run) -> None:
    facts = told("doctor")
    assert facts["self_check"]["error"] < 1e-12
    assert facts["problems"] == []
    assert {"numpy", "scipy", "typer"} <= {one["name"] for one in facts["needed"]}
    assert {one["extra"] for one in facts["optional"]}.isdisjoint({"dev", "docs"})


def test_quiet_prints_nothing(run: Run) -> None:
    result = run("doctor --quiet --no-check")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_a_missing_and_an_old_library_are_named_with_what_installs_them(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = ["numpy>=99", "no-such-library>=2", "also-not-there>=1; extra == 'rare'"]
    monkeypatch.setattr(doctor.metadata, "requires", lambda _: wanted)
    result = run("doctor")
    assert result.exit_code == 2
    assert "numpy 2." in result.stderr
    assert "(pip install 'numpy>=99')" in result.stderr
    assert "no-such-library is missing" in result.stderr
    assert "pip install 'also-not-there>=1'" in result.stdout  # optional: told, no fault
    assert "also-not-there" not in result.stderr


def test_where_it_is_not_installed_it_says_how(monkeypatch: pytest.MonkeyPatch, refused: Refused) -> None:
    def requires(name: str) -> list[str]:
        raise doctor.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(doctor.metadata, "requires", requires)
    refused(["doctor"], "pip install .")


def test_a_library_that_calculates_wrong_is_a_problem(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = {"expected": 1.0, "found": 1.001, "error": 1e-3, "s": 0.1}
    monkeypatch.setattr(doctor, "self_check", lambda: wrong)
    result = run("doctor")
    assert result.exit_code == 2
    assert "the cantilever turns 1.001 rad/N, expected 1" in result.stderr
    assert "Self check: WRONG" in result.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_completion_is_there_for_any_shell(succeed: Run, shell: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # the shell that is named, not the one that happens to run the tests
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    result = succeed(f"--show-completion {shell}")
    assert "_BEAMSTIFF_COMPLETE" in result.stdout
    assert f"complete_{shell}" in result.stdout


ROBOTS = ["kr240-2", "kr500"]  # that come along


@pytest.mark.parametrize(
    ("typed", "expected"),
    [("dia", ["diagnose"]), ("show kr", ROBOTS), ("stiffness kr", ROBOTS), ("diagnose kr", ROBOTS)],
)
def test_completion_completes(monkeypatch: pytest.MonkeyPatch, typed: str, expected: list[str]) -> None:
    monkeypatch.setenv("_BEAMSTIFF_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"beamstiff {typed}")
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split())))
    assert CliRunner().invoke(app, [], prog_name="beamstiff").stdout.split() == expected
