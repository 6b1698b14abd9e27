"""Sizes of rows, such as their gap, over the workspace and over the joints; and all numbers as a table."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import counted
from beamstiff.measure.table import Measurements
from beamstiff.report.html.parts import (
    Figure,
    Section,
    axis,
    chart_layout,
    css,
    label,
    numbers,
    plain_layout,
    scatter,
    shared,
)
from beamstiff.report.tables import Table
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

MOST_ROWS = 1000  # that figures and tables show
WORST = 100  # of them in any case
MOST_TABLED = 200  # rows of a table, the worst
# colours distinguish values up to this percentile, where the largest is so many times as large
USUAL, OUTLYING = 95, 1.5
LEGEND, BUTTONS = 62, 40  # px above a figure, for its buttons and its legend, and for its buttons alone
JOINTS = 12  # at most, those that vary
MARKS = (("circle", "blue"), ("square", "orange"), ("triangle-up", "green"))
SIDES = {(0, 1): "from above", (0, 2): "from the side", (1, 2): "along x"}
PLANES = ((0, 1), (0, 2))
BEFORE_AFTER = (("circle-open", "orange"), ("circle", "blue"), ("triangle-up", "green"))


@dataclass(frozen=True)
class Sizes:
    """A length of every row, by what it is of."""

    robot: Robot
    rows: Measurements
    values: Mapping[str, Array]  # (N,): by a key for ids, mm; NaN where there is none
    names: Sequence[str]  # of the values, as people read them
    what: str = "gap"  # such as "gap"

    @property
    def shown(self) -> NDArray[np.intp]:
        """The rows that are shown: all, or the worst by the first value and others evenly chosen."""
        count = len(self.rows)
        if count <= MOST_ROWS:
            return np.arange(count)
        worst = np.argsort(-np.nan_to_num(next(iter(self.values.values()))))[:WORST]
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

    @property
    def largest(self) -> float:
        """The largest value, mm; 0 where there is none."""
        return max(float(np.nanmax(one, initial=0.0)) for one in self.values.values())

    @property
    def ceiling(self) -> float:
        """The value from which on all marks look alike: outliers do not flatten the scale."""
        known = [one[np.isfinite(one)] for one in self.values.values()]
        usual = [float(np.percentile(one, USUAL)) for one in known if one.size]
        high = max(usual, default=0.0)
        return high if 0.0 < OUTLYING * high < self.largest else self.largest


def over_places(
    sizes: Sizes, joints: bool = True, planes: Sequence[tuple[int, int]] = PLANES
) -> list[Section]:
    """Return the sections that show the sizes of rows where the tool was, and by joint reading.

    There are none where no row has a size above 0.

    `joints`: show them by joint reading. `planes`: in which the tool's places are drawn.
    """
    chosen, rows = sizes.shown, sizes.rows
    if not sizes.largest > 0.0:  # none, or nothing to see
        return []
    held: dict[str, list[Any]] = {"rows": [label(line_of(rows, at)) for at in chosen.tolist()]}
    held |= {f"size_{key}": numbers(value[chosen], 4) for key, value in sizes.values.items()}
    if sizes.ceiling < sizes.largest:
        drawn = {key: np.minimum(value[chosen], sizes.ceiling) for key, value in sizes.values.items()}
        held |= {f"mark_{key}": numbers(value, 4) for key, value in drawn.items()}
    places = tool_places(sizes.robot, rows, chosen)
    held |= {f"place_{name}": numbers(places[:, k], 4) for k, name in enumerate("xyz")}
    what, said = sizes.what, f" {sizes.left_out}" if sizes.left_out else ""
    sides = " and ".join(SIDES[plane] for plane in planes)
    text = f"The position {what} of every row at the place of the tool: {sides}. Larger and darker is worse."
    title, maps = "Where in the workspace", _maps(sizes, planes)
    sections = [Section("workspace", title, [text + said], maps, open=False, shared=held)]
    if joints:
        text = f"The position {what} of every row over each joint's reading."
        if what != "displacement":
            text += " A trend points at a joint; so does a step."
        sections.append(Section("joints", "Over the joints", [text], _joints(sizes), open=False))
    return sections


def tool_places(robot: Robot, rows: Measurements, chosen: NDArray[np.intp]) -> Array:
    """Return where the measured points of some rows are, (n, 3), m."""
    kinematics = compile_kinematics(robot)
    poses, number = np.unique(rows.q[chosen], axis=0, return_inverse=True)
    where = posture(kinematics, poses).node_positions[number.reshape(-1)]
    seen = np.array([kinematics.node_index[name] for name in rows.point[chosen].tolist()])
    return np.asarray(where[np.arange(chosen.size), seen])


def line_of(rows: Measurements, at: int) -> str:
    """Return where a row stands: its line, and the name of its file where there are several."""
    line = f"line {rows.rows[at]}"
    return f"{Path(rows.sources[rows.run[at]]).name}, {line}" if len(rows.sources) > 1 else line


def rows_table(sizes: Sizes, more: Iterable[tuple[str, Array]]) -> Table:
    """Return all numbers of the worst rows: joint values, load, and more, (N,) each by its heading."""
    robot, rows = sizes.robot, sizes.rows
    last = list(sizes.values.values())[-1]
    chosen = np.argsort(-np.nan_to_num(last), kind="stable")[:MOST_TABLED]
    columns, values = joint_columns(robot, rows.variables)
    blocks = [rows.q * values, rows.wrench]
    columns += ["fx, N", "fy, N", "fz, N", "mx, N m", "my, N m", "mz, N m"]
    for name, value in more:
        columns.append(name)
        blocks.append(value[:, None])
    body = np.concatenate([one[chosen] for one in blocks], axis=1) + 0.0  # no -0
    cells = [
        [line_of(rows, at), str(rows.pose[at]), *(f"{v:.4g}" if np.isfinite(v) else "" for v in line)]
        for at, line in zip(chosen.tolist(), body.tolist(), strict=True)
    ]
    of = f"{len(cells)} of " if len(cells) < len(rows) else ""
    title = f"{of}{counted(len(rows), 'row')}, the largest {sizes.what} first"
    return Table(title, ("row", "pose", *columns), cells, left=1)


def joint_columns(robot: Robot, names: Sequence[str]) -> tuple[list[str], list[float]]:
    """Return headings of joint variables with their units, and the factors from SI."""
    turns = {item.name: item.kind != "length" for item in robot.variables}
    headings = [f"{name}, {'deg' if turns.get(name, True) else 'mm'}" for name in names]
    return headings, [180 / np.pi if turns.get(name, True) else 1e3 for name in names]


def _maps(sizes: Sizes, planes: Sequence[tuple[int, int]]) -> list[Figure]:
    figures, most = [], sizes.ceiling
    above = most < sizes.largest
    more = " (last colour: and above)" if above else ""
    marker: dict[str, Any] = {
        "sizemode": "diameter",
        "sizeref": most / 16 or 1.0,
        "sizemin": 4,
        "cmin": 0,
        "cmax": most,
        "colorscale": [[0, css("low")], [0.5, css("middle")], [1, css("high")]],
        "showscale": True,
        "colorbar": {"title": {"text": f"{sizes.what}, mm{more}", "side": "right"}, "thickness": 12},
        "line": {"width": 0.5, "color": css("ink")},
    }
    for key, name in zip(sizes.values, sizes.names, strict=False):
        for plane in planes:
            (a, b), view = ("xyz"[k] for k in plane), SIDES[plane]
            hover, size = "%{text}: %{customdata} mm<extra></extra>", shared(f"size_{key}")
            mark = shared(f"mark_{key}") if above else size
            trace = scatter(shared(f"place_{a}"), shared(f"place_{b}"), label(name), hover, mode="markers")
            trace |= {
                "text": shared("rows"),
                "customdata": size,
                "marker": marker | {"color": mark, "size": mark},
            }
            up = axis(f"{b}, m", scaleanchor="x", scaleratio=1)
            layout = plain_layout(340, xaxis=axis(f"{a}, m"), yaxis=up, showlegend=False)
            title = f"{name[0].upper()}{name[1:]}, {view}"
            figures.append(Figure(f"map-{key}-{a}{b}", title, "", [trace], layout))
    return figures


def _joints(sizes: Sizes) -> list[Figure]:
    figures, chosen, rows = [], sizes.shown, sizes.rows
    marks = BEFORE_AFTER if len(sizes.values) > 1 else MARKS
    headings, factors = joint_columns(sizes.robot, rows.variables)
    varying = [k for k in range(rows.q.shape[1]) if np.ptp(rows.q[chosen, k]) > 0][:JOINTS]
    for k in varying:
        q = numbers(factors[k] * rows.q[chosen, k], 4)
        hover = "%{text}: %{y} mm at %{x} " + headings[k].rpartition(", ")[2]
        rest = {"text": shared("rows"), "opacity": 0.7}
        traces = [
            scatter(q, shared(f"size_{key}"), label(name), hover, (symbol, colour, 6), **rest)
            for key, name, (symbol, colour) in zip(sizes.values, sizes.names, marks, strict=False)
        ]
        x, y = axis(label(headings[k])), axis(f"{sizes.what}, mm", rangemode="tozero")
        above, both = (LEGEND + 18, True) if len(traces) > 1 else (BUTTONS, False)
        layout = chart_layout(320, above, x, y, showlegend=both)
        figures.append(Figure(f"joint-{k + 1}", f"Over {rows.variables[k]}", "", traces, layout))
    return figures
