"""Tables and figures of a map of the workspace: its slices with the worst pose."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from math import degrees
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from beamstiff.errors import BeamstiffError
from beamstiff.maps.quantities import QUANTITIES, variable_of
from beamstiff.maps.summary import PERCENTILES, axes_of, ordered_quantities, worst_pose
from beamstiff.measure.table import WRENCH
from beamstiff.report.figures import BLUE, ORANGE, new_figure, plain
from beamstiff.report.tables import Column, Table, number, table
from beamstiff.se3 import Array

if TYPE_CHECKING:
    import xarray

PANELS = 5  # slices beside one another
WIDE = 100.0  # largest over least value above which colours follow the logarithm
OUTSIDE = 99.5  # per cent of the values that the colours tell apart
LETTERS = 12  # of a title, an inch wide
GREY = "0.85"  # where there is no value
SHOWN = {"N/m": (1e-3, "N/mm"), "m": (1e3, "mm"), "m/N": (1e6, "µm/N"), "rad": (degrees(1.0), "deg")}


def shown(value: float | None, unit: str) -> str:
    """Return a value as people read it, without its unit.

    >>> shown(1.5e6, "N/m"), shown(None, "1")
    ('1500', 'inf')
    """
    return "inf" if value is None else number(value * SHOWN.get(unit, (1.0, ""))[0])


def shown_unit(unit: str) -> str:
    """Return the unit in which `shown` shows."""
    return SHOWN.get(unit, (1.0, "" if unit == "1" else unit))[1]


def map_tables(facts: Mapping[str, Any]) -> Iterator[Table | str]:
    """Yield tables of a map's summary: how values spread, where the worst are, which poses have none."""
    axes = ", ".join(
        f"{name} {shown(axis['from'], axis['unit'])} to {shown(axis['to'], axis['unit'])} "
        f"{shown_unit(axis['unit'])} ({axis['count']})"
        for name, axis in facts["axes"].items()
    )
    yield f"{facts['robot']}: {facts['poses']:,} poses over {axes}; {facts['computed']:,} have all values."
    if facts["quantities"]:
        ends = ("min", *(f"{share} %" for share in PERCENTILES), "max")
        result = table("Over the map", "quantity", "unit", *ends, Column("worst at", left=True), left=2)
        keys = ("min", *(f"p{share}" for share in PERCENTILES), "max")
        for name, told in facts["quantities"].items():
            values = (shown(told[key], told["unit"]) if key in told else "" for key in keys)
            result.add_row(name, shown_unit(told["unit"]), *values, _place(facts, told))
        yield result
    if facts["reasons"]:
        heads = ("reason", "poses", "share", Column("for instance", left=True))
        result = table("Poses that lack values", *heads)
        for label, told in facts["reasons"].items():
            share = f"{number(100.0 * told['count'] / facts['poses'])} %"
            result.add_row(label.replace("_", " "), f"{told['count']:,}", share, told["example"])
        yield result


def _place(facts: Mapping[str, Any], told: Mapping[str, Any]) -> str:
    at = told.get("worst", {}).get("at", {})
    return ", ".join(
        f"{name} = {shown(value, facts['axes'][name]['unit'])} {shown_unit(facts['axes'][name]['unit'])}"
        for name, value in at.items()
    )


def map_figure(dataset: xarray.Dataset, quantities: list[str] | None = None) -> Figure:
    """Draw a map: a line over one axis, a picture over two, slices along the first of three.

    Of more axes, those between are held where the worst pose is. A cross marks the worst pose; what is grey
    has no value.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `map_workspace`.
    quantities : list of str, optional
        Of one number a pose; default: all of these.

    Raises
    ------
    BeamstiffError
        When the map has no such quantity.
    """
    drawn = ordered_quantities(dataset)
    names = drawn if quantities is None else quantities
    for name in names:
        if name not in drawn:
            expected = ", ".join(drawn) or "none"
            raise BeamstiffError(f"plot: {name!r} is not drawn, expected some of {expected}")
    if not names:
        raise BeamstiffError("plot: the map has matrices alone, expected a quantity of one number a pose")
    dataset = upright(dataset)
    axes = axes_of(dataset)
    slices = [_slices(dataset, name) for name in names]
    columns = max(len(some) for some in slices)
    figure = new_figure(max(5.0, 3.1 * columns + 1.2), 3.4 * len(names) + 0.3)
    panels = figure.subplots(len(names), columns, squeeze=False)
    for row, (name, some) in enumerate(zip(names, slices, strict=True)):
        if len(axes) == 1:
            _draw_line(panels[row, 0], dataset, name)
        else:
            _draw_slices(figure, panels[row], dataset, name, some)
    what = ", ".join(name.replace("_", " ") for name in names)
    title = f"{dataset.attrs.get('robot', '')}: {what}{_loaded(dataset, names)}"
    title = fill(title, int(LETTERS * figure.get_figwidth()))
    title += f"\n{dataset['reason'].size:,} poses, base frame"
    figure.suptitle(title.replace("$", r"\$"), fontsize="medium")
    return figure


def upright(dataset: xarray.Dataset) -> xarray.Dataset:
    """Return a map with z, where it is one of its last two axes, as the one that is drawn upwards."""
    axes = list(axes_of(dataset))
    if len(axes) > 1 and axes[-1] == "z":
        axes[-2:] = axes[:-3:-1]
    return dataset.transpose(*axes, ...)


def _loaded(dataset: xarray.Dataset, names: list[str]) -> str:
    """Return under which wrench the tool was displaced, in words; empty where no load counts."""
    if not any("wrench" in QUANTITIES[name].needs for name in names):
        return ""
    loads = zip(WRENCH, json.loads(dataset.attrs.get("wrench", "[]")), strict=False)
    parts = [f"{axis} = {number(value)} {'N' if axis[0] == 'f' else 'N m'}" for axis, value in loads if value]
    parts += ["its own weight"] if "added" in dataset.attrs.get("dead_weight", "") else []
    return f" under {', '.join(parts)}" if parts else ""


def _slices(dataset: xarray.Dataset, name: str) -> list[int]:
    """Return which values of the first axis to show: evenly, the worst among them."""
    axes = axes_of(dataset)
    if len(axes) < 3:
        return [0]
    count = dataset.sizes[axes[0]]
    some = np.unique(np.linspace(0, count - 1, min(PANELS, count)).round().astype(np.int64))
    worst = worst_pose(dataset, name)
    if worst is not None:
        some[np.argmin(np.abs(some - worst[0]))] = worst[0]
    return [int(at) for at in some]


def _draw_slices(figure: Figure, panels: Any, dataset: xarray.Dataset, name: str, some: list[int]) -> None:
    axes = axes_of(dataset)
    known, worst = QUANTITIES[name], worst_pose(dataset, name)
    factor, unit = SHOWN.get(known.unit, (1.0, shown_unit(known.unit)))
    between = axes[1:-2]
    held = {axis: (worst or (0,) * len(axes))[axes.index(axis)] for axis in between}
    along, across = axes[-1], axes[-2]
    values = dataset[name].isel({**held, **({axes[0]: some} if len(axes) > 2 else {})}).values * factor
    values = values.reshape(len(some), *values.shape[-2:])
    norm, extend = _norm(values)
    colours = colormaps["viridis" if known.worst == "least" else "viridis_r"].with_extremes(bad=GREY)
    u, v = (_scaled(dataset, axis) for axis in (along, across))
    for panel in panels[len(some) :]:
        panel.set_axis_off()
    image = None
    for at, (panel, number_of) in enumerate(zip(panels, some, strict=False)):
        shown_values = np.ma.masked_invalid(np.where(np.isinf(values[at]), norm.vmax, values[at]))
        look = {"norm": norm, "cmap": colours, "shading": "nearest", "rasterized": True}
        image = panel.pcolormesh(u, v, shown_values, **look)
        panel.set_facecolor(GREY)
        if {along, across} <= set("xyz"):
            panel.set_aspect("equal")
        panel.set_xlabel(_label(dataset, along))
        if at == 0:
            panel.set_ylabel(_label(dataset, across))
        if len(axes) > 2:
            panel.set_title(_where(dataset, axes[0], number_of), fontsize="medium")
            if worst is not None and worst[0] != number_of:
                continue
        if worst is not None:
            panel.plot(
                u[worst[-1]], v[worst[-2]], "X", color=ORANGE, markeredgecolor="white", markersize=10,
                clip_on=False, zorder=5, label="worst",
            )  # fmt: skip
            panel.legend(loc="best", fontsize="small", framealpha=0.8)
    if image is not None:
        label = name.replace("_", " ") + (f", {unit}" if unit else "")
        if held:
            label += "\n" + ", ".join(_where(dataset, axis, at) for axis, at in held.items())
        figure.colorbar(image, ax=panels[: len(some)].tolist(), label=label, extend=extend)


def _norm(values: Array) -> tuple[Normalize, str]:
    """Return how values become colours, and which end lies beyond them."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return Normalize(0.0, 1.0), "neither"
    low, high = float(finite.min()), float(finite.max())
    extend = "neither"
    if np.isinf(values).any() or (low > 0 and high > WIDE * max(low, float(np.percentile(finite, OUTSIDE)))):
        high, extend = float(np.percentile(finite, OUTSIDE)), "max"
    if low == high:
        low, high = 0.9 * low - 1e-12, 1.1 * high + 1e-12
    if low > 0 and high > WIDE * low:
        return LogNorm(low, high), extend
    return Normalize(low, high), extend


def _draw_line(panel: Axes, dataset: xarray.Dataset, name: str) -> None:
    (axis,) = axes_of(dataset)
    unit = QUANTITIES[name].unit
    at, values = _scaled(dataset, axis), dataset[name].values * SHOWN.get(unit, (1.0, ""))[0]
    panel.plot(at, np.where(np.isfinite(values), values, np.nan), color=BLUE)
    if (worst := worst_pose(dataset, name)) is not None and np.isfinite(values[worst]):
        panel.plot(at[worst], values[worst], "X", color=ORANGE, markersize=9, label="worst")
        panel.legend(fontsize="small")
    up = f"{name.replace('_', ' ')}, {shown_unit(unit)}".rstrip(", ")
    panel.set(xlabel=_label(dataset, axis), ylabel=up)
    plain(panel)


def _scaled(dataset: xarray.Dataset, axis: str) -> Array:
    return np.asarray(dataset[axis].values * SHOWN[dataset[axis].attrs["units"]][0])


def _label(dataset: xarray.Dataset, axis: str) -> str:
    return f"{variable_of(dataset, axis)}, {SHOWN[dataset[axis].attrs['units']][1]}".replace("$", r"\$")


def _where(dataset: xarray.Dataset, axis: str, at: int) -> str:
    unit, value = SHOWN[dataset[axis].attrs["units"]][1], number(float(_scaled(dataset, axis)[at]))
    return f"{variable_of(dataset, axis)} = {value} {unit}".replace("$", r"\$")
