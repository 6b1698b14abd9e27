"""How many tests are enough: the worst standard error against their number (compare seed 000, Figure 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.planning.designs import Criterion, Design, choose_tests
from beamstiff.se3 import Array

ONLY_AVERAGING = (
    1.05  # times the best standard error per test: from there on more tests only average the noise
)


@dataclass(frozen=True, eq=False)
class Enough:
    """Optimal designs of growing size."""

    designs: tuple[Design, ...]
    counts: NDArray[np.int64]  # (c,) int: their numbers of tests
    standard_errors: Array  # (c, m): relative, of each parameter
    worst: Array  # (c,): the largest of them
    # the number of tests from which on more of them only average the noise: ``worst * sqrt(n)`` is within 5 %
    # of the least it gets to. Below, every test also shows directions that were hardly seen before
    knee: int

    def tests_for(self, standard_error: float) -> int:
        """Return how many tests bring the worst relative standard error down to a value.

        Past the largest number looked at, the error is taken to fall with the root of the number of tests.
        """
        if not (np.isfinite(standard_error) and standard_error > 0):
            raise BeamstiffError(f"standard error: found {standard_error}, expected a positive number")
        good = np.flatnonzero(self.worst <= standard_error)
        if good.size:
            return int(self.counts[good[0]])
        ratio = float(self.worst[-1] / standard_error) ** 2
        return int(np.ceil(self.counts[-1] * ratio * (1 - 1e-12)))


def how_many(
    information: Array,
    names: Sequence[str],
    counts: Sequence[int],
    criterion: Criterion = "A",
    repeats: int = 1,
) -> Enough:
    """Return the best designs of several sizes, each started from the one before.

    Parameters
    ----------
    information : (N, m, m) array
        Of each candidate.
    counts : sequence of int
        Numbers of tests, growing.
    criterion : "D", "A" or "E"
    repeats : int
        How often a candidate may be taken.
    """
    numbers = np.asarray(counts, dtype=np.int64)
    if numbers.ndim != 1 or not numbers.size or (np.diff(numbers) <= 0).any():
        raise BeamstiffError(f"numbers of tests: found {list(counts)!s:.60}, expected growing numbers")
    designs: list[Design] = []
    for count in numbers.tolist():
        start = designs[-1].chosen.tolist() if designs else []
        designs.append(choose_tests(information, count, names, criterion, repeats, start))
    errors = np.sqrt(np.array([np.diagonal(design.covariance) for design in designs]))
    worst = errors.max(axis=1)
    per_test = worst * np.sqrt(numbers)
    knee = int(numbers[np.argmax(per_test <= ONLY_AVERAGING * per_test.min())])
    return Enough(tuple(designs), numbers, errors, worst, knee)
