"""Matrices as coloured squares: correlations, and how often one was taken for the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from beamstiff.report.html.parts import Figure, axis, css, label, plain_layout
from beamstiff.report.tables import Table
from beamstiff.se3 import Array

SQUARE = 30  # px


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
    """Return how often each truth, by rows, got each verdict, by columns: the share of the truth's cases.

    `order`: of truths and verdicts. `table`: the counts.
    """
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
