"""Curves of errors: what share stays below a size, and how they go along a path or by rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from beamstiff.report.html.bars import log_axis
from beamstiff.report.html.parts import (
    MARGIN,
    Figure,
    axis,
    css,
    label,
    numbers,
    plain_layout,
    scatter,
    shared,
)
from beamstiff.report.html.places import BEFORE_AFTER, LEGEND
from beamstiff.se3 import Array

LINES = (("solid", "orange"), ("solid", "blue"), ("dash", "green"), ("dot", "muted"))
MOST = 400  # points of a curve


def distribution(key: str, title: str, caption: str, sizes: Mapping[str, Array], unit: str) -> Figure:
    """Return the share of rows whose size stays below each size, a curve by name; others are left out."""
    traces = []
    for (name, values), (dash, colour) in zip(sizes.items(), LINES, strict=False):
        own = np.sort(values[values > 0])  # NaN is not
        at = np.unique(np.linspace(0, own.size - 1, min(own.size, MOST)).astype(int))
        if own.size:
            line = {"color": css(colour), "dash": dash, "width": 2.5, "shape": "hv"}
            share, hover = numbers((at + 1) / own.size), f"%{{y:.0%}} below %{{x}} {unit}"
            traces.append(scatter(numbers(own[at]), share, label(name), hover, line=line))
    layout = plain_layout(
        380,
        margin=MARGIN | {"t": LEGEND + 10},
        xaxis=log_axis(f"error, {unit}", traces, "x"),
        yaxis=axis("share of the rows", tickformat=".0%", range=[0, 1.02]),
    )
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
    layout = plain_layout(
        380,
        margin=MARGIN | {"t": LEGEND + 10},
        xaxis=axis(axes[0]),
        yaxis=log_axis(axes[1], traces) if log else axis(axes[1], exponentformat="power"),
    )
    return Figure(key, title, caption, traces, layout)
