"""What a design is worth against tests taken at random from the same candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.planning.designs import Criterion, criterion_of
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class AtRandom:
    """Designs drawn at random."""

    values: Array  # (d,): the criterion of each; 0 where the tests do not determine all parameters
    worst: Array  # (d,): the largest relative standard error of a parameter; infinite there


def random_designs(
    information: Array, count: int, criterion: Criterion, draws: int = 200, seed: int = 0
) -> AtRandom:
    """Return what designs of `count` different tests, drawn evenly from the candidates, would tell.

    Parameters
    ----------
    information : (N, m, m) array
        Of each candidate.
    count : int
        Number of tests of a design, N at most.
    criterion : "D", "A" or "E"
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
