"""One function a command: paths and names do what objects do, and `--json` is `to_dict()`."""

import json
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import beamstiff
from beamstiff.cli.main import app
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.maps.summary import summary
from beamstiff.measure.table import make_measurements
from beamstiff.robot.parts import AddedEffect
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
    head = "x [mm],y [mm],z [mm],a [deg],b [deg],c [deg],fz [N]\n"
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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: beamstiff.identify("ir663", DATA, "J12.torsional"), "parameters: found 'J12"),
        (lambda: beamstiff.identify("ir663", DATA, folds=1), "folds: found 1, expected"),
        (lambda: beamstiff.identify("ir663", DATA, loss="l1"), "loss: found 'l1'"),
        (lambda: beamstiff.plan("ir663", force="2 kg"), "force: "),
        (lambda: beamstiff.plan("ir663", tests=4, poses=2), "tests: found beside"),
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
