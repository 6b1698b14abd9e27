"""Charts: bars and intervals of named values, curves of errors, matrices as coloured squares."""

from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import Any

import numpy as np

from beamstiff.report.html.parts import (
    Figure,
    axis,
    chart_layout,
    css,
    label,
    numbers,
    plain_layout,
    scatter,
    shared,
)
from beamstiff.report.html.places import BEFORE_AFTER, LEGEND
from beamstiff.report.tables import Table
from beamstiff.se3 import Array

ROW = 30  # px
DECADES = 4  # ticks of a logarithmic axis at most, and of intervals: a phone's labels must not meet
WIDEST = 34  # characters of a name
LINES = (("solid", "orange"), ("solid", "blue"), ("dash", "green"), ("dot", "muted"))
MOST_POINTS = 400  # points of a curve
SQUARE = 30  # px
SHARE: dict[str, Any] = {"range": [0, 1.02], "tickformat": ".0%"}  # an axis of shares


def bars(
    names: Sequence[str],
    values: Sequence[float],
    colour: str,
    title: str,
    intervals: Sequence[tuple[float, float]] | None = None,
    **more: Any,
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the traces and the layout of horizontal bars, the first on top.

    `names`: as people's files say them. `colour`: of the theme. `title`: of the axis of values. `more`: of
    the axis of values.
    """
    trace: dict[str, Any] = {
        "type": "bar",
        "orientation": "h",
        "x": list(values),
        "y": list(range(len(values))),
        "text": [label(name) for name in names],
        "textposition": "none",
        "hovertemplate": "%{text}: %{x:.4g}<extra></extra>",
        "marker": {"color": css(colour)},
        "name": title,
    }
    if intervals is not None:
        trace["error_x"] = error_bars(values, intervals, "ink")
    return [trace], named_rows(names, title, **more)


def error_bars(values: Sequence[float], ends: Sequence[tuple[float, float]], colour: str) -> dict[str, Any]:
    """Return the bars from values to the ends of their intervals."""
    return {
        "type": "data",
        "symmetric": False,
        "array": [max(0.0, high - value) for value, (_, high) in zip(values, ends, strict=True)],
        "arrayminus": [max(0.0, value - low) for value, (low, _) in zip(values, ends, strict=True)],
        "color": css(colour),
        "thickness": 1.5,
    }


def intervals(
    names: Sequence[str],
    values: Sequence[float | None],
    ends: Sequence[tuple[float | None, float | None]],
    title: str,
    log: bool = True,
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the traces and the layout of values with intervals, on a logarithmic axis or not.

    An interval without an upper end has an arrow there.
    """
    traces: list[dict[str, Any]] = []
    for at, (low, high) in enumerate(ends):
        if low is not None and (low > 0 or not log):
            far = high if high is not None else 10 * low
            end = "line-ns-open" if high is not None else "triangle-right"
            trace = scatter(
                [low, far], [at, at], "", line={"color": css("blue"), "width": 3}, showlegend=False
            )
            marks = {"symbol": ["line-ns-open", end], "size": 11, "color": css("blue")}
            traces.append(trace | {"mode": "lines+markers", "marker": marks})
    known = [at for at, value in enumerate(values) if value is not None]
    x, texts = [values[at] for at in known], [label(names[at]) for at in known]
    hover = "%{text}: %{x:.4g}<extra></extra>"
    traces.append(scatter(x, known, "identified", hover, ("circle", "blue", 10), text=texts))
    more: dict[str, Any] = {"nticks": DECADES}
    if log:
        seen = [one for pair in ends for one in pair if one is not None and one > 0.0] + [v for v in x if v]
        more = {"type": "log", **({"tickvals": log_ticks(min(seen), max(seen))} if seen else {})}
    return traces, named_rows(names, title, exponentformat="SI", **more)


def log_axis(title: str, traces: Sequence[Mapping[str, Any]], way: str = "y") -> dict[str, Any]:
    """Return the logarithmic axis of traces, with a few round numbers: plotly's own labels overlap."""
    known = [value for one in traces for value in one[way] if value and value > 0.0]
    if not known:
        return axis(title, type="log", exponentformat="power")
    low, high, most = min(known), max(known), DECADES if way == "x" else 2 * DECADES
    small = [
        step * 10.0**power for power in range(floor(log10(low)), ceil(log10(high))) for step in range(2, 10)
    ]
    minor = {"ticks": "outside", "tickvals": small}
    return axis(title, type="log", exponentformat="power", tickvals=log_ticks(low, high, most), minor=minor)


def log_ticks(low: float, high: float, most: int = DECADES) -> list[float]:
    """Return a few round numbers about two ends, at most so many, for an axis that is logarithmic.

    >>> log_ticks(3e5, 4e6), log_ticks(5.2e5, 5.9e5), log_ticks(1.0, 1e7)
    ([500000.0, 1000000.0, 2000000.0], [520000.0, 590000.0], [1.0, 100.0, 10000.0, 1000000.0])
    """
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    if len(decades) > DECADES:
        return [10.0**power for power in decades[:: ceil(len(decades) / most)]]
    some = [
        step * 10.0**power for power in decades for step in (1, 2, 5) if low <= step * 10.0**power <= high
    ]
    if len(some) < 2:
        return [float(f"{low:.2g}"), float(f"{high:.2g}")] if high > 1.05 * low else [float(f"{low:.2g}")]
    return some[:: ceil(len(some) / most)]


def named_rows(names: Sequence[str], title: str, **more: Any) -> dict[str, Any]:
    """Return a layout with a row a name, the first on top."""
    return plain_layout(
        110 + ROW * len(names),
        xaxis=axis(title, **more),
        yaxis=axis(
            tickvals=list(range(len(names))),
            ticktext=[label(name if len(name) <= WIDEST else f"{name[: WIDEST - 3]}...") for name in names],
            range=[len(names) - 0.4, -0.6],
            showgrid=False,
            zeroline=False,
        ),
        showlegend=False,
    )


def distribution(key: str, title: str, caption: str, sizes: Mapping[str, Array], unit: str) -> Figure:
    """Return the share of rows whose size stays below each size, a curve by name; others are left out."""
    traces = []
    for (name, values), (dash, colour) in zip(sizes.items(), LINES, strict=False):
        own = np.sort(values[values > 0])  # NaN is not
        at = np.unique(np.linspace(0, own.size - 1, min(own.size, MOST_POINTS)).astype(int))
        if own.size:
            line = {"color": css(colour), "dash": dash, "width": 2.5, "shape": "hv"}
            share, hover = numbers((at + 1) / own.size), f"%{{y:.0%}} below %{{x}} {unit}"
            traces.append(scatter(numbers(own[at]), share, label(name), hover, line=line))
    up = axis("share of the rows", tickformat=".0%", range=[0, 1.02])
    layout = chart_layout(380, LEGEND + 10, log_axis(f"error, {unit}", traces, "x"), up)
    return Figure(key, title, caption, traces, layout)


def along(
    key: str,
    title: str,
    caption: str,
    x: Array | str,
    values: Mapping[str, Array],
    axes: tuple[str, str],
    texts: Sequence[str] | str,
    lines: bool = False,
    marks: Sequence[tuple[str, str]] = BEFORE_AFTER,
    log: bool = False,
) -> Figure:
    """Return values along something, a curve (or marks) by name.

    `x` (n,), or str: a name of an array that the page holds. `values` (n,). `axes`: what is drawn across and
    up. `texts`: what each point is; a name of an array that the page holds. `lines`: join the points.
    `marks`: symbol and colour of each; default: those of before and after.
    """
    across = shared(x) if isinstance(x, str) else numbers(x)
    said = shared(texts) if isinstance(texts, str) else [label(text) for text in texts]
    traces = []
    for (name, value), (symbol, colour) in zip(values.items(), marks, strict=False):
        mark, line = (symbol, colour, 6 if lines else 7), {"color": css(colour), "width": 1.5}
        trace = scatter(
            across, numbers(value, 4), label(name), "%{text}: %{y}", mark, line if lines else None
        )
        traces.append(trace | {"text": said})
    up = log_axis(axes[1], traces) if log else axis(axes[1], exponentformat="power")
    layout = chart_layout(380, LEGEND + 10, axis(axes[0]), up)
    return Figure(key, title, caption, traces, layout)


def correlation_figure(names: Sequence[str], correlation: Array) -> Figure:
    """Return the correlation (n, n) of the logarithms of named values."""
    values = [[round(v, 3) if np.isfinite(v) else None for v in row] for row in correlation.tolist()]
    rows = [
        [name, *("-" if v is None else f"{v:.2f}" for v in row)]
        for name, row in zip(names, values, strict=True)
    ]
    return Figure(
        "correlation",
        "Correlation",
        "Of the logarithms of the values: near 1 or -1, the data hardly distinguish two.",
        [
            {
                **_squares(len(names), len(names), values),
                "zmin": -1,
                "zmax": 1,
                "colorscale": [[0, css("blue")], [0.5, css("panel")], [1, css("orange")]],
                "hovertemplate": "%{z}<extra></extra>",
                "colorbar": {"thickness": 12},
            }
        ],
        _layout(names, names, 160),
        Table("Correlation", ("parameter", *names), rows, open=False),
    )


def confusion_figure(counts: Mapping[str, Mapping[str, int]], order: Sequence[str], table: Table) -> Figure:
    """Return which share of each truth, by rows, got each verdict, by columns, both in an `order`."""
    given = {verdict for row in counts.values() for verdict in row}
    truths = [name for name in order if name in counts]
    verdicts = [name for name in order if name in given]
    shares, told = [], []
    for truth in truths:
        total = sum(counts[truth].values())
        own = [counts[truth].get(verdict, 0) for verdict in verdicts]
        shares.append([round(count / total, 4) if count else None for count in own])
        told.append([f"{truth}: {c} of {total} called {v}" for c, v in zip(own, verdicts, strict=True)])
    trace = {
        **_squares(len(verdicts), len(truths), shares),
        "zmin": 0,
        "zmax": 1,
        "text": [[label(text) for text in row] for row in told],
        "hovertemplate": "%{text}<extra></extra>",
        "colorscale": [[0, css("low")], [0.5, css("middle")], [1, css("high")]],
        "colorbar": {"thickness": 12, "tickformat": ".0%"},
        "xgap": 1,
        "ygap": 1,
    }
    caption = "Truth down, verdict across: share of the truth's cases. On the diagonal the verdict is right."
    layout = _layout(verdicts, truths, 190)
    return Figure("confusion-shares", "Confusion", caption, [trace], layout, table)


def _squares(across: int, down: int, values: Sequence[Sequence[float | None]]) -> dict[str, Any]:
    return {"type": "heatmap", "x": list(range(across)), "y": list(range(down)), "z": values}


def _layout(across: Sequence[str], down: Sequence[str], around: int) -> dict[str, Any]:
    def ticks(names: Sequence[str]) -> dict[str, Any]:
        places = list(range(len(names)))
        return {"tickvals": places, "ticktext": [label(name) for name in names], "showgrid": False}

    return plain_layout(
        around + SQUARE * len(down),
        xaxis=axis(**ticks(across)),
        yaxis=axis(**ticks(down), autorange="reversed"),
    )
