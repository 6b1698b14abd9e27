"""Intervals by the profile likelihood, within the bounds that compliances have: none is below zero.

Around the optimum the likelihood of the compliances x (over those found) is normal, cut off at the bounds. A
value phi belongs to its interval as long as the best fit with it is hardly worse than the best of all::

    min { Q(x) : x within bounds, a x = phi } - min { Q(x) : x within bounds } <= quantile^2

Away from the bounds this is ``phi +- quantile s``. Where a spring next to it is as good as rigid, whose
compliance the fit stops at zero, ``+- quantile s`` would hold the truth too often: in up to 97.5 % of the
cases instead of 95 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import brentq, lsq_linear

from beamstiff.se3 import Array

RIDGE = 1e-12  # where the data say nothing, beside unit sensitivities
FIRM = 1e4  # how much more than a residual the distance from phi counts
STILL = 1e-3  # gradient, in standard deviations, that counts as none


@dataclass(frozen=True)
class Profile:
    """Twice the negative logarithm of the likelihood around an optimum, in compliances over those there."""

    information: Array  # (t, t): second derivatives of half of it
    # (t,): first derivatives of half of it, where x = 1: not zero for compliances that a bound holds
    gradient: Array
    # low, high, (t,): bounds of x
    low: Array
    high: Array
    quantile: float  # standard deviations that an interval reaches

    def interval(self, direction: Array, std: float) -> tuple[float, float]:
        """Return how far ``a x`` reaches below and above its value at the optimum.

        `direction` (t,): a. `std`: standard deviation of ``a x`` without bounds. Infinite where only a bound
        ends it.
        """
        reach = self.quantile * std
        if self._inside or not np.isfinite(std):
            return -reach, reach
        a = direction / self._size
        felt, at = a != 0, float(a @ self._size)
        ends = a[felt] * np.stack([self._low[felt], self._high[felt]])
        least, most = ends.min(axis=0).sum() - at, ends.max(axis=0).sum() - at
        return self._end(a, -reach, float(least), -np.inf), self._end(a, reach, float(most), np.inf)

    def _end(self, a: Array, reach: float, wall: float, beyond: float) -> float:
        """Return where the profile crosses the quantile, between 0 and `reach`, which it cannot pass."""
        far = reach if abs(reach) < abs(wall) else wall
        # data without noise: the optimum is off its place by more than the standard deviation, by rounding
        if far == 0.0 or self._excess(a, far) <= 0.0 or self._excess(a, 0.0) >= 0.0:
            return beyond if far == wall else far
        return float(brentq(lambda shift: self._excess(a, shift), 0.0, far, xtol=1e-6 * abs(reach)))

    def _excess(self, a: Array, shift: float) -> float:
        """Return by how much the best fit with a shift of ``a x`` exceeds what the interval allows."""
        firm = FIRM / float(np.linalg.norm(a))
        matrix = np.concatenate([self._root, firm * a[None]])
        target = np.append(self._root @ self._free, firm * (a @ self._size + shift))
        found = lsq_linear(matrix, target, bounds=(self._low, self._high), method="bvls", tol=1e-12)
        return self._distance(found.x) - self._least - self.quantile**2

    def _distance(self, y: Array) -> float:
        return float(((self._root @ (y - self._free)) ** 2).sum())

    @cached_property
    def _size(self) -> Array:
        """Sensitivity to each compliance; y = size x are the unknowns here."""
        size = np.sqrt(np.maximum(np.diagonal(self.information), 0.0))
        return np.where(size > 0, size, 1.0)

    @property
    def _low(self) -> Array:
        return self.low * self._size

    @property
    def _high(self) -> Array:
        return self.high * self._size

    @cached_property
    def _root(self) -> Array:
        unit = self.information / np.outer(self._size, self._size)
        return cholesky(unit + RIDGE * np.eye(len(unit)), lower=False)

    @cached_property
    def _free(self) -> Array:
        """The optimum if there were no bounds, y."""
        half = solve_triangular(self._root, self.gradient / self._size, trans="T")
        return self._size - solve_triangular(self._root, half)

    @cached_property
    def _least(self) -> float:
        found = lsq_linear(
            self._root, self._root @ self._free, bounds=(self._low, self._high), method="bvls", tol=1e-12
        )
        return min(self._distance(found.x), self._distance(self._size))

    @cached_property
    def _inside(self) -> bool:
        """Whether no bound is within reach of any compliance."""
        half = solve_triangular(self._root, np.eye(len(self._size)), trans="T")
        reach = self.quantile * np.linalg.norm(half, axis=0) / self._size
        still = np.abs(self.gradient / self._size) < STILL
        return bool((still & (reach < 1 - self.low) & (reach < self.high - 1)).all())
