"""Figures of the rows: measured against predicted, and the gap wherever it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.measure.doubts import doubts
from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.report.html.parts import (
    MARGIN,
    Figure,
    Section,
    axis,
    css,
    numbers,
    plain_layout,
    scatter,
    shared,
)
from beamstiff.report.html.places import LEGEND, MARKS, RowFigures, Sizes, over_places, rows_table
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

PARTS = {
    "displacement": ((0, "displacement", "mm"), (3, "rotation", "mrad")),
    "absolute": ((0, "deviation", "mm"), (3, "rotation", "mrad")),
}


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


def row_figures(compared: Compared, names: tuple[str, str] = ("the model", "with the cause")) -> RowFigures:
    """Return the sections that show rows.

    `names`: what the predictions are of, before and after.
    """
    gaps = {"before": compared.gap(compared.before)}
    if compared.after is not None:
        gaps["after"] = compared.gap(compared.after)
    sizes = Sizes(compared.robot, compared.rows, gaps, names)
    chosen, said = sizes.shown, sizes.left_out
    over = over_places(sizes)
    held = dict(over.shared)
    more = [
        *_columns(compared, names),
        *((f"gap {name}, mm", one) for name, one in zip(names, gaps.values(), strict=False)),
    ]
    table = rows_table(compared.robot, compared.rows, chosen, more)
    last = Section("rows", "The rows", texts=[said] if said else [], tables=[table])
    sections = [_parity(compared, chosen, held, names), *over.sections, last]
    return RowFigures([one for one in sections if one.figures or one.tables], held)


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


def _parity(
    compared: Compared, chosen: NDArray[np.intp], held: dict[str, list[Any]], names: tuple[str, str]
) -> Section:
    figures = []
    predictions = [("before", compared.before)]
    if compared.after is not None:
        predictions.append(("after", compared.after))
    for first, what, unit in PARTS[compared.rows.kind]:
        part = slice(first, first + 3)
        used = compared.used[chosen][:, part]
        if not used.any():
            continue
        measured = np.where(used, 1e3 * compared.measured[chosen][:, part], np.nan)
        values = [np.where(used, 1e3 * predicted[chosen][:, part], np.nan) for _, predicted in predictions]
        whole = np.concatenate([measured, *values])
        margin = 0.05 * float(np.nanmax(whole) - np.nanmin(whole)) or 0.05
        ends = numbers(np.array([np.nanmin(whole) - margin, np.nanmax(whole) + margin]))
        for k in range(3):
            held[f"measured_{first + k}"] = numbers(measured[:, k], 4)
        for (key, _), value, name in zip(predictions, values, names, strict=False):
            traces = [scatter(ends, ends, "equal", line={"color": css("muted"), "width": 1})]
            hover = "%{text}: measured %{x}, predicted %{y} " + unit
            for k, (symbol, colour) in enumerate(MARKS):
                if used[:, k].any():
                    x, y = shared(f"measured_{first + k}"), numbers(value[:, k], 4)
                    trace = scatter(x, y, DISPLACEMENT[first + k], hover, (symbol, colour, 6), opacity=0.75)
                    traces.append(trace | {"text": shared("rows")})
            rms = float(np.sqrt(np.nanmean(np.nansum((measured - value) ** 2, axis=1)[used.any(axis=1)])))
            layout = plain_layout(
                400,
                margin=MARGIN | {"t": LEGEND},
                xaxis=axis(f"measured {what}, {unit}", range=ends),
                yaxis=axis(f"predicted {what}, {unit}", range=ends),
            )
            caption = f"Root mean square of the distance {rms:.3g} {unit}"
            caption += "." if key == "before" else ", fitted to these rows."
            title = f"{what.capitalize()}, {name}"
            figures.append(Figure(f"parity-{what}-{key}", title, caption, traces, layout))
    kind = "displacement" if compared.rows.kind == "displacement" else "deviation from the nominal pose"
    return Section(
        "parity",
        "Measured against predicted",
        texts=[
            f"On the line the model is right. Shown is the {kind} of every row, component by component; "
            "the numbers are in the table of rows below."
        ],
        figures=figures,
    )
