"""Uncertainty told to people: sources of errors, rows left out, number of tests, models side by side."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from beamstiff.identification.compare import Comparison
from beamstiff.identification.number_of_tests import NumberOfTests
from beamstiff.identification.sensitivity import Sensitivity
from beamstiff.identification.validation import HeldOut, Repeatability
from beamstiff.measure.arrays import places_of_each
from beamstiff.measure.table import Measurements
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain
from beamstiff.report.tables import Table, add_rows, counted, number, table

SOURCES = {
    "readings": "readings",
    "load": "size of load",
    "force": "force",
    "moment": "moment",
    "angle": "joint angles",
    "length": "slides",
    "hold_angle": "joints that do not hold",
    "hold_length": "slides that do not hold",
    "all": "all",
}


def comparison_table(found: Comparison, title: str = "Models of the same data") -> Table:
    """Return a table of models: criteria less the best one's, held-out likelihood and errors."""
    result = table(
        f"{title}: {found.source}, {found.components} measured values",
        "model",
        "values",
        "AICc - best",
        "weight",
        "BIC - best",
        "held-out log L - best",
        "RMS, mm",
        "poses left out, mm",
        "loads left out, mm",
    )
    scores = found.scores
    aicc, bic = min(score.aicc for score in scores), min(score.bic for score in scores)
    unseen = [score.held_out for score in scores if score.held_out is not None]
    for score in scores:
        behind = None if score.held_out is None else score.held_out - max(unseen)
        result.add_row(
            score.name,
            str(score.count),
            "-" if np.isinf(score.aicc) else f"{score.aicc - aicc:.1f}",
            "-" if np.isnan(score.weight) else f"{score.weight:.2f}",
            f"{score.bic - bic:.1f}",
            "-" if behind is None else f"{behind:.1f}",
            *(_mm(value) for value in (score.rms, score.rms_held_out, score.rms_held_out_load)),
        )
    return result


def sensitivity_table(found: Sensitivity, title: str = "Scatter by source of errors") -> Table:
    """Return a table of relative standard deviations, percent: by parameter and by source."""
    result = table(title, "parameter", *(f"{SOURCES[source]}, %" for source in found.sources))
    for at, name in enumerate(found.names):
        result.add_row(name, *(f"{100 * value:.3g}" for value in found.spread[:, at]))
    for at, relation in enumerate(found.relations):
        sums = found.sums[:, :, at]
        spread = sums.std(axis=1, ddof=1) / np.abs(sums.mean(axis=1))
        result.add_row(relation, *(f"{100 * value:.3g}" for value in spread))
    return result


def held_out_table(
    found: HeldOut, measured: Measurements, title: str = "Errors on rows left out of the fit"
) -> Table:
    """Return a table of the groups that the model misses most: where, and by how much.

    Parameters
    ----------
    found : HeldOut
        By pose, or by load.
    measured : Measurements
        The rows.
    """
    result = table(title, "first row", "rows", "RMS, mm", "of the displacement, %")
    size = np.linalg.norm(np.nan_to_num(measured.displacement[:, :3]), axis=1)
    known = np.flatnonzero(np.isfinite(found.gap))
    groups = {int(found.groups[known[at[0]]]): known[at] for at in places_of_each(found.groups[known])}
    lines = []
    for group, rms in sorted(found.by_group().items(), key=lambda item: -item[1]):
        rows = groups[group]
        moved = float(np.sqrt((size[rows] ** 2).mean()))
        share = f"{100 * rms / moved:.1f}" if moved else "-"
        lines.append((measured.place(int(rows[0])), str(rows.size), _mm(rms), share))
    add_rows(result, lines)
    return result


def repeatability_text(found: Repeatability) -> str:
    """Return a sentence: how well repeats agree."""
    position = float(np.nanmean(found.sigma[:3]))
    return (
        f"Repeats of {counted(found.states, 'state')} agree to {100 * found.share:.2g} % of the displacement "
        f"(three standard deviations); a reading scatters by {number(1e3 * position)} mm."
    )


def number_of_tests_figure(found: NumberOfTests, title: str = "Influence of the number of tests") -> Figure:
    """Draw each value over its final one against the number of tests (seed 000, Figure 7)."""
    count = len(found.names)
    columns = min(count, 3)
    figure = new_figure(3.8 * columns, 2.8 * -(-count // columns) + 0.4)
    figure.suptitle(title)
    band = found.band()
    panels = figure.subplots(-(-count // columns), columns, sharex=True, sharey=True, squeeze=False).flat
    for at, name in enumerate(found.names):
        axes = panels[at]
        low, middle, high = band[:, :, at].T
        axes.fill_between(
            found.counts, low, high, color=BLUE, alpha=0.25, linewidth=0, label="90 % of the orders"
        )
        axes.plot(found.counts, middle, color=BLUE, label="median")
        one = found.stiffness[0, :, at] / found.final[at]
        axes.plot(found.counts, one, "o", color=ORANGE, markersize=3, label="one order")
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.set(ylim=(0.5, 1.5), title=name)
        plain(axes)
    for axes in list(panels)[count:]:
        axes.set_visible(False)
    figure.supxlabel("number of tests")
    figure.supylabel("stiffness over that from all tests")
    figure.axes[0].legend(fontsize="small")
    return figure


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.4f}"
