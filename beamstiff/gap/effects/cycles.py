"""Cycles in time: what switches on and off, as an air conditioner does, moves a reading to and fro.

The period is not known beforehand. It is taken where waves of all periods, along x, y and z, explain most of
the gap (a periodogram by least squares: Lomb, Astrophys. Space Sci. 39 (1976) 447); what is paid for the
choice is the number of periods that can be told from one another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import stated_scale
from beamstiff.gap.effects.outside import clock
from beamstiff.se3 import Array

FEWEST, MOST = 2.0, 150.0  # cycles in a campaign
FINE, FINEST = 0.2, 0.02  # steps of cycles in a campaign
READINGS = 4  # a cycle, at least
HARMONICS = (1, 2, 3)


@dataclass(frozen=True)
class Cycle:
    """How many cycles a campaign has, and how many numbers of them can be told apart; 0 where none can."""

    count: float
    choices: float


def cycle_of(baseline: Baseline, since_unloaded: bool) -> Cycle:
    """Return the cycle that explains most of the gap of the rows that were fitted, or the one stated.

    Parameters
    ----------
    baseline : Baseline
    since_unloaded : bool
        Whether readings count from the first of their posture.
    """
    stated = stated_scale(baseline, "cycles")
    if stated is not None:
        return Cycle(stated, 1.0)
    fit = baseline.fit
    time = clock(fit)
    most = min(MOST, np.unique(time).size / READINGS)
    if most <= FEWEST:
        return Cycle(0.0, 1.0)
    counts = np.arange(FEWEST, most, FINE)
    start = first_of_pose(fit) if since_unloaded else None
    best = counts[np.argmax(_explained(fit, waves(time, counts, start)))]
    near = np.arange(best - FINE, best + FINE, FINEST)
    return Cycle(float(near[np.argmax(_explained(fit, waves(time, near, start)))]), most - FEWEST)


def first_of_pose(baseline: Baseline) -> NDArray[np.intp]:
    """Return for each row the first reading of its pose, (N,)."""
    time, pose = clock(baseline), baseline.rows.pose
    result = np.empty(len(pose), dtype=np.intp)
    for one in np.unique(pose):
        at = np.flatnonzero(pose == one)
        result[at] = at[np.argmin(time[at])]
    return result


def waves(time: Array, counts: Array, start: NDArray[np.intp] | None = None) -> Array:
    """Return sine and cosine (N, F, 2) of cycles a campaign (F,), less those of the rows `start` if given."""
    phase = 2.0 * np.pi * time[:, None] * counts
    result: Array = np.stack([np.sin(phase), np.cos(phase)], -1)
    return result if start is None else result - result[start]


def _explained(baseline: Baseline, found: Array) -> Array:
    """Return what waves (N, F, 2) along x, y and z explain (F,) beside the model's own values, squared."""
    weight = np.where(baseline.used, 1.0 / baseline.sigma, 0.0)
    tangent = (baseline.tangent * weight[..., None]).reshape(-1, baseline.tangent.shape[2])
    vectors, sizes, _ = np.linalg.svd(tangent, full_matrices=False)
    own = vectors[:, sizes > 1e-9 * sizes.max(initial=0.0)]
    gap = (baseline.gap * weight).ravel()
    left = (gap - own @ (own.T @ gap)).reshape(-1, 6)
    bound = 5.0 * np.median(np.abs(left[baseline.used]))
    left = np.clip(left, -bound, bound)  # a bad row must not make a cycle
    own = own.reshape(len(left), 6, -1)[:, :3]
    found = np.concatenate([found, np.ones((*found.shape[:2], 1))], -1)  # about any middle
    columns = found[:, None] * weight[:, :3, None, None]  # (N, 3, F, 3)
    toward = np.einsum("niab,ni->aib", columns, left[:, :3]).reshape(found.shape[1], 9)
    part = np.einsum("niab,nit->atib", columns, own).reshape(found.shape[1], own.shape[2], 9)
    square = np.zeros((found.shape[1], 3, 3, 3, 3))
    for i in range(3):
        square[:, i, :, i] = np.einsum("nab,nac->abc", columns[:, i], columns[:, i])
    gram = square.reshape(-1, 9, 9) - part.swapaxes(1, 2) @ part
    solved = np.linalg.pinv(gram, rcond=1e-8, hermitian=True) @ toward[..., None]
    result: Array = np.einsum("fa,fa->f", toward, solved[..., 0])
    return result
