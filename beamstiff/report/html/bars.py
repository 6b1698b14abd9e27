"""Bars of named values, and intervals of values that span decades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import Any

from beamstiff.report.html.parts import axis, css, label, plain_layout, scatter

ROW = 30  # px
DECADES = 4  # ticks of a logarithmic axis at most, and of intervals: a phone's labels must not meet
WIDEST = 34  # characters of a name


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
    ticks = {"tickvals": log_ticks(min(known), max(known))} if known else {}
    return axis(title, type="log", exponentformat="power", **ticks)


def log_ticks(low: float, high: float) -> list[float]:
    """Return a few round numbers about two ends, for an axis that is logarithmic.

    Examples
    --------
    >>> log_ticks(3e5, 4e6), log_ticks(5.2e5, 5.9e5), log_ticks(1.0, 1e7)
    ([500000.0, 1000000.0, 2000000.0], [520000.0, 590000.0], [1.0, 100.0, 10000.0, 1000000.0])
    """
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    if len(decades) > DECADES:
        return [10.0**power for power in decades[:: ceil(len(decades) / DECADES)]]
    some = [
        step * 10.0**power for power in decades for step in (1, 2, 5) if low <= step * 10.0**power <= high
    ]
    if len(some) < 2:
        return [float(f"{low:.2g}"), float(f"{high:.2g}")] if high > 1.05 * low else [float(f"{low:.2g}")]
    return some[:: ceil(len(some) / DECADES)]


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
