"""Models side by side: errors by what was held out and by load, and over the workspace."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import RenderableType

from beamstiff.errors import BeamstiffError, counted
from beamstiff.functions.checks import effects_text
from beamstiff.identification.models.side_by_side import Judged, Models
from beamstiff.identification.models.split import KINDS
from beamstiff.report.figures import new_figure, plain
from beamstiff.report.tables import Table, table
from beamstiff.report.verdict import Verdict, data_of, level_of, rounded
from beamstiff.se3 import Array

COLUMNS = 3  # of maps side by side
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def models_told(models: Models) -> Iterator[RenderableType]:
    """Yield what a terminal shows of models side by side."""
    name = "" if models.robot is None else f"{models.robot.name}: "
    yield from models_verdict(models).lines()
    yield models_table(models, f"{name}position error, RMS / max, mm")
    yield ""
    yield loads_table(models)
    yield from ("", *models_text(models))


def models_table(models: Models, title: str) -> Table:
    """Return RMS and largest error of every model, by what was held out: fitted, new poses, new loads."""
    kinds, counts = np.unique(models.split.kind, return_counts=True)
    heads = (f"{KINDS[kind]} ({count})" for kind, count in zip(kinds, counts, strict=True))
    result = table(title, "model", *heads, "outside", "time, s")
    for one in models.judged:
        cells = ["-"] * (len(kinds) + 2)
        if one.model is not None:
            cells = [_both(one, models.split.kind == kind) for kind in kinds]
            cells += [str(int(one.outside.sum()) or ""), f"{one.seconds:.2f}"]
        result.add_row(one.name, *cells)
    return result


def loads_table(models: Models) -> Table:
    """Return RMS and largest error of every model over the rows that were not fitted, by load."""
    split = models.split
    some = {f"{split.loads[at]:.4g} {split.unit}": rows for at, rows in held_out_levels(models).items()}
    some |= {"all": ~split.fitted} if len(some) > 1 else {}
    result = table("Held-out rows, by load: RMS / max, mm", "model", *some)
    for one in models.judged:
        if one.model is not None:
            result.add_row(one.name, *(_both(one, rows) for rows in some.values()))
    return result


def held_out_levels(models: Models) -> dict[int, NDArray[np.bool_]]:
    """Return the rows that were not fitted, by the number of their load."""
    rows = {at: ~models.split.fitted & (models.split.level == at) for at in range(len(models.split.loads))}
    return {at: some for at, some in rows.items() if some.any()}


def ranked(models: Models) -> list[Judged]:
    """Return the models that answer for rows that were not fitted, the best first.

    Those that have no answer for some of these rows come last: their error is of fewer rows.
    """
    unseen = ~models.split.fitted
    answered = [one for one in models.judged if one.rms(unseen) is not None]
    return sorted(answered, key=lambda one: (not whole(models, one), one.rms(unseen) or 0.0))


def whole(models: Models, one: Judged) -> bool:
    """Return whether a model answers for every row that was not fitted."""
    seen = np.isfinite(models.table.displacement[:, :3]).any(axis=1)
    return bool(np.isfinite(one.error[~models.split.fitted & seen]).all())


def models_verdict(models: Models) -> Verdict:
    """Return the headline: which model predicts held-out rows best, and its error over the noise."""
    best, data = ranked(models), data_of(models.table)
    if not best or models.split.fitted.all():
        said, action = "No model could be tested on held-out rows", "Measure more postures."
        return Verdict(said, data=data, action=action)
    first, unseen = best[0], ~models.split.fitted
    rms = first.rms(unseen) or 0.0
    held = counted(int(unseen.sum()), "held-out row")
    said = f"{first.name} predicts best: {rounded(1e3 * rms)} mm RMS on {held}"
    action = "--out FILE writes the robot with this model."
    if not models.noise:
        return Verdict(said, data=data, action=action)
    level = level_of(rms / models.noise)
    if level != "agrees":
        action = "All of them leave more than noise: beamstiff diagnose says what is missing."
    return Verdict(f"{said}, {rms / models.noise:.1f} times the noise", level, data, action)


def models_text(models: Models) -> list[str]:
    """Return what came out of each model, a line each, and the noise floor."""
    lines = [f"{one.name}: {one.about}" for one in models.judged]
    if models.noise is not None:
        lines.append(f"Noise floor: {1e3 * models.noise:.4f} mm RMS.")
    if models.robot is not None and models.robot.effects:
        effects = effects_text(models.robot.effects)
        lines.append(f"All models include the robot's effects unchanged: {effects}.")
    return lines


def _both(one: Judged, rows: NDArray[np.bool_]) -> str:
    rms, largest = one.rms(rows), one.largest(rows)
    return "-" if rms is None or largest is None else f"{1e3 * rms:.4f} / {1e3 * largest:.3f}"


def models_figure(models: Models, title: str) -> Figure:
    """Draw every model's errors over the workspace, one scale for all, and their RMS by load."""
    shown = [one for one in models.judged if np.isfinite(one.error).any() and one.name != "rigid"]
    if not shown:
        raise BeamstiffError(f"{models.table.source}: no model has an answer, so there is nothing to draw")
    rows = -(-(len(shown) + 1) // COLUMNS)
    figure = new_figure(4.4 * COLUMNS, 3.5 * rows)
    what = "position error over the workspace, mm: RMS / max not fitted (squares: new poses)"
    figure.suptitle(f"{title}: {what}" if title else what.capitalize())
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    across, up = widest_plane(models.position)
    largest = 1e3 * max(float(np.nanmax(one.error)) for one in shown)
    drawn = [_map(axes, one, models, across, up, largest) for axes, one in zip(panels, shown, strict=False)]
    figure.colorbar(drawn[-1], ax=panels[: len(shown)].tolist(), label="mm", shrink=0.6)
    _by_load(panels[len(shown)], shown, models)
    for axes in panels[len(shown) + 1 :]:
        axes.set_visible(False)
    return figure


def widest_plane(position: Array) -> tuple[int, int]:
    """Return the two axes along which the positions spread most, the vertical one upwards."""
    first, second = sorted(np.argsort(np.ptp(position, axis=0))[1:].tolist())
    return first, second


def _map(axes: Axes, one: Judged, models: Models, across: int, up: int, largest: float) -> PathCollection:
    """Draw one model's errors: at each place the largest that was not fitted, on top."""
    split = models.split
    look: dict[str, Any] = {"s": 30, "edgecolors": "black", "linewidths": 0.3}
    for held, marker in ((False, "o"), (True, "s")):
        own = np.isfinite(one.error) & (split.new_pose == held)
        own &= ~split.fitted | np.isin(models.table.pose, models.table.pose[~split.fitted], invert=True)
        order = np.flatnonzero(own)[np.argsort(one.error[own])]
        x, y = models.position[order, across], models.position[order, up]
        result = axes.scatter(
            x, y, c=1e3 * one.error[order], marker=marker, cmap="viridis", vmin=0.0, vmax=largest, **look
        )
    axes.set_title(f"{one.name}: {_both(one, ~models.split.fitted)}", fontsize="medium")
    axes.set(xlabel=f"{'xyz'[across]} of the TCP, m", ylabel=f"{'xyz'[up]} of the TCP, m")
    plain(axes)
    return result


def _by_load(axes: Axes, shown: Sequence[Judged], models: Models) -> None:
    levels, loads = held_out_levels(models), models.split.loads
    for one, marker in zip(shown, MARKERS * 2, strict=False):
        values = [one.rms(rows) for rows in levels.values()]
        drawn = [np.nan if value is None else 1e3 * value for value in values]
        axes.plot([loads[at] for at in levels], drawn, marker=marker, label=one.name, linewidth=1)
    axes.set(xlabel=f"load, {models.split.unit}", ylabel="held-out RMS, mm")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False, fontsize="small")
    plain(axes)
