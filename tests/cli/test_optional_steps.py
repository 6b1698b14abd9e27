"""A finished result is written although a step that it does not need fails: a note says what is missing."""

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot, save_robot, write_measurements
from beamstiff.errors import BeamstiffError, UnwritableError
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from tests.cli.conftest import CRANE, PROGRAM, Run
from tests.cli.test_calibrate import readings
from tests.exam.standins import always_none

pytestmark = pytest.mark.usefixtures("remembering")
REASON = "loop_1 does not close there"

# A joint that goes up and down, without limits, below the joint that gives way.
LIFT = (
    CRANE.replace("crane", "lift")
    .replace("variables:\n", "variables:\n  - {name: s, type: prismatic}\n")
    .replace("frames:\n  - {name: f1, ", "frames:\n  - {name: f0, r: s}\n  - {name: f1, parent: f0, ")
    .replace("{name: foot}", "{name: foot, frame: f0}")
    .replace('axial: "4e6 N/m", radial: "2e6 N/m"', "axial: rigid, radial: rigid")
    .replace('"8e6 N*m/rad"', "rigid")
)
# An arm that its drive hardly holds: pulled it is stiff, pushed by the same force it buckles.
SLACK = (
    LIFT.replace("  - {name: s, type: prismatic}\n", "")
    .replace("r: s", "r: 0")
    .replace('radial: rigid, torsional: "1e6', 'radial: "2e6 N/m", torsional: "1e3')
    .replace("identify: [J1.torsional]", "identify: [J1.radial]")
)


def with_play(folder: Path, text: str, q: Any, force: Any) -> tuple[str, str]:
    """Write a robot, and what it shows where its readings jump by 0.3 mm with the sign of the force."""
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    robot = load_robot(folder / "robot.yaml")
    names = [variable.name for variable in robot.actuated]
    wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
    table = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, sigma_position=1e-5)
    moved = predict_displacements(robot, table, preload=True)[:, :3]
    moved += 3e-4 * moved / np.linalg.norm(moved, axis=1, keepdims=True)
    moved += 1e-5 * np.random.default_rng(0).standard_normal(moved.shape)
    told = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=moved, sigma_position=1e-5)
    write_measurements(told, folder / "data.csv", robot)
    return "robot.yaml", "data.csv"


STEPS = np.array([0.5, 1.0, 0.5, -0.5, -1.0, -0.5])


def test_states_are_proposed_within_the_measured_range_of_a_free_length(folder: Path, told: Run) -> None:
    q = np.repeat([[0.0, 0.0], [0.2, 0.3], [0.4, -0.3], [0.1, 0.1]], len(STEPS), axis=0)
    ways = np.stack([-np.sin(q[:, 1]), np.cos(q[:, 1]), 0.0 * q[:, 1]], axis=1)
    given = with_play(folder, LIFT, q, 800.0 * ways * np.tile(STEPS, 4)[:, None])
    found = told("diagnose", *given, "--next", "next.csv")
    assert found["verdict"]["effect"] not in ("none", "unknown")
    lengths = np.array([state["q"]["s"] for state in found["next"]])
    assert len(np.unique(lengths)) > 4  # others than the four measured
    assert (lengths >= 0.0).all()
    assert (lengths <= 0.4).all()
    assert (folder / "next.csv").exists()


def test_a_posture_that_buckles_leaves_the_diagnosis_with_a_note(succeed: Run, folder: Path) -> None:
    q = np.repeat([[0.0], [0.3], [-0.3], [0.6], [-0.6], [0.9]], 3, axis=0)
    ways = np.stack([np.cos(q[:, 0]), np.sin(q[:, 0]), 0.0 * q[:, 0]], axis=1)
    force = 2000.0 * ways * np.tile([-0.05, 0.7, 1.0], 6)[:, None]
    result = succeed("diagnose", *with_play(folder, SLACK, q, force), "--json", "out.json")
    found = json.loads((folder / "out.json").read_text())
    assert found["next"] == []
    [note] = [text for text in found["notes"] if text.startswith("what to measure next is skipped: ")]
    assert "buckles" in note
    assert f"note: {note}\n" in result.stderr


def test_a_bootstrap_of_too_few_poses_leaves_the_fit_with_a_note(run: Run, folder: Path) -> None:
    result = run(*IDENTIFY, "--bootstrap", "20", "--json", "out.json")
    assert result.exit_code == 0, result.output
    assert "note: the bootstrap is skipped: crane.csv: found 3 poses" in result.stderr
    assert json.loads((folder / "out.json").read_text())["parameters"]["J1.torsional"]["value"] > 0


def fails(*_: Any, **__: Any) -> Any:
    raise BeamstiffError(REASON)


IDENTIFY = ("identify", "crane.yaml", "crane.csv")
DIAGNOSE = ("diagnose", "crane.yaml", "crane.csv")
DEFLECT = ("deflect", "crane.yaml", "crane.csv")
MAP = ("map", "crane.yaml", "--grid", "q1=-170deg:170deg:5")
CALIBRATE = ("calibrate", "arm.yaml", "poses.csv", "--fix", "base", "--parameters", "q2")
COMPARE = ("compare", "crane.yaml", "crane.csv", "--models", "rigid,nominal")
COMPENSATE = ("compensate", "kr500", "cell.src", "--wrench", "fz=-900N")
EXAM = ("exam", "kr240-2", "--cases", "2", "--seed", "5", "--classes", "null", "--no-compare")
MAIN = {
    "identify": "parameters",
    "diagnose": "which",
    "deflect": "displacement",
    "map": "quantities",
    "calibrate": "parameters",
    "compare": "split",
    "compensate": "targets",
    "exam": "headline",
}
STEPS_OF_COMMANDS = [
    (IDENTIFY, "beamstiff.functions.identify.with_separations", (), True),
    (IDENTIFY, "beamstiff.functions.identify.draw", ("--bootstrap", "10"), True),
    (IDENTIFY, "beamstiff.functions.identify.reduce_model", ("--reduce", "small.yaml"), True),
    (IDENTIFY, "beamstiff.report.residuals.residual_figure", ("--figure", "a.png"), False),
    (IDENTIFY, "beamstiff.report.html.identification.identification_html", ("--html", "a.html"), False),
    (DIAGNOSE, "beamstiff.diagnosis.apply.extended", ("--apply", "a.yaml"), False),
    (DIAGNOSE, "beamstiff.report.diagnosis.diagnosis_figure", ("--figure", "a.png"), False),
    (DIAGNOSE, "beamstiff.report.html.diagnosis.diagnosis_html", ("--html", "a.html"), False),
    (DEFLECT, "beamstiff.report.vtk.vtu_text", ("--vtu", "a.vtu"), False),
    (DEFLECT, "beamstiff.report.html.deflection.deflection_html", ("--html", "a.html"), False),
    (MAP, "beamstiff.report.workspace.map_figure", ("--figure", "a.png"), False),
    (CALIBRATE, "beamstiff.calibration.calibrate.held_out", (), True),
    (CALIBRATE, "beamstiff.functions.calibrate.errors_on", ("--test", "fresh.csv"), True),
    (CALIBRATE, "beamstiff.calibration.sensitivity.sensitivity_indices", ("--sensitivity", "a.png"), False),
    (CALIBRATE, "beamstiff.calibration.recursion.recursion", ("--recursion", "a.png"), False),
    (CALIBRATE, "beamstiff.report.html.calibration.calibration_html", ("--html", "a.html"), False),
    (COMPARE, "beamstiff.report.compare.models_figure", ("--figure", "a.png"), False),
    (COMPARE, "beamstiff.report.html.comparison.comparison_html", ("--html", "a.html"), False),
    (COMPENSATE, "beamstiff.report.compensation.compensation_figure", ("--figure", "a.png"), False),
    (COMPENSATE, "beamstiff.report.html.compensation.compensation_html", ("--html", "a.html"), False),
    (EXAM, "beamstiff.report.exam.reliability_figure", ("--figure", "a.png"), False),
    (EXAM, "beamstiff.report.html.exam.exam_html", ("--html", "a.html"), False),
]


@pytest.fixture
def inputs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder with what the commands read, and an exam that is over soon."""
    monkeypatch.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)
    robot = load_robot("kr500").with_parameters({f"J{k}.torsional": np.inf for k in range(1, 7)})
    save_robot(robot.model_copy(update={"identify": ()}), folder / "arm.yaml")
    for name, count in (("poses", 12), ("fresh", 8)):
        write_measurements(readings(robot, count, 1), folder / f"{name}.csv", robot)
    (folder / "cell.src").write_bytes(PROGRAM.encode("latin-1"))
    return folder


@pytest.fixture(scope="module")
def before_of() -> dict[str, Any]:
    """Return the JSON of each command where no step fails, as it is found."""
    return {}


@pytest.mark.parametrize(
    ("command", "step", "options", "in_json"),
    STEPS_OF_COMMANDS,
    ids=[f"{command[0]}-{step.rpartition('.')[2]}" for command, step, _, _ in STEPS_OF_COMMANDS],
)
def test_a_step_that_fails_becomes_a_note_beside_the_result(
    succeed: Run,
    inputs: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: tuple[str, ...],
    step: str,
    options: tuple[str, ...],
    in_json: bool,
    before_of: dict[str, Any],
    told: Run,
) -> None:
    if command[0] not in before_of:
        before_of[command[0]] = told(*command)
    module, _, name = step.rpartition(".")
    monkeypatch.setattr(import_module(module), name, fails)
    assert f"skipped: {REASON}\n" in succeed(*command, *options, "--json", "after.json").stderr
    before, after = before_of[command[0]], json.loads((inputs / "after.json").read_text())
    notes = after.get("notes") or []
    assert any(REASON in text for text in notes) == in_json
    main = MAIN[command[0]]
    assert after[main] == before[main]


@pytest.mark.parametrize("command", [IDENTIFY, DIAGNOSE, DEFLECT])
def test_a_page_that_cannot_be_written_is_an_error_after_the_result(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    def full(path: str, content: bytes) -> None:
        if path == "a.html":
            raise UnwritableError(f"{path}: cannot be written: no space left on device")
        Path(path).write_bytes(content)

    monkeypatch.setattr("beamstiff.outputs.write_whole", full)
    result = run(*command, "--html", "a.html", "--json", "out.json")
    assert result.exit_code == 2
    assert result.stderr.endswith("a.html: cannot be written: no space left on device\n")
    assert json.loads((folder / "out.json").read_text())
