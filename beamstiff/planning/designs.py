"""Which tests to make: D-, A- and E-optimal choices among candidates, certified by how good they could be.

A choice of n tests has the information M, the sum of theirs; its criterion is better the larger:

* D: ``det(M)^(1/m)``, the volume of the confidence ellipsoid;
* A: ``1 / tr(M^-1)``, the mean variance of the parameters;
* E: the least eigenvalue of M, the worst direction.

The tests are taken one by one where they help most, then exchanged while that improves (Fedorov, Theory of
Optimal Experiments, 1972; one after the other as in Cook and Nachtsheim, Technometrics 22 (1980) 315). No
choice of n can beat the bound that the equivalence theorem gives (Kiefer and Wolfowitz 1960; Pukelsheim,
Optimal Design of Experiments, ch. 5 to 7): for every M, with G the gradient of the criterion such that
tr(G M) = 1,

    criterion(any choice) <= criterion(M) * (sum of the n largest tr(G M_i), each as often as allowed)

It is taken at the best weighted design that Frank and Wolfe's method finds, where it is nearly sharp.

Designs of growing size say how many tests are enough, by the worst standard error (seed 000, Figure 7).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.planning.observability import Observability, observability
from beamstiff.se3 import Array

Criterion = Literal["D", "A", "E"]
CRITERIA: tuple[Criterion, ...] = ("D", "A", "E")

PASSES = 50  # of exchanges, at most
STEPS = 400  # of Frank and Wolfe's method
SMOOTH = 32.0  # E is the limit of ``tr(M^-p)^(-1/p)``; the power with which its gradient is taken
AT_ONCE = 4_000_000  # entries of the matrices compared at a time
# criteria by which tests are taken at first; while a direction is not seen at all, E tells nothing
GREEDY: tuple[Criterion, ...] = ("A", "D")
RIDGE = 1e-9  # of the mean information, so that the first tests have a criterion at all

ONLY_AVERAGING = (
    1.05  # times the best standard error per test: from there on more tests only average the noise
)


@dataclass(frozen=True, eq=False)
class Design:
    """Tests chosen among candidates."""

    criterion: Criterion
    chosen: NDArray[np.int64]  # (n,) int: candidates; one may stand there several times
    value: float
    bound: float  # what the criterion of no choice of n tests can exceed
    names: tuple[str, ...]
    covariance: Array  # (m, m): of the logarithms of the parameters
    sensitivity: Array  # (N,): ``tr(G M_i)`` of every candidate: above 1/n, more of it would help
    indices: Observability

    @property
    def efficiency(self) -> float:
        """At least this share of what any choice of n tests could have: the certificate."""
        return min(1.0, self.value / self.bound)

    @property
    def standard_errors(self) -> dict[str, float]:
        """The relative standard error expected of each parameter."""
        return dict(zip(self.names, np.sqrt(np.diagonal(self.covariance)).tolist(), strict=True))

    @property
    def worst(self) -> float:
        """The largest of them."""
        return max(self.standard_errors.values())


def criterion_of(information: Array, criterion: Criterion) -> Array:
    """Return the criterion of information matrices (..., m, m), in their unit; 0 where singular; (...)."""
    if criterion == "D":
        sign, logarithm = np.linalg.slogdet(information)
        result = np.where(sign > 0, np.exp(logarithm / information.shape[-1]), 0.0)
    else:
        values = np.maximum(np.linalg.eigvalsh(information), 0.0)
        with np.errstate(divide="ignore"):
            result = values[..., 0] if criterion == "E" else 1 / (1 / values).sum(axis=-1)
    return np.asarray(result, dtype=np.float64)


def choose_tests(
    information: Array,
    count: int,
    names: Sequence[str],
    criterion: Criterion = "D",
    repeats: int = 1,
    start: Sequence[int] = (),
) -> Design:
    """Return the best choice of tests that greedy choice and exchange find, and how good it is at least.

    Parameters
    ----------
    information : (N, m, m) array
        Of each candidate, as from `candidates.information`.
    count : int
        Number of tests n to choose.
    names : sequence of str (m)
    criterion : "D", "A" or "E"
    repeats : int
        How often a candidate may be taken.
    start : sequence of int
        Tests to begin with; they may be exchanged.

    Raises
    ------
    BeamstiffError
        When there are too few candidates, or n tests cannot determine all parameters.

    Examples
    --------
    >>> line = [np.outer(row, row) for row in ([1.0, 0.0], [0.9, 0.1], [0.0, 1.0])]
    >>> design = choose_tests(np.array(line), 2, ["a", "b"])
    >>> sorted(design.chosen.tolist()), round(design.efficiency, 6)
    ([0, 2], 1.0)
    """
    _check(information, count, names, criterion, repeats)
    # one unit for all candidates: the criterion's scale does not matter to the choice
    scale = float(np.trace(information.mean(axis=0))) / len(names)
    scaled = information / scale
    ridge = RIDGE * np.diag(np.diagonal(scaled.mean(axis=0)))
    # two ways to begin: an exchange ends in a local optimum
    found = [
        _exchange(_greedy(start, count, scaled, ridge, by, repeats), scaled, ridge, criterion, repeats)
        for by in GREEDY
    ]
    values = criterion_of(np.array([scaled[choice].sum(axis=0) for choice in found]), criterion)
    chosen = found[int(np.argmax(values > (1 - 1e-9) * values.max()))]  # the first of equals
    total = scaled[chosen].sum(axis=0)
    if criterion_of(total, criterion) <= 1e-12 * criterion_of(scaled.sum(axis=0), criterion):
        raise BeamstiffError(
            f"{count} of these tests cannot determine the {len(names)} parameters {listed(names)}: take more"
        )
    bound = upper_bound(scaled, count, criterion, repeats, total)
    return design_of(chosen, information, names, criterion, bound * scale)


def design_of(
    chosen: Sequence[int], information: Array, names: Sequence[str], criterion: Criterion, bound: float
) -> Design:
    """Return a design of tests; no choice of as many exceeds `bound` by the criterion."""
    scale = float(np.trace(information.mean(axis=0))) / len(names)
    scaled = information / scale
    total = scaled[list(chosen)].sum(axis=0)
    value = float(criterion_of(total, criterion)) * scale
    return Design(
        criterion=criterion,
        chosen=np.array(chosen, dtype=np.int64),
        value=value,
        bound=bound,
        names=tuple(names),
        covariance=np.linalg.inv(total) / scale,
        sensitivity=_sensitivity(total, scaled, criterion),
        indices=observability(np.linalg.cholesky(total).T * np.sqrt(scale), len(chosen)),
    )


def _check(information: Array, count: int, names: Sequence[str], criterion: str, repeats: int) -> None:
    if information.ndim != 3 or information.shape[1:] != (len(names), len(names)):
        raise BeamstiffError(
            f"information: found shape {information.shape}, expected matrices of the {len(names)} parameters"
        )
    if not np.isfinite(information).all():
        raise BeamstiffError("information: found entries that are no numbers")
    if criterion not in CRITERIA:
        raise BeamstiffError(f"criterion: found {criterion!r}, expected D, A or E")
    if repeats < 1 or count < 1:
        raise BeamstiffError(f"found {count} tests with {repeats} repeats, expected at least one of each")
    if count > len(information) * repeats:
        raise BeamstiffError(
            f"{len(information)} candidates for {count} tests, each at most {repeats} times: make more "
            "candidates, or allow repeats"
        )


def _best_addition(
    total: Array, information: Array, allowed: NDArray[np.bool_], criterion: Criterion
) -> tuple[int, float]:
    """Return the allowed candidate with which the criterion is largest, and the criterion."""
    candidates = np.flatnonzero(allowed)
    at_once = max(1, AT_ONCE // total.size)
    parts = (candidates[start : start + at_once] for start in range(0, candidates.size, at_once))
    values = np.concatenate([criterion_of(total + information[part], criterion) for part in parts])
    best = int(np.argmax(values))
    return int(candidates[best]), float(values[best])


def _greedy(
    start: Sequence[int], count: int, information: Array, ridge: Array, criterion: Criterion, repeats: int
) -> list[int]:
    """Return tests taken one by one, each where it helps most."""
    chosen = list(map(int, start))
    taken = np.bincount(np.array(chosen, dtype=np.int64), minlength=len(information))
    total = information[chosen].sum(axis=0) + ridge
    while len(chosen) < count:
        best, _ = _best_addition(total, information, taken < repeats, criterion)
        chosen.append(best)
        taken[best] += 1
        total = total + information[best]
    return chosen


def _exchange(
    chosen: list[int], information: Array, ridge: Array, criterion: Criterion, repeats: int
) -> list[int]:
    """Return the choice after exchanging its tests one after the other while that improves it."""
    chosen = list(chosen)
    taken = np.bincount(np.array(chosen, dtype=np.int64), minlength=len(information))
    value = float(criterion_of(information[chosen].sum(axis=0) + ridge, criterion))
    for _ in range(PASSES):
        improved = False
        for place, old in enumerate(chosen):
            taken[old] -= 1
            rest = information[[*chosen[:place], *chosen[place + 1 :]]].sum(axis=0) + ridge
            new, better = _best_addition(rest, information, taken < repeats, criterion)
            if better > value * (1 + 1e-9):
                chosen[place], value, improved = new, better, True
            taken[chosen[place]] += 1
        if not improved:
            break
    return chosen


def _sensitivity(total: Array, information: Array, criterion: Criterion) -> Array:
    """Return ``tr(G M_i)`` of every candidate, with G such that ``tr(G M) = 1`` (Pukelsheim, ch. 7)."""
    values, vectors = np.linalg.eigh(total)
    # relative to the least eigenvalue: powers of it neither over- nor underflow
    ratio = values[0] / values
    power = {"D": ratio, "A": ratio**2, "E": ratio ** (SMOOTH + 1)}[criterion]
    gradient = (vectors * power) @ vectors.T
    gradient = gradient / np.sum(gradient * total)
    return np.asarray(np.einsum("nab,ab->n", information, gradient))


def upper_bound(information: Array, count: int, criterion: Criterion, repeats: int, start: Array) -> float:
    """Return what no choice of tests exceeds, from weighted designs between `start` (m, m) and the best."""
    full, left = divmod(count, repeats)
    most = np.full(full + (left > 0), float(repeats))
    if left:
        most[-1] = left
    bound, total = np.inf, start
    for step in range(STEPS):
        sensitivity = _sensitivity(total, information, criterion)
        if most.size < sensitivity.size:
            largest = np.argpartition(-sensitivity, most.size - 1)[: most.size]
        else:
            largest = np.arange(sensitivity.size)
        largest = largest[np.argsort(-sensitivity[largest])]
        gain = float(sensitivity[largest] @ most)
        bound = min(bound, _polar(total, criterion) * gain)
        if gain < 1 + 1e-6:
            break
        vertex = np.einsum("n,nab->ab", most, information[largest])
        total = _between(total, vertex, criterion, step)
    return bound


def _polar(total: Array, criterion: Criterion) -> float:
    """Return the criterion that the bound multiplies; for E that of the weights which its gradient has."""
    if criterion != "E":
        return float(criterion_of(total, criterion))
    # tr(Z X) >= least eigenvalue of X for every Z >= 0 of trace 1; here Z is proportional to M^-(p+1)
    values = np.linalg.eigvalsh(total)
    ratio = values[0] / values
    return float(values[0] * np.sum(ratio**SMOOTH) / np.sum(ratio ** (SMOOTH + 1)))


def _between(total: Array, vertex: Array, criterion: Criterion, step: int) -> Array:
    """Return the best of the designs between two."""
    shares = np.append(np.geomspace(1e-4, 1.0, 25), 2 / (step + 3))
    mixed = total + shares[:, None, None] * (vertex - total)
    values = np.linalg.eigvalsh(mixed)
    with np.errstate(divide="ignore"):
        if criterion == "E":  # smooth, or the steps would end where two eigenvalues meet
            least = np.maximum(values[:, :1], np.finfo(float).tiny)
            merit = least[:, 0] * np.sum((least / np.maximum(values, least)) ** SMOOTH, axis=1) ** (
                -1 / SMOOTH
            )
        else:
            merit = criterion_of(mixed, criterion)
    return np.asarray(mixed[int(np.argmax(merit))])


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
    """Return the best designs of growing sizes `counts`, each started from the one before."""
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
    """Return what designs of `count` different tests, drawn evenly from all candidates, would tell."""
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
