"""How many tests are enough, by the worst standard error (seed 000, Figure 7), and against random choices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.planning.designs import Criterion, Design, choose_tests, criterion_of
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

    `information` (N, m, m): of each candidate. `counts`: numbers of tests, growing. `repeats`: how often a
    candidate may be taken.
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


@dataclass(frozen=True, eq=False)
class AtRandom:
    """Designs drawn at random."""

    values: Array  # (d,): the criterion of each; 0 where the tests do not determine all parameters
    worst: Array  # (d,): the largest relative standard error of a parameter; infinite there


def random_designs(
    information: Array, count: int, criterion: Criterion, draws: int = 200, seed: int = 0
) -> AtRandom:
    """Return what designs of `count` different tests, drawn evenly from the candidates, would tell.

    `information` (N, m, m): of each candidate. `count`: number of tests of a design, N at most.
    """
    if not 1 <= count <= len(information):
        raise BeamstiffError(
            f"{len(information)} candidates for {count} tests at random: make more candidates"
        )
    random = np.random.default_rng(seed)
    chosen = np.argsort(random.random((draws, len(information))), axis=1)[:, :count]
    totals = np.stack([information[rows].sum(axis=0) for rows in chosen])
    scale = np.sqrt(np.maximum(np.diagonal(totals, axis1=-2, axis2=-1), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(totals / (scale[:, :, None] * scale[:, None, :]))
    determined = values[:, 0] > 1e-12 * values[:, -1]
    least = np.where(determined[:, None], values, 1.0)
    variances = np.einsum("dij,dj->di", vectors**2, 1 / least) / scale**2
    return AtRandom(
        np.where(determined, criterion_of(totals, criterion), 0.0),
        np.where(determined, np.sqrt(variances.max(axis=1)), np.inf),
    )
