"""How commands end: exit codes, Ctrl-C, pipes, colours, faults of ours."""

import json
import os
import signal
import subprocess
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, __version__, examine, load_robot
from beamstiff.cli.main import app
from beamstiff.cli.output import files_last, json_text, working, write_robot
from beamstiff.stages import stage
from tests.cli.conftest import Run

WITHOUT_FRAMES = {"campaign", "check", "compare", "compare-runs", "convert"}
WITHOUT_FRAMES |= {"demo", "diagnose", "doctor", "exam", "schema"}
COMMAND = [sys.executable, "-m", "beamstiff"]
REFUSED = ["check", "none.json", "--max-gap", "1mm"]  # which loads little


def shell(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own, its output through pipes."""
    return subprocess.run(
        [*COMMAND, *arguments],
        env=os.environ | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


def test_a_process_ends_with_0_or_2_and_pipes_get_whole_lines_without_colours(folder: Path) -> None:
    good = shell("stiffness", "crane.yaml", "--json", "good.json", COLUMNS="40")
    assert (good.returncode, good.stderr) == (0, "")
    assert json.loads((folder / "good.json").read_text())["tcp"] == [1.0, 0.0, 0.0]
    assert "\x1b" not in good.stdout
    assert any("fx [N]" in line and "mz [N m]" in line for line in good.stdout.splitlines())
    bad = shell("stiffness", "crane.yml", "--json", "bad.json", COLUMNS="40")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr == "error: crane.yml: no such file (did you mean 'crane.yaml'?)\n"
    assert not (folder / "bad.json").exists()


def test_the_installed_script_is_the_same_command() -> None:
    script = Path(sys.executable).with_name("beamstiff")
    if not script.exists():
        pytest.skip("beamstiff is not installed as a script here")
    result = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert result.stdout == f"beamstiff {__version__}\n"


def test_a_fault_of_ours_ends_with_1_and_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("in two\nlines")

    monkeypatch.setattr("beamstiff.robot.reader.parse_robot", fail)
    result = run("stiffness crane.yaml --json a.json")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.startswith(
        "internal error: ZeroDivisionError: in two lines: a fault of beamstiff, please report"
    )
    assert result.stderr.count("\n") == 1
    assert not Path("a.json").exists()

    result = run("stiffness crane.yaml --debug")
    assert result.exit_code == 1
    assert "Traceback (most recent call last)" in result.stderr


def test_debug_shows_where_bad_input_was_found(run: Run) -> None:
    result = run("stiffness crane.yaml --q q1=x --debug")
    assert result.exit_code == 2
    assert "Traceback" in result.stderr
    assert result.stderr.splitlines()[-1].startswith("error: --q: q1")


def test_ctrl_c_while_a_file_is_written_leaves_the_old_one(
    run: Run, succeed: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    succeed("stiffness crane.yaml --q q1=1 --json out.json")
    before, old = sorted(folder.iterdir()), (folder / "out.json").read_bytes()

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("beamstiff.files.os.replace", interrupt)
    result = run("stiffness crane.yaml --json out.json")
    assert (result.exit_code, result.stderr) == (130, "interrupted\n")
    assert (folder / "out.json").read_bytes() == old
    assert sorted(folder.iterdir()) == before


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_ctrl_c_ends_a_process_with_130_and_no_traceback(folder: Path) -> None:
    os.mkfifo(folder / "slow.yaml")
    process = subprocess.Popen(
        [*COMMAND, "stiffness", "./slow.yaml", "--json", "out.json"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        # tests that run in the background (nohup, some build servers) hand on a Ctrl-C that is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    with (folder / "slow.yaml").open("w"):  # opens once the process reads, and then it waits for us
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    assert (process.returncode, stdout, stderr) == (130, "", "interrupted\n")
    assert not (folder / "out.json").exists()


def test_colours_are_for_terminals_that_want_them() -> None:
    wanted = shell(*REFUSED, FORCE_COLOR="1", TERM="xterm", NO_COLOR="")
    refused = shell(*REFUSED, FORCE_COLOR="1", TERM="xterm", NO_COLOR="1")
    assert "\x1b[31m" in wanted.stderr
    assert "\x1b[3" not in refused.stderr


def test_an_old_code_page_loses_signs_but_not_the_answer(folder: Path) -> None:
    assert folder.is_dir()
    result = shell("show", "crane.yaml", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert (result.returncode, result.stderr) == (0, "")
    assert "tip by arm" in result.stdout


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX shell")
def test_a_reader_that_goes_away_causes_no_traceback(folder: Path) -> None:
    assert folder.is_dir()
    for arguments in ("show", "stiffness crane.yaml --json -"):
        line = f"'{sys.executable}' -m beamstiff {arguments} | true"
        result = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=120, check=False)
        assert result.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments",
    [("show",), ("--version",), ("stiffness", "crane.yaml", "--json", "-")],
)
def test_a_stdout_that_takes_nothing_is_told_in_one_line(folder: Path, arguments: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [*COMMAND, *arguments], cwd=folder, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert ended.stderr == "error: stdout: cannot be written: no space left on device\n"
    assert ended.returncode == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_stderr_that_takes_nothing_leaves_the_exit_code(folder: Path) -> None:
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [*COMMAND, *REFUSED], cwd=folder, stdout=subprocess.PIPE, stderr=full, check=False
        )
        both = subprocess.run([*COMMAND, "show"], stdout=full, stderr=full, check=False)
    assert (ended.returncode, ended.stdout) == (2, b"")
    assert both.returncode == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_told_in_one_line(run: Run) -> None:
    result = run("stiffness crane.yaml --quiet --json /dev/full")
    assert result.exit_code == 2
    assert result.stderr == "error: /dev/full: cannot be written: no space left on device\n"


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help_names_the_commands_and_the_exit_codes(run: Run, arguments: list[str]) -> None:
    result = run(*arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    for word in ("show", "stiffness", "deflect", "identify", "plan", "Exit code", "base frame"):
        assert word in result.stdout


@pytest.mark.parametrize(
    "command", [one.callback.__name__.replace("_", "-") for one in app.registered_commands if one.callback]
)
def test_the_help_of_every_command_teaches(run: Run, command: str) -> None:
    text = run(f"{command} --help").stdout
    assert f"\n    beamstiff {command}" in text
    assert all(part in text for part in ("Example", "--json", "--quiet", "--debug"))
    assert "base frame" in " ".join(text.lower().split()) or command in WITHOUT_FRAMES
    assert "\x1b" not in text, "no colours in a pipe"


def test_the_version_is_that_of_the_package(run: Run) -> None:
    assert run("--version").stdout == f"beamstiff {__version__}\n"


def test_help_needs_none_of_the_heavy_libraries() -> None:
    script = (
        "import sys, beamstiff.cli.main as main\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'matplotlib', 'networkx', 'pint', 'pydantic'}\n"
        "heavy &= set(sys.modules)\n"
        "import json; print(json.dumps(sorted(heavy)))"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert json.loads(result.stdout) == []


@pytest.mark.parametrize(("stated", "expected"), [(None, "1"), ("3", "3")])
def test_linear_algebra_has_one_thread_unless_told_otherwise(stated: str | None, expected: str) -> None:
    code = (
        "import os, sys; from beamstiff.cli.main import app; "
        "app(['--version'], standalone_mode=False); "
        "assert 'numpy' not in sys.modules; print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    if stated is not None:
        environment["OPENBLAS_NUM_THREADS"] = stated
    python = [sys.executable, "-c", code]
    done = subprocess.run(python, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == expected


@pytest.mark.skipif(sys.platform == "win32", reason="pipes end otherwise there")
def test_files_are_written_though_nobody_reads_the_tables(folder: Path) -> None:
    command = [*COMMAND, "identify", "crane.yaml", "crane.csv", "--out", "found.yaml", "--json", "found.json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        running.stdout.close()  # as `| head -0` does
        _, errors = running.communicate(timeout=120)
    assert (running.returncode, b"Traceback" in errors) == (0, False)
    assert json.loads((folder / "found.json").read_text())["parameters"]
    assert "J1" in (folder / "found.yaml").read_text()


leaves = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)
plain = st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=30)


@given(plain)
def test_json_is_read_back_the_same(value: Any) -> None:
    assert json.loads(json_text(value)) == value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [1.0, float("-inf")], {"a": [[float("nan")]]}])
def test_json_never_holds_what_is_no_number(value: Any) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_text(value)


def test_a_matrix_has_a_line_a_row() -> None:
    assert json_text([[1, 2], [3, 4]]) == "[\n  [1, 2],\n  [3, 4]\n]"


def test_a_robot_written_from_a_written_robot_is_replaced_like_any_output(succeed: Run) -> None:
    for robot, out in (("crane.yaml", "a.yaml"), ("a.yaml", "b.yaml"), ("a.yaml", "b.yaml")):
        succeed(f"identify {robot} crane.csv --out {out}")


def test_reports_of_an_exam_replace_nothing_of_the_users_whoever_asks_for_them(folder: Path) -> None:
    report = folder / "reports" / "case-000001.json"
    report.parent.mkdir()
    report.write_text("my notes")
    with pytest.raises(BeamstiffError, match=r"case-000001\.json: exists"):
        examine("kr240-2", cases=2, classes=["null"], reports="reports")
    assert [(path.name, path.read_text()) for path in report.parent.iterdir()] == [(report.name, "my notes")]


def test_long_work_says_what_it_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = list[str]()
    monkeypatch.setattr("beamstiff.cli.output._console", lambda **_: Terminal(shown))
    with working("diagnosing"):
        stage("calibrating")
    stage("nobody listens any more")
    assert shown == ["diagnosing ...", "diagnosing: calibrating ..."]


class Terminal:
    """A terminal that keeps its status lines."""

    is_terminal = True

    def __init__(self, shown: list[str]) -> None:
        self.update = shown.append

    def status(self, text: str) -> AbstractContextManager["Terminal"]:
        self.update(text)
        return nullcontext(self)


@pytest.mark.parametrize("ending", [".yaml", ".urdf"])
def test_a_robot_is_written_as_its_path_ends(tmp_path: Path, ending: str) -> None:
    robot = load_robot("kr240-2")
    to = tmp_path / f"fitted{ending}"
    with files_last():
        write_robot(str(to), robot, tmp_path / "given.urdf", {}, "# fitted\n")
    assert load_robot(to).parameter("J2.torsional") == pytest.approx(robot.parameter("J2.torsional"))
