"""Errors at check points by model, and by the size of cubes: figures 6 and 7 of seed 001."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from beamstiff.errors import BeamstiffError
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain
from beamstiff.se3 import Array

COLOURS = (GREY, BLUE, ORANGE, GREEN, "#CC79A7", "#56B4E9", "#E69F00", "#000000")


def check_points_figure(
    errors: Mapping[str, Array], by_size: Mapping[str, Sequence[tuple[float, float]]], title: str
) -> Figure:
    """Draw position errors point by point, and mean errors over the size of cubes.

    Parameters
    ----------
    errors : mapping of str to (P,) array, m
        At the same P check points, by model; points are ordered by the first model's.
    by_size : mapping of str to sequence of (size, mean error), m
        By way of fitting; a size of infinity is one model for the whole space.
    """
    counts = {len(one) for one in errors.values()}
    if len(counts) != 1 or not by_size:
        raise BeamstiffError(
            f"check points: found errors at {sorted(counts)} points for {len(errors)} models and "
            f"{len(by_size)} curves by size, expected one or more, at the same points"
        )
    figure = new_figure(12.0, 4.8)
    figure.suptitle(title)
    points, sizes = figure.subplots(1, 2, width_ratios=(2, 1))
    order = np.argsort(next(iter(errors.values())))
    for at, (name, error) in enumerate(errors.items()):
        label = f"{name}: mean {1e3 * float(error.mean()):.4f}"
        points.plot(1e3 * error[order], color=COLOURS[at % len(COLOURS)], linewidth=1.2, label=label)
    points.set_xlabel("check point")
    points.set_ylabel("position error, mm")
    points.legend(frameon=False, fontsize="small")
    every = sorted({size for curve in by_size.values() for size, _ in curve}, reverse=True)
    places = {size: at for at, size in enumerate(every)}
    for at, (name, curve) in enumerate(by_size.items()):
        drawn = sorted(curve, reverse=True)
        across, up = [places[size] for size, _ in drawn], [1e3 * error for _, error in drawn]
        sizes.plot(across, up, marker="os^Dv"[at % 5], color=COLOURS[at + 1], label=name)
    texts = ["whole" if np.isinf(size) else f"{1e3 * size:.0f}" for size in every]
    sizes.set_xticks(range(len(every)), texts)
    sizes.set_xlabel("side of the cubes, mm")
    sizes.set_ylabel("mean error, mm")
    for axes in (points, sizes):
        axes.set_ylim(bottom=0.0)
        plain(axes)
    sizes.legend(frameon=False, fontsize="small")
    return figure
