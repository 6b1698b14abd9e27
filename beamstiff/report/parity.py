"""Measured against predicted, component by component: on the diagonal where the model is right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.identification.pareto import Front
from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.report.figures import BLUE, GREEN, ORANGE, new_figure, plain
from beamstiff.se3 import Array

MARKERS = (("o", BLUE), ("s", ORANGE), ("^", GREEN))


def parity_figure(measured: Measurements, predicted: Array, title: str = "") -> Figure:
    """Draw predicted over measured displacement, positions and rotations apart.

    `measured`: n rows of displacements. `predicted` (N, 6): ``[d, r]``, m and rad.
    """
    mask = measured.measured_mask & (measured.kind == "displacement")
    panels = [(part, what, unit) for part, what, unit in _PARTS if mask[:, part].any()]
    if not panels:
        raise BeamstiffError(
            f"{measured.source}: holds no measured displacement, so there is nothing to draw"
        )
    figure = new_figure(5.2 * len(panels), 4.8)
    figure.suptitle(
        f"{title}: predicted over measured displacement" if title else "Predicted over measured displacement"
    )
    for axes, (part, what, unit) in zip(
        figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True
    ):
        _draw(axes, measured.displacement[:, part], predicted[:, part], mask[:, part], DISPLACEMENT[part])
        axes.set_xlabel(f"measured {what}, {unit}")
        axes.set_ylabel(f"predicted {what}, {unit}")
    return figure


def front_figure(front: Front, title: str = "") -> Figure:
    """Draw the compromises between position error and rotation error."""
    figure = new_figure(5.2, 4.8)
    figure.suptitle(f"{title}: position against rotation" if title else "Position against rotation")
    axes = figure.subplots()
    axes.plot(1e3 * front.rms[:, 0], np.degrees(front.rms[:, 1]), "o-", color=BLUE, markersize=5)
    axes.set_xlabel("RMS position error, mm")
    axes.set_ylabel("RMS rotation error, deg")
    plain(axes)
    return figure


_PARTS = ((slice(0, 3), "displacement", "mm"), (slice(3, 6), "rotation", "mrad"))


def _draw(
    axes: Axes, measured: Array, predicted: Array, mask: NDArray[np.bool_], names: Sequence[str]
) -> None:
    for at, (name, (marker, colour)) in enumerate(zip(names, MARKERS, strict=True)):
        rows = mask[:, at]
        if rows.any():
            axes.plot(
                1e3 * measured[rows, at],
                1e3 * predicted[rows, at],
                marker,
                color=colour,
                alpha=0.7,
                label=name,
                markersize=5,
            )
    shown = 1e3 * np.concatenate([measured[mask], predicted[mask]])
    margin = 0.05 * float(np.ptp(shown)) or 0.05
    ends = [float(shown.min()) - margin, float(shown.max()) + margin]
    axes.plot(ends, ends, color="black", linewidth=0.8, label="equal")
    axes.set(xlim=ends, ylim=ends, aspect="equal")
    axes.legend(frameon=False)
    plain(axes)
