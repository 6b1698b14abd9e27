"""Where something stands, or when it happened: chosen where it explains most of the gap, and paid for.

What the model itself and another part of the shape leave of the gap is what has to be explained. The noise
has no part in the choice, which must not move with what the noise is thought to be.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline
from beamstiff.diagnosis.residual.whitened import orthonormal, shown
from beamstiff.se3 import Array

Choice = TypeVar("Choice")

BOUND = 5.0  # usual sizes beyond which a value counts as one at this bound: a bad row must not choose
TIED = 1e-6  # share of what is explained, within which two choices are equals
ROTATION_LENGTH = 0.5  # m, by which rotations count beside positions, whatever the noise is thought to be


@dataclass(frozen=True)
class Left:
    """What is left of the gap of the rows that were fitted, n values.

    `fit`: of these rows.
    `gap`: (n,) array.
    `own`: (n, t) array; orthonormal columns of what was taken out.
    """

    fit: Baseline
    gap: Array
    own: Array

    def explained(self, columns: Array) -> float:
        """Return how much of it columns (N, 6, c) of the rows that were fitted explain, squared."""
        whole = _weighted(self.fit, self.fit.rows.along(columns))
        flat = whole - self.own @ (self.own.T @ whole)
        flat = flat[:, np.linalg.norm(flat, axis=0) > ROUNDING * np.linalg.norm(whole, axis=0)]
        if not flat.shape[1]:
            return 0.0
        toward = flat.T @ self.gap
        return float(toward @ np.linalg.pinv(flat.T @ flat, rcond=1e-8, hermitian=True) @ toward)


def left_by(fit: Baseline, columns: Array) -> Left:
    """Return what the model's own values and columns (N, 6, c) leave of the gap."""
    parts = [shown(_weighted(fit, some)) for some in (fit.tangent, fit.rows.along(columns))]
    own = orthonormal(np.concatenate(parts, axis=1))
    gap = _weighted(fit, fit.gap[..., None])[:, 0]
    left = gap - own @ (own.T @ gap)
    bound = BOUND * float(np.median(np.abs(left))) if left.size else 0.0
    clipped = np.clip(left, -bound, bound)
    return Left(fit, clipped - own @ (own.T @ clipped), own)


def best_of(choices: Sequence[Choice], left: Left, columns: Callable[[Choice], Array]) -> Choice | None:
    """Return the choice whose columns explain most of what is left, None if none explains anything.

    Of few rows many explain all: the first, for rounding must not choose.
    """
    values = np.array([left.explained(columns(one)) for one in choices])
    if not values.size or not values.max() > ROUNDING * (left.fit.gap**2).sum():
        return None
    return choices[int(np.argmax(values >= (1.0 - TIED) * values.max()))]


def _weighted(fit: Baseline, columns: Array) -> Array:
    return np.asarray((columns * np.repeat([1.0, ROTATION_LENGTH], 3)[:, None])[fit.used])
