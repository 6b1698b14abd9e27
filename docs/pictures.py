"""Draw the pictures of the documentation: `python -m docs.pictures [FOLDER]` in the repository's folder.

They are drawn from bundled robots and from examples/data, by the functions that users have.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from beamstiff import (
    compile_structure,
    identify,
    load_robot,
    map_workspace,
    posture,
    read_measurements,
    tcp_compliance,
)
from beamstiff.calibration.sensitivity import sensitivity_indices
from beamstiff.compensation.formats import read_program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.process.files import read_process
from beamstiff.compensation.rewrite import compensate_program
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.identification.models.fuzzy import fit_fuzzy
from beamstiff.planning.candidates import Noise, candidate_poses, candidate_tests, force_loads, identifiable
from beamstiff.planning.designs import how_many, random_designs
from beamstiff.report.compensation import compensation_figure
from beamstiff.report.diagnosis import diagnosis_figure
from beamstiff.report.exam import exam_figure
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain, save_figure
from beamstiff.report.geometry import sensitivity_figure
from beamstiff.report.residuals import residual_figure
from beamstiff.report.skeleton import draw_shares
from beamstiff.report.workspace import map_figure
from beamstiff.robot.kinematics import compile_kinematics
from benchmarks.geometry_study import geometry

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent / "examples" / "data"
DATA = EXAMPLES / "ir663_compliance_xx.csv"
DPI = 80  # small files
COLOURS = (BLUE, ORANGE, GREEN, GREY)


def main(folder: Path = HERE / "pictures") -> None:
    """Draw them all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        save_figure(draw(), folder / f"{name}.png", DPI)


def stiffness() -> Figure:
    """Draw the IR-663 in a posture, and how far 900 N along x move its tool over both drives."""
    robot = load_robot("ir663")
    structure = compile_structure(robot)
    figure = new_figure(9.0, 4.0)
    left, right = figure.subplots(1, 2)
    draw_shares(left, robot, np.radians([1.37, 48.63]), {})
    left.set(title="Beams (lines), joints (circles), base, tool", xlabel="x, m", ylabel="z, m")
    q8 = np.radians(np.linspace(33.0, 63.0, 31))
    for q2, colour in ((-24.15, BLUE), (1.37, ORANGE), (36.83, GREY)):
        where = posture(structure.kinematics, {"q2": np.radians(q2), "q8": q8})
        moved = 900e3 * tcp_compliance(structure, where)[:, 0, 0]
        right.plot(np.degrees(q8), moved, color=colour, label=f"q2 = {q2} deg")
    right.set(title="Displacement along x under 900 N", xlabel="q8, deg", ylabel="mm", ylim=(0, None))
    right.legend()
    plain(right)
    return figure


def identification() -> Figure:
    """Draw the residuals of the IR-663 before and after identification."""
    robot = load_robot("ir663")
    measured = read_measurements(DATA, robot)
    return residual_figure(identify(robot, measured), measured, "KUKA IR-663")


def planning() -> Figure:
    """Draw the worst standard error of chosen and of random tests over their number, KR240-2."""
    robot = load_robot("kr240-2")
    poses = candidate_poses(compile_kinematics(robot), 200, 0)
    tests = candidate_tests(robot, poses, force_loads(1000.0))
    names, information, _ = identifiable(robot, tests, Noise(30e-6))
    counts = [4, 6, 8, 12, 16, 24, 32, 48]
    chosen = how_many(information, names, counts, "D")
    drawn = [random_designs(information, count, "D", seed=0) for count in counts]
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    axes.loglog(
        counts, [100 * np.median(one.worst) for one in drawn], "s--", color=GREY, label="random, median"
    )
    axes.loglog(counts, 100 * chosen.worst, "o-", color=BLUE, label="chosen (D-optimal)")
    axes.set(title="KUKA KR240-2, 1 kN, 0.03 mm", xlabel="tests", ylabel="worst standard error, %")
    axes.minorticks_off()
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.set_yticks((10, 20, 40, 80), ("10", "20", "40", "80"))
    axes.legend()
    plain(axes)
    return figure


def diagnosis() -> Figure:
    """Draw what may be wrong with the IR-663 when springs of two drives are all that is fitted."""
    robot = load_robot("ir663")
    robot = robot.model_copy(update={"identify": ("J12.torsional", "J18.torsional")})
    return diagnosis_figure(diagnose(robot, read_measurements(DATA, robot)))


def calibration() -> Figure:
    """Draw what a geometric error of the IR-663 moves."""
    found = geometry()
    names = {item.name for item in found.parameters[:24]}
    return sensitivity_figure(sensitivity_indices(found).some(names), "KUKA IR-663, 24 of 43 parameters")


def compensation() -> Figure:
    """Draw the path of forming before and after."""
    program = read_program(EXAMPLES / "forming_path.csv")
    process = read_process(EXAMPLES / "forming.yaml")
    done = compensate_program(program, Machine(load_robot("ir663")), process, taught=True)
    return compensation_figure(done, "KUKA IR-663, bending a beam")


def models() -> Figure:
    """Draw what one stiffness and what fuzzy rules leave of the published displacements."""
    robot = load_robot("ir663")
    measured = read_measurements(DATA, robot)
    q8 = np.radians(np.linspace(33.04, 62.90, 31))
    fit = fit_fuzzy(robot, measured)
    springs = identify(robot, measured).robot
    structure = compile_structure(springs)
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    for q2, colour in zip(np.unique(measured.q[:, 0])[:4], COLOURS, strict=False):
        at = measured.q[:, 0] == q2
        axes.plot(
            np.degrees(measured.q[at, 1]), 1e3 * np.abs(measured.displacement[at, 0]), "o", color=colour
        )
        q = np.stack([np.full_like(q8, q2), q8], axis=-1)
        wrench = np.zeros((len(q8), 6))
        wrench[:, 0] = -900.0
        one = tcp_compliance(structure, posture(structure.kinematics, {"q2": q2, "q8": q8}))
        axes.plot(np.degrees(q8), 900e3 * one[:, 0, 0], "-", color=colour, label=f"{np.degrees(q2):.1f} deg")
        axes.plot(np.degrees(q8), 1e3 * np.abs(fit.model.predict(q, wrench)[:, 0]), ":", color=colour)
    axes.set(title="Springs (lines), fuzzy rules (dotted), published", xlabel="q8, deg", ylabel="mm")
    axes.legend(title="q2")
    plain(axes)
    return figure


def maps() -> Figure:
    """Draw stiffness and dexterity of the KR 240-2 at three heights, its tool along x."""
    found = map_workspace(
        load_robot("kr240-2"),
        {"z": [0.9, 1.4, 1.9], "x": np.linspace(1.2, 2.3, 34), "y": np.linspace(-0.8, 0.8, 49)},
        held={"q2": np.radians(60.0), "q3": np.radians(-200.0), "q5": np.radians(50.0)},
        orientation=[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
        quantities=["stiffness", "kappa"],
    )
    return map_figure(found)


def exam() -> Figure:
    """Draw a stored exam: a new one replaces it by `beamstiff exam ... --json docs/exam.json`."""
    told = json.loads((HERE / "exam.json").read_text(encoding="utf-8"))
    return exam_figure(told, f"{told['cases']} simulated cases, seed {told['exam']['seed']}")


PICTURES: dict[str, Callable[[], Figure]] = {
    "stiffness": stiffness,
    "maps": maps,
    "identification": identification,
    "planning": planning,
    "diagnosis": diagnosis,
    "calibration": calibration,
    "compensation": compensation,
    "models": models,
    "exam": exam,
}

if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
