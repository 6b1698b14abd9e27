"""One function a command: paths and names do what objects do, and `--json` is `to_dict()`."""

import html
import io
import json
from collections.abc import Callable
from contextlib import chdir
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

import beamstiff
from beamstiff.cli.main import app
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.next_measurement.outlook import outlook
from beamstiff.diagnosis.notes import MASSLESS
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.functions.campaign import CampaignState
from beamstiff.functions.examine import Examination
from beamstiff.maps.summary import summary
from beamstiff.measure.table import make_measurements
from beamstiff.report.shown import notes_of
from beamstiff.robot.library import robot_path
from beamstiff.robot.parts import AddedEffect
from beamstiff.shown import Shown
from tests.diagnosis.planted import diagnosed
from tests.exam.answered import of_every_kind
from tests.remembered import remembered

DATA = Path(__file__).parents[1] / "examples" / "data" / "ir663_compliance_xx.csv"
Q = {"q2": 0.1, "q8": 0.8}
GRID = {"q2": np.linspace(-0.1, 0.1, 2), "q8": np.linspace(0.7, 0.9, 2)}
WITHOUT = [name for name in EFFECTS if name not in ("actuator-lever", "tool-compliance")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with readings of absolute positions, and a path of the KR 500."""
    folder = tmp_path_factory.mktemp("public")
    robot = beamstiff.load_robot("kr500")
    q = np.random.default_rng(0).uniform(-1, 1, (40, 6))
    seen = beamstiff.forward_kinematics(robot, q)[:, :3, 3] + 1e-4
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, position=seen, sigma_position=1e-5)
    beamstiff.write_measurements(rows, folder / "poses.csv", robot)
    head = "# orientation: KUKA ABC\nx [mm],y [mm],z [mm],a [deg],b [deg],c [deg],fz [N]\n"
    path = head + "1500,0,900,0,90,0,-500\n1500,100,900,0,90,0,-500\n"
    (folder / "path.csv").write_text(path, encoding="utf-8")
    return folder


Call = Callable[[Any, Any], dict[str, Any]]
# robot, data, function of both, and the command's arguments beside them
CASES: dict[str, tuple[str, str | None, Call, list[str]]] = {
    "identify": (
        "ir663",
        str(DATA),
        lambda r, d: beamstiff.identify(r, d, bootstrap=50).to_dict(),
        ["--bootstrap", "50"],
    ),
    "diagnose": (
        "ir663",
        str(DATA),
        lambda r, d: beamstiff.diagnose(r, d, seed=1, without=WITHOUT).to_dict(),
        ["--seed", "1", "--without", ",".join(WITHOUT)],
    ),
    "deflect": ("ir663", str(DATA), lambda r, d: beamstiff.predict(r, d).to_dict(), []),
    "compare": (
        "ir663",
        str(DATA),
        lambda r, d: beamstiff.compare(r, d, models=["rigid", "parametric"]).to_dict(),
        ["--models", "rigid,parametric"],
    ),
    "calibrate": (
        "kr500",
        "poses.csv",
        lambda r, d: beamstiff.calibrate(r, d, ["q2", "f3.d"], priors={"f3.d": "1 mm"}).to_dict(),
        ["--parameters", "q2,f3.d", "--prior", "f3.d=1mm"],
    ),
    "compensate": ("kr500", "path.csv", lambda r, d: beamstiff.compensate(r, d).to_dict(), []),
    "plan": (
        "ir663",
        None,
        lambda r, _: beamstiff.plan(r, tests=8, candidates=20).to_dict(),
        ["--tests", "8", "--candidates", "20"],
    ),
    "stiffness": ("ir663", None, lambda r, _: beamstiff.stiffness(r, Q).to_dict(), ["--q", "q2=0.1,q8=0.8"]),
    "map": (
        "ir663",
        None,
        lambda r, _: summary(beamstiff.map_workspace(r, GRID)),
        ["--grid", "q2=-0.1:0.1:2,q8=0.7:0.9:2"],
    ),
}
TIMES = ("seconds",)  # that a fit took


def same(found: Any, expected: Any) -> bool:
    """Return whether plain data are alike but for how long something took, and from where it came."""
    if isinstance(found, dict):
        known = found.keys() - {*TIMES, "provenance", "out"}
        return known == expected.keys() - {*TIMES} and all(same(found[key], expected[key]) for key in known)
    if isinstance(found, list | tuple):
        return len(found) == len(expected) and all(map(same, found, expected))
    return bool(found == expected)


def as_json(value: Any) -> Any:
    return json.loads(json.dumps(value))


@pytest.mark.parametrize("command", CASES)
def test_a_command_writes_what_its_function_returns_whether_of_paths_or_objects(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    module = import_module("beamstiff.functions.diagnose")
    monkeypatch.setattr(module, "run", remembered(module.run))  # the longest: once for equal arguments
    name, data, function, options = CASES[command]
    robot = beamstiff.load_robot(name)
    given: Any = data
    if data is not None and command != "compensate":
        given = beamstiff.read_measurements(data, robot)
    by_path = as_json(function(name, None if data is None else Path(data)))
    assert same(by_path, as_json(function(robot, given)))
    said = CliRunner().invoke(app, [command, name, *([data] if data else []), *options, "--json", "-"])
    assert said.exit_code == 0, said.stderr
    assert same(json.loads(said.stdout), by_path)


def test_identify_takes_the_effects_of_the_robot_off_the_readings_as_the_command_does() -> None:
    """A load cell that reads a tenth too little: known as an effect, it leaves the drives their stiffness."""
    robot = beamstiff.load_robot("ir663")
    rows = beamstiff.read_measurements(DATA, robot)
    cell = AddedEffect(
        effect="load-error", shape="gain by axis", parameters={"gain_x": 0.1}, scales={"force": 900.0}
    )
    larger = robot.model_copy(update={"effects": (cell,)})
    seen = beamstiff.predict(larger, rows).displacement
    made = replace(rows, displacement=np.where(rows.measured_mask, seen, np.nan))
    found, without = (beamstiff.identify(one, made, folds=0) for one in (larger, robot))
    known = [item.name for item in found.parameters if item.value is not None]
    assert known
    for name in known:
        assert found[name].value == pytest.approx(robot.parameter(name), rel=1e-4)
        assert without[name].value < 0.95 * robot.parameter(name)
    assert found.robot.effects == larger.effects


# what every function returns, for little work
RESULTS: dict[str, Callable[[], Any]] = {
    "identify": lambda: beamstiff.identify("ir663", DATA, folds=0),
    "calibrate": lambda: beamstiff.calibrate("kr500", "poses.csv", ["q2"], folds=0),
    "compare": lambda: beamstiff.compare("ir663", DATA, models=["rigid", "parametric"]),
    "compare_runs": lambda: beamstiff.compare_runs("ir663", DATA, "later.csv"),
    "diagnose": lambda: diagnosed("backlash"),
    "verify": lambda: beamstiff.verify("ir663", DATA),
    "campaign": lambda: beamstiff.campaign("ir663", [], rows=6),
    "campaign with a batch": lambda: batch(diagnosed("backlash")),
    "predict": lambda: beamstiff.predict("ir663", DATA),
    "predict positions": lambda: beamstiff.predict("kr500", "poses.csv"),
    "plan": lambda: beamstiff.plan("ir663", tests=8, candidates=20),
    "compensate": lambda: beamstiff.compensate("kr500", "path.csv"),
    "stiffness": lambda: beamstiff.stiffness("ir663", Q),
    "examine": lambda: Examination(of_every_kind(), {}),
    "load_robot": lambda: beamstiff.load_robot("ir663"),
}
TABLES_ONLY = {"compare_runs", "verify", "plan", "stiffness", "examine", "campaign"}  # without a batch


def batch(found: Diagnosis) -> CampaignState:
    return CampaignState(12, found, outlook(found), 0, "")


@pytest.fixture(scope="module")
def results(folder: Path) -> dict[str, Any]:
    (folder / "later.csv").write_text(DATA.read_text(encoding="utf-8"), encoding="utf-8")
    with chdir(folder):
        return {name: make() for name, make in RESULTS.items()}


def test_everything_that_shows_itself_is_among_the_results(results: dict[str, Any]) -> None:
    for name in beamstiff.__all__:
        getattr(beamstiff, name)  # loads it
    assert {type(result) for result in results.values()} == set(Shown.__subclasses__())


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_printed_with_its_notes_each_once(name: str, results: dict[str, Any]) -> None:
    result = results[name]
    assert "\n" not in repr(result)
    assert repr(result).startswith(f"<{type(result).__name__}: ")
    assert repr(result) != f"<{type(result).__name__}: {type(result).__name__}>"
    console = Console(file=io.StringIO(), width=200, record=True)
    console.print(result)
    page = html.unescape(result._repr_html_())
    for text in (console.export_text(), str(result), page):
        words = " ".join(text.split())
        for note in notes_of(result):
            assert words.count(" ".join(note[1:].split())) == 1


@pytest.mark.parametrize("name", sorted({*RESULTS} - {"load_robot", "campaign"}))
def test_what_to_mind_is_said_wherever_a_result_shows_itself(name: str, results: dict[str, Any]) -> None:
    result, notes = results[name], ("fz is <reversed>", "is fx too?", "fz is <reversed>")
    if isinstance(result, CampaignState):
        assert result.diagnosis is not None
        result = replace(result, diagnosis=replace(result.diagnosis, notes=notes))
    else:
        result = replace(result, notes=notes)
    for text in (str(result), html.unescape(result._repr_html_())):
        assert text.count("Mind: fz is <reversed>.") == 1
        assert text.count("Mind: is fx too?") == 1
        assert "?." not in text


def test_a_doubt_of_the_verdict_is_no_note_again() -> None:
    result = replace(diagnosed("backlash"), notes=(MASSLESS,))
    assert " ".join(str(result).lower().split()).count(MASSLESS.lower()) == 1


def test_long_notes_are_printed_to_the_last_name() -> None:
    """Of an arm whose drives have long names, what was chosen for it is said whole."""
    arm = beamstiff.load_robot("kr240-2").model_copy(update={"identify": ()})
    names = {joint.name: f"{joint.name}_of_the_arm_beside_the_conveyor" for joint in arm.joints}
    joints = [joint.model_copy(update={"name": names[joint.name]}) for joint in arm.joints]
    found = beamstiff.plan(arm.model_copy(update={"joints": tuple(joints)}), tests=8, candidates=20)
    said = " ".join(str(found).split())
    assert all(f"{name}.torsional" in said.partition("Mind: ")[2] for name in names.values())
    assert "...." not in said


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_drawn_or_says_that_there_are_tables_only(name: str, results: dict[str, Any]) -> None:
    if name not in TABLES_ONLY:
        assert results[name].plot()._repr_png_().startswith(b"\x89PNG")
        return
    with pytest.raises(beamstiff.BeamstiffError, match=r"of which there (are tables|is nothing)"):
        results[name].plot()


def test_a_prediction_draws_what_was_measured_beside_what_is_predicted(results: dict[str, Any]) -> None:
    found = results["predict"]
    above, below = found.plot().axes
    predicted, measured = (line.get_ydata() for line in above.lines)
    np.testing.assert_allclose(measured, 1e3 * np.abs(found.rows.displacement[:, 0]))  # x alone was measured
    np.testing.assert_allclose(predicted, 1e3 * np.abs(found.displacement[:, 0]))
    np.testing.assert_allclose(below.lines[0].get_ydata(), 1e3 * found.gap)
    assert below.get_xlabel() == "line of the table"
    bare = replace(found, rows=replace(found.rows, displacement=np.full_like(found.displacement, np.nan)))
    (alone,) = bare.plot().axes
    np.testing.assert_allclose(
        alone.lines[0].get_ydata(), 1e3 * np.linalg.norm(found.displacement[:, :3], axis=1)
    )


def test_a_plan_finds_the_drives_of_a_robot_that_names_nothing_as_identify_does() -> None:
    named = beamstiff.load_robot("kr240-2")
    unnamed = named.model_copy(update={"identify": ()})
    found, same = (beamstiff.plan(one, tests=8, candidates=20) for one in (unnamed, named))
    assert found.to_dict() == same.to_dict()
    assert "names nothing under `identify:`" in found.notes[0]
    assert same.notes == ()


@pytest.mark.parametrize("name", ["identify", "diagnose", "predict", "compare", "calibrate"])
@pytest.mark.parametrize(
    ("robot", "data", "message"),
    [
        (
            5,
            DATA,
            "robot: found 5, expected a Robot, the path of a robot file, or the name of a bundled robot",
        ),
        ("ir633", DATA, "ir633: no such file, and no robot of this name comes with beamstiff"),
        ("ir663", 5, "data: found 5, expected measurements, the path of a CSV table, or several of these"),
        ("ir663", [DATA, None], "data: found null, expected measurements"),
        ("ir663", [], "data: found no table, expected at least one"),
        ("ir663", [DATA, str(DATA)], "is given twice, its rows would count twice"),
    ],
)
def test_what_is_neither_robot_nor_table_is_refused(name: str, robot: Any, data: Any, message: str) -> None:
    with pytest.raises(beamstiff.BeamstiffError) as raised:
        getattr(beamstiff, name)(robot, data)
    assert message in str(raised.value)


def test_a_table_is_read_for_a_robot_however_it_is_given() -> None:
    robot = beamstiff.load_robot("ir663")
    expected = beamstiff.read_measurements(DATA, robot)
    for given in ("ir663", robot_path("ir663"), str(robot_path("ir663"))):
        np.testing.assert_array_equal(beamstiff.read_measurements(DATA, given).q, expected.q)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: beamstiff.read_measurements(DATA, 5), "robot: found 5, expected a Robot, the path"),
        (lambda: beamstiff.read_measurements(5, "ir663"), "path: found 5, expected the path of a CSV file"),
        (lambda: beamstiff.identify("ir663", DATA, "J12.torsional"), "parameters: found 'J12"),
        (lambda: beamstiff.identify("ir663", DATA, folds=1), "folds: found 1, expected"),
        (lambda: beamstiff.identify("ir663", DATA, loss="l1"), "loss: found 'l1'"),
        (lambda: beamstiff.plan("ir663", force="2 kg"), "force: "),
        (lambda: beamstiff.plan("ir663", tests=4, poses=2), "tests: found beside"),
        (lambda: beamstiff.plan("cantilever"), "parameters: robot 'cantilever' names no parameters"),
        (lambda: beamstiff.compensate("kr500", 7), "path: found 7, expected a program"),
        (lambda: beamstiff.stiffness("ir663", Q, wrench=[0] * 6), "wrench: needs --preload"),
        (lambda: beamstiff.stiffness("ir663", Q, preload=True, wrench=[0]), "wrench: found [0]"),
        (lambda: beamstiff.tcp_compliance(None), "robot: found null"),
        (lambda: beamstiff.map_workspace(1.5, GRID), "robot: found 1.5"),
    ],
)
def test_options_that_make_no_sense_are_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(beamstiff.BeamstiffError) as raised:
        call()
    assert message in str(raised.value)


def test_stiffness_is_the_inverse_of_compliance_however_the_robot_is_given() -> None:
    structure = beamstiff.compile_structure("ir663")
    where = beamstiff.posture(structure.kinematics, Q)
    compliance = beamstiff.tcp_compliance(structure, where)
    np.testing.assert_array_equal(beamstiff.tcp_compliance("ir663", Q), compliance)
    np.testing.assert_allclose(beamstiff.tcp_stiffness("ir663", Q)[0] @ compliance[0], np.eye(6), atol=1e-6)
    np.testing.assert_array_equal(beamstiff.stiffness("ir663", Q).compliance, compliance[0])
    place = beamstiff.forward_kinematics("ir663", Q)[0, :3, 3]
    np.testing.assert_array_equal(beamstiff.stiffness("ir663", Q).tcp, place)
