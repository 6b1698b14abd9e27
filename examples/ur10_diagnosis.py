"""Diagnose a UR10 that is calibrated as well as its kinematics allow: 0.4 mm are left, at a noise of 0.01 mm.

Landgraf et al. (CASE 2021, Fraunhofer IPA) measured a UR10 with a laser tracker, without payload, in random
postures (series C) and chosen ones (series B). All kinematics are calibrated on two thirds of 900 postures
and tested on the rest; the diagnosis is asked what is missing. It does not know: is it, then, a matter of the
joints' angles alone?

The measurements (MIT licence) are read from the folder of shared data (BEAMSTIFF_SHARED, default `../shared`
beside the repository). Run `python examples/ur10_diagnosis.py [FIGURE.png]`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from geometric_calibration import (
    POSTURES,
    SERIES,
    SHARED,
    UR10,
    UR10_STAGES,
    Stage,
    held_out,
    read_ur10,
    rows_of,
    stage,
)
from matplotlib.figure import Figure
from rich.console import Console

from beamstiff import load_robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.measure.rows import subset
from beamstiff.report.diagnosis import named
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain, save_figure
from beamstiff.report.tables import Table, table
from beamstiff.se3 import Array

HERE = Path(__file__).resolve().parent
FIGURE = HERE / "output" / "ur10_diagnosis.png"
CLAIM = 1e-5  # m: median of the tracker's standard deviations, by axis
WAVES = (6, 12, 20, 30, 40, 60)  # of a joint's error, at most so many a turn
FINEST, COARSE = 30, 10  # waves drawn; cosines and sines of 1 to 5 are left out: geometry makes such as well
AMPLITUDE, NOISE = 1e-4, 1e-4  # rad, m: ridge of the fit of waves
CONCLUSION = (
    "What it says. Unknown, in both series, at the tracker's noise: no effect of the library closes "
    "anything of the gap on postures held out. Nothing elastic is named, though the arm's own weight "
    "acts.",
    "That is right, and can be checked. An error of each joint that depends on its own angle only, in "
    "waves of up to 30 a turn, closes most of the gap on postures held out; finer waves add little. Where "
    "a joint had the same angles in both series, the two curves, fitted apart, agree. So what is left is "
    "not elastic, not in the lengths and not random: it is in the joints' angles, some tenths of a "
    "milliradian from gears or encoders. No effect of the library is that, and no stiffness will mend it. "
    "To measure: each joint alone, in steps of 1 degree, before the tracker. 0.1 mm remain, still more "
    "than the noise.",
)


def main(figure: Path = FIGURE) -> None:
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 110)
    missing = [name for name in SERIES.values() if not (SHARED / UR10 / name).exists()]
    if missing:
        place = UR10 / missing[0]
        console.print(
            f"Skipped: shared data missing: {place} (set BEAMSTIFF_SHARED to the folder that holds it)"
        )
        return
    robot = load_robot(HERE / "data" / "ur10.yaml")
    curves: dict[str, Waves] = {}
    before: dict[str, float] = {}
    for series in SERIES:
        rows = read_ur10(robot, series)
        chosen = np.sort(np.random.default_rng(0).permutation(len(rows))[:POSTURES])
        some, train = subset(rows, chosen), held_out(POSTURES, 1 / 3)
        stages = {
            name: stage(robot, some, train, geometry, name=name) for name, geometry in UR10_STAGES.items()
        }
        console.print(stage_table(series, stages, train))
        found = stages["all kinematics"]
        fitted = rows_of(found.rows, train)
        claimed = replace(fitted, sigma=np.full((len(fitted), 6), CLAIM), sigma_position=CLAIM)
        console.print(
            "",
            verdict_table(
                {"0.01 mm": diagnose(found.robot, claimed), "nothing": diagnose(found.robot, fitted)}
            ),
            "",
        )
        tested = held_out(len(rows), 1 / 3)
        every = stage(robot, rows, tested, UR10_STAGES["all kinematics"])
        curves[series] = waves(every, tested)
        before[series] = 1e3 * float(np.linalg.norm(every.left[~tested], axis=1).mean())
    console.print(wave_table(curves, before))
    console.print(f"\n{agreement(curves)}")
    for paragraph in CONCLUSION:
        console.print(f"\n{paragraph}")
    figure.parent.mkdir(parents=True, exist_ok=True)
    save_figure(draw(curves, before), figure)
    console.print(f"\nErrors of the joints over their angles: {figure}", soft_wrap=True)


def stage_table(series: str, stages: dict[str, Stage], train: Array) -> Table:
    result = table(f"Series {series}: mean position error, mm", "calibrated", "fitted", "held out", "largest")
    for name, found in stages.items():
        size = found.errors
        result.add_row(name, f"{size[train].mean():.3f}", f"{size[~train].mean():.3f}", f"{size.max():.2f}")
    return result


def verdict_table(told: dict[str, Diagnosis]) -> Table:
    result = table("What is missing", "noise claimed", "verdict", "best effect", "it closes", "gap", left=3)
    for name, one in told.items():
        best = next(item for item in one.candidates if item.shrink is not None)
        assert best.shrink is not None
        result.add_row(
            name,
            f"{named(one.verdict)} ({100 * one.verdict.probability:.0f} %)",
            f"{named(best)} ({100 * best.probability:.0f} %)",
            f"{100 * best.shrink.shrink:.0f} %",
            f"{1e3 * one.rms:.3f} mm RMS",
        )
    return result


@dataclass(frozen=True)
class Waves:
    """Errors of joints 1 to 5 that follow their own angles; joint 6 turns about the reflector.

    Attributes
    ----------
    angle : (N, 5) array, rad
    held_out : tuple of ((mean error fitted, held out), mm), for each of `WAVES`
    factors : (5, 2 FINEST) array, rad
        Of cosines and sines, 1 to FINEST a turn.
    """

    angle: Array
    held_out: tuple[tuple[float, float], ...]
    factors: Array

    def error(self, joint: int, angle: Array) -> Array:
        """Return a joint's error (n,) at angles (n,), rad, without the waves that geometry makes as well."""
        return np.asarray(basis(angle, FINEST)[:, COARSE:] @ self.factors[joint, COARSE:])


def basis(angle: Array, most: int) -> Array:
    """Return cosines and sines (..., 2 most) of an angle, 1 to `most` waves a turn, in pairs."""
    phase = angle[..., None] * np.arange(1, most + 1)
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(*angle.shape, -1)


def waves(found: Stage, train: Array) -> Waves:
    """Fit waves to what a calibration left."""
    baseline = fit_baseline(found.robot, found.rows)
    shapes = [EFFECTS["geometry-error"].shapes(baseline, f"q{k}")[0] for k in range(1, 6)]
    turn = np.stack([shape.columns[:, :3, 0] for shape in shapes], axis=-1)  # (N, 3, 5)
    angle = found.rows.q[:, :5]
    errors, factors = [], np.zeros((5, 2 * FINEST))
    for most in WAVES:
        columns = (turn[..., None] * basis(angle, most)[:, None]).reshape(*found.left.shape, -1)
        scaled = columns[train].reshape(-1, columns.shape[-1]) * (AMPLITUDE / NOISE)
        gram = scaled.T @ scaled + np.eye(scaled.shape[1])
        theta = AMPLITUDE * np.linalg.solve(gram, scaled.T @ (found.left[train].ravel() / NOISE))
        size = 1e3 * np.linalg.norm(found.left - columns @ theta, axis=1)
        errors.append((float(size[train].mean()), float(size[~train].mean())))
        if most == FINEST:
            factors = theta.reshape(5, -1)
    return Waves(angle, tuple(errors), factors)


def common(one: Waves, other: Waves, joint: int) -> Array:
    """Return angles (n,) that a joint had in both series, 0 to 2 pi."""
    edges = np.linspace(0, 2 * np.pi, 73)
    seen = [np.histogram(x.angle[:, joint] % (2 * np.pi), edges)[0] > 8 for x in (one, other)]
    grid = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    return grid[(seen[0] & seen[1])[np.digitize(grid, edges) - 1]]


def wave_table(curves: dict[str, Waves], before: dict[str, float]) -> Table:
    result = table(
        "Errors that follow each joint's own angle: mean position error, mm",
        "waves a turn",
        *(f"series {s}, {what}" for s in curves for what in ("fitted", "held out")),
    )
    result.add_row("none", *(cell for series in curves for cell in ("", f"{before[series]:.3f}")))
    for at, most in enumerate(WAVES):
        result.add_row(
            f"up to {most}", *(f"{value:.3f}" for found in curves.values() for value in found.held_out[at])
        )
    return result


def agreement(curves: dict[str, Waves]) -> str:
    """Say how far the errors found in two series agree where a joint had the same angles."""
    one, other = curves.values()
    parts = []
    for joint in range(5):
        angle = common(one, other, joint)
        if angle.size >= 90:
            both = [found.error(joint, angle) for found in (one, other)]
            parts.append(f"q{joint + 1} {np.corrcoef(*both)[0, 1]:.2f} (over {angle.size / 2:.0f} deg)")
    return "Correlation of the two series' curves over angles they share: " + ", ".join(parts) + "."


def draw(curves: dict[str, Waves], before: dict[str, float]) -> Figure:
    """Return the figure: what waves close, and the joints' errors over their angles in both series."""
    figure = new_figure(12.0, 7.0)
    axes = figure.subplots(2, 3).ravel()
    for (series, found), colour, mark in zip(curves.items(), (BLUE, ORANGE), "os", strict=True):
        held = [before[series], *(pair[1] for pair in found.held_out)]
        axes[0].plot((0, *WAVES), held, color=colour, marker=mark, label=f"series {series}")
        for joint in range(5):
            angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
            edges = np.linspace(0, 2 * np.pi, 73)
            seen = np.histogram(found.angle[:, joint] % (2 * np.pi), edges)[0] > 8
            error = np.where(seen[np.digitize(angle, edges) - 1], found.error(joint, angle), np.nan)
            axes[1 + joint].plot(
                np.degrees(angle), 1e3 * error, color=colour, linewidth=1, label=f"series {series}"
            )
            axes[1 + joint].set(title=f"q{joint + 1}", xlabel="angle, deg", ylabel="error, mrad")
    axes[0].axhline(1e3 * CLAIM * np.sqrt(3), color="black", linestyle=":", label="noise")
    axes[0].set(
        title="Errors that follow the joints' angles",
        xlabel="finest wave, a turn",
        ylabel="mean error held out, mm",
        ylim=(0, None),
    )
    axes[0].legend()
    for one in axes:
        plain(one)
    return figure


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
