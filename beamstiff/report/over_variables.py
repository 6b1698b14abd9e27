"""Measured against predicted over two joint variables: a panel a value of one, lines over the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamstiff.report.figures import BLUE, GREY, ORANGE, new_figure, plain
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Panel:
    """Displacements over one joint variable while the other stands still, mm over deg."""

    title: str
    # at, measured, predicted: (n,): the measured states, and what the model says there
    at: Array
    measured: Array
    predicted: Array
    # line_at, line: (m,): the model between them
    line_at: Array
    line: Array


def figure_over_variables(
    panels: list[Panel], title: str, variable: str, displacement: str, sigma: float | None
) -> Figure:
    """Draw the panels side by side, the residuals below.

    Parameters
    ----------
    title, variable, displacement : str
        Of the figure, the horizontal and the vertical axis, with units.
    sigma : float, optional
        Standard deviation of the measured values, mm.
    """
    figure = new_figure(2.9 * len(panels) + 0.8, 5.6)
    figure.suptitle(title)
    axes = figure.subplots(2, len(panels), sharex=True, sharey="row", squeeze=False, height_ratios=(2.2, 1))
    for column, panel in enumerate(panels):
        _draw_values(axes[0, column], panel, sigma)
        _draw_gap(axes[1, column], panel, sigma)
        axes[0, column].set_title(panel.title, fontsize="medium")
        axes[1, column].set_xlabel(variable)
    axes[0, 0].set_ylabel(displacement)
    axes[1, 0].set_ylabel("gap, mm")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    more, names = axes[1, 0].get_legend_handles_labels()
    figure.legend(handles + more, labels + names, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_values(axes: Axes, panel: Panel, sigma: float | None) -> None:
    axes.plot(panel.line_at, panel.line, color=BLUE, label="predicted")
    axes.errorbar(
        panel.at,
        panel.measured,
        yerr=sigma,
        fmt="o",
        color=ORANGE,
        markersize=6,
        capsize=3,
        label="measured (± 1 std)" if sigma else "measured",
    )
    plain(axes)


def _draw_gap(axes: Axes, panel: Panel, sigma: float | None) -> None:
    if sigma:
        axes.axhspan(-2 * sigma, 2 * sigma, color=GREY, alpha=0.25, linewidth=0, label="± 2 std of the noise")
    axes.axhline(0.0, color="black", linewidth=0.8)
    gap = panel.measured - panel.predicted
    axes.vlines(panel.at, np.minimum(gap, 0.0), np.maximum(gap, 0.0), color=ORANGE, linewidth=2)
    axes.plot(panel.at, gap, "D", color=ORANGE, markersize=5, label="gap: measured - predicted")
    plain(axes)
