"""Print how long writing a report takes and how large it is: asked beside reached.

Run as `python -m benchmarks.report_size [ROWS]`. The KR 240-2 with noise, on a base that gives way: what is
reported is computed before the clock starts. The first report of a process also loads what all need.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, calibrate, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.compensation.formats import path_csv
from beamstiff.compensation.formats.program import Program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.rewrite import compensate_program
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.predictions import columns_at
from beamstiff.diagnosis.residual.baseline import at_rows
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.record import Answer, Label, Record
from beamstiff.exam.table import table_dict
from beamstiff.files import write_whole
from beamstiff.functions.predict import Prediction
from beamstiff.identification.identify import identify
from beamstiff.identification.models.side_by_side import fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.html.calibration import calibration_html
from beamstiff.report.html.comparison import comparison_html
from beamstiff.report.html.compensation import compensation_html
from beamstiff.report.html.deflection import deflection_html
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.exam import exam_html
from beamstiff.report.html.identification import identification_html
from beamstiff.report.html.provenance import provenance
from beamstiff.robot.kinematics import compile_kinematics, posture

ASKED_SECONDS, ASKED_MEGABYTES = 3.0, 6.0
NOISE = 2e-5  # m
LEVELS = (0.3, 0.6, 1.0)  # of the load, at every pose
DIAGNOSED = 60  # rows; the report then shows as many as asked for


def campaign(robot: Robot, count: int, seed: int = 0) -> Measurements:
    """Return rows of a robot whose base gives way too: several loads at every pose, with noise."""
    draw = np.random.default_rng(seed)
    poses = -(-count // len(LEVELS))
    low, high = np.array([item.limits or (-1.5, 1.5) for item in robot.actuated]).T
    q = np.repeat(draw.uniform(0.6 * low, 0.6 * high, (poses, len(low))), len(LEVELS), axis=0)[:count]
    force = draw.normal(size=(poses, 3))
    force *= 1500.0 / np.linalg.norm(force, axis=1, keepdims=True)
    wrench = np.zeros((poses * len(LEVELS), 6))
    wrench[:, :3] = np.repeat(force, len(LEVELS), axis=0) * np.tile(LEVELS, poses)[:, None]
    names = [item.name for item in robot.actuated]
    plain = make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench[:count], displacement=np.zeros((count, 6))
    )
    moved = predict_displacements(robot, plain)
    moved[:, :3] += 2e-7 * wrench[:count, :3]  # what the model lacks
    moved[:, :3] += draw.normal(0.0, NOISE, (count, 3))
    moved[:, 3:] += draw.normal(0.0, 2e-5, (count, 3))
    return make_measurements(
        names,
        q,
        tcp=robot.tcp,
        wrench=wrench[:count],
        displacement=moved,
        sigma_position=NOISE,
        sigma_rotation=2e-5,
    )


def with_rows(result: Diagnosis, rows: Measurements) -> Diagnosis:
    """Return a diagnosis that reports other rows than those it was made of, its causes at these rows."""
    baseline, linear = at_rows(result.baseline, rows), at_rows(result.linear, rows)
    fits = []
    for fit in result.fits:
        shapes = []
        for one in fit.shapes:
            shape = replace(one.hypothesis.shape, columns=columns_at(linear, one.hypothesis))
            shapes.append(replace(one, hypothesis=replace(one.hypothesis, shape=shape)))
        fits.append(replace(fit, shapes=tuple(shapes)))
    poses = [{**one, "pose": at} for at, one in enumerate(result.where["poses"])]
    where = {**result.where, "poses": poses}
    return replace(result, baseline=baseline, linear=linear, fits=tuple(fits), where=where)


def written(text_of: Callable[[], str], path: Path) -> tuple[float, float]:
    """Return seconds and megabytes of writing a report that a function makes."""
    start = time.perf_counter()
    write_whole(path, text_of())
    return time.perf_counter() - start, path.stat().st_size / 1e6


def measure(count: int) -> dict[str, tuple[float, float]]:
    """Return seconds and megabytes of the reports of so many rows, targets or cases."""
    robot = load_robot("kr240-2")
    rows = campaign(robot, count)
    found = identify(robot, rows, folds=0)
    verdict = diagnose(robot, campaign(robot, DIAGNOSED))
    reported = with_rows(verdict, rows)
    source = provenance([], 0, ["diagnose", "robot.yaml", "data.csv", "--html", "report.html"])
    predicted = predict_displacements(robot, rows)
    readings = absolute(robot, count)
    calibrated = calibrate(robot, readings, fixed=["base"], folds=0)
    models = fit_models(robot, rows, split_rows(rows), ("rigid", "nominal", "parametric"))
    path = compensate_program(program(count), Machine(robot))
    cases = records(count)
    pages: dict[str, Callable[[], str]] = {
        "identification": lambda: identification_html(found, robot, rows, source),
        "diagnosis": lambda: diagnosis_html(reported, source),
        "calibration": lambda: calibration_html(calibrated, robot, readings, source),
        "comparison": lambda: comparison_html(models, robot, source),
        "deflection": lambda: deflection_html(Prediction(robot, rows, predicted, False), source),
        "compensation": lambda: compensation_html(path, robot, source),
        "exam": lambda: exam_html(cases, "robots", source, table_dict(cases)),
    }
    with TemporaryDirectory() as folder:
        return {name: written(page, Path(folder) / "report.html") for name, page in pages.items()}


def absolute(robot: Robot, count: int) -> Measurements:
    """Return positions of a robot whose geometry is a little off, with noise."""
    draw = np.random.default_rng(1)
    low, high = np.array([item.limits or (-1.5, 1.5) for item in robot.actuated]).T
    q = draw.uniform(0.6 * low, 0.6 * high, (count, len(low)))
    real = compile_kinematics(corrected(robot, {"q2": 1e-3, "f3.d": 5e-4}, q[:1]))
    seen = posture(real, q).node_positions[:, real.node_index[robot.tcp]]
    names = [item.name for item in robot.actuated]
    position = seen + draw.normal(0.0, NOISE, seen.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=NOISE)


def program(count: int) -> Program:
    """Return a path round a circle, the tool along x, under a load that turns with it."""
    turn = np.linspace(0.0, 2 * np.pi, count)
    rows = zip(1.7 + 0.3 * np.cos(turn), 0.3 * np.sin(turn), 900 * np.cos(turn), strict=True)
    lines = ["# orientation: KUKA ABC", "x,y,z,a [deg],b [deg],c [deg],fz"]
    lines += [f"{x:.6f},{y:.6f},1.4,0,90,0,{fz:.3f}" for x, y, fz in rows]
    return path_csv.read("\n".join(lines), "circle.csv")


def records(count: int) -> list[Record]:
    """Return cases of all effects, most of them answered rightly."""
    draw = np.random.default_rng(2)
    cases = []
    for at in range(count):
        truth = f"{EFFECTS[at % len(EFFECTS)]}:null"
        right = bool(draw.uniform() < 0.9)
        label = Label(at, "single", (truth,), (0.5,), (), "kr240-2", "rich", "displacement", "true", 6)
        probability = float(draw.uniform(0.3, 1.0))
        answer = Answer(truth if right else "unknown:null", probability, probabilities={truth: probability})
        cases.append(Record(label, answer, 2.0, (2.0,), 0.9, {}, "", "", 0.0))
    return cases


def main(count: int = 1000) -> None:
    """Print a row for each report."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    table = Table(title=f"Reports of {count} rows; load of the machine {load:.1f}")
    for heading in ("report", "seconds", "asked", "MB", "asked", ""):
        table.add_column(heading, justify="left" if heading == "report" else "right")
    for name, (seconds, size) in measure(count).items():
        good = seconds < ASKED_SECONDS and size < ASKED_MEGABYTES
        table.add_row(
            name,
            f"{seconds:.2f}",
            f"< {ASKED_SECONDS:g}",
            f"{size:.2f}",
            f"< {ASKED_MEGABYTES:g}",
            "met" if good else "missed",
        )
    Console().print(table)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
