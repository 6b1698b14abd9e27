"""No command changes a file that it did not make, whatever the file is, whatever becomes of the command."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from beamstiff.cli.main import app
from beamstiff.outputs import LEDGER
from tests.cli.conftest import CRANE, CRANE_DATA, PROGRAM
from tests.exam.standins import always_none

POINTS = """\
# sigma_position: 0.01 mm
q1 [deg],x,y,z
0,1,0,0
30,0.866,0.5,0
60,0.5,0.866,0
90,0,1,0
-40,0.766,-0.643,0
120,-0.5,0.866,0
"""
TURNED = """\
# sigma_position: 0.01 mm
# sigma_rotation: 0.001 deg
q1,fy,mz,dx,dy,dz,rx,ry,rz
0,1000,0,0,1.1e-3,0,0,0,1.2e-3
0.5,0,500,0,4e-4,0,0,0,7e-4
"""


def log() -> str:
    """Return a log of the crane at 25 Hz: three plateaus and two motions of one second between them."""
    t = np.arange(200) / 25
    part = np.clip(np.stack([t - 2, t - 5]), 0, 1)
    q = (0.5, -0.8) @ (part**2 * (3 - 2 * part))
    shaken = 1e-5 * np.sin(97.3 * np.arange(200) ** 2)
    rows = np.stack([t, q, 1.5 * np.cos(q) + shaken, 1.5 * np.sin(q) - shaken, 0.9 + 0 * q], axis=1)
    return "t,q1,x,y,z\n" + "".join(",".join(f"{cell:.6f}" for cell in row) + "\n" for row in rows)


INPUTS = {
    "log.csv": log(),
    "samples.yaml": "samples: true\ncolumns: {t: t, q1: q1, x: x, y: y, z: z}\n"
    "units: {length: m, q1: rad, t: s}\n",
    "crane.yaml": CRANE,
    "crane.csv": CRANE_DATA,
    "again.csv": CRANE_DATA.replace("1.5", "1.6"),
    "earlier.json": '{"rms_mm": 0.5}',
    "points.csv": POINTS,
    "turned.csv": TURNED,
    "forces.yaml": "kind: cutting-table\nvariable: way\nvalues: [0, 1]\nfz: [-900, -900]\n",
    "run.csv": "x,y,z\n1.5,-0.2,0.899\n1.5,0,0.899\n1.5,0.2,0.899\n",
    "cell.src": PROGRAM,
    "camp/robot.yaml": CRANE,
    "camp/batch-1.csv": CRANE_DATA,
    "camp/campaign.json": '{"format": "beamstiff-campaign/1", "region": null, "rows": 10, "seed": 0, '
    '"batches": [{"file": "batch-1.csv", "source": "crane.csv", "withdrawn": false}]}',
    "plan.csv": "q1 [deg],fy,dx,dy,dz\n0,900,,,\n0,-900,,,\n60,900,,,\n",
}
# each command with all of its outputs, an option and the name of a file each
COMMANDS: dict[str, tuple[tuple[str, ...], dict[str, str]]] = {
    "show": (("crane.yaml", "--samples", "5"), {}),
    "stiffness": (("crane.yaml",), {}),
    "deflect": (("crane.yaml", "crane.csv"), {"out": "o.csv", "vtu": "o.vtu", "html": "o.html"}),
    "identify": (
        ("crane.yaml", "turned.csv", "--folds", "0", "--pareto", "2"),
        {"out": "o.yaml", "reduce": "small.yaml", "figure": "o.PNG", "front": "f.png", "html": "o.html"},
    ),
    "calibrate": (
        ("crane.yaml", "points.csv", "--fix", "base", "--parameters", "q1", "--folds", "0"),
        {
            "out": "o.yaml", "readings": "r.csv", "sensitivity": "s.svg", "recursion": "r.pdf",
            "figure": "o.png", "html": "o.html",
        },
    ),
    "compare": (
        ("crane.yaml", "crane.csv", "--models", "rigid,nominal,fuzzy"),
        {"out": "o.yaml", "figure": "o.png", "rules": "r.svg", "html": "o.html"},
    ),
    "diagnose": (
        ("crane.yaml", "crane.csv"),
        {"next": "next.csv", "apply": "o.yaml", "residuals": "r.csv", "figure": "o.pdf", "html": "o.html"},
    ),
    "campaign": (("next", "camp"), {"out": "o.csv"}),
    "compare-runs": (("crane.yaml", "crane.csv", "again.csv"), {}),
    "verify": (("crane.yaml", "crane.csv"), {}),
    "check": (("earlier.json", "--max-gap", "1mm"), {}),
    "plan": (("crane.yaml", "--candidates", "20", "--tests", "3"), {"out": "o.csv"}),
    "map": (("crane.yaml", "--grid", "q1=-1:1:5"), {"out": "o.nc", "figure": "o.png"}),
    "compensate": (
        ("kr500", "cell.src", "--wrench", "fz=-900N", "--process", "forces.yaml", "--measured", "run.csv"),
        {"out": "o.src", "joints-out": "q.csv", "learned": "p.yaml", "figure": "o.png", "html": "o.html"},
    ),
    "convert": (("log.csv", "--profile", "samples.yaml"), {"out": "o.csv", "figure": "o.png"}),
    "exam": (
        ("crane.yaml", "--plan", "plan.csv", "--cases", "1", "--classes", "null", "--no-compare"),
        {"out": "o.jsonl", "reports": "reports", "figure": "o.png", "html": "o.html"},
    ),
    "doctor": (("--no-check",), {}),
    "schema": ((), {}),
}  # fmt: skip
# other names in a folder that commands know
OTHERS = (
    LEDGER, "o.nc.parts/job.json", "o.nc.parts/000000.chunk", "o.nc.parts/lock", "o.nc.parts/mine.txt",
    "reports/case-000000.json", ".beamstiff-mine", f".beamstiff-{12 * '0'}-{32 * '0'}",
)  # fmt: skip
INPUT_OPTIONS = {
    "region", "plan", "sets", "process", "actual", "profile", "joints", "joints-profile", "like", "test",
    "scheduler", "orientation", "apply-to", "positions", "std",
}  # fmt: skip


SAID: dict[str, str] = {}  # stdout of each command, as `earlier` runs it


def outputs_of(name: str) -> dict[str, str]:
    return {"json": "o.json", **COMMANDS[name][1]}


def typed(name: str) -> list[str]:
    return [name, *COMMANDS[name][0], *(word for o, f in outputs_of(name).items() for word in (f"--{o}", f))]


def test_every_output_of_every_command_is_tried() -> None:
    """What takes the name of a file and is no input is in the table above."""
    group: Any = typer.main.get_command(app)
    # the demo takes half a minute: its files are tried in test_demo
    commands = {name: one for name, one in group.commands.items() if name != "demo"}
    assert set(commands) == set(COMMANDS)
    for name, command in commands.items():
        named = {
            option.opts[0].removeprefix("--")
            for option in command.params
            if option.param_type_name == "option"
            and any(word in (option.metavar or "") for word in ("FILE", "FOLDER", "CSV", "YAML", "URDF"))
        }
        assert named - INPUT_OPTIONS == set(outputs_of(name)), name


@pytest.fixture(scope="module", autouse=True)
def quick(remembering: None) -> Iterator[None]:
    """Examine what is over soon, and calculate once what commands do with the same files."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)
        yield


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return folders with the inputs and what each command wrote there."""
    folders = {}
    SAID.clear()
    for name in COMMANDS:
        folder = folders[name] = tmp_path_factory.mktemp(name)
        lay_out(folder)
        result = run(name, folder)
        assert result.exit_code in (0, 2 if name == "doctor" else 0), result.output
        SAID[name] = result.stdout
    return folders


@pytest.mark.usefixtures("earlier")
@pytest.mark.parametrize("name", COMMANDS)
def test_files_are_named_once_behind_the_result(name: str) -> None:
    lines = SAID[name].splitlines()
    last = [line for line in lines if line.startswith("written: ")]
    assert lines[len(lines) - len(last) :] == last
    assert len(lines) > len(last) or name == "schema"
    for file in outputs_of(name).values():
        told = [line for line in lines if file in line.split() and not line.startswith(f"$ {file}")]
        assert [line.split()[:2] for line in told] == [["written:", file]] or file in ("reports", "next.csv")


def lay_out(folder: Path) -> None:
    for name, text in INPUTS.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(text.encode("latin-1"))


def run(name: str, folder: Path) -> Any:
    with chdir(folder):
        return CliRunner().invoke(app, typed(name), prog_name="beamstiff")


def state(folder: Path, outside: Path) -> dict[str, Any]:
    """Return all there is to know of the files below two folders."""
    found: dict[str, Any] = {}
    for path in sorted([*folder.rglob("*"), *outside.rglob("*")]):
        kind = "link" if path.is_symlink() else "folder" if path.is_dir() else "file"
        said: Any = os.readlink(path) if kind == "link" else None
        if kind == "file":
            said = path.read_bytes(), path.stat().st_mtime_ns, path.stat().st_ino
        found[str(path)] = kind, said
    return found


LOOKALIKES = (
    b"", b"\n", b"mine\n", b'{"precious": 1}', b'{"format": "beamstiff-diagnosis/1", "gap": {}}',
    b"\x89PNG\r\n\x1a\nmine",
    b"CDF\x02mine", b"%PDF-1.4 mine", b"<!DOCTYPE html><html>mine</html>", b"beamstiff: 1\nname: mine\n",
    b'{"format": "beamstiff-exam/1", "exam": {}}\nmine', b'{"format": "beamstiff-exam/1", "exam": {}}',
    b"# beamstiff-output sha256=" + 64 * b"0" + b"\nmine\n", b"# beamstiff-output sha256=" + 64 * b"a",
    CRANE.encode(), CRANE_DATA.encode(), PROGRAM.encode("latin-1"), b'{"format": "beamstiff-map-parts/2"}',
    b"# SHA-256 of files in this folder that beamstiff wrote, and may replace while they are unchanged\n",
)  # fmt: skip
KINDS = ("absent", "earlier", "edited", "text", "bytes", "folder", "link", "hard link", "input")
content = st.sampled_from(LOOKALIKES) | st.binary(max_size=40)
edits = st.tuples(st.sampled_from(("append", "flip", "cut")), st.integers(0, 10**6))


def edited(data: bytes, how: str, at: int) -> bytes:
    """Return a file that its user has changed."""
    at %= len(data)
    if how == "append":
        return data + b"\n"
    if how == "cut":
        return data[:at]
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def put(
    folder: Path, file: str, kind: str, data: bytes, edit: tuple[str, int], made: Path, outside: Path
) -> bool:
    """Put something under a name; return whether the user would lose something by its change.

    Empty files hold nothing to lose.
    """
    where = folder / file
    where.parent.mkdir(exist_ok=True)
    if kind in ("earlier", "edited"):
        if not made.is_file():
            return False
        shutil.copy2(made, where)
        if kind == "earlier":
            return False
        where.write_bytes(edited(where.read_bytes(), *edit))
        return where.stat().st_size > 0
    if kind == "folder":
        where.mkdir()
        (where / "mine.txt").write_bytes(data)
    elif kind in ("link", "hard link"):
        other = outside / f"{where.name}.mine"
        other.write_bytes(data)
        where.symlink_to(other) if kind == "link" else where.hardlink_to(other)
    elif kind == "input":
        where.symlink_to(folder / "crane.yaml")
    elif kind in ("text", "bytes"):
        where.write_bytes(data)
    return kind in ("folder", "input") or (kind != "absent" and data != b"")


@pytest.mark.parametrize("name", COMMANDS)
@settings(suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_what_a_command_did_not_write_stays(name: str, data: st.DataObject, earlier: dict[str, Path]) -> None:
    files = [file if file != "reports" else "reports/case-000000.json" for file in outputs_of(name).values()]
    with tempfile.TemporaryDirectory() as root:
        folder, outside = Path(root, "here"), Path(root, "there")
        folder.mkdir()
        outside.mkdir()
        lay_out(folder)
        if (made := earlier[name] / LEDGER).exists():
            shutil.copy2(made, folder / LEDGER)
        mine, blocked, log = {}, False, None
        for file in files:
            kind = data.draw(st.sampled_from(KINDS), label=file)
            theirs = put(
                folder, file, kind, data.draw(content), data.draw(edits), earlier[name] / file, outside
            )
            if file == "o.jsonl" and kind == "edited":  # may be what a kill left: added to, never replaced
                log, theirs = folder / file, False
            blocked |= theirs
            mine[str((folder / file).resolve())] = theirs
            mine[str(folder / file)] = theirs
        for other in data.draw(st.sets(st.sampled_from(OTHERS), max_size=3), label="others"):
            if not (folder / other).exists() and not (folder / other).parent.is_file():
                (folder / other).parent.mkdir(exist_ok=True)
                (folder / other).write_bytes(data.draw(content))
        ours = {path for path, theirs in mine.items() if not theirs} | {str(folder / LEDGER)}
        reads = [word for word in COMMANDS[name][0] if word in INPUTS]
        if broken := bool(reads) and data.draw(st.integers(0, 4), label="a broken input at 0") == 0:
            (folder / reads[0]).write_bytes(data.draw(st.sampled_from((b"", b"beamstiff: 2\n", b"\0"))))
        before = state(folder, outside)
        if (folder / LEDGER).exists() and not (earlier[name] / LEDGER).exists():
            ours.discard(str(folder / LEDGER))
        result = run(name, folder)
        after = state(folder, outside)
        event(f"{name}: exit {result.exit_code}")
        assert result.exit_code in (0, 2), result.output
        for path, was in before.items():
            if path not in ours:
                assert after.get(path) == was, (path, result.stderr)
        if log is not None:
            whole = before[str(log)][1][0].rpartition(b"\n")
            assert log.read_bytes().startswith(whole[0] + whole[1])
        if blocked or broken:
            assert result.exit_code == 2
            assert result.stderr.splitlines()[-1].startswith("error: ")
            assert after.keys() - {str(folder / "reports")} <= before.keys(), "nothing is written then"
            assert all(after[path] == was for path, was in before.items())


HEADS = {
    ".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".html": b"<!doctype html>", ".vtu": b"<?xml",
    ".json": b"{", ".jsonl": b"{", ".nc": b"CDF", ".urdf": b"<?xml", ".yaml": b"# ", ".csv": b"# ",
    ".src": b"DEF",
}  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_outputs_are_of_the_kind_that_their_name_says(name: str, earlier: dict[str, Path]) -> None:
    for file in outputs_of(name).values():
        if file != "reports":
            head = HEADS[Path(file).suffix.lower()].lower()
            assert (earlier[name] / file).read_bytes().lower().startswith(head)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_same_command_again_replaces_its_own(name: str, earlier: dict[str, Path]) -> None:
    before = {file: (earlier[name] / file).stat().st_mtime_ns for file in outputs_of(name).values()
              if (earlier[name] / file).is_file()}  # fmt: skip
    again = run(name, earlier[name])
    assert again.exit_code in (0, 2 if name == "doctor" else 0), again.output
    for file, when in before.items():
        if file != "o.jsonl":  # which had nothing to add
            assert (earlier[name] / file).stat().st_mtime_ns > when
