"""Cycles in time: what switches on and off, as an air conditioner does, moves a reading to and fro.

The period is not known beforehand. It is taken where waves of all periods, along x, y and z, explain most of
the gap (a periodogram by least squares: Lomb, Astrophys. Space Sci. 39 (1976) 447); what is paid for the
choice is the number of periods that can be told from one another.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.effect import stated_scale
from beamstiff.diagnosis.effects.external import clock, first_of_pose
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

FEWEST, MOST = 2.0, 150.0  # cycles in a campaign
FINE, FINEST = 0.2, 0.02  # steps of cycles in a campaign
READINGS = 4  # a cycle, at least
HARMONICS = (1, 2, 3)


@dataclass(frozen=True)
class Cycle:
    """How many cycles a campaign has, and how many numbers of them are distinguishable; 0 where none is."""

    count: float
    choices: float


def cycle_of(baseline: Baseline, since_unloaded: bool) -> Cycle:
    """Return the cycle that explains most of the gap of the rows that were fitted, or the one stated.

    `since_unloaded`: whether readings count from the first of their posture.
    """
    if baseline.stated is not None:
        return Cycle(stated_scale(baseline, "cycles") or 0.0, 1.0)
    fit = baseline.fit
    time = clock(fit)
    read = fit.used[:, :3]
    most = min(MOST, np.unique(time[read.any(axis=1)]).size / READINGS)
    if most <= FEWEST:
        return Cycle(0.0, 1.0)
    left, own = _positions(fit)
    start = first_of_pose(fit) if since_unloaded else None

    def best(counts: Array) -> float:
        explained = _explained(left, own, waves(time, counts, start), read, start is None)
        return float(counts[np.argmax(explained)])

    about = best(np.arange(FEWEST, most, FINE))
    near = np.clip(np.arange(about - FINE, about + FINE, FINEST), FEWEST, most)
    return Cycle(best(near), max(1.0, most - FEWEST))


def waves(time: Array, counts: Array, start: NDArray[np.intp] | None = None) -> Array:
    """Return sine and cosine (N, F, 2) of cycles a campaign (F,), less those of the rows `start` if given."""
    phase = 2.0 * np.pi * time[:, None] * counts
    result: Array = np.stack([np.sin(phase), np.cos(phase)], -1)
    return result if start is None else result - result[start]


def _positions(baseline: Baseline) -> tuple[Array, Array]:
    """Return the position gap (N, 3) beside the model's own values, and what these move, (N, 3, t) together.

    In metres, whatever the noise is thought to be: the period must not change with that.
    """
    read = baseline.used[:, :3]
    tangent = np.where(read[..., None], baseline.tangent[:, :3], 0.0).reshape(read.size, -1)
    vectors, sizes, _ = np.linalg.svd(tangent, full_matrices=False)
    own = vectors[:, sizes > 1e-9 * sizes.max(initial=0.0)]
    gap = np.where(read, baseline.gap[:, :3], 0.0).ravel()
    left = gap - own @ (own.T @ gap)
    bound = 5.0 * float(np.median(np.abs(left[read.ravel()]))) if read.any() else 0.0
    clipped = np.clip(left, -bound, bound)  # a bad row must not make a cycle
    return clipped.reshape(-1, 3), own.reshape(len(read), 3, own.shape[1])


def _explained(left: Array, own: Array, found: Array, read: NDArray[np.bool_], middle: bool) -> Array:
    """Return what waves (N, F, 2) along x, y and z, about any middle or none, explain (F,), squared.

    Of the positions that were read (N, 3).
    """
    if middle:
        found = np.concatenate([found, np.ones((*found.shape[:2], 1))], -1)
    count, waves_each = found.shape[1:]
    toward = np.einsum("nfa,ni->fia", found, left).reshape(count, -1)
    part = np.einsum("nfa,nit->ftia", found, own).reshape(count, own.shape[2], 3 * waves_each)
    gram = np.zeros((count, 3, waves_each, 3, waves_each))
    for axis in range(3):
        seen = found * read[:, axis, None, None]
        gram[:, axis, :, axis] = np.einsum("nfa,nfb->fab", seen, found)
    whole = gram.reshape(count, 3 * waves_each, -1) - part.swapaxes(1, 2) @ part
    solved = np.linalg.pinv(whole, rcond=1e-8, hermitian=True) @ toward[..., None]
    return np.asarray(np.einsum("fa,fa->f", toward, solved[..., 0]))
