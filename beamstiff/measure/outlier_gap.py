"""Rows that stand far from all others: a wrong reading or a slip, which no model of the machine explains.

What a model leaves has tails, but no gap: nothing that a machine does moves one row or two so much farther
than the farthest of all others. With e the errors over the noise as stated, the largest first, and s what the
middle of them scatters, the first k stand apart where ``e_k > 3 e_(k+1)`` and
``P(chi^2_3 > (e_k / s)^2) < 1e-3 / n``. Rows that bend the fit are found by their influence,
`diagnosis.decomposition.outlier_influence`; of displacements by leaving each out,
`diagnosis.residual.outlier_screening`.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamstiff.errors import listed
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

APART = 3.0  # times the error of the farthest other row; causes of 150 simulated tables left at most 2.3
FEW, SHARE = 2, 0.02  # rows, and share of them, that may be gross errors whatever they look like
CHANCE = 1e-3  # of so large an error of any row, by what the middle of them scatters


def most_far(count: int) -> int:
    """Return how many of so many rows may be gross errors, whatever they look like."""
    return max(FEW, int(SHARE * count))


def farthest(error: Array, most: int, count: int) -> Integers:
    """Return the places (k,) of the farthest errors, behind which others follow at a distance; mostly none.

    `error` (n,): of each row, over its noise as stated. `most`: that may be so. `count`: rows in all.

    Examples
    --------
    >>> farthest(np.array([1.0, 1.5, 40.0, 0.5, 2.0]), most=2, count=5).tolist()
    [2]
    >>> farthest(np.array([1.0, 1.5, 4.0, 0.5, 2.0]), most=2, count=5).tolist()
    []
    """
    order = np.argsort(-error)
    for found in range(1, min(most, len(error) - 1) + 1):
        if stands_apart(float(error[order[found - 1]]), float(error[order[found]]), error, count):
            return order[:found]
    return order[:0]


def stands_apart(last: float, other: float, error: Array, count: int) -> bool:
    """Return whether an error is far behind the largest other, by the middle of all others too."""
    scale = max(float(np.median(error)) / np.sqrt(chi2.median(3)), 1.0)
    by_chance = float(chi2.sf((last / scale) ** 2, 3))
    return bool(last > APART * other and by_chance < CHANCE / count)


def far_rows(rows: Measurements, gap: Array, sigma: Array, used: NDArray[np.bool_]) -> Iterator[str]:
    """Yield, in words, which rows are far off all others, if any are.

    `gap` (N, 3): measured less predicted, m. `sigma`, `used` (N, 3): noise as stated, 0 or NaN for none, and
    what was measured.
    """
    some = np.flatnonzero(used.any(axis=1))
    off = np.linalg.norm(np.where(used, gap, 0.0), axis=1)[some]
    noise = np.nan_to_num(sigma[used])
    scale = np.sqrt(np.square(noise).mean()) if noise.any() else np.median(off) / np.sqrt(chi2.median(3))
    far = farthest(off / scale, most_far(len(some)), len(some)) if scale > 0.0 else some[:0]
    if not far.size:
        return
    others = 1e3 * float(np.delete(off, far).max())
    places = listed([f"{rows.place(int(some[at]))} ({1e3 * off[at]:.2g} mm)" for at in far.tolist()])
    are, them = ("are", "them") if len(far) > 1 else ("is", "it")
    yield (
        f"{places} {are} off far more than all other rows, of which none is by more than {others:.2g} mm: a "
        f"wrong reading or a slip; check {them}, or leave {them} out"
    )
