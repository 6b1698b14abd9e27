"""Figures of the rows: measured against predicted, the gap over the workspace and over the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.report.html.parts import (
    MARGIN,
    Figure,
    Section,
    Table,
    axis,
    css,
    label,
    numbers,
    plain_layout,
    shared,
)
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

MOST_ROWS = 1000  # that figures and tables show
WORST = 100  # of them in any case
LEGEND = 62  # px above a figure, for its buttons and its legend
JOINTS = 12  # at most, those that vary
MARKS = (("circle", "blue"), ("square", "orange"), ("triangle-up", "green"))
PARTS = {
    "displacement": ((0, "displacement", "mm"), (3, "rotation", "mrad")),
    "absolute": ((0, "deviation", "mm"), (3, "rotation", "mrad")),
}


@dataclass(frozen=True)
class Compared:
    """Rows with what a model says of them.

    Attributes
    ----------
    robot : Robot
    rows : Measurements
    measured, before : (N, 6) array
        Displacement, or deviation from the nominal pose, m and rad; and what the model says of it.
    used : (N, 6) bool array
        What was measured.
    after : (N, 6) array or None
        What the model says with the cause in it.
    """

    robot: Robot
    rows: Measurements
    measured: Array
    before: Array
    used: NDArray[np.bool_]
    after: Array | None = None

    def gap(self, predicted: Array) -> Array:
        """Return the norm of the position gap of every row, mm; NaN where none was measured."""
        seen = self.used[:, :3]
        size = 1e3 * np.linalg.norm(np.where(seen, self.measured[:, :3] - predicted[:, :3], 0.0), axis=1)
        result: Array = np.where(seen.any(axis=1), size, np.nan)
        return result

    @property
    def shown(self) -> NDArray[np.intp]:
        """The rows that are shown: all, or the worst and others evenly chosen."""
        count = len(self.rows)
        if count <= MOST_ROWS:
            return np.arange(count)
        worst = np.argsort(-np.nan_to_num(self.gap(self.before)))[:WORST]
        rest = np.setdiff1d(np.arange(count), worst)
        even = rest[np.linspace(0, rest.size - 1, MOST_ROWS - WORST).astype(int)]
        return np.sort(np.concatenate([worst, even]))

    @property
    def left_out(self) -> str:
        """A sentence on rows that are not shown; empty where all are."""
        if len(self.rows) <= MOST_ROWS:
            return ""
        of = f"{MOST_ROWS} of the {len(self.rows)} rows are shown"
        return f"{of}: the {WORST} worst, and others evenly chosen."


@dataclass(frozen=True)
class RowFigures:
    """Sections that show rows, and the arrays that their figures share."""

    sections: list[Section]
    shared: dict[str, list[Any]]


def row_figures(compared: Compared, names: tuple[str, str] = ("the model", "with the cause")) -> RowFigures:
    """Return the sections that show rows.

    Parameters
    ----------
    compared : Compared
    names : (str, str)
        What the predictions are of, before and after.
    """
    chosen = compared.shown
    gaps = {"before": compared.gap(compared.before)}
    if compared.after is not None:
        gaps["after"] = compared.gap(compared.after)
    kinematics = compile_kinematics(compared.robot)
    poses, number = np.unique(compared.rows.q[chosen], axis=0, return_inverse=True)
    where = posture(kinematics, poses).node_positions[number.reshape(-1)]
    seen = np.array([kinematics.node_index[name] for name in compared.rows.point[chosen].tolist()])
    places = where[np.arange(chosen.size), seen]
    held: dict[str, list[Any]] = {"rows": [label(line_of(compared.rows, at)) for at in chosen.tolist()]}
    held |= {f"gap_{name}": numbers(value[chosen], 4) for name, value in gaps.items()}
    held |= {f"place_{name}": numbers(places[:, k], 4) for k, name in enumerate("xyz")}
    said = compared.left_out
    sections = [_parity(compared, chosen, held, names)]
    if np.isfinite(gaps["before"]).any():
        joints = _joints(compared, chosen, names)
        sections += [
            Section(
                "workspace",
                "Where in the workspace",
                texts=[
                    "The position gap of every row at the place of the tool: from above and from the side. "
                    "Larger and darker is worse." + (f" {said}" if said else "")
                ],
                figures=_maps(max(np.nanmax(value) for value in gaps.values()), list(gaps), names),
            ),
            Section(
                "joints",
                "Over the joints",
                texts=[
                    "The position gap of every row over each joint's reading. A trend points at a joint; so "
                    "does a step."
                ],
                figures=joints,
            ),
        ]
    sections.append(
        Section(
            "rows",
            "The rows",
            texts=[said] if said else [],
            tables=[_table(compared, chosen, gaps, names)],
        )
    )
    return RowFigures([one for one in sections if one.figures or one.tables], held)


def line_of(rows: Measurements, at: int) -> str:
    """Return where a row stands: its line, and the name of its file where there are several."""
    line = f"line {rows.rows[at]}"
    return f"{Path(rows.sources[rows.run[at]]).name}, {line}" if len(rows.sources) > 1 else line


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
            traces: list[dict[str, Any]] = [
                {
                    "type": "scatter",
                    "mode": "lines",
                    "x": ends,
                    "y": ends,
                    "line": {"color": css("muted"), "width": 1},
                    "name": "equal",
                    "hoverinfo": "skip",
                }
            ]
            for k, (symbol, colour) in enumerate(MARKS):
                if used[:, k].any():
                    traces.append(
                        {
                            "type": "scatter",
                            "mode": "markers",
                            "x": shared(f"measured_{first + k}"),
                            "y": numbers(value[:, k], 4),
                            "text": shared("rows"),
                            "hovertemplate": "%{text}: measured %{x}, predicted %{y} " + unit,
                            "name": DISPLACEMENT[first + k],
                            "marker": {"symbol": symbol, "color": css(colour), "size": 6, "opacity": 0.75},
                        }
                    )
            rms = float(np.sqrt(np.nanmean(np.nansum((measured - value) ** 2, axis=1)[used.any(axis=1)])))
            figures.append(
                Figure(
                    f"parity-{what}-{key}",
                    f"{what.capitalize()}, {name}",
                    f"Root mean square of the distance {rms:.3g} {unit}"
                    + ("." if key == "before" else ", fitted to these rows."),
                    traces,
                    plain_layout(
                        400,
                        margin=MARGIN | {"t": LEGEND},
                        xaxis=axis(f"measured {what}, {unit}", range=ends),
                        yaxis=axis(f"predicted {what}, {unit}", range=ends),
                    ),
                )
            )
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


def _maps(most: float, keys: Sequence[str], names: tuple[str, str]) -> list[Figure]:
    figures = []
    for key, name in zip(keys, names, strict=False):
        for a, b, view in (("x", "y", "from above"), ("x", "z", "from the side")):
            trace = {
                "type": "scatter",
                "mode": "markers",
                "x": shared(f"place_{a}"),
                "y": shared(f"place_{b}"),
                "text": shared("rows"),
                "customdata": shared(f"gap_{key}"),
                "hovertemplate": "%{text}: %{customdata} mm<extra></extra>",
                "name": name,
                "marker": {
                    "color": shared(f"gap_{key}"),
                    "size": shared(f"gap_{key}"),
                    "sizemode": "diameter",
                    "sizeref": most / 16 or 1.0,
                    "sizemin": 4,
                    "cmin": 0,
                    "cmax": most,
                    "colorscale": [[0, css("low")], [0.5, css("middle")], [1, css("high")]],
                    "showscale": True,
                    "colorbar": {"title": {"text": "gap, mm", "side": "right"}, "thickness": 12},
                    "line": {"width": 0.5, "color": css("ink")},
                },
            }
            figures.append(
                Figure(
                    f"map-{key}-{a}{b}",
                    f"{name[0].upper()}{name[1:]}, {view}",
                    "",
                    [trace],
                    plain_layout(
                        340,
                        xaxis=axis(f"{a}, m"),
                        yaxis=axis(f"{b}, m", scaleanchor="x", scaleratio=1),
                        showlegend=False,
                    ),
                )
            )
    return figures


def _joints(compared: Compared, chosen: NDArray[np.intp], names: tuple[str, str]) -> list[Figure]:
    figures = []
    turns = {item.name: item.kind != "length" for item in compared.robot.variables}
    varying = [k for k in range(compared.rows.q.shape[1]) if np.ptp(compared.rows.q[chosen, k]) > 0][:JOINTS]
    for k in varying:
        variable = compared.rows.variables[k]
        factor, unit = (180 / np.pi, "deg") if turns.get(variable, True) else (1e3, "mm")
        q = numbers(factor * compared.rows.q[chosen, k], 4)
        traces = []
        for key, name, (symbol, colour) in zip(("before", "after"), names, MARKS, strict=False):
            if key == "before" or compared.after is not None:
                traces.append(
                    {
                        "type": "scatter",
                        "mode": "markers",
                        "x": q,
                        "y": shared(f"gap_{key}"),
                        "text": shared("rows"),
                        "hovertemplate": "%{text}: %{y} mm at %{x} " + unit,
                        "name": name,
                        "marker": {"symbol": symbol, "color": css(colour), "size": 6, "opacity": 0.7},
                    }
                )
        figures.append(
            Figure(
                f"joint-{k + 1}",
                f"Over {variable}",
                "",
                traces,
                plain_layout(
                    320,
                    margin=MARGIN | {"t": LEGEND + 18},
                    xaxis=axis(f"{label(variable)}, {unit}"),
                    yaxis=axis("gap, mm", rangemode="tozero"),
                    showlegend=compared.after is not None,
                ),
            )
        )
    return figures


def _table(
    compared: Compared, chosen: NDArray[np.intp], gaps: dict[str, Array], names: tuple[str, str]
) -> Table:
    rows = compared.rows
    turns = {item.name: item.kind != "length" for item in compared.robot.variables}
    columns = [
        "row",
        "pose",
        *(f"{name}, {'deg' if turns.get(name, True) else 'mm'}" for name in rows.variables),
    ]
    factors = [180 / np.pi if turns.get(name, True) else 1e3 for name in rows.variables]
    blocks = [rows.q[chosen] * factors]
    shown = [k for k in range(6) if compared.used[chosen, k].any()]
    blocks.append(rows.wrench[chosen])
    columns += ["fx, N", "fy, N", "fz, N", "mx, N m", "my, N m", "mz, N m"]
    for what, values in (
        ("measured", np.where(compared.used, compared.measured, np.nan)),
        (names[0], compared.before),
        *([] if compared.after is None else [(names[1], compared.after)]),
    ):
        blocks.append(1e3 * values[chosen][:, shown])
        columns += [f"{DISPLACEMENT[k]} {what}, {'mm' if k < 3 else 'mrad'}" for k in shown]
    blocks += [value[chosen][:, None] for value in gaps.values()]
    columns += [f"gap {name}, mm" for _, name in zip(gaps, names, strict=False)]
    body = np.concatenate(blocks, axis=1) + 0.0  # no -0
    cells = [
        [
            line_of(rows, at),
            str(rows.pose[at]),
            *(f"{value:.4g}" if np.isfinite(value) else "" for value in line),
        ]
        for at, line in zip(chosen.tolist(), body.tolist(), strict=True)
    ]
    return Table(f"All numbers of {len(cells)} rows", tuple(columns), cells, left=1, open=False)
