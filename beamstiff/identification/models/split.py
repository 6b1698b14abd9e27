"""Rows to fit, and rows to judge by: whole poses and a whole load that no model sees."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import equal_rows
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

SAME = 0.02  # loads that differ by less than this share are one level
MOST_LEVELS = 8  # beyond, levels are quarters of the rows
KINDS = ("fitted", "new pose", "new load", "new pose and load")


@dataclass(frozen=True, eq=False)
class Split:
    """What is fitted and what is not, N rows."""

    # new_pose, new_load, (N,): whether the row's pose, and its load, are held out
    new_pose: NDArray[np.bool_]
    new_load: NDArray[np.bool_]
    level: NDArray[np.int64]  # (N,): load of each row, by size
    loads: tuple[float, ...]  # mean size of each level, N; N m where loads are moments only
    unit: str  # of `loads`

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Rows that models are fitted to, (N,)."""
        return ~(self.new_pose | self.new_load)

    @property
    def kind(self) -> NDArray[np.int64]:
        """Which of `KINDS` each row is, (N,)."""
        return self.new_pose + 2 * self.new_load.astype(np.int64)


def split_rows(
    table: Measurements, share: float = 0.25, fit_load: float | None = None, seed: int = 0
) -> Split:
    """Hold poses out, and a load where there are several.

    `share`: of the poses that are held out, drawn at random. `fit_load`: size of the load to fit, N (N m
    where loads are moments only): all others are held out, as in seed 003. Default: the largest is held out.

    What is held out is where the robot stood: rows of equal joint values leave together, in whatever table
    and under whatever pose id they are.
    """
    if not 0.0 <= share < 1.0:
        raise BeamstiffError(f"share of poses to hold out: found {share}, expected at least 0, less than 1")
    stood = configurations(table)
    poses = np.unique(stood)
    held = round(share * len(poses)) if share else 0
    if share and not 1 <= held < len(poses):
        raise BeamstiffError(
            f"{table.source}: found {len(poses)} poses, expected more, so that a share of {share:.2g} can be "
            "held out"
        )
    out = np.random.default_rng(seed).permutation(poses)[:held]
    level, loads, unit = load_levels(table)
    new_load = np.zeros(len(table), dtype=np.bool_)
    if fit_load is not None:
        near = np.abs(np.array(loads) - fit_load)
        if not (near <= SAME * np.array(loads)).any():
            known = ", ".join(f"{load:.4g}" for load in loads)
            raise BeamstiffError(
                f"{table.source}: found no load of {fit_load:.4g} {unit}, expected one of {known} {unit}"
            )
        new_load = level != int(near.argmin())
    elif len(loads) > 1:
        new_load = level == len(loads) - 1
    split = Split(np.isin(stood, out), new_load, level, loads, unit)
    if not split.fitted.any():
        raise BeamstiffError(f"{table.source}: no row is left to fit, expected several poses under each load")
    return split


def configurations(table: Measurements) -> NDArray[np.int64]:
    """Return an id for every row (N,), equal where the robot stood the same; tables number poses apart."""
    whole = table.q[np.unique(table.pose, return_index=True)[1]]  # one reading for all rows of a pose
    of_pose = equal_rows(whole)
    return of_pose[np.unique(table.pose, return_inverse=True)[1].reshape(-1)]


def load_levels(table: Measurements) -> tuple[NDArray[np.int64], tuple[float, ...], str]:
    """Return the level of each row's load (N,), the mean size of each level, and the unit."""
    force = np.linalg.norm(table.wrench[:, :3], axis=1)
    size, unit = (force, "N") if force.any() else (np.linalg.norm(table.wrench[:, 3:], axis=1), "N m")
    order = np.argsort(size, kind="stable")
    steps = np.diff(size[order]) > SAME * np.maximum(size[order][1:], 1e-12)
    level = np.empty(len(size), dtype=np.int64)
    level[order] = np.concatenate([[0], np.cumsum(steps)])
    if level.max() >= MOST_LEVELS:
        level[order] = (4 * np.arange(len(size))) // len(size)
    return level, tuple(float(size[level == one].mean()) for one in range(int(level.max()) + 1)), unit


def position_errors(table: Measurements, predicted: Array) -> Array:
    """Return the norm of the position error of every row, (N,), m, over the components that were measured.

    NaN where none was, or where the model has no answer for one that was.
    """
    seen = table.measured_mask[:, :3]
    gap = np.where(seen, table.displacement[:, :3] - predicted[:, :3], 0.0)
    return np.where(seen.any(axis=1), np.linalg.norm(gap, axis=1), np.nan)
