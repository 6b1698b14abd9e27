"""What states that were measured again say by themselves: the noise, and whether the readings drift.

Rows are repeats where posture, load, its point, the reflector and the way the load was reached are the same.
Nothing but noise, and what goes with time, can part them, whatever the model.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamstiff.diagnosis.effects.load_error import rising
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

DIGITS = 9  # of loads and joint values, to which states are the same


@dataclass(frozen=True)
class Repeats:
    """Noise and drift of repeated states; positions, then rotations.

    `noise`: (2,) array; standard deviation over the sigma that the baseline counts with; NaN where nothing
        was repeated.
    `freedom`: (2,) int array; differences it rests on.
    `likely`: (2,) array; probability of a scatter at least as far from that sigma, to its side.
    `drift`: (2,) array; slope of the readings over time, largest component, m/s and rad/s; NaN without times.
    `steady`: (2,) array; probability of slopes at least as steep without drift.
    """

    noise: Array
    freedom: NDArray[np.intp]
    likely: Array
    drift: Array
    steady: Array


def repeats(baseline: Baseline) -> Repeats:
    """Return what the repeats among a baseline's rows say."""
    group = _groups(baseline)
    noise, drift = np.full(2, np.nan), np.full(2, np.nan)
    freedom, likely, steady = np.zeros(2, dtype=np.intp), np.ones(2), np.ones(2)
    for kind, some in enumerate((slice(0, 3), slice(3, 6))):
        deviation, time, used, sigma = _within(baseline, group, some)
        freedom[kind] = used.sum() - sum(np.unique(group[own]).size for own in used.T)
        if not freedom[kind]:
            continue
        square = float((deviation**2).sum())
        noise[kind] = np.sqrt(square / freedom[kind])
        above = float(chi2.sf(square, freedom[kind]))
        likely[kind] = min(above, 1.0 - above)
        spread = (time**2).sum(axis=0)
        if not noise[kind] or not (spread > 0).any():  # NaN: no times
            continue
        kept = spread > 0
        slope = (time * deviation).sum(axis=0)[kept] / spread[kept]
        steady[kind] = float(chi2.sf((slope**2 * spread[kept]).sum() / noise[kind] ** 2, kept.sum()))
        drift[kind] = float(np.abs(slope).max() * np.median(sigma[used]))
    return Repeats(noise, freedom, likely, drift, steady)


def repeated(baseline: Baseline) -> bool:
    """Return whether a state was read more than once."""
    return bool(np.bincount(_groups(baseline)).max(initial=0) > 1)


def independent(baseline: Baseline, left: Array) -> float:
    """Return as how many values those of the rows count, of which a fit leaves `left` (n,), whitened.

    What is systematic is left of every repeat alike, and m repeats are no m witnesses of it. Of a variance v
    of which w parts repeats, the mean of m keeps ``v - w + w/m``: they count as ``v / (v - w + w/m)``. That
    is m where all is noise, and one where all is systematic.
    """
    row, component = np.nonzero(baseline.used)
    group = np.unique(6 * _groups(baseline)[row] + component, return_inverse=True)[1].reshape(-1)
    count = np.bincount(group)
    if count.max() == 1 or (baseline.sharing >= 0).any():  # what rows share is weighed by the covariance
        return float(len(left))
    within = left - (np.bincount(group, left) / count)[group]
    whole = float(left @ left) / len(left)
    parts = min(float(within @ within) / (len(left) - len(count)), whole)
    if whole == 0.0:
        return float(len(left))
    return float((whole / (whole - parts * (1.0 - 1.0 / count))).sum())


def _groups(baseline: Baseline) -> NDArray[np.intp]:
    """Return the number of each row's state, (N,)."""
    rows = baseline.rows
    names = np.unique(np.concatenate([rows.point, rows.load_point]))
    states = np.concatenate(
        [
            np.round(rows.q, DIGITS),
            np.round(rows.wrench, DIGITS),
            np.stack(
                [
                    rows.pose,
                    rising(baseline),
                    np.searchsorted(names, rows.point),
                    np.searchsorted(names, rows.load_point),
                    np.unique(rows.target, return_inverse=True)[1],
                ],
                axis=1,
            ),
        ],
        axis=1,
    )
    return np.unique(states, axis=0, return_inverse=True)[1].reshape(-1)


def _within(
    baseline: Baseline, group: NDArray[np.intp], some: slice
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Return deviations from each state's mean over sigma, of the times, which values count, and that sigma.

    All (N, 3). An unloaded reading that rows share is common to them: only half of their variance is their
    own.
    """
    sigma = np.where(baseline.sharing >= 0, np.sqrt(0.5), 1.0)[:, None] * baseline.sigma[:, some]
    used = baseline.used[:, some]
    values = np.where(used, baseline.measured[:, some] / sigma, 0.0)
    time = np.where(used, baseline.rows.time[:, None], 0.0)
    count = np.zeros((group.max() + 1, 3))
    np.add.at(count, group, used.astype(np.float64))
    repeated = used & (count[group] > 1)

    def centred(quantity: Array) -> Array:
        total = np.zeros_like(count)
        np.add.at(total, group, quantity)
        return np.where(repeated, quantity - (total / np.maximum(count, 1))[group], 0.0)

    return centred(values), centred(time), repeated, sigma
