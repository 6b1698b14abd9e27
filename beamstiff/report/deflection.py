"""Table, sentences and figure of predicted displacements: the gap to measured ones, the effects included."""

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure
from rich.console import RenderableType

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.functions.checks import effects_text
from beamstiff.functions.predict import Prediction
from beamstiff.measure.table import DISPLACEMENT
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain
from beamstiff.report.tables import Table, number, table
from beamstiff.report.verdict import Level, Verdict, data_of, level_of, rounded
from beamstiff.se3 import Array

ROUNDING = 1e-12
SHOWN = 0.01  # share of the strain energy from which a part is listed
UNITS = ("mm",) * 3 + ("mrad",) * 3


def deflection_told(found: Prediction) -> Iterator[RenderableType]:
    """Yield what a terminal shows of predicted displacements."""
    yield from deflection_verdict(found).lines()
    yield from (deflection_table(found), "\n".join(deflection_text(found)))


def deflection_table(found: Prediction) -> Table:
    """Return a table of the displacement of every row, beside what was measured of it.

    Of absolute rows: of where its point is predicted, base frame, and of its displacement.
    """
    rows, name = found.rows, found.robot.name
    units = [f"{name} [{unit}]" for name, unit in zip(DISPLACEMENT, UNITS, strict=True)]
    moved, seen = 1e3 * without_rounding(found.displacement), 1e3 * rows.measured
    if found.pose is None:
        title = f"{name}: predicted displacement, loaded minus unloaded, base frame"
        title += ", with gravity and K_C" if found.preload else ""
        columns, heads, shown = units, units, number
        predicted = [[*map(number, row)] for row in moved]
    else:
        title = f"{name}: predicted position, base frame, and displacement from the undeformed machine"
        columns, shown = [f"{axis} [mm]" for axis in "xyz"], "{:.3f}".format
        heads = [*columns, *units[:3]]
        placed = zip(1e3 * found.pose[:, :3], moved[:, :3], strict=True)
        predicted = [[*map(shown, at), *map(number, by)] for at, by in placed]
    compared = np.flatnonzero(rows.measured_mask[:, : len(columns)].any(axis=0)).tolist()
    measured = [["" if np.isnan(row[at]) else shown(row[at]) for at in compared] for row in seen]
    cells = zip(rows.rows.tolist(), predicted, measured, strict=True)
    heads = ["line", *heads, *(f"measured {columns[at]}" for at in compared)]
    return table(title, *heads, rows=([str(line), *one, *other] for line, one, other in cells))


def deflection_verdict(found: Prediction) -> Verdict:
    """Return the headline: the gap to what was measured, against the noise, or how far the tool moves."""
    moved = 1e3 * np.linalg.norm(found.displacement[:, :3], axis=1).max()
    most = f"The tool moves {number(moved)} mm at most"
    known, data = np.isfinite(found.gap), data_of(found.rows)
    if not known.any() or found.pose is not None:
        action = "Compare it with what the task allows, or with a measured table."
        return Verdict(most, data=data, action=action)
    gap = float(np.sqrt((found.gap[known] ** 2).mean()))
    sigma = np.nan_to_num(found.rows.sigma[known][:, :3])
    noise = float(np.sqrt((sigma**2).sum(axis=1).mean()))
    level: Level = level_of(gap / noise) if noise > 0.0 else "plain"
    times = f", {gap / noise:.1f} times the noise" if noise > 0.0 else ""
    action = "Use the model within these postures and loads."
    if level != "agrees":
        action = "Fit the stiffness (beamstiff identify), or ask for the cause (beamstiff diagnose)."
    said = f"{most}; measured and predicted differ by {rounded(1e3 * gap)} mm{times}"
    return Verdict(said, level, data, action)


def deflection_text(found: Prediction) -> list[str]:
    """Return sentences: the gap between measured and predicted positions, and effects that are in it."""
    said = []
    if found.robot.model is not None:
        said.append(f"By the robot's model ({found.robot.model.kind}), fitted to {found.robot.model.source}.")
    if found.std is not None:
        std = np.linalg.norm(1e3 * found.std[:, :3], axis=1)
        said.append(
            f"Standard deviation of the predicted position: {number(np.median(std))} mm in the middle, "
            f"{number(std.max())} mm at most."
        )
    gap = 1e3 * found.gap[np.isfinite(found.gap)]
    if gap.size:
        said.append(
            f"Gap between measured and predicted position: RMS {number(np.sqrt((gap**2).mean()))} mm, "
            f"at most {number(gap.max())} mm, over {gap.size} rows."
        )
    if found.pose is not None and gap.size:
        said.append(
            "Readings in a frame of the tracker's own: `beamstiff verify --refit-frame` fits it first."
        )
    most = int(np.linalg.norm(found.displacement[:, :3], axis=1).argmax())
    where = f"in {found.rows.place(most)}, where the tool moves most"
    if found.robot.effects:
        whole = number(1e3 * float(np.linalg.norm(found.displacement[most, :3])))
        said.append(
            f"Of the {whole} mm {where}, effects in the robot file make: {_effects_text(found, most)}."
        )
    if shares := found.energy_shares(most):
        parts = [f"{name} {100 * share:.0f} %" for name, share in shares.items() if share >= SHOWN]
        weight = " and the weight" if found.pose is not None else ""
        what = f"What is compliant {where}"
        if found.robot.effects:
            what = "The rest, without these effects, is the compliance of"
        said.append(f"{what}: {', '.join(parts)} of the strain energy under the load{weight}.")
    return said


def _effects_text(found: Prediction, row: int) -> str:
    """Return the effects of a robot in words, with how far each by itself moves the tool in a row, mm."""
    said = []
    for one in found.robot.effects:
        alone = found.robot.model_copy(update={"effects": (one,)})
        moved = 1e3 * float(np.linalg.norm(effects_displacement(alone, found.rows)[row, :3]))
        said.append(f"{effects_text([one])} {number(moved)} mm")
    return ", ".join(said)


def deflection_figure(found: Prediction) -> Figure:
    """Draw how far every row moves, and where displacements or positions were measured, the gap to them."""
    rows, known = found.rows, np.asarray(np.isfinite(found.gap))
    figure = new_figure(7.0, 3.2 + 2.2 * known.any())
    axes = figure.subplots(1 + int(known.any()), 1, sharex=True, squeeze=False).ravel()
    seen = rows.measured_mask[:, :3] if rows.kind == "displacement" else np.zeros((len(rows), 3), dtype=bool)
    own = np.asarray(seen.any(axis=1))
    counted = seen | ~own[:, None]  # what was measured of a row, or all of it
    moved = 1e3 * np.linalg.norm(np.where(counted, found.displacement[:, :3], 0.0), axis=1)
    one_table = len(rows.sources) == 1
    at = rows.rows if one_table else np.arange(1, len(rows) + 1)
    axes[0].plot(at, moved, "o", color=BLUE, label="predicted")
    if own.any():
        size = 1e3 * np.linalg.norm(np.where(seen, rows.displacement[:, :3], 0.0), axis=1)
        axes[0].plot(at[own], size[own], "x", color=ORANGE, label="measured")
        axes[0].legend()
    axes[0].set(ylabel="displacement, mm", title=found.robot.name.replace("$", r"\$"))
    if known.any():
        axes[1].plot(at[known], 1e3 * found.gap[known], "s", color=ORANGE)
        axes[1].set(ylabel="measured less\npredicted, mm")
    axes[-1].set_xlabel("line of the table" if one_table else "row")
    for one in axes:
        one.set_ylim(bottom=0.0)
        plain(one)
    return figure


def without_rounding(displacement: Array) -> Array:
    """Return displacements with what is rounding beside the largest of them (m, rad) set to 0."""
    size = np.abs(displacement)
    return np.where(size > ROUNDING * size.max(initial=0.0), displacement, 0.0)
