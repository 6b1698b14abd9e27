"""What effects outside the machine share: the axes of the tool, the clock of the campaign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from beamstiff.gap.baseline import Baseline, nominal_pose
from beamstiff.measure.rows import history_order
from beamstiff.se3 import Array


def tool_axes(baseline: Baseline) -> Array:
    """Return the axes of the TCP's frame in the base frame as columns, (N, 3, 3)."""
    return nominal_pose(baseline.nominal, baseline.rows)[1]


def clock(baseline: Baseline) -> Array:
    """Return when each row was read, (N,): its time, else its place in the order, from 0 to about 1."""
    rows, fitted = baseline.rows, baseline.fit.rows
    if np.isfinite(fitted.time).all() and np.ptp(fitted.time) > 0:
        first, span = fitted.time.min(), np.ptp(fitted.time)
        read: Array = np.nan_to_num((rows.time - first) / span)
        return read
    result = np.empty(len(rows))
    result[history_order(rows)] = np.arange(len(rows)) / max(len(fitted) - 1, 1)
    return result


def since_pose(baseline: Baseline, time: Array) -> Array:
    """Return the time since the first reading of a row's pose, (N,)."""
    result = np.empty_like(time)
    for pose in np.unique(baseline.rows.pose):
        chosen: NDArray[np.bool_] = baseline.rows.pose == pose
        result[chosen] = time[chosen] - time[chosen].min()
    return result
