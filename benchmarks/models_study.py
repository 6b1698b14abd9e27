"""Print what models of elasticity reach, beside what the papers did.

Run as `python -m benchmarks.models_study [FIGURE.png]` (a minute and a half). The campaigns are simulated;
`benchmarks.kr500_grid`, `benchmarks.ir663_models` and `benchmarks.fuzzy_six_joints` say what the machines
are. Published numbers are of other, real machines: they are what was asked, not what must come out.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from beamstiff import load_robot, read_measurements
from beamstiff.identification.models.side_by_side import Models
from beamstiff.model.fuzzy_compliance import rules_from_table
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain, save_figure
from beamstiff.report.tables import Table, table
from beamstiff.se3 import Array
from benchmarks import fuzzy_six_joints, ir663_models, kr500_grid
from benchmarks.kr500_grid import Row

KR500 = {
    "drives that ripple until one stiffness leaves what the paper's left": kr500_grid.published,
    "drives that ripple with the posture of the arm": kr500_grid.by_posture,
    "levers, hardening and bending of usual size": kr500_grid.usual,
}
COLOURS = (GREY, BLUE, ORANGE, GREEN, "#CC79A7", "#56B4E9", "#E69F00", "#000000")
DATA = Path(__file__).resolve().parents[1] / "examples" / "data"


def grid_table(title: str, rows: Sequence[Row], asked: bool = True) -> Table:
    """Return mean and largest position error at the check points, by model."""
    result = table(title, "model", "measurements", *(["paper, mean"] if asked else []), "mean, mm", "max, mm")
    for row in rows:
        paper = [f"{1e3 * row.published:.4f}" if row.published is not None else ""] if asked else []
        result.add_row(
            row.name, str(row.measurements), *paper, f"{1e3 * row.mean:.4f}", f"{1e3 * row.largest:.4f}"
        )
    return result


def table_4() -> float:
    """Return the largest difference, mm, between table 4 of seed 003 and the rules loaded from it."""
    rows = read_measurements(DATA / "ir663_compliance_xx.csv", load_robot("ir663"))
    rules = rules_from_table(rows, ["q2", "q8"])
    return 1e3 * float(np.abs(rules.predict(rows.q, rows.wrench)[:, 0] - rows.displacement[:, 0]).max())


def table_5(machine: str, found: Models, share: float) -> Table:
    """Return RMS and largest error by load, over held-out poses where there are some, as table 5."""
    judged = found.split.new_pose if share else np.ones(len(found.table), dtype=np.bool_)
    held = f"{round(100 * share)} % of the poses held out" if share else "as the paper: no pose held out"
    loads = [f"{load:.0f} N" for load in ir663_models.LOADS]
    result = table(f"{machine}, fitted at 900 N, {held}: RMS / max, mm", "model", *loads, "all, RMS")
    for name, by_load in ir663_models.PAPER.items():
        cells = [f"{rms:.3f} / {largest:.3f}" for rms, largest in by_load.values()]
        result.add_row(f"{name}, paper", *cells, f"{ir663_models.PAPER_ALL[name]:.3f}")
    for one in found.judged:
        cells = []
        for level in range(len(found.split.loads)):
            rows = judged & (found.split.level == level)
            cells.append(f"{_millimetres(one.rms(rows))} / {_millimetres(one.largest(rows))}")
        result.add_row(one.name, *cells, _millimetres(one.rms(judged)))
    return result


def _millimetres(error: float | None) -> str:
    return "no answer" if error is None else f"{1e3 * error:.3f}"


def six_joints_table(left: Sequence[fuzzy_six_joints.Left]) -> Table:
    """Return what models of six joints and the wrench leave of all six components."""
    heads = ("readings", "rules", "displacement left", "rotation left")
    result = table("KR240-2, six joints and the wrench to six components, fresh poses", "model", *heads)
    for one in left:
        shares = (f"{100 * share:.1f} %" for share in (one.position, one.rotation))
        result.add_row(one.name, str(one.readings), str(one.rules or ""), *shares)
    return result


def check_points_figure(
    errors: Mapping[str, Array], by_size: Mapping[str, Sequence[tuple[float, float]]], title: str
) -> Figure:
    """Draw position errors point by point, and mean errors over the size of cubes."""
    figure = new_figure(12.0, 4.8)
    figure.suptitle(title)
    points, sizes = figure.subplots(1, 2, width_ratios=(2, 1))
    order = np.argsort(next(iter(errors.values())))
    for at, (name, error) in enumerate(errors.items()):
        label = f"{name}: mean {1e3 * float(error.mean()):.4f}"
        points.plot(1e3 * error[order], color=COLOURS[at % len(COLOURS)], linewidth=1.2, label=label)
    points.set_xlabel("check point")
    points.set_ylabel("position error, mm")
    points.legend(frameon=False, fontsize="small")
    every = sorted({size for curve in by_size.values() for size, _ in curve}, reverse=True)
    places = {size: at for at, size in enumerate(every)}
    for at, (name, curve) in enumerate(by_size.items()):
        drawn = sorted(curve, reverse=True)
        across, up = [places[size] for size, _ in drawn], [1e3 * error for _, error in drawn]
        sizes.plot(across, up, marker="os^Dv"[at % 5], color=COLOURS[at + 1], label=name)
    texts = ["whole" if np.isinf(size) else f"{1e3 * size:.0f}" for size in every]
    sizes.set_xticks(range(len(every)), texts)
    sizes.set_xlabel("side of the cubes, mm")
    sizes.set_ylabel("mean error, mm")
    for axes in (points, sizes):
        axes.set_ylim(bottom=0.0)
        plain(axes)
    sizes.legend(frameon=False, fontsize="small")
    return figure


def cubes_figure(rows: Sequence[Row]) -> Figure:
    """Draw errors point by point and over the size of cubes, as figures 6 and 7 of seed 001."""
    by_name = {row.name: row for row in rows}
    sizes = {f"{cubes.count} cubes of {size} mm": 1e-3 * size for size, cubes in kr500_grid.CUBES.items()}
    shown = ["none", "one stiffness", *(name for name in sizes if name in by_name)]
    errors = {name: by_name[name].errors for name in shown}
    errors |= {f"{row.name}, {row.measurements}": row.errors for row in rows if row.name.startswith("gauss")}
    whole = (np.inf, by_name["one stiffness"].mean)
    by_size = {}
    for way in ("", ", shrunk", ", shrunk and interpolated"):
        curve = [(size, by_name[name + way].mean) for name, size in sizes.items() if name + way in by_name]
        by_size[way.removeprefix(", ") or "each cube for itself"] = [whole, *curve]
    paper = [(sizes[row.name], row.published) for row in rows if row.published and row.name in sizes]
    by_size["paper, another machine"] = [(np.inf, 0.1049e-3), *paper]
    return check_points_figure(errors, by_size, "KR500, simulated: errors at 128 check points")


def main() -> None:
    """Print all tables; with the name of a file, draw the KR500's errors there."""
    console = Console(width=130)
    for title, truth in KR500.items():
        asked = truth is kr500_grid.published
        rows = kr500_grid.study(kr500_grid.bench(truth))
        console.print(grid_table(f"KR500, 128 check points, {title}", rows, asked))
        if asked and len(sys.argv) > 1:
            save_figure(cubes_figure(rows), sys.argv[1])
        console.print()
    console.print(
        f"Table 4 of seed 003 at its 12 modal values: differs by {table_4():.1e} mm (asked: exact).\n"
    )
    for machine in ("ir663-screws", "ir663-screws-beams"):
        console.print(table_5(machine, ir663_models.table_5(machine), 0.0))
        console.print()
    console.print(table_5("ir663-screws", ir663_models.table_5("ir663-screws", share=0.25), 0.25))
    console.print(f"Noise alone: {1e3 * np.sqrt(3) * ir663_models.SIGMA:.3f} mm.\n")
    console.print(six_joints_table(fuzzy_six_joints.study()))


if __name__ == "__main__":
    main()
