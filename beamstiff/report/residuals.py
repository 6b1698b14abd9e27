"""Residuals of displacements before and after a fit, over load and posture; the front of two errors."""

from contextlib import suppress

import numpy as np
from matplotlib.figure import Figure

from beamstiff.errors import BeamstiffError
from beamstiff.identification.pareto import Front
from beamstiff.identification.result import Identification
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain
from beamstiff.report.html.places import joint_columns
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

_PARTS = ((slice(0, 3), "position", "mm", "force, N"), (slice(3, 6), "rotation", "mrad", "moment, N m"))
BEFORE, AFTER = "robot file", "identified"


def residual_figure(found: Identification, measured: Measurements, title: str = "") -> Figure:
    """Draw the size of the residual, before and after the fit, over the load and over the posture.

    `measured`: n rows of displacements. Before the fit is not drawn of a robot with effects or a model, or
    one that cannot be predicted.

    Raises BeamstiffError when no displacement is measured.
    """
    mask = measured.measured_mask & (measured.kind == "displacement")
    panels = [one for one in _PARTS if mask[:, one[0]].any()]
    if not panels:
        told = "holds no measured displacement, so there is nothing to draw"
        raise BeamstiffError(f"{measured.source}: {told}")
    models = {AFTER: (found.predicted, {"marker": ".", "color": BLUE, "markersize": 7})}
    if (before := before_fit(found, measured)) is not None:
        open_circle = {"marker": "o", "color": ORANGE, "markerfacecolor": "none", "markersize": 5}
        models = {BEFORE: (before, open_circle), **models}
    figure = new_figure(10.4, 3.8 * len(panels))
    figure.suptitle(f"{title}: measured minus predicted" if title else "Measured minus predicted")
    rows = figure.subplots(len(panels), 2, squeeze=False)
    for row, (part, what, unit, load) in zip(rows, panels, strict=True):
        seen = mask[:, part].any(axis=1)
        size = np.linalg.norm(measured.wrench[:, part], axis=1)
        loaded = np.ptp(size[seen]) > 0.0 or not measured.variables
        by_load = (size, load) if loaded else _moved_most(found.robot, measured)
        for axes, (where, name) in zip(row, (by_load, (measured.pose, "pose")), strict=True):
            for label, (predicted, look) in models.items():
                gap = np.where(mask, measured.displacement - predicted, 0.0)[seen, part]
                far = 1e3 * np.linalg.norm(gap, axis=1)
                axes.plot(where[seen], far, linestyle="none", label=label, **look)
            axes.set(xlabel=name, ylabel=f"size of the {what} residual, {unit}", ylim=(0.0, None))
            plain(axes)
    figure.axes[0].legend(frameon=False)
    return figure


def _moved_most(robot: Robot, measured: Measurements) -> tuple[Array, str]:
    """Return the readings (N,) of the joint that moves most, and its name: for rows under one load."""
    headings, factors = joint_columns(robot, measured.variables)
    k = int(np.argmax(np.ptp(measured.q, axis=0)))
    return factors[k] * measured.q[:, k], headings[k]


def before_fit(found: Identification, measured: Measurements) -> Array | None:
    """Return what the robot file predicts of the rows, (N, 6); None where that is not known."""
    start = found.start
    if start is None or start.effects or start.model is not None:
        return None
    with suppress(BeamstiffError):
        return predict_displacements(start, measured)
    return None


def front_figure(front: Front, title: str = "") -> Figure:
    """Draw the compromises between position error and rotation error."""
    figure = new_figure(5.2, 4.8)
    figure.suptitle(f"{title}: position against rotation" if title else "Position against rotation")
    axes = figure.subplots()
    axes.plot(1e3 * front.rms[:, 0], np.degrees(front.rms[:, 1]), "o-", color=BLUE, markersize=5)
    axes.set(xlabel="RMS position error, mm", ylabel="RMS rotation error, deg")
    plain(axes)
    return figure
