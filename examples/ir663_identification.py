"""Identify the KUKA IR-663 as its paper does, step by step, and draw the paper's figures.

Marie, Courteille, Maurine: elasto-geometrical modeling and calibration of robot manipulators. The paper
prints no measurements, only 12 values of a fuzzy model of them: here they are simulated, on a machine that
has the ball screws which the paper suspects behind its gap, with the paper's noise. The last step takes the
12 values.
Figures go to examples/output/, or into the folder given: `python examples/ir663_identification.py [FOLDER]`.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from beamstiff import (
    Robot,
    compile_structure,
    identify,
    load_robot,
    posture,
    read_measurements,
    tcp_compliance,
)
from beamstiff.identification.degeneracy import find_degeneracy
from beamstiff.identification.minimise import Effort, minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import build_parameters
from beamstiff.identification.problem import build_problem
from beamstiff.identification.reduced_model import reduce_model
from beamstiff.identification.separating_rows import with_separations
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain, save_figure
from beamstiff.report.identification import combinations_text, identification_table
from beamstiff.report.tables import table
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

HERE = Path(__file__).resolve().parent
OUTPUT, DATA = HERE / "output", HERE / "data"
SIGMA = 35e-6  # m, as the paper says of its camera
WINDOW = (1.25, 2.25), (0.85, 2.15)  # m, of x and z (eq. 65)
COUNT = 63  # poses
LOADS = (300.0, 600.0, 900.0, 1100.0)
USED = 900.0
RADIAL = [f"{joint}.radial" for joint in ("J12", "J18", "J33", "J99", "J1010")]
NAMES = ["J12.torsional", "J18.torsional", *RADIAL]
GROUPS = {"K12eq": ("J12.radial", "J33.radial"), "K18eq": ("J18.radial", "J99.radial", "J1010.radial")}
DESIGNS, EVALUATIONS = 3, 6000


def main(folder: Path = OUTPUT) -> None:
    width = None if sys.stdout.isatty() else 100
    console = Console(highlight=False, markup=False, soft_wrap=True, width=width)
    folder.mkdir(parents=True, exist_ok=True)
    robot, screws = load_robot("ir663"), load_robot("ir663-screws")
    random = np.random.default_rng(0)

    # 3.3.1 Poses in a plane, loads along z0 and x0, displacements by differences
    poses, positions = some_poses(robot)
    strokes = strokes_of(screws, poses)
    measured = simulate(robot, poses, screws, strokes, random)
    size = np.abs(measured.wrench).max(axis=1)
    used = subset(measured, size == USED)
    console.print(
        f"{len(measured)} simulated readings, {len(used)} of them under {USED:.0f} N to identify from\n"
    )
    save_figure(draw_maps(positions, measured), folder / "ir663_displacement.png")

    # 3.3.1 Seven stiffness values by a genetic search, as it is and more than once
    console.print(designs(robot, used), "")

    # What these readings cannot tell apart, and what would
    found = with_separations(identify(robot, used, NAMES), robot, used)
    console.print(identification_table(found, robot, "The same by least squares"), "")
    for line in combinations_text(found):
        console.print(line)
    console.print()

    # The reduced model
    values = dict(zip(NAMES, found.stiffness.tolist(), strict=True))
    reduced = reduce_model(robot, find_degeneracy(build_problem(robot, used, NAMES)), values, NAMES).robot
    small = identify(reduced, used)
    of_screws = replace(measured, variables=("r2", "r8"), q=np.repeat(strokes, 2 * len(LOADS), axis=0))
    told = identify(screws, subset(of_screws, size == USED))

    # Validation under the other loads
    models = {
        "constant springs": predict_displacements(small.robot, measured),
        "ball screws": predict_displacements(told.robot, of_screws),
    }
    console.print(validation_table(measured, size, models), "")
    save_figure(draw_validation(measured, size, models), folder / "ir663_validation.png")

    # Figure 11: the share of the beams
    share = beam_share(small.robot, poses)
    for name, at in (("horizontal", 0), ("vertical", 2)):
        console.print(
            f"beams under a {name} load: {share[:, at].mean():.1%} of the displacement in the mean, "
            f"{share[:, at].max():.1%} at most (the paper: about 10 %)"
        )
    save_figure(draw_beams(positions, share), folder / "ir663_beams.png")

    # The paper's own values
    console.print("", published(robot, screws), sep="\n")
    console.print(f"Figures: {folder}/ir663_*.png", soft_wrap=True)


def some_poses(robot: Robot) -> tuple[Array, Array]:
    """Return poses (63, 2) over that part of the paper's window that this arrangement reaches, and where."""
    x, z = np.meshgrid(np.linspace(*WINDOW[0], 15), np.linspace(*WINDOW[1], 11), indexing="ij")
    targets = np.stack([x.reshape(-1), np.zeros(x.size), z.reshape(-1)], axis=1)
    found = inverse_geometry(compile_kinematics(robot), targets, tolerance=1e-6, restarts=20)
    reached = np.flatnonzero(found.reached)
    some = reached[np.linspace(0, len(reached) - 1, COUNT).round().astype(int)]
    return found.q[some], targets[some]


def strokes_of(screws: Robot, poses: Array) -> Array:
    """Return the lengths of the ball screws (P, 2) at angles of the axes 2 and 8: one depends on one."""
    result = np.zeros_like(poses)
    structure = compile_structure(screws)
    names = structure.kinematics.coupling.names
    for column, (variable, angle) in enumerate(zip(screws.actuated, ("th2", "th8"), strict=True)):
        low, high = variable.limits or (0.0, 0.0)
        strokes = np.tile([np.mean(one.limits) for one in screws.actuated if one.limits], (400, 1))
        strokes[:, column] = np.linspace(low, high, 400)
        angles = posture(structure.kinematics, strokes).values[:, names.index(angle)]
        order = np.argsort(angles)
        result[:, column] = np.interp(poses[:, column], angles[order], strokes[order, column])
    return result


def simulate(
    robot: Robot, poses: Array, screws: Robot, strokes: Array, random: np.random.Generator
) -> Measurements:
    """Return the readings of a machine with ball screws, as a table over the angles of its axes."""
    each = np.array([[load, 0, 0, 0, 0, 0] for load in LOADS] + [[0, 0, -load, 0, 0, 0] for load in LOADS])
    wrench = np.tile(each, (len(poses), 1))

    def tests(of: Robot, q: Array) -> Measurements:
        return make_measurements(
            [variable.name for variable in of.actuated],
            np.repeat(q, len(each), axis=0),
            tcp=of.tcp,
            wrench=wrench,
            sigma_position=SIGMA,
            source="simulated campaign",
        )

    seen = predict_displacements(screws, tests(screws, strokes))
    seen += SIGMA * random.normal(size=seen.shape)
    seen[:, 3:] = np.nan
    seen[:, 1] = np.nan  # the paper stays in its plane
    return replace(tests(robot, poses), displacement=seen)


def designs(robot: Robot, used: Measurements) -> object:
    """Return Table 3: what a genetic search finds from one seed and the next, beside the paper's designs."""
    problem = build_problem(robot, used, NAMES)
    sought = build_parameters(
        NAMES,
        problem.model.start,
        bounds={name: (1e5, 1e15) if "radial" in name else (1e5, 1e8) for name in NAMES},
    )
    objective = Objective(problem, sought)
    runs = [
        minimise(objective, "genetic", effort=Effort(EVALUATIONS, seed), polish=False)
        for seed in range(DESIGNS)
    ]
    least = minimise(objective)
    found = {f"seed {number}": sought.stiffness(run.theta) for number, run in enumerate(runs)}
    found["descent"] = sought.stiffness(least.theta)
    paper = published_designs()
    result = table(
        "Table 3: seven stiffness values, N m/rad and N/m, by a genetic search from three seeds",
        "",
        *found,
        *paper,
    )
    for at, name in enumerate(NAMES):
        cells = [f"{values[at]:.1e}" for values in found.values()]
        result.add_row(name, *cells, *(f"{design[name]:.1e}" for design in paper.values()))
    for name, members in GROUPS.items():
        cells = [f"{1 / sum(1 / values[NAMES.index(m)] for m in members):.1e}" for values in found.values()]
        theirs = [f"{1 / sum(1 / design[m] for m in members):.1e}" for design in paper.values()]
        result.add_row(name, *cells, *theirs)
    gaps = [np.sqrt(2 * run.cost / len(used)) * SIGMA for run in (*runs, least)]
    result.add_row("RMS, mm", *(f"{1e3 * gap:.4f}" for gap in gaps), *("" for _ in paper))
    result.add_row("evaluations", *(str(run.evaluations) for run in (*runs, least)), *("" for _ in paper))
    return result


def published_designs() -> dict[str, dict[str, float]]:
    """Return the three designs of the paper's Table 3, SI."""
    lines = (DATA / "ir663_identified.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    factor = {"N*mm/rad": 1e-3, "N/mm": 1e3}
    return {
        f"paper {n}": {
            row["parameter"]: float(row[f"design_{n}"]) * factor[row["unit"]]
            for row in rows
            if row["unit"] in factor
        }
        for n in (1, 2, 3)
    }


def gaps_of(measured: Measurements, predicted: Array) -> Array:
    """Return the gap in the plane, row by row, m."""
    return np.linalg.norm((measured.displacement - predicted)[:, [0, 2]], axis=1)


def validation_table(measured: Measurements, size: Array, models: Mapping[str, Array]) -> object:
    """Return Table 5: RMS gaps by load."""
    with (DATA / "ir663_methods.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    theirs = {row["load_N"]: row["rms"] for row in rows if row["method"] == "parametric"}
    result = table(
        "Table 5: RMS gap, mm, and what is predicted",
        "load, N",
        *(n for m in models for n in (m, "predicted")),
        "paper",
    )
    for load in LOADS:
        rows_of = size == load
        moved = np.linalg.norm(measured.displacement[rows_of][:, [0, 2]], axis=1)
        cells = []
        for predicted in models.values():
            gap = gaps_of(measured, predicted)[rows_of]
            cells += [f"{1e3 * np.sqrt((gap**2).mean()):.3f}", f"{1 - gap.sum() / moved.sum():.1%}"]
        result.add_row(f"{load:.0f}{' (used)' if load == USED else ''}", *cells, theirs[f"{load:.0f}"])
    return result


def beam_share(robot: Robot, poses: Array) -> Array:
    """Return the share (P, 6) of the beams in the displacement along each unit load at the tool."""
    joints = {
        name: RIGID for name, value in stiffness_parameters(robot).items() if value != FREE and "." in name
    }
    beams = {f"{beam.name}.E" for beam in robot.beams}
    stiff = robot.with_parameters({name: value for name, value in joints.items() if name not in beams})
    own, all_of = (
        np.diagonal(tcp_compliance(structure, posture(structure.kinematics, poses)), axis1=1, axis2=2)
        for structure in (compile_structure(stiff), compile_structure(robot))
    )
    return own / all_of


def published(robot: Robot, screws: Robot) -> object:
    """Return what both models leave of the 12 values of the paper's Table 4."""
    result = table(
        "The 12 published values under 900 N along x", "model", "RMS, mm", "held out, mm", "identified"
    )
    values = read_measurements(DATA / "ir663_compliance_xx.csv", robot)
    strokes = replace(values, variables=("r2", "r8"), q=strokes_of(screws, values.q))
    for name, one, rows in (("constant springs", robot, values), ("ball screws", screws, strokes)):
        found = identify(one, rows)
        cells = [
            f"{item.name} {'>' if item.value is None else ''}{item.value or item.lower_bound:.2e}"
            for item in found.parameters
        ]
        assert found.rms_held_out is not None
        result.add_row(name, f"{1e3 * found.rms:.3f}", f"{1e3 * found.rms_held_out:.3f}", ", ".join(cells))
    return result


def draw_maps(positions: Array, measured: Measurements) -> Figure:
    """Figure 9: norm of the displacement over the plane, by load."""
    figure = new_figure(13, 7)
    moved = 1e3 * np.linalg.norm(measured.displacement[:, [0, 2]], axis=1).reshape(len(positions), 2, -1)
    axes = figure.subplots(2, len(LOADS), sharex=True, sharey=True)
    for row, name in enumerate(("horizontal", "vertical")):
        for column, load in enumerate(LOADS):
            place = axes[row, column]
            drawn = place.tricontourf(*positions.T[[0, 2]], moved[:, row, column], 12, cmap="cividis")
            place.plot(*positions.T[[0, 2]], ".", color="white", markersize=2)
            place.set_title(f"{load:.0f} N {name}", fontsize="medium")
            place.set_aspect("equal")
            figure.colorbar(drawn, ax=place, shrink=0.8)
    figure.supxlabel("x, m")
    figure.supylabel("z, m")
    figure.suptitle("Norm of the displacement, mm")
    return figure


def draw_validation(measured: Measurements, size: Array, models: Mapping[str, Array]) -> Figure:
    """Figure 10: measured and predicted, horizontal under 600 N along x, vertical under 1100 N along z."""
    figure = new_figure(12, 5.6)
    for axes, (load, at, what) in zip(
        figure.subplots(1, 2), ((600.0, 0, "horizontal"), (1100.0, 2, "vertical")), strict=True
    ):
        rows = np.flatnonzero((size == load) & (measured.wrench[:, at] != 0))
        order = rows[np.argsort(np.abs(measured.displacement[rows, at]))]
        axes.plot(1e3 * measured.displacement[order, at], ".", color="black", label="measured")
        for (name, predicted), colour in zip(models.items(), (ORANGE, BLUE), strict=True):
            axes.plot(1e3 * predicted[order, at], color=colour, label=name)
        axes.set(
            xlabel="pose, by displacement",
            ylabel=f"{what} displacement, mm",
            title=f"{load:.0f} N {what}; identified from {USED:.0f} N",
        )
        axes.legend(frameon=False)
        plain(axes)
    return figure


def draw_beams(positions: Array, share: Array) -> Figure:
    """Figure 11: the share of the beams over the plane."""
    figure = new_figure(11, 5)
    for axes, (at, name) in zip(figure.subplots(1, 2), ((0, "horizontal"), (2, "vertical")), strict=True):
        drawn = axes.tricontourf(*positions.T[[0, 2]], 100 * share[:, at], 12, cmap="cividis")
        figure.colorbar(drawn, ax=axes, label="%")
        axes.set(xlabel="x, m", ylabel="z, m", title=f"{name} load", aspect="equal")
    figure.suptitle("Share of the beams in the displacement along the load")
    return figure


if __name__ == "__main__":
    arguments: Sequence[str] = sys.argv[1:2]
    main(*map(Path, arguments))
