"""What a report is made of: text, tables, figures, sections; plain data that the templates write.

Figures are those of plotly, as plain data with two additions that the page resolves when it draws:
``{"css": "--name"}`` is a colour of the page's theme, and ``{"shared": "name"}`` an array that several
figures draw, which the page holds once.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from beamstiff.report.tables import Table
from beamstiff.se3 import Array

DIGITS = 5  # of numbers in figures: more than a screen shows
MARGIN = {"l": 56, "r": 16, "t": 34, "b": 48}


@dataclass(frozen=True)
class Figure:
    """A figure of plotly."""

    key: str  # its id in the page
    title: str
    caption: str
    traces: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any] = field(default_factory=dict)
    table: Table | None = None  # the numbers that it shows

    @property
    def height(self) -> int:
        """Its height in the page, px."""
        return int(self.layout.get("height", 340))


@dataclass(frozen=True)
class Section:
    """A part of the page under a heading of its own; what is empty is left out."""

    key: str
    title: str
    texts: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tables: Sequence[Table] = ()
    items: Sequence[str] = ()
    tables_text: str = ""
    footnote: str = ""  # below the tables
    open: bool = True  # shown at once; else behind its heading
    shared: Mapping[str, Sequence[Any]] = field(default_factory=dict)  # arrays that figures of the page draw


@dataclass(frozen=True)
class Fact:
    """A number that the page begins with: what it is, how much, and what it means."""

    name: str
    value: str
    meaning: str = ""


def css(name: str) -> dict[str, str]:
    """Return a colour of the page's theme."""
    return {"css": f"--{name}"}


def shared(name: str) -> dict[str, str]:
    """Return what stands in a figure for an array that the page holds once."""
    return {"shared": name}


def numbers(values: Array, digits: int = DIGITS) -> list[float | None]:
    """Return numbers as figures hold them: few digits, None where there is none.

    >>> numbers(np.array([1 / 3, np.nan, -0.0]))
    [0.33333, None, 0.0]
    """
    flat = np.asarray(values, dtype=float).ravel().tolist()
    return [float(f"{value:.{digits}g}") + 0.0 if np.isfinite(value) else None for value in flat]


def places(points: Array, moved: Array | None = None, digits: int = DIGITS) -> dict[str, Any]:
    """Return the places (n, 3) of a trace and how they move: each by itself (n, 3), or all alike (3,)."""
    trace: dict[str, Any] = {name: numbers(points[:, k], digits) for k, name in enumerate("xyz")}
    if moved is not None:
        ways = numbers(moved, digits) if moved.ndim == 1 else [numbers(way, digits) for way in moved.T]
        trace |= {f"d{name}": way for name, way in zip("xyz", ways, strict=True)}
    return trace


def label(text: str) -> str:
    """Return a text from people's files for a figure: plotly would read tags in it."""
    return escape(text, quote=False)


Mark = tuple[str, str, float]  # its symbol, its colour in the theme, its size in px


def scatter(
    x: Any, y: Any, name: str, hover: str = "", mark: Mark | None = None, line: Any = None, **more: Any
) -> dict[str, Any]:
    """Return a trace of marks, of a line, or of both; without a template for `hover` it says nothing."""
    drawn = {"lines": line is not None, "markers": mark is not None}
    trace = {"type": "scatter", "mode": "+".join(part for part in drawn if drawn[part]), "x": x, "y": y}
    trace |= {"name": name, **({"hovertemplate": hover} if hover else {"hoverinfo": "skip"})}
    if line is not None:
        trace["line"] = line
    if mark is not None:
        trace["marker"] = {"symbol": mark[0], "color": css(mark[1]), "size": mark[2]}
    return trace | more


def axis(title: str = "", **more: Any) -> dict[str, Any]:
    """Return an axis in the look of the report."""
    return {
        "title": {"text": title, "standoff": 14},
        "ticklabelstandoff": 6,  # so that the labels of two axes do not meet in the corner
        "gridcolor": css("grid"),
        "zerolinecolor": css("grid"),
        "linecolor": css("muted"),
        "automargin": True,
        **more,
    }


def plain_layout(height: int = 340, **more: Any) -> dict[str, Any]:
    """Return the layout that all figures share."""
    return {
        "height": height,
        "margin": dict(MARGIN),
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": css("ink")},
        "hoverlabel": {"align": "left"},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        **more,
    }


def chart_layout(height: int, above: int, x: Any, y: Any, **more: Any) -> dict[str, Any]:
    """Return the layout of a chart over two axes, with so much room above it, px."""
    return plain_layout(height, margin=MARGIN | {"t": above}, xaxis=x, yaxis=y, **more)


def embedded(value: Any) -> str:
    """Return JSON that may stand in a script of a page: no text in it can end the script."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"), default=_plain)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"no JSON of {type(value).__name__}")
