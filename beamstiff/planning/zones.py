"""Zones of the joint space: contiguous regions of a map where something is good, and their intersections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from beamstiff.errors import BeamstiffError
from beamstiff.planning.poses import Grid, Mask
from beamstiff.se3 import Array

FULL_TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Zone:
    """A contiguous region of a map."""

    grid: Grid
    mask: Mask  # (n, m) bool: points of the grid that belong to it
    # rad or m: smallest ranges of both variables that hold it; past a full turn where it runs
    # over the edge
    ranges: dict[str, tuple[float, float]]
    share: float  # of the grid's points
    best: float  # its best value
    at: dict[str, float]  # rad or m: where that is


def find_zones(grid: Grid, values: Array, least: float) -> list[Zone]:
    """Return the contiguous regions where values (n, m) are at least `least`, the largest first.

    A grid over a full turn of an angle is closed: what runs over its edge is one region. Points where there
    is no value (NaN) belong to none.
    """
    if values.shape != grid.shape:
        raise BeamstiffError(f"zones: found values of shape {values.shape}, expected {grid.shape}")
    with np.errstate(invalid="ignore"):  # NaN is in no zone
        mask = values >= least
    labels, count = ndimage.label(mask)
    number = np.arange(count + 1)
    axes = tuple(zip(grid.names, (grid.first, grid.second), grid.turns, strict=True))
    for axis, (_, ticks, turns) in enumerate(axes):
        if turns and _closed(ticks):
            edges = zip(np.take(labels, 0, axis=axis), np.take(labels, -1, axis=axis), strict=True)
            for a, b in {(int(a), int(b)) for a, b in edges if a and b}:
                number[number == number[b]] = number[a]
    zones = []
    for label in np.unique(number[1:]):
        region = (number[labels] == label) & mask
        i, j = np.unravel_index(np.argmax(np.where(region, values, -np.inf)), grid.shape)
        ranges = {
            name: _range(ticks, region.any(axis=1 - axis), turns)
            for axis, (name, ticks, turns) in enumerate(axes)
        }
        at = {grid.names[0]: float(grid.first[i]), grid.names[1]: float(grid.second[j])}
        zones.append(Zone(grid, region, ranges, float(region.mean()), float(values[i, j]), at))
    return sorted(zones, key=lambda zone: -zone.share)


def _closed(values: Array) -> bool:
    """Return whether values of an angle go all around, so that the first follows on the last."""
    step = float(np.diff(values).max())
    return bool(values[-1] - values[0] + step >= FULL_TURN - 1e-6 * step)


def _range(values: Array, used: Mask, turns: bool) -> tuple[float, float]:
    """Return the smallest range that holds the used values, over the edge of a full turn where shorter."""
    held = values[used]
    if not (turns and _closed(values)) or used.all():
        return float(held[0]), float(held[-1])
    gaps = np.diff(np.append(held, held[0] + FULL_TURN))
    widest = int(np.argmax(gaps))
    start = held[(widest + 1) % held.size]
    return float(start), float(start + FULL_TURN - gaps[widest])
