"""Whether a cause is there, or whether a little of everything explains the rows as well.

What no library holds is taken up by the causes that come nearest to it, each for a part. So each cause is held
against a model discrepancy (Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425) that is a mixture of all
forms of all causes, each cause with the same variance: ``y ~ N(X b, s^2 (1 + u^2 K))``, ``K`` the mean over
the causes of ``x x^T``, x the unit columns of their forms beside the open geometry. With and without the
cause, u is the one that explains the rows best. One true cause needs no mixture; a stand-in is replaced by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from beamstiff.diagnosis.decomposition.selection import Choice, Step, bic
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

SIZES = (0.0, 0.05, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 50.0)  # u: none to far above the noise
MOST_VALUES = 800  # that the mixture is weighed by: its cost grows with their third power
SHOWS = 1e-6  # of 1: what the open geometry leaves of a column, below which it is rounding


def discrepancy_odds(choice: Choice, step: Step, causes: Sequence[tuple[int, ...]]) -> list[float]:
    """Return the log odds of each cause of a fit against a mixture of everything in its place.

    Parameters
    ----------
    choice : Choice
    step : Step
        A fit with all causes.
    causes : sequence of tuple of int
        Their forms.
    """
    rows = np.arange(0, choice.count, -(-choice.count // MOST_VALUES))
    rows = np.concatenate([rows, np.arange(choice.count, len(choice.residual))])
    variance, axes = np.linalg.eigh(_mixture(choice, rows))
    residual, count = axes.T @ choice.residual[rows], max(len(rows) - choice.open_count, 1)
    at = {
        number: np.arange(choice.at[number].start, choice.at[number].stop)[free]
        for number, free in zip(step.chosen, step.free, strict=True)
    }
    drives = np.arange(choice.drives)[step.drives]

    def weighed(numbers: Sequence[int]) -> float:
        some = np.concatenate([drives, *(at[number] for number in numbers)])
        return _best(
            np.maximum(variance, 0.0), residual, axes.T @ choice.columns[np.ix_(rows, some)],
            choice.precision[some], count,
        )  # fmt: skip

    whole = weighed(step.chosen)
    return [0.5 * (weighed([k for k in step.chosen if k not in cause]) - whole) for cause in causes]


def _mixture(choice: Choice, rows: Integers) -> Array:
    """Return K (m, m) of some rows, of trace m: each cause counts the same, whatever its forms."""
    columns = choice.columns[rows]
    size = np.linalg.norm(columns, axis=0)
    keys = np.repeat([form.key for form in choice.forms], [part.stop - part.start for part in choice.at])
    _, cause, count = np.unique(keys, return_inverse=True, return_counts=True)
    weight = np.concatenate([np.zeros(choice.drives), 1.0 / count[cause]])
    unit = columns * (np.where(size > SHOWS, np.sqrt(weight), 0.0) / np.maximum(size, SHOWS))
    mixture: Array = unit @ unit.T
    return mixture * (len(rows) / max(float(np.trace(mixture)), SHOWS))


def _best(variance: Array, residual: Array, columns: Array, precision: Array, count: int) -> float:
    """Return the least BIC over u, in the axes of K with its eigenvalues (m,)."""
    result = []
    for size in SIZES:
        spread = 1.0 + size**2 * variance
        weighed = columns.T / spread
        gram = weighed @ columns
        normal = gram + np.diag(precision)
        pull = weighed @ residual
        found = np.linalg.solve(normal, np.column_stack([pull, gram]))
        squares = float(residual @ (residual / spread) - pull @ found[:, 0])
        determined = float(np.trace(found[:, 1:]))
        result.append(float(bic(squares, determined, count, 0.0)) + float(np.log(spread).sum()))
    return min(result)
