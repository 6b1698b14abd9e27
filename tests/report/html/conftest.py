"""Reports of a small robot whose every name is hostile, and a browser to open them with.

Every page is made once a session, and only when a test asks for it.
"""

import itertools
import os
import shutil
import subprocess
import tarfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import calibrate, load_robot, read_measurements
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.result import Calibration
from beamstiff.compensation.formats import read_program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.process.load import Constant
from beamstiff.compensation.rewrite import Compensated, compensate_program
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.record import Record
from beamstiff.exam.table import table_dict
from beamstiff.functions.predict import Prediction
from beamstiff.identification.identify import identify
from beamstiff.identification.models.side_by_side import Models, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.identification.result import Identification
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.html.calibration import calibration_html
from beamstiff.report.html.comparison import comparison_html
from beamstiff.report.html.compensation import compensation_html
from beamstiff.report.html.deflection import deflection_html
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.exam import exam_html
from beamstiff.report.html.identification import identification_html
from beamstiff.report.html.provenance import Provenance, provenance
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.cli import conftest as commands
from tests.exam.answered import of_every_kind

KINDS = ("diagnosis", "identification", "calibration", "compensation", "comparison", "deflection", "exam")
ROBOT_NAME = "<script>alert(1)</script>"
LINK_NAME = "<img src=x onerror=alert(2)>"
JOINT_NAME = '</script><b>"J1"</b> & {{ 7 * 7 }}'

# Two joints in a row, the second about z too; a rigid link and one that bends.
ARM = f"""\
beamstiff: 1
name: "{ROBOT_NAME}"
variables:
  - {{name: q1, type: revolute}}
  - {{name: q2, type: revolute}}
frames:
  - {{name: f1, theta: q1, r: 0.5}}
  - {{name: f2, parent: f1, d: 1.0, theta: q2}}
materials: {{steel: {{E: "210 GPa", G: "80 GPa", density: 0}}}}
sections: {{bar: {{A: 1e-3, Iy: 1e-7, Iz: 1e-7, J: 2e-7}}}}
nodes:
  - {{name: foot}}
  - {{name: top, at: [0, 0, 0.5]}}
  - {{name: hub, frame: f1}}
  - {{name: elbow, frame: f1, at: [1.0, 0, 0]}}
  - {{name: hand, frame: f2}}
  - {{name: tip, frame: f2, at: [0.8, 0, 0]}}
beams:
  - {{name: forearm, nodes: [hand, tip], section: bar, material: steel}}
rigids:
  - {{name: post, nodes: [foot, top]}}
  - {{name: "{LINK_NAME}", nodes: [hub, elbow]}}
joints:
  - {{name: '{JOINT_NAME}', nodes: [top, hub], frame: f1, axis: z, variable: q1,
     stiffness: {{axial: rigid, radial: rigid, torsional: "1e6 N*m/rad", tilting: "5e6 N*m/rad"}}}}
  - {{name: J2, nodes: [elbow, hand], frame: f2, axis: z, variable: q2,
     stiffness: {{axial: rigid, radial: rigid, torsional: "4e5 N*m/rad", tilting: rigid}}}}
fixed: [foot]
tcp: tip
identify: ['{JOINT_NAME}.torsional', J2.torsional]
"""


def table_text(robot: Robot, slip: float) -> str:
    """Return a table: loads in cycles, what the robot does under them, a dead zone in q1 and some noise."""
    noise = np.random.default_rng(5)
    rows = []
    for (q1, q2), force, side in itertools.product(
        [(0, 20), (30, -40), (-50, 70), (80, 110), (20, -90), (-20, 45), (60, -15), (-70, -60)],
        (150, 300, 600, -600, -300),
        ("fx", "fy"),
    ):
        rows.append((q1, q2, *((force, 0) if side == "fx" else (0, force))))
    q = np.radians([row[:2] for row in rows])
    wrench = np.array([[row[2], row[3], 0, 0, 0, 0] for row in rows], dtype=float)
    plain = make_measurements(["q1", "q2"], q, tcp="tip", wrench=wrench, displacement=0 * wrench)
    moved = predict_displacements(robot, plain)[:, :3]
    total = q[:, 0] + q[:, 1]
    tip = np.stack([np.cos(q[:, 0]) + 0.8 * np.cos(total), np.sin(q[:, 0]) + 0.8 * np.sin(total)], axis=1)
    torque = tip[:, 0] * wrench[:, 1] - tip[:, 1] * wrench[:, 0]
    turn = slip * np.tanh(torque / 5.0)
    moved[:, :2] += turn[:, None] * np.stack([-tip[:, 1], tip[:, 0]], axis=1)
    moved += noise.normal(0.0, 1e-5, moved.shape)
    lines = ["# sigma_position: 0.01 mm", "q1 [deg],q2 [deg],fx,fy,dx [mm],dy [mm],dz [mm]"]
    lines += [
        ",".join([*map(str, row), *(f"{1e3 * value:.5f}" for value in way)])
        for row, way in zip(rows, moved, strict=True)
    ]
    return "\n".join(lines)


folder, run = commands.folder, commands.run


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the files of a robot and its table; their names are hostile as well."""
    folder = tmp_path_factory.mktemp("report")
    robot, data = folder / "a <b>robot.yaml", folder / "a & <i>table.csv"
    robot.write_text(ARM, encoding="utf-8")
    data.write_text(table_text(load_robot(robot), slip=5e-4), encoding="utf-8")
    return robot, data


@pytest.fixture(scope="session")
def robot(files: tuple[Path, Path]) -> Robot:
    return load_robot(files[0])


@pytest.fixture(scope="session")
def rows(files: tuple[Path, Path], robot: Robot) -> Measurements:
    return read_measurements(files[1], robot)


@pytest.fixture(scope="session")
def source(files: tuple[Path, Path]) -> Provenance:
    return provenance(files, 3, ["diagnose", *map(str, files), "--html", "out.html"])


@pytest.fixture(scope="session")
def diagnosed(robot: Robot, rows: Measurements) -> Diagnosis:
    few = ("backlash", "joint-compliance", "bearing-tilt", "load-error", "hysteresis")
    return diagnose(robot, rows, without=[name for name in EFFECTS if name not in few], seed=3)


@pytest.fixture(scope="session")
def identified(robot: Robot, rows: Measurements) -> Identification:
    return identify(robot, rows)


@pytest.fixture(scope="session")
def diagnosis_page(diagnosed: Diagnosis, source: Provenance) -> str:
    return diagnosis_html(diagnosed, source)


@pytest.fixture(scope="session")
def identification_page(
    identified: Identification, robot: Robot, rows: Measurements, source: Provenance
) -> str:
    return identification_html(identified, robot, rows, source)


@pytest.fixture(scope="session")
def readings(robot: Robot) -> Measurements:
    """Return where a tracker saw the tip of the robot, whose geometry is a little off."""
    noise = np.random.default_rng(2)
    q = noise.uniform(-2.0, 2.0, (25, 2))
    real = compile_kinematics(corrected(robot, {"q2": 2e-3, "f2.d": 1e-3}, q[:1]))
    seen = posture(real, q).node_positions[:, real.node_index["tip"]]
    position = seen + 1e-5 * noise.standard_normal(seen.shape)
    return make_measurements(["q1", "q2"], q, tcp="tip", position=position, sigma_position=1e-5)


@pytest.fixture(scope="session")
def calibrated(robot: Robot, readings: Measurements) -> Calibration:
    return calibrate(robot, readings, fixed=["base"])


@pytest.fixture(scope="session")
def compensated(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Compensated:
    path = tmp_path_factory.mktemp("path") / "path.csv"
    rows = [
        "name,x,y,z",
        "<b>first</b>,1.2,0.5,0.5",
        *(f"P{k},{1.2 - 0.02 * k},0.5,0.5" for k in range(1, 20)),
    ]
    path.write_text("\n".join([*rows, "far,5,5,0.5"]), encoding="utf-8")
    return compensate_program(read_program(path), Machine(robot), Constant((0.0, -300.0, 0.0, 0.0, 0.0, 0.0)))


@pytest.fixture(scope="session")
def compared(robot: Robot, rows: Measurements) -> Models:
    some = subset(rows, np.arange(0, len(rows), 2))
    return fit_models(robot, some, split_rows(some), ("rigid", "nominal", "parametric", "fuzzy"))


@pytest.fixture(scope="session")
def records() -> list[Record]:
    return of_every_kind("<b>q3</b>", f"ValueError: {LINK_NAME} broke")


@pytest.fixture(scope="session")
def calibration_page(
    calibrated: Calibration, robot: Robot, readings: Measurements, source: Provenance
) -> str:
    tested = replace(calibrated, tests={LINK_NAME: calibrated.after})
    return calibration_html(tested, robot, readings, source)


@pytest.fixture(scope="session")
def compensation_page(compensated: Compensated, robot: Robot, source: Provenance) -> str:
    return compensation_html(replace(compensated, notes=(LINK_NAME,)), robot, source)


@pytest.fixture(scope="session")
def comparison_page(compared: Models, robot: Robot, source: Provenance) -> str:
    return comparison_html(replace(compared, notes=(LINK_NAME,)), robot, source)


@pytest.fixture(scope="session")
def deflection_page(robot: Robot, rows: Measurements, source: Provenance) -> str:
    some = subset(rows, np.arange(0, len(rows), 4))
    predicted = predict_displacements(robot, some)
    return deflection_html(Prediction(robot, some, predicted, False, (LINK_NAME,)), source)


@pytest.fixture(scope="session")
def exam_page(records: list[Record], source: Provenance) -> str:
    return exam_html(records, ROBOT_NAME, source, table_dict(records), notes=[JOINT_NAME])


FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a headless Chromium; the tests are skipped where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is missing (pip install .[dev])")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        missing = [name for name, path in (("chromium", chromium), ("chromedriver", driver)) if path is None]
        pytest.skip(f"{' and '.join(missing)} missing (on Debian: apt install chromium chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    started = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    started.set_page_load_timeout(60)
    started.set_script_timeout(60)
    yield started
    started.quit()


@pytest.fixture(scope="session")
def axe(request: pytest.FixtureRequest) -> str:
    """Return the script of axe-core, kept among pytest's files; skipped where npm cannot get it."""
    folder = Path(request.config.cache.mkdir("axe-core"))
    kept = folder / "axe.min.js"
    if not kept.exists():
        npm = shutil.which("npm")
        if npm is None:
            pytest.skip("axe-core is missing, and npm to get it")
        own = folder / str(os.getpid())
        own.mkdir(exist_ok=True)
        try:
            command = [npm, "pack", "--silent", "axe-core@^4.10"]
            subprocess.run(command, cwd=own, check=True, timeout=60, capture_output=True)
            with tarfile.open(next(own.glob("*.tgz"))) as archive:
                content = archive.extractfile("package/axe.min.js")
                assert content is not None
                (own / "axe.min.js").write_bytes(content.read())
        except (subprocess.SubprocessError, OSError, StopIteration, KeyError) as error:
            pytest.skip(f"axe-core is missing, and npm did not get it: {error}")
        os.replace(own / "axe.min.js", kept)
        shutil.rmtree(own)
    return kept.read_text(encoding="utf-8")
