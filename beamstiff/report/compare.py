"""Models side by side: errors by what was held out and by load, and over the workspace."""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import RenderableType

from beamstiff.errors import BeamstiffError
from beamstiff.functions.checks import effects_text
from beamstiff.identification.models.side_by_side import Judged, Models
from beamstiff.identification.models.split import KINDS
from beamstiff.report.figures import new_figure, plain
from beamstiff.report.tables import Table, counted, table
from beamstiff.report.verdict import Verdict, data_of, level_of, rounded
from beamstiff.se3 import Array

AXES = ("x", "y", "z")
COLUMNS = 3  # of maps side by side
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def models_told(models: Models) -> Iterator[RenderableType]:
    """Yield what a terminal shows of models side by side."""
    name = "" if models.robot is None else f"{models.robot.name}: "
    yield from models_verdict(models).lines()
    yield models_table(models, f"{name}position error, RMS / max, mm")
    yield ""
    yield loads_table(models, "Held-out rows, by load: RMS / max, mm")
    yield from ("", *models_text(models))


def models_table(models: Models, title: str) -> Table:
    """Return RMS and largest error of every model, by what was held out: fitted, new poses, new loads."""
    kinds = [kind for kind in range(len(KINDS)) if (models.split.kind == kind).any()]
    counts = np.bincount(models.split.kind, minlength=len(KINDS))
    result = table(
        title, "model", *(f"{KINDS[kind]} ({counts[kind]})" for kind in kinds), "outside", "time, s"
    )
    for one in models.judged:
        if one.model is None:
            result.add_row(one.name, *("-" for _ in kinds), "-", "-")
            continue
        cells = [_both(one, models.split.kind == kind) for kind in kinds]
        result.add_row(one.name, *cells, str(int(one.outside.sum()) or ""), f"{one.seconds:.2f}")
    return result


def loads_table(models: Models, title: str) -> Table:
    """Return RMS and largest error of every model over the rows that were not fitted, by load."""
    split = models.split
    levels = [at for at in range(len(split.loads)) if (~split.fitted & (split.level == at)).any()]
    heads = [f"{split.loads[at]:.4g} {split.unit}" for at in levels]
    result = table(title, "model", *heads, *(["all"] if len(levels) > 1 else []))
    for one in models.judged:
        if one.model is None:
            continue
        cells = [_both(one, ~split.fitted & (split.level == at)) for at in levels]
        result.add_row(one.name, *cells, *([_both(one, ~split.fitted)] if len(levels) > 1 else []))
    return result


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
    if not models.noise:
        return Verdict(said, data=data, action="--out FILE writes the robot with this model.")
    level = level_of(rms / models.noise)
    action = "--out FILE writes the robot with this model."
    if level != "agrees":
        action = "All of them leave more than noise: beamstiff diagnose says what is missing."
    return Verdict(f"{said}, {rms / models.noise:.1f} times the noise", level, data, action)


def models_text(models: Models) -> list[str]:
    """Return what came out of each model, a line each, and the noise floor."""
    lines = [f"{one.name}: {one.about}" for one in models.judged]
    if models.noise is not None:
        lines.append(f"Noise floor: {1e3 * models.noise:.4f} mm RMS.")
    if models.robot is not None and models.robot.effects:
        lines.append(
            f"All models include the robot's effects unchanged: {effects_text(models.robot.effects)}."
        )
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
    drawn: PathCollection | None = None
    for axes, one in zip(panels, shown, strict=False):
        drawn = _map(axes, one, models, across, up, largest)
    assert drawn is not None
    figure.colorbar(drawn, ax=panels[: len(shown)].tolist(), label="mm", shrink=0.6)
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
    result: PathCollection | None = None
    split = models.split
    for held, marker in ((False, "o"), (True, "s")):
        own = np.isfinite(one.error) & (split.new_pose == held)
        own &= ~split.fitted | np.isin(models.table.pose, models.table.pose[~split.fitted], invert=True)
        order = np.flatnonzero(own)[np.argsort(one.error[own])]
        result = axes.scatter(
            models.position[order, across],
            models.position[order, up],
            c=1e3 * one.error[order],
            marker=marker,
            s=30,
            cmap="viridis",
            vmin=0.0,
            vmax=largest,
            edgecolors="black",
            linewidths=0.3,
        )
    axes.set_title(f"{one.name}: {_both(one, ~models.split.fitted)}", fontsize="medium")
    axes.set_xlabel(f"{AXES[across]} of the TCP, m")
    axes.set_ylabel(f"{AXES[up]} of the TCP, m")
    plain(axes)
    assert result is not None
    return result


def _by_load(axes: Axes, shown: Sequence[Judged], models: Models) -> None:
    split = models.split
    unseen = ~split.fitted
    levels = [at for at in range(len(split.loads)) if (unseen & (split.level == at)).any()]
    for one, marker in zip(shown, MARKERS * 2, strict=False):
        values = [one.rms(unseen & (split.level == at)) for at in levels]
        drawn = [np.nan if value is None else 1e3 * value for value in values]
        axes.plot([split.loads[at] for at in levels], drawn, marker=marker, label=one.name, linewidth=1)
    axes.set_xlabel(f"load, {split.unit}")
    axes.set_ylabel("held-out RMS, mm")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False, fontsize="small")
    plain(axes)
