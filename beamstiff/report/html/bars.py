"""Bars of named values, and intervals of values that span decades."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from beamstiff.report.html.parts import axis, css, label, plain_layout

ROW = 30  # px


def bars(
    names: Sequence[str],
    values: Sequence[float],
    colour: str,
    title: str,
    intervals: Sequence[tuple[float, float]] | None = None,
    **more: Any,
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the traces and the layout of horizontal bars, the first on top.

    Parameters
    ----------
    names : sequence of str
        As people's files say them.
    colour : str
        Of the theme.
    title : str
        Of the axis of values.
    **more
        Of the axis of values.
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
        trace["error_x"] = {
            "type": "data",
            "symmetric": False,
            "array": [max(0.0, high - value) for value, (_, high) in zip(values, intervals, strict=True)],
            "arrayminus": [max(0.0, value - low) for value, (low, _) in zip(values, intervals, strict=True)],
            "color": css("ink"),
            "thickness": 1.5,
        }
    return [trace], named_rows(names, title, **more)


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
            traces.append(
                {
                    "type": "scatter",
                    "mode": "lines+markers",
                    "x": [low, high if high is not None else 10 * low],
                    "y": [at, at],
                    "line": {"color": css("blue"), "width": 3},
                    "marker": {
                        "symbol": ["line-ns-open", "line-ns-open" if high is not None else "triangle-right"],
                        "size": 11,
                        "color": css("blue"),
                    },
                    "hoverinfo": "skip",
                    "showlegend": False,
                }
            )
    known = [at for at, value in enumerate(values) if value is not None]
    traces.append(
        {
            "type": "scatter",
            "mode": "markers",
            "x": [values[at] for at in known],
            "y": known,
            "text": [label(names[at]) for at in known],
            "hovertemplate": "%{text}: %{x:.4g}<extra></extra>",
            "marker": {"color": css("blue"), "size": 10},
            "name": "identified",
        }
    )
    more = {"type": "log"} if log else {}
    return traces, named_rows(names, title, exponentformat="power", **more)


def named_rows(names: Sequence[str], title: str, **more: Any) -> dict[str, Any]:
    """Return a layout with a row a name, the first on top."""
    return plain_layout(
        110 + ROW * len(names),
        xaxis=axis(title, **more),
        yaxis=axis(
            tickvals=list(range(len(names))),
            ticktext=[label(_short(name)) for name in names],
            range=[len(names) - 0.4, -0.6],
            showgrid=False,
            zeroline=False,
        ),
        showlegend=False,
    )


def _short(name: str, most: int = 34) -> str:
    return name if len(name) <= most else f"{name[: most - 3]}..."
