"""Figures of the rows: residuals over load and posture, and the gap wherever it is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.measure.plausibility import doubts
from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.report.html.parts import (
    MARGIN,
    Figure,
    Section,
    axis,
    chart_layout,
    label,
    numbers,
    plain_layout,
    scatter,
    shared,
)
from beamstiff.report.html.places import (
    BEFORE_AFTER,
    LEGEND,
    MARKS,
    Sizes,
    line_of,
    over_places,
    rows_table,
)
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

OFF_UNDEFORMED = (
    "dx, dy and dz, read and predicted: distance along the base axes from where the geometry puts the point "
    "without load and weight."
)
ALONG = 0.02  # share of a force from which it acts along an axis as well
ROUNDED = 1  # decimals, N, to which forces are of one load level


@dataclass(frozen=True)
class Compared:
    """Rows with what a model says of them."""

    robot: Robot
    rows: Measurements
    # measured, before: (N, 6): displacement, or deviation from the nominal pose, m and rad; and what the
    # model says of it
    measured: Array
    before: Array
    used: NDArray[np.bool_]  # (N, 6) bool: what was measured
    after: Array | None = None  # (N, 6): what the model says with the cause in it

    def gap(self, predicted: Array) -> Array:
        """Return the norm of the position gap of every row, mm; NaN where none was measured."""
        seen = self.used[:, :3]
        size = 1e3 * np.linalg.norm(np.where(seen, self.measured[:, :3] - predicted[:, :3], 0.0), axis=1)
        return np.asarray(np.where(seen.any(axis=1), size, np.nan))


def minded(rows: Measurements, robot: Robot) -> list[str]:
    """Return what in a table looks like a mistake, as a page says it before all else."""
    return [f"Mind first: {doubt}" + ("" if doubt.endswith("?") else ".") for doubt in doubts(rows, robot)]


def row_figures(
    compared: Compared, names: tuple[str, str] = ("the model", "with the cause")
) -> list[Section]:
    """Return the sections that show rows; `names`: what the predictions before and after are of."""
    gaps = {"before": compared.gap(compared.before)}
    if compared.after is not None:
        gaps["after"] = compared.gap(compared.after)
    sizes = Sizes(compared.robot, compared.rows, gaps, names)
    norms = ((f"gap {name}, mm", one) for name, one in zip(names, gaps.values(), strict=False))
    table = rows_table(sizes, [*_columns(compared, names), *norms])
    texts = [OFF_UNDEFORMED] if compared.rows.kind == "absolute" else []
    last = Section("rows", "The rows", texts, tables=[table], open=False)
    sections = [_residuals(compared, sizes), *over_places(sizes), last]
    return [one for one in sections if one.figures or one.tables]


def _columns(compared: Compared, names: tuple[str, str]) -> Iterator[tuple[str, Array]]:
    """Yield what was measured and predicted, component by component, with its heading."""
    kinds = [
        ("measured", np.where(compared.used, compared.measured, np.nan)),
        (names[0], compared.before),
        *([] if compared.after is None else [(names[1], compared.after)]),
    ]
    for what, values in kinds:
        for k in np.flatnonzero(compared.used.any(axis=0)).tolist():
            yield f"{DISPLACEMENT[k]} {what}, {'mm' if k < 3 else 'mrad'}", 1e3 * values[:, k]


def _residuals(compared: Compared, sizes: Sizes) -> Section:
    """Return the residual over the load, component by component, and over the postures in their order."""
    chosen, names = sizes.shown, sizes.names
    predictions = [compared.before, *([] if compared.after is None else [compared.after])]
    figures, held = [], dict[str, list[Any]]()
    if compared.used[chosen][:, :3].any():
        figures = list(_over_load(compared, chosen, predictions, names))
    if sizes.largest > 0.0:
        held["pose"] = [int(at) for at in compared.rows.pose[chosen]]
        marks = BEFORE_AFTER if len(sizes.values) > 1 else MARKS
        x, hover, rows = shared("pose"), "%{text}, pose %{x}: %{y} mm", shared("rows")
        traces = [
            scatter(x, shared(f"size_{key}"), label(name), hover, (symbol, colour, 6), text=rows)
            for key, name, (symbol, colour) in zip(sizes.values, names, marks, strict=False)
        ]
        up = axis("size of the residual, mm", rangemode="tozero")
        layout = chart_layout(340, LEGEND, axis("pose"), up, showlegend=len(traces) > 1)
        figures.append(Figure("residual-pose", "Over the poses", "", traces, layout))
    title = "Residuals, before and after" if compared.after is not None else "Residuals"
    text = "Measured minus predicted position. A pattern over load or posture is more than noise."
    return Section("residuals", title, [text], figures, shared=held)


def _over_load(
    compared: Compared, chosen: NDArray[np.intp], predictions: Sequence[Array], names: Sequence[str]
) -> Iterator[Figure]:
    used = compared.used[chosen][:, :3]
    force = compared.rows.wrench[chosen][:, :3]
    if not np.any(force):
        return
    gaps = [
        np.where(used, 1e3 * (compared.measured - predicted)[chosen][:, :3], np.nan)
        for predicted in predictions
    ]
    # rows without a load along an axis say nothing of it: they would stand on top of one another at 0
    loaded = np.abs(force) > ALONG * np.linalg.norm(force, axis=1, keepdims=True)
    seen = used & loaded
    if np.unique(np.round(force[seen], ROUNDED)).size < 2:  # one vertical line: beside it, rows without load
        seen = seen | (used & (force == 0.0).all(axis=1, keepdims=True))
        if np.unique(np.round(force[seen], ROUNDED)).size < 2:
            return
    lines = [label(line_of(compared.rows, at)) for at in chosen.tolist()]
    most = 1.08 * max(float(np.nanmax(np.abs(gap))) for gap in gaps) or 0.05  # one scale for both
    for gap, name, key in zip(gaps, names, ("before", "after"), strict=False):
        traces = []
        for k, (symbol, colour) in enumerate(MARKS):
            own = seen[:, k]
            if own.any():
                hover = f"%{{text}}: %{{y}} mm under %{{x}} N along {'xyz'[k]}"
                x, y = numbers(force[own, k], 4), numbers(gap[own, k], 4)
                trace = scatter(x, y, "xyz"[k], hover, (symbol, colour, 6), opacity=0.75)
                traces.append(trace | {"text": [lines[at] for at in np.flatnonzero(own).tolist()]})
        if not traces:
            return
        layout = plain_layout(
            340,
            margin=MARGIN | {"t": LEGEND},
            xaxis=axis("force along the same axis, N"),
            showlegend=True,  # of one axis too
            yaxis=axis("residual, mm", range=[-most, most]),
        )
        yield Figure(f"residual-load-{key}", f"Over the load: {name}", "", traces, layout)
