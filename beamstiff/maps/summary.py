"""A map in numbers: how its values spread, where the worst pose is, how many poses have none and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from beamstiff.maps.quantities import QUANTITIES, Reason, variable_of

if TYPE_CHECKING:
    import xarray

PERCENTILES = (5, 50, 95)


def axes_of(dataset: xarray.Dataset) -> tuple[str, ...]:
    """Return the names of the axes of a map."""
    return tuple(str(name) for name in dataset["reason"].dims)


def ordered_quantities(dataset: xarray.Dataset) -> list[str]:
    """Return the quantities of a map that have one number a pose."""
    return [name for name in QUANTITIES if name in dataset and QUANTITIES[name].worst is not None]


def reason_counts(dataset: xarray.Dataset) -> dict[str, int]:
    """Return how many poses lack something, by reason; none that does not occur."""
    counts = np.bincount(dataset["reason"].values.reshape(-1), minlength=len(Reason))
    return {reason.label: int(counts[reason]) for reason in Reason if reason and counts[reason]}


def worst_pose(dataset: xarray.Dataset, name: str) -> tuple[int, ...] | None:
    """Return the place in the grid of the worst value of a quantity; None where there is no value."""
    values = dataset[name].values
    if np.isnan(values).all():
        return None
    flat = np.nanargmin(values) if QUANTITIES[name].worst == "least" else np.nanargmax(values)
    return tuple(int(at) for at in np.unravel_index(flat, values.shape))


def summary(dataset: xarray.Dataset) -> dict[str, Any]:
    """Return a map in numbers as plain data, SI; a value that is infinite, at a singular pose, is None.

    Returns
    -------
    dict
        ``poses``, ``computed`` (poses that lack nothing), ``reasons`` by name with ``count`` and ``example``,
        ``quantities`` by name with ``unit``, ``min``, ``p5``, ``p50``, ``p95``, ``max`` and ``worst``: its
        ``value``, where it is on the axes (``at``) and, over positions, the joint values (``q``).
    """
    reason = dataset["reason"]
    counts = reason_counts(dataset)
    return {
        "robot": dataset.attrs["robot"],
        "axes": {
            variable_of(dataset, name): {
                "unit": dataset[name].attrs["units"],
                "from": float(dataset[name][0]),
                "to": float(dataset[name][-1]),
                "count": dataset.sizes[name],
            }
            for name in axes_of(dataset)
        },
        "poses": reason.size,
        "computed": reason.size - sum(counts.values()),
        "reasons": {
            label: {"count": count, "example": reason.attrs.get(f"example_{label}", "")}
            for label, count in counts.items()
        },
        "quantities": {name: _of_quantity(dataset, name) for name in ordered_quantities(dataset)},
    }


def _of_quantity(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    values = dataset[name].values.reshape(-1)
    values = values[~np.isnan(values)]
    told: dict[str, Any] = {"unit": QUANTITIES[name].unit, "worst_is": QUANTITIES[name].worst}
    place = worst_pose(dataset, name)
    if place is None:
        return told
    ends = (values.min(), *np.percentile(values, PERCENTILES, method="lower"), values.max())
    labels = ("min", *(f"p{share}" for share in PERCENTILES), "max")
    told |= {label: _finite(float(end)) for label, end in zip(labels, ends, strict=True)}
    worst: dict[str, Any] = {
        "value": _finite(float(dataset[name].values[place])),
        "at": {
            variable_of(dataset, axis): float(dataset[axis][at])
            for axis, at in zip(axes_of(dataset), place, strict=True)
        },
    }
    if "q" in dataset:
        worst["q"] = dict(
            zip(dataset["joint"].values.tolist(), dataset["q"].values[place].tolist(), strict=True)
        )
    return told | {"worst": worst}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
