"""Fuzzy compliance as pictures: the surface of one term over two inputs, and the membership functions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamstiff.measure.table import DISPLACEMENT, WRENCH
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.fuzzy_inference import Partition
from beamstiff.report.figures import BLUE, GREEN, ORANGE, new_figure, plain
from beamstiff.se3 import Array

POINTS = 41  # of a surface, along each input
LINES = (BLUE, ORANGE, GREEN)


def rules_figure(model: FuzzyCompliance, angles: Sequence[str] = ()) -> Figure:
    """Draw the largest terms of a fuzzy compliance over its first two inputs, and the sets of every input.

    As figure 13 of seed 003; other inputs are in the middle of their trained range, `angles` in degrees.
    """
    premises = model.system.premises
    chosen = _largest(model)
    order = sorted(range(len(premises.inputs)), key=lambda at: -premises.sets[at])
    first, second = sorted(order[:2]) if len(order) > 1 else (order[0], order[0])
    unit = {name: 180 / np.pi if name in angles else 1.0 for name in premises.inputs}
    figure = new_figure(4.6 * max(len(chosen), 2), 7.2)
    grid = figure.add_gridspec(2, max(len(chosen), 2), height_ratios=(1.8, 1))
    for column, (i, j) in enumerate(chosen):
        name = f"{DISPLACEMENT[i]} per {WRENCH[j]}"
        if first == second:
            _line(figure.add_subplot(grid[0, column]), model, first, (i, j), unit)
        else:
            axes = figure.add_subplot(grid[0, column], projection="3d")
            _surface(axes, model, (first, second), (i, j), unit)
        unit_of_term = f"{'µm' if i < 3 else 'µrad'} / {'kN' if j < 3 else 'kN m'}"
        figure.axes[-1].set_title(f"compliance {name}, {unit_of_term}", fontsize="medium")
    for column, at in enumerate(dict.fromkeys((first, second))):
        _memberships(figure.add_subplot(grid[1, column]), premises, at, unit)
    return figure


def _largest(model: FuzzyCompliance) -> list[tuple[int, int]]:
    """Return up to three known terms, those of forces and displacements first, the largest first."""
    known = model.known
    size = np.where(known, np.abs(np.nan_to_num(model.system.conclusions)).max(axis=0), 0.0)
    pairs = [(i, j) for i in range(6) for j in range(6) if known[i, j] and not (i > j and known[j, i])]
    pairs.sort(key=lambda pair: (max(pair) > 2, -size[pair]))
    return pairs[:3]


def _middle(premises: Partition, count: int) -> Array:
    return np.tile(premises.trained.mean(axis=1), (count, 1))


def _steps(premises: Partition, at: int, count: int) -> Array:
    low, high = premises.trained[at].tolist()
    return np.linspace(low, high, count)


def _surface(
    axes: Axes, model: FuzzyCompliance, inputs: tuple[int, int], term: tuple[int, int], unit: dict[str, float]
) -> None:
    premises = model.system.premises
    a, b = (_steps(premises, at, POINTS) for at in inputs)
    at_a, at_b = np.meshgrid(a, b)
    x = _middle(premises, at_a.size)
    x[:, inputs[0]], x[:, inputs[1]] = at_a.ravel(), at_b.ravel()
    height = 1e9 * model.system(x, extrapolate=True)[:, term[0], term[1]].reshape(at_a.shape)
    names = [premises.inputs[at] for at in inputs]
    low, high = np.nanpercentile(height, (2, 98)).tolist()  # an outlying rule does not flatten the colours
    look = {"cmap": "viridis", "vmin": low, "vmax": high, "linewidth": 0, "alpha": 0.85}
    scales = [unit[name] for name in names]
    axes.plot_surface(at_a * scales[0], at_b * scales[1], height, **look)  # type: ignore[attr-defined]
    if all(at in inputs or premises.sets[at] < 2 for at in range(len(premises.inputs))):
        own = 1e9 * model.system.conclusions[:, term[0], term[1]]
        corners = (premises.corners()[:, inputs] * scales).T
        axes.plot(*corners, own, "o", color="black", markersize=4)
    axes.set(xlabel=_label(names[0], unit), ylabel=_label(names[1], unit))


def _line(axes: Axes, model: FuzzyCompliance, at: int, term: tuple[int, int], unit: dict[str, float]) -> None:
    premises = model.system.premises
    x = _middle(premises, POINTS)
    x[:, at] = _steps(premises, at, POINTS)
    name = premises.inputs[at]
    axes.plot(x[:, at] * unit[name], 1e9 * model.system(x, extrapolate=True)[:, term[0], term[1]], color=BLUE)
    axes.set_xlabel(_label(name, unit))
    plain(axes)


def _memberships(axes: Axes, premises: Partition, at: int, unit: dict[str, float]) -> None:
    x = _middle(premises, 20 * POINTS)
    x[:, at] = _steps(premises, at, len(x))
    name = premises.inputs[at]
    for number, degrees in enumerate(premises.memberships(x)[at].T):
        style = ("-", "--")[number // 3 % 2]
        axes.plot(x[:, at] * unit[name], degrees, color=LINES[number % 3], linestyle=style)
    axes.set(xlabel=_label(name, unit), ylabel="membership", ylim=(0.0, 1.05))
    plain(axes)


def _label(name: str, unit: dict[str, float]) -> str:
    return f"{name}, deg" if unit[name] != 1.0 else name
