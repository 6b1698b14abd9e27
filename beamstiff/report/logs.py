"""Figure of a log: speeds over time, with the windows that were kept and those that were cut."""

import numpy as np
from matplotlib.figure import Figure

from beamstiff.measure.logs import LogTable
from beamstiff.measure.signals import Signal
from beamstiff.report.figures import BLUE, GREEN, ORANGE, new_figure, plain
from beamstiff.se3 import Array

LEAST = {"joints": 1e-4, "point": 1e-2, "pose": 1e-2}  # deg/s, mm/s: lower end of the scale


def log_figure(table: LogTable) -> Figure:
    """Return the speeds of joints and points, kept windows green, creeping and ringing ones orange."""
    signals = [one for one in table.signals if one.kind in LEAST]
    figure = new_figure(9.0, 1.0 + 1.7 * len(signals))
    for axes, one in zip(np.atleast_1d(figure.subplots(len(signals), sharex=True)), signals, strict=True):
        unit, factor = ("deg/s", 180 / np.pi) if one.kind == "joints" else ("mm/s", 1e3)
        time, speed = _speed(one)
        axes.semilogy(time, np.maximum(factor * speed, LEAST[one.kind]), color=BLUE, linewidth=0.8)
        for window in table.windows:
            if window.kept:
                axes.axvspan(window.start, window.end, color=GREEN, alpha=0.25, linewidth=0)
            elif window.reason != "moves":
                axes.axvspan(window.start, window.end, color=ORANGE, alpha=0.35, linewidth=0)
        axes.set_ylabel(unit)
        axes.set_title(one.name.replace("$", r"\$"), fontsize=9, loc="left")
        plain(axes)
    axes.set_xlabel("time, s (green: kept, orange: cut, it creeps, rings or is too short)")
    return figure


def _speed(signal: Signal) -> tuple[Array, Array]:
    """Return times and speeds, each read over 0.1 s."""
    time = np.arange(signal.time[0], signal.time[-1], 0.05)
    values = signal.values if signal.kind == "joints" else signal.values[:, :3]
    moved = [
        np.interp(time + 0.05, signal.time, v) - np.interp(time - 0.05, signal.time, v) for v in values.T
    ]
    return time, np.asarray(np.linalg.norm(moved, axis=0) / 0.1)
