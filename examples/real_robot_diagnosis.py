"""Diagnose real robots from their nominal models; check what is promised on postures that were not fitted.

- UR10, laser tracker (Landgraf et al., CASE 2021): 0.5 mm are left with all kinematics calibrated.
- Agile Justin, right arm (Tenhumberg and Baeuml, Humanoids 2021), an elastic humanoid: the published stages
  leave 10.5 mm with all kinematics, 5.6 mm with joints that give way, 3.1 mm with bearings that do as well.

Each third run of postures is held out. The measurements are read from the folder of shared data
(BEAMSTIFF_SHARED, default `../shared` beside the repository).
Run `python examples/real_robot_diagnosis.py [FIGURE.png]`; it takes a minute or two.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from geometric_calibration import JUSTIN, SERIES, SHARED, UR10, read_justin, read_ur10
from rich.console import Console

from beamstiff import Robot, diagnose, load_robot, verify
from beamstiff.diagnosis.apply import extended
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain, save_figure
from beamstiff.report.tables import table

HERE = Path(__file__).resolve().parent
FIGURE = HERE / "output" / "real_robot_diagnosis.png"
RUN = 25  # postures in a row that are fitted, or held out: effects may remember the one before


def ur10() -> tuple[Robot, Measurements, float]:
    """Return the UR10, 900 of its random postures and the noise of its tracker, m."""
    robot = load_robot(HERE / "data" / "ur10.yaml")
    return robot, subset(read_ur10(robot, "C"), np.arange(900)), 1e-5


def justin() -> tuple[Robot, Measurements, float]:
    """Return Justin's torso and right arm, its 500 postures and a guess of its cameras' noise, m."""
    robot = load_robot(HERE / "data" / "agile_justin.yaml").model_copy(update={"tcp": "hand_r"})
    return robot, read_justin(robot, "r"), 1e-3


ROBOTS: dict[str, tuple[Path, Callable[[], tuple[Robot, Measurements, float]]]] = {
    "UR10": (UR10 / SERIES["C"], ur10),
    "Agile Justin": (JUSTIN, justin),
}


def main(path: Path = FIGURE) -> None:
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 110)
    for data, _ in ROBOTS.values():
        if not (SHARED / data).exists():
            console.print(
                f"Skipped: shared data missing: {data} (set BEAMSTIFF_SHARED to the folder that holds it)"
            )
            return
    figure = new_figure(11.0, 4.0)
    for axes, (name, (_, load)) in zip(figure.subplots(1, 2), ROBOTS.items(), strict=True):
        robot, rows, noise = load()
        rows = replace(rows, sigma=np.where(rows.measured_mask, noise, np.nan), sigma_position=noise)
        held = np.arange(len(rows)) // RUN % 3 == 1
        found = diagnose(robot, subset(rows, np.flatnonzero(~held)))
        causes = found.to_dict()["causes"]
        checked = verify(extended(found), subset(rows, np.flatnonzero(held)), refit_frame=True)
        result = table(f"{name}: position gap, RMS, mm", "model", "cross-validated", "closes", left=1)
        result.add_row("geometry calibrated", f"{1e3 * found.rms:.3f}", "")
        names, left = ["geometry"], [1e3 * found.rms]
        for cause in causes:
            names.append(f"{cause['effect']}\n{cause['component'] or ''}")
            left.append(cause["rms_after_mm"])
            result.add_row(
                f"and {names[-1].strip()}".replace("\n", " at "), f"{left[-1]:.3f}", f"{cause['closes']:.0%}"
            )
        console.print(result)
        console.print(
            f"Promised {checked.promised or 0.0:.0%}; on {held.sum()} rows that were not fitted the causes "
            f"leave {1e3 * checked.after:.3f} mm: true {checked.true:.0%}.\n"
        )
        axes.bar(names, left, color=BLUE, label="cross-validated")
        axes.axhline(1e3 * checked.after, color=ORANGE, label="with all, postures not fitted")
        axes.set(title=name, ylabel="position gap, RMS, mm")
        axes.tick_params(axis="x", labelsize="x-small", labelrotation=30)
        axes.legend(fontsize="small")
        plain(axes)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)
    console.print(f"What each cause leaves: {path}", soft_wrap=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
