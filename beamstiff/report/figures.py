"""Figures without global state: made as `Figure` objects, saved whole or not at all.

Colours are those of Okabe and Ito, which colour-blind readers tell apart; what differs in colour also differs
in its marker.
"""

import io
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from beamstiff.errors import BeamstiffError
from beamstiff.files import write_whole

FORMATS = ("png", "svg", "pdf")
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#777777"


class Picture(Figure):
    """A figure that Jupyter shows without pyplot."""

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=100)
        return data.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, size in inches."""
    figure = Picture(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def plain(axes: Axes) -> None:
    """Give axes the plain look: light grid behind, no box."""
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def check_format(path: str | Path) -> str:
    """Return the format that a figure's file name asks for.

    >>> check_format("fit.PNG")
    'png'
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FORMATS:
        raise BeamstiffError(
            f"{path}: found the ending {ending!r}, expected a figure as {', '.join(FORMATS)}"
        )
    return ending


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> None:
    """Save a figure as PNG, SVG or PDF by the ending of the file's name; no half-written file.

    Raises
    ------
    BeamstiffError
        When the ending is unknown or the file cannot be written.
    """
    write_whole(path, figure_bytes(figure, path, dpi))


def figure_bytes(figure: Figure, path: str | Path, dpi: int = 150) -> bytes:
    """Return the content of the file that `save_figure` writes."""
    ending = check_format(path)
    data = io.BytesIO()
    # no date and no random ids: the same figure gives the same file
    metadata = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[ending]
    with rc_context({"svg.hashsalt": "beamstiff"}):
        figure.savefig(data, format=ending, dpi=dpi, metadata=metadata)
    return data.getvalue()
