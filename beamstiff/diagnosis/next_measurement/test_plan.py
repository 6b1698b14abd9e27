"""What to measure next: the states where rival explanations predict what the noise cannot hide.

Explanations i and j, fitted to the rows, foretell new ones as normal, with means m and covariances V of their
open parameters and the noise. Whoever decides between them after reading errs with a probability of at most
``sqrt(p_i p_j) exp(-B_ij)`` (Bhattacharyya; Kailath, IEEE Trans. Commun. 15 (1967) 52), where::

    B_ij = (m_i - m_j)^T V^-1 (m_i - m_j) / 8 + log(|V|^2 / (|V_i| |V_j|)) / 4,    V = (V_i + V_j) / 2

No real effect has quite the shape of the library: V counts it as off by a share of its own size, as the
evidence does. So rows tell most where causes differ in kind, not where each moves the tool far.

Rows are chosen one after another, so that the sum over pairs falls most. That holds what those before tell
(Kalman's update), and counts a row where a cause would show, if there, before any has shown. The
discrimination of a row is by how much it lowers the logarithm of the sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from beamstiff.diagnosis.held_out.score import Fitted, Weighted, fitted, shift, stacked
from beamstiff.diagnosis.inference.evidence import AMISS
from beamstiff.diagnosis.next_measurement.candidates import (
    empty_rows,
    load_cycles,
    noise_of,
    reflector_nodes,
    short_way,
)
from beamstiff.diagnosis.predictions import columns_at
from beamstiff.diagnosis.residual.baseline import Baseline, at_rows
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.se3 import Array

PROGRAMME = 6  # load cycles that are proposed, each in another posture
READINGS = 12  # postures, where a cycle is one reading
SETTLED = 0.9  # probability among its rivals from which a cause needs no second reflector
WORTH = 2.0  # times what the TCP tells: less is not worth a second reflector
DECIDES = 2.0  # of discrimination, all states together: less hardly moves the odds
ALIKE = 1.2  # times what load cycles tell: single loads that tell less than this do not replace them
REMEMBER = ("backlash", "hysteresis")  # whose answer depends on the loads before
FARTHEST = 1.0  # m: standard deviation of what a parameter may move the tool by
ROUNDING = 1e-12  # of 1: what is left of a variance that the readings determine


@dataclass(frozen=True, eq=False)
class Foretold:
    """What one explanation foretells of new rows.

    `mean`: (R, 3) array, m.
    `matrix`: (R, 3, p) array; positions by parameters.
    `covariance`: (p, p) array; of the parameters.
    `amiss`: (R,) array, m; what it may be off by, standard deviation of a coordinate, beside the parameters.
    `key`: of the explanation, ``effect:component``.
    """

    mean: Array
    matrix: Array
    covariance: Array
    amiss: Array | float = 0.0
    key: str = ""


Pair = tuple[float, Foretold, Foretold]  # two explanations to tell apart, with what that counts


@dataclass(frozen=True)
class Programme:
    """States to measure, and which rivals they separate.

    `rows`: poses, loads and where to read; nothing measured.
    `score`: (R,) array; expected discrimination of each row.
    `alike`: which of them the likeliest is not told from even so.
    """

    rows: Measurements
    separates: tuple[str, ...]
    score: Array
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rival:
    """An explanation: its probability, and the freest of its likely shapes, fitted; without one the model."""

    key: str
    probability: float
    fit: Fitted


def propose_tests(
    baseline: Baseline,
    used: NDArray[np.bool_],
    rivals: Sequence[tuple[str, float, Sequence[Weighted]]],
    scale: float,
    seed: int,
    hidden: Sequence[tuple[str, float, Sequence[Weighted]]] = (),
) -> Programme | None:
    """Return the load cycles that tell rivals apart best; None where there is nothing to tell apart.

    Each is of another posture. Where a reflector elsewhere on the robot would tell far more than the TCP does
    in these states, it is read as well.

    `rivals`: without shapes the rival is the model as it is.
    `scale`: of the noise.
    `hidden`: causes to tell from no cause alone, the last of the rivals: whether there is any shows first.
    """
    if len(rivals) < 2:
        return None
    # what does not show may be as large as it usually is, where the rows do not tell
    least = 1.0 if hidden else 0.0
    fits, faint = ([_rival(baseline, used, *one, scale, least) for one in some] for some in (rivals, hidden))
    noise = scale * np.median(baseline.sigma[:, :3], axis=0)
    found = []
    for single in ways_to_load(baseline.rows.batch, [key for key, _, _ in rivals]):
        rows, cycle, posture = load_cycles(baseline, seed, single)
        pairs, separates = foretold_pairs(baseline, rows, fits, faint)
        if pairs:
            most = most_cycles(baseline.rows.batch, cycle)
            picked, score, told = best_rows(pairs, noise_of(rows, noise), cycle, most, posture)
            same = undecided(pairs, separates, told)
            found.append(Programme(subset(rows, picked), separates, score, same))
    if not found:
        return None
    best = max(found, key=lambda one: one.score.sum())
    if best.score.sum() < ALIKE * found[-1].score.sum():  # a memory shows in cycles whatever its shape is
        best = found[-1]
    return _with_a_second_reflector(best, baseline, fits, noise)


def ways_to_load(batch: int | None, causes: Sequence[str]) -> tuple[bool, ...]:
    """Return whether postures are loaded once (True), in a cycle (False), or the better of the two.

    Of so many rows as a batch has, single loads tell more, since there are more postures; but the answer of
    some causes depends on the loads before.
    """
    if batch is None:
        return (False,)
    return (True, False) if any(key.partition(":")[0] in REMEMBER for key in causes) else (True,)


def most_cycles(batch: int | None, cycle: NDArray[np.intp]) -> int:
    """Return how many load cycles are proposed: more where each is one reading."""
    count = len(cycle) // (int(cycle.max()) + 1)
    if batch is not None:
        return max(batch // count, 1)
    return READINGS if count == 1 else PROGRAMME


def best_rows(
    pairs: Sequence[Pair], noise: Array, group: NDArray[np.intp], most: int, posture: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the rows that tell pairs apart best, (k,), what each adds, (k,), and B of every pair.

    `pairs`: with the product of their probabilities.
    `noise`: (R, 3) array, m; standard deviation of a reading.
    `group`: (R,) array of int; rows that are read together, equally many in each, from 0.
    `most`: groups to choose, each of another posture where there are enough.
    `posture`: (R,) array of int.
    """
    of = np.argsort(group, kind="stable").reshape(int(group.max()) + 1, -1)  # (G, g)
    told = [_Told(weight, one, other, of, noise) for weight, one, other in pairs]
    chosen: list[int] = []
    score: list[Array] = []
    free = np.ones(len(of), dtype=np.bool_)
    while len(chosen) < min(most, len(of)):
        before = logsumexp([one.bound for one in told])
        adds = [one.adds() for one in told]
        after = logsumexp(
            [one.bound - each.cumsum(axis=1) for one, each in zip(told, adds, strict=True)], axis=0
        )  # (G, g)
        best = int(np.argmin(np.where(free, after[:, -1], np.inf)))
        chosen.append(best)
        score.append(-np.diff(after[best], prepend=before))
        for one, each in zip(told, adds, strict=True):
            one.take(best, float(each[best].sum()))
        free &= posture[of[:, 0]] != posture[of[best, 0]]
        if not free.any():
            free[:] = True
            free[chosen] = False
    apart = np.array([one.first - one.bound for one in told])
    return of[chosen].ravel(), np.concatenate(score), apart


def undecided(pairs: Sequence[Pair], keys: Sequence[str], told: Array) -> tuple[str, ...]:
    """Return the explanations that the first of `keys` is not told from: `told` (pairs,), B of each pair."""
    first, near = keys[0] if keys else "", dict[str, None]()
    for (_, one, other), apart in zip(pairs, told.tolist(), strict=True):
        if first in (one.key, other.key) and apart < DECIDES:
            near[other.key if one.key == first else one.key] = None
    return tuple(key for key in near if key in keys)


class _Open:
    """Parameters that are open, and what groups of rows read of them, (G, 3 g, p).

    They are independent, and of variance 1 before any group is taken.
    """

    def __init__(self, matrix: Array) -> None:
        # none moves the tool beyond `FARTHEST`: of one that is all but unknown the variances would cancel to
        # less than their rounding
        matrix = matrix / np.maximum(np.abs(matrix).max(axis=(0, 1), initial=0.0) / FARTHEST, 1.0)
        rows, count = matrix.shape[0] * matrix.shape[1], matrix.shape[2]
        if rows < count:  # as many mixtures of the parameters as there are readings say all of them
            triangle = np.asarray(np.linalg.qr(matrix.reshape(rows, count).T, mode="r"))
            matrix = triangle.T.reshape(*matrix.shape[:2], rows)
        self.matrix = matrix
        self.covariance = np.eye(matrix.shape[2])

    def root(self, read: Array) -> Array:
        """Return Cholesky's factor of the covariance of each group, (G, 3 g, 3 g)."""
        spread = self.matrix @ self.covariance @ self.matrix.swapaxes(1, 2)
        largest = np.diagonal(spread, axis1=1, axis2=2).max(axis=1)
        return np.asarray(
            np.linalg.cholesky(spread + read + ROUNDING * largest[:, None, None] * np.eye(read.shape[-1]))
        )

    def take(self, group: int, read: Array) -> Array:
        """Go on from what a group tells; return the gain (p, 3 g).

        In Joseph's form, which stays positive where little is left of much (Bucy and Joseph 1968, ch. 16).
        """
        seen = self.matrix[group] @ self.covariance
        gain: Array = np.linalg.solve(seen @ self.matrix[group].T + read[group], seen).T
        left = np.eye(len(self.covariance)) - gain @ self.matrix[group]
        self.covariance = left @ self.covariance @ left.T + gain @ read[group] @ gain.T
        return gain


class _Told:
    """Two explanations: the bound of the error between them, beside the groups of rows that are taken."""

    def __init__(
        self, weight: float, one: Foretold, other: Foretold, of: NDArray[np.intp], noise: Array
    ) -> None:
        self.first = self.bound = 0.5 * float(np.log(max(weight, 1e-300)))  # log
        self.apart = (one.mean - other.mean)[of].reshape(len(of), -1)
        square = noise**2 + 0.5 * (np.square(one.amiss) + np.square(other.amiss))[..., None]
        self.read = np.eye(self.apart.shape[1]) * square[of].reshape(len(of), 1, -1)
        a, b = (
            _independent(each.matrix[of].reshape(*self.apart.shape, -1), each.covariance)
            for each in (one, other)
        )
        self.single = [_Open(a), _Open(b)]
        self.both = _Open(np.sqrt(0.5) * np.concatenate([a, -b], axis=2))
        self.known = np.zeros(len(self.both.covariance))  # of the parameters, by the groups taken

    def adds(self) -> Array:
        """Return what each row of each group adds to B, (G, g)."""
        root = self.both.root(self.read)
        off = np.linalg.solve(root, (self.apart - self.both.matrix @ self.known)[..., None])[..., 0]
        sizes = [
            np.log(np.diagonal(each, axis1=1, axis2=2))
            for each in (root, *(o.root(self.read) for o in self.single))
        ]
        every = off**2 / 8.0 + sizes[0] - 0.5 * (sizes[1] + sizes[2])
        return np.asarray(every.reshape(len(off), -1, 3).sum(axis=2))

    def take(self, group: int, added: float) -> None:
        """Go on from what a group tells, that adds so much to B."""
        self.bound -= added
        off = self.apart[group] - self.both.matrix[group] @ self.known
        self.known = self.known + self.both.take(group, self.read) @ off
        for one in self.single:
            one.take(group, self.read)


def _independent(matrix: Array, covariance: Array) -> Array:
    """Return a matrix (G, 3 g, p) for parameters in which these are independent and of variance 1."""
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray(matrix @ (size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))))


def foretold_pairs(
    baseline: Baseline, rows: Measurements, rivals: Sequence[Rival], hidden: Sequence[Rival] = ()
) -> tuple[list[Pair], tuple[str, ...]]:
    """Return the pairs of rivals as they foretell rows, and which of them can be foretold.

    The last of them is paired with each of those that are hidden, too.
    """
    there = at_rows(baseline, rows)
    told: list[tuple[Rival, Foretold]] = []
    for rival in (*rivals, *hidden):
        try:
            columns = [columns_at(there, one.hypothesis) for one in rival.fit.shapes]
        except BeamstiffError:  # what it would be there is not known
            continue
        mean = shift(there, [rival.fit], [columns])[:, :3]
        matrix = stacked(there, rival.fit, columns)[:, :3]
        amiss = AMISS * np.sqrt((mean**2).mean(axis=1))
        told.append((rival, Foretold(mean, matrix, rival.fit.covariance, amiss, rival.key)))
    shown = {rival.key for rival in rivals}
    pairs = [
        (a.probability * b.probability, x, y)
        for (a, x), (b, y) in combinations(told, 2)
        if b.key in shown or a is rivals[-1]
    ]
    return pairs, tuple(rival.key for rival, _ in told if rival.key in shown)


def _rival(
    baseline: Baseline,
    used: NDArray[np.bool_],
    key: str,
    probability: float,
    shapes: Sequence[Weighted],
    scale: float,
    least: float,
) -> Rival:
    # a simplest shape that is fitted to few rows predicts more than it knows, and loses against others later
    freest = [max(shapes, key=lambda one: one.hypothesis.columns.shape[1])] if shapes else []
    sized = [[replace(one, weight=1.0, magnitude=max(one.magnitude, least))] for one in freest]
    return Rival(key, probability, fitted(baseline, used, sized, scale)[0])


def _with_a_second_reflector(
    found: Programme, baseline: Baseline, rivals: Sequence[Rival], noise: Array
) -> Programme:
    """Return a test plan with a second reflector where one tells far more than the TCP does."""
    nodes, batch = reflector_nodes(baseline), baseline.rows.batch
    states = np.arange(len(found.rows) if batch is None else max(batch // 2, 1))[: len(found.rows)]

    def read_at(states: NDArray[np.intp], points: Sequence[str], read_together: int) -> Programme:
        """Return the states, each read at its point; of readings that come together the best."""
        rows = replace(subset(found.rows, states), point=np.array(points))
        pairs, separates = foretold_pairs(baseline, rows, rivals)
        group = np.arange(len(rows)) // read_together
        picked, score, told = best_rows(pairs, noise_of(rows, noise), group, 1, np.zeros_like(group))
        return Programme(subset(rows, picked), separates, score, undecided(pairs, separates, told))

    odds = [rival.probability for rival in rivals]
    if not nodes or max(odds) >= SETTLED * sum(odds):
        return found
    count = len(states)
    best = read_at(np.tile(states, len(nodes)), np.repeat(nodes, count).tolist(), count)
    told = best.score.sum()
    if best.separates != found.separates or told < max(DECIDES, WORTH * found.score.sum()):
        return found
    both = [baseline.nominal.tcp, str(best.rows.point[0])]
    return read_at(np.repeat(states, 2), both * count, 2 * count)


def as_plain(found: Programme | None) -> list[dict[str, Any]]:
    """Return a test plan as the report has it, in an order in which it is soon driven."""
    if found is None:
        return []
    rows = found.rows
    return [
        {
            "q": dict(zip(rows.variables, rows.q[k].tolist(), strict=True)),
            "wrench": rows.wrench[k].tolist(),
            "point": str(rows.point[k]),
            **({"target": str(rows.target[k])} if rows.targets else {}),
            "separates": list(found.separates),
            **({"alike": list(found.alike)} if found.alike else {}),
            "discrimination": float(found.score[k]),
        }
        for k in short_way(rows.q).tolist()
    ]


def proposed_csv(result: Diagnosis) -> str:
    """Return the proposed states of a diagnosis as a table to fill in.

    Raises BeamstiffError when it proposes none.
    """
    if not result.next:
        raise BeamstiffError("--next: this diagnosis has no rivals to tell apart, so no states to propose")
    rows = result.baseline.rows
    wrench = np.array([item["wrench"] for item in result.next])
    return measurements_to_csv(
        empty_rows(
            rows,
            result.baseline.nominal.tcp,
            np.array([[item["q"][name] for name in rows.variables] for item in result.next]),
            wrench,
            point=[item["point"] for item in result.next],
            target=[item.get("target", "") for item in result.next],
            targets=rows.targets,
            sigma_position=rows.sigma_position,  # who measured before measures again
            sigma_rotation=rows.sigma_rotation,
            metadata={"robot": result.baseline.nominal.name},
            units=rows.units,
        ),
        result.baseline.nominal,
    )
