"""A command run in an empty folder, and a small robot whose answers are known by hand."""

import json
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from beamstiff.cli.main import app
from tests.remembered import remembered

Run = Callable[..., Any]
Refused = Callable[[str | Sequence[str], str | Sequence[str]], None]

# A rigid arm of 1 m on one elastic joint about z: along x at q1 = 0, along y at q1 = 90 deg.
CRANE = """\
beamstiff: 1
name: crane
variables:
  - {name: q1, type: revolute, limits: ["-170 deg", "170 deg"]}
frames:
  - {name: f1, theta: q1}
nodes:
  - {name: foot}
  - {name: hub, frame: f1}
  - {name: tip, frame: f1, at: ["1 m", 0, 0]}
rigids: [{name: arm, nodes: [hub, tip]}]
joints:
  - {name: J1, nodes: [foot, hub], frame: f1, axis: z, variable: q1,
     stiffness: {axial: "4e6 N/m", radial: "2e6 N/m", torsional: "1e6 N*m/rad", tilting: "8e6 N*m/rad"}}
fixed: [foot]
tcp: tip
identify: [J1.torsional]
"""

# What the crane does under these loads: across the arm 1/radial + 1 m^2/torsional, along it 1/radial.
CRANE_DATA = """\
# sigma_position: 0.01 mm
q1 [deg],fx,fy,dx [mm],dy [mm]
0,0,1000,0,1.5
0,1000,0,0.5,0
90,1000,0,1.5,0
45,1000,1000,0.5,0.5
"""

PROGRAM = (
    "DEF cell()\r\n"
    "  $BASE={FRAME: X 0,Y 0,Z 0,A 0,B 0,C 0}\r\n"
    "  PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\r\n"
    "  LIN {X 1500.000,Y -200.0,Z 900,A 0,B 110,C 0} C_DIS ; gr\xfc\xdfe\r\n"
    "  LIN {X 1500,Y    0.0,Z 900,A 0,B 110,C 0} C_DIS\r\n"
    "  LIN {X 1500,Y  200.0,Z 9.0E+02,A 0,B 110,C 0} C_DIS\r\n"
    "END\r\n"
)
TAUGHT = (
    *("--base-taught", "x=1500mm,y=-200mm,z=900mm"),
    *("--base-taught", "x=1900mm,y=-200mm,z=0.9"),
    *("--base-taught", "x=1500mm,y=200mm,z=900mm"),
)
FAR = PROGRAM.replace("Y    0.0", "Y 9000.0")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder, the present one, that holds `crane.yaml` and `crane.csv`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    (tmp_path / "crane.yaml").write_text(CRANE, encoding="utf-8")
    (tmp_path / "crane.csv").write_text(CRANE_DATA, encoding="utf-8")
    return tmp_path


@pytest.fixture
def cell(folder: Path) -> Path:
    """Return the folder, with two programs."""
    (folder / "cell.src").write_bytes(PROGRAM.encode("latin-1"))
    (folder / "far.src").write_bytes(FAR.encode("latin-1"))
    return folder


# what takes long and sees no file: module and name of a function, and what calculates once what it is asked
LONG = {
    (module, name): remembered(getattr(import_module(f"beamstiff.functions.{module}"), name))
    for module, name in (
        ("diagnose", "run"), ("measured_runs", "learn"), ("compensate", "compensate_program")
    )
}  # fmt: skip


@pytest.fixture(scope="module")
def remembering() -> Iterator[None]:
    """Calculate once, in all modules that ask for it, what commands do with the same robots and tables."""
    with pytest.MonkeyPatch.context() as patched:
        for (module, name), once in LONG.items():
            patched.setattr(import_module(f"beamstiff.functions.{module}"), name, once)
        yield


@pytest.fixture
def run(folder: Path) -> Run:
    """Return a function that runs `beamstiff`; its result has exit_code, stdout, stderr.

    The first argument is a line as it is typed, further ones are words of their own.
    """

    def invoke(typed: str = "", *words: str) -> Any:
        assert folder.is_dir()
        return CliRunner().invoke(app, [*shlex.split(typed), *words], prog_name="beamstiff")

    return invoke


@pytest.fixture
def succeed(run: Run) -> Run:
    """Return a function that runs what has to end with 0, and gives its result."""

    def invoke(*arguments: str) -> Any:
        result = run(*arguments)
        assert result.exit_code == 0, result.output
        return result

    return invoke


@pytest.fixture
def told(succeed: Run) -> Run:
    """Return a function that runs a command and gives its JSON."""
    return lambda *arguments: json.loads(
        succeed(*arguments, "--json", "-").stdout, parse_constant=pytest.fail
    )


@pytest.fixture
def refused(run: Run, folder: Path) -> Refused:
    """Return a function that runs what has to be refused (a line or words): 2, one line with given parts."""

    def check(arguments: str | Sequence[str], says: str | Sequence[str]) -> None:
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        result = run(arguments) if isinstance(arguments, str) else run(*arguments)
        assert (result.exit_code, result.stdout) == (2, ""), result.output
        assert re.fullmatch(r"error: .*\n", result.stderr), result.stderr
        assert "Traceback" not in result.stderr
        for part in [says] if isinstance(says, str) else says:
            assert part in result.stderr
        assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before

    return check
