"""Many samples of a state to its mean, with the spread kept."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.arrays import Integers, equal_rows, finite
from beamstiff.se3 import Array

# modified z-score above which a sample is an outlier, and the factors that make the median and the mean
# absolute deviation of normal noise its standard deviation (Iglewicz & Hoaglin, How to Detect and Handle
# Outliers, 1993)
OUTLIER = 3.5
_MEDIAN_DEVIATION = 1.482602218505602
_MEAN_DEVIATION = 1.2533141373155003


@dataclass(frozen=True, eq=False)
class AveragedStates:
    """States averaged over their samples; S states, D components."""

    state: Integers  # (S,): their ids, in order of appearance
    mean: Array  # (S, D): naN where nothing was sampled
    spread: Array  # (S, D): standard deviation of one sample (n - 1); NaN for fewer than two
    # (S, D): standard deviation of the mean, ``spread / sqrt(n)``: of independent samples. Slow drift within
    # a state makes it too small
    sigma: Array
    count: Integers  # (S, D): samples used
    rejected: Integers  # (S, D): samples left out as outliers


def average_samples(samples: ArrayLike, state: ArrayLike, *, robust: bool = False) -> AveragedStates:
    """Return the mean and spread of every state's samples.

    `samples` (T, D): raw readings; NaN where one dropped out. Angles must not wrap: give rotations relative
    to a reference. `state` (T,): state that each sample belongs to. `robust`: leave out samples further from
    the median than 3.5 robust standard deviations, component by component.

    >>> states = average_samples([[1.0], [3.0], [7.0]], [5, 5, 6])
    >>> states.mean.ravel(), states.spread.ravel(), states.sigma[0]
    (array([2., 7.]), array([1.41421356, nan]), array([1.]))
    """
    x = finite(samples, "samples", -1, -1, missing=True)
    ids, first, group = _groups(state, len(x), x.ndim)
    used: NDArray[np.bool_] = ~np.isnan(x)
    sampled = _sums(used, group, len(ids))
    if robust:
        used = used & ~_outliers(x, group, len(ids))
    count = _sums(used, group, len(ids))
    known = np.where(used, x, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        # about the first sample of each state, so that metres do not drown micrometres
        origin = np.where(np.isnan(x[first]), 0.0, x[first])
        shifted = np.where(used, known - origin[group], 0.0)
        mean = _sums(shifted, group, len(ids)) / count
        squares = _sums(np.where(used, (shifted - mean[group]) ** 2, 0.0), group, len(ids))
        spread = np.where(count > 1, np.sqrt(squares / (count - 1)), np.nan)
        sigma = spread / np.sqrt(count)
    return AveragedStates(
        state=ids,
        mean=np.where(count > 0, mean + origin, np.nan),
        spread=spread,
        sigma=sigma,
        count=count.astype(np.int64),
        rejected=(sampled - count).astype(np.int64),
    )


def difference_of_states(
    states: AveragedStates, loaded: ArrayLike, unloaded: ArrayLike
) -> tuple[Array, Array]:
    """Return loaded minus unloaded means (N, D) and their standard deviations (N, D).

    `loaded, unloaded` (N,): ids of the states. Where one unloaded state serves several rows, their errors are
    correlated: give ``shared_unloaded=True`` to `make_measurements`.

    >>> states = average_samples([[1.0], [3.0], [7.0], [9.0]], [0, 0, 1, 1])
    >>> difference_of_states(states, [1], [0])
    (array([[6.]]), array([[1.41421356]]))
    """
    rows = []
    for name, ids in (("loaded", loaded), ("unloaded", unloaded)):
        wanted = np.atleast_1d(np.asarray(ids))
        order = np.argsort(states.state)
        at = np.searchsorted(states.state[order], wanted).clip(max=len(order) - 1)
        missing = states.state[order][at] != wanted
        if missing.any():
            raise BeamstiffError(f"{name}: found state {wanted[missing][0]}, of which there is no sample")
        rows.append(order[at])
    a, b = rows
    if a.shape != b.shape:
        raise BeamstiffError(
            f"found {len(a)} loaded and {len(b)} unloaded states, expected one unloaded for each loaded"
        )
    sigma: Array = np.hypot(states.sigma[a], states.sigma[b])
    return states.mean[a] - states.mean[b], sigma


def _groups(state: ArrayLike, n: int, dimensions: int) -> tuple[Integers, Integers, Integers]:
    ids = np.asarray(state)
    if ids.shape != (n,) or dimensions != 2 or n == 0 or not np.issubdtype(ids.dtype, np.integer):
        raise BeamstiffError(
            f"state: found {ids.dtype} values of shape {ids.shape} for {n} samples, expected one whole "
            "number a sample"
        )
    group = equal_rows(ids[:, None].astype(np.float64))
    first = np.unique(group, return_index=True)[1]
    return ids[first].astype(np.int64), first.astype(np.int64), group


def _sums(values: ArrayLike, group: Integers, groups: int) -> Array:
    """Return the sums (groups, D) of the rows of each group."""
    array = np.asarray(values, dtype=np.float64)
    result = np.zeros((groups, array.shape[1]))
    np.add.at(result, group, array)
    return result


def _medians(x: Array, group: Integers, groups: int) -> Array:
    """Return the medians (groups, D), NaN left out."""
    result = np.full((groups, x.shape[1]), np.nan)
    for column in range(x.shape[1]):  # a handful of components; the groups are what there are many of
        known = ~np.isnan(x[:, column])
        values, of = x[known, column], group[known]
        order = np.lexsort((values, of))
        count = np.bincount(of, minlength=groups)
        start = np.cumsum(count) - count
        some = count > 0
        low, high = (start + (count - 1) // 2)[some], (start + count // 2)[some]
        result[some, column] = (values[order[low]] + values[order[high]]) / 2
    return result


def _outliers(x: Array, group: Integers, groups: int) -> NDArray[np.bool_]:
    """Return which samples (T, D) lie too far from the median of their state."""
    away = np.abs(x - _medians(x, group, groups)[group])
    scale = _MEDIAN_DEVIATION * _medians(away, group, groups)
    count = _sums(~np.isnan(x), group, groups)
    mean = _MEAN_DEVIATION * _sums(np.nan_to_num(away), group, groups) / np.maximum(count, 1)
    # more than half of the samples equal (coarse digits): the median deviation is zero, the mean one is not
    scale = np.where(scale > 0, scale, mean)
    with np.errstate(invalid="ignore"):
        result: NDArray[np.bool_] = away > OUTLIER * scale[group]
    return result
