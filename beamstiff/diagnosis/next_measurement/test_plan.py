"""What to measure next: the states where rival explanations predict what the noise cannot hide.

Rivals i and j, fitted to the rows, predict displacements m_i and m_j of a new row with covariances S_i and
S_j of their parameters. The expected discrimination of a row (Box & Hill, Technometrics 9 (1967) 57, with
the covariance of the estimates) is::

    sum over i < j  p_i p_j (m_i - m_j)^T (S_i + S_j + 2 sigma^2)^-1 (m_i - m_j)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.held_out.prediction import Fitted, Weighted, fitted, shift, stacked_covariance
from beamstiff.diagnosis.next_measurement.candidates import empty_rows, load_cycles, noise_of, reflector_nodes
from beamstiff.diagnosis.residual.baseline import Baseline, at_rows
from beamstiff.diagnosis.result import Diagnosis, columns_at
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.se3 import Array

PROGRAMME = 6  # load cycles that are proposed, each in another posture
READINGS = 12  # postures, where a cycle is one reading
WORTH = 2.0  # times what the TCP tells: less is not worth a second reflector
DECIDES = 2.0  # of discrimination, all states together: less hardly moves the odds


@dataclass(frozen=True)
class Programme:
    """States to measure, and which rivals they separate.

    Attributes
    ----------
    rows : Measurements
        Poses, loads and where to read; nothing measured.
    separates : tuple of str
    score : (R,) array
        Expected discrimination of each row.
    """

    rows: Measurements
    separates: tuple[str, ...]
    score: Array


@dataclass(frozen=True)
class Rival:
    """An explanation: its probability, and its likeliest shape, fitted (the model as it is without one)."""

    key: str
    probability: float
    fit: Fitted


def propose_tests(
    baseline: Baseline,
    used: NDArray[np.bool_],
    rivals: Sequence[tuple[str, float, Sequence[Weighted]]],
    scale: float,
    seed: int,
) -> Programme | None:
    """Return the load cycles that tell rivals apart best; None where there is nothing to tell apart.

    Each is of another posture. Where a reflector elsewhere on the robot would tell far more than the TCP does
    in these states, it is read as well.

    Parameters
    ----------
    rivals : sequence of (key, probability, shapes)
        Without shapes the rival is the model as it is.
    scale : float
        Of the noise.
    """
    if len(rivals) < 2:
        return None
    rows, cycle, posture = load_cycles(baseline, seed)
    fits = [_rival(baseline, used, *rival, scale) for rival in rivals]
    score, separates = discrimination(baseline, rows, fits, scale)
    if len(separates) < 2:
        return None
    picked = best_cycles(score, cycle, posture)
    found = Programme(subset(rows, picked), separates, score[picked])
    return _with_a_second_reflector(found, baseline, fits, scale)


def best_cycles(score: Array, cycle: NDArray[np.intp], posture: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the rows of the load cycles that tell most, (k,), the best first, each of another posture."""
    whole = np.bincount(cycle, weights=score)
    chosen: list[int] = []
    for k in np.argsort(-whole, kind="stable").tolist():
        if posture[cycle == k][0] not in [posture[cycle == other][0] for other in chosen]:
            chosen.append(k)
        if len(chosen) == most_cycles(cycle):
            break
    return np.concatenate([np.flatnonzero(cycle == k) for k in chosen])


def most_cycles(cycle: NDArray[np.intp]) -> int:
    """Return how many load cycles are proposed: more where each is one reading."""
    return READINGS if np.unique(cycle).size == cycle.size else PROGRAMME


def discrimination(
    baseline: Baseline, rows: Measurements, rivals: Sequence[Rival], scale: float
) -> tuple[Array, tuple[str, ...]]:
    """Return how far each row is expected to tell rivals apart (R,), and which of them can be foretold."""
    there = at_rows(baseline, rows)
    told, means, covariances = [], [], []
    for rival in rivals:
        try:
            columns = [columns_at(there, one.hypothesis) for one in rival.fit.shapes]
        except BeamstiffError:  # what it would be there is not known
            continue
        told.append(rival)
        means.append(shift(there, [rival.fit], [columns])[:, :3])
        covariances.append(stacked_covariance(there, rival.fit, columns)[:, :3, :3])
    if not told:
        return np.zeros(len(rows)), ()
    noise = noise_of(rows, scale * np.median(baseline.sigma[:, :3], axis=0))
    odds = [rival.probability for rival in told]
    return discriminations(odds, means, covariances, noise), tuple(rival.key for rival in told)


def discriminations(
    odds: Sequence[float], means: Sequence[Array], covariances: Sequence[Array], noise: Array
) -> Array:
    """Return the expected discrimination of each row, (R,).

    Parameters
    ----------
    odds : sequence of float
        Probability of each rival.
    means, covariances : sequence of (R, 3) and (R, 3, 3) array, m and m^2
        What each foretells of the rows.
    noise : (3,) or (R, 3) array, m
        Standard deviation of a reading.
    """
    score, read = np.zeros(len(means[0])), 2 * np.eye(3) * noise[..., None, :] ** 2
    for i, j in combinations(range(len(odds)), 2):
        apart, total = means[i] - means[j], covariances[i] + covariances[j] + read
        square = np.einsum("na,na->n", apart, np.linalg.solve(total, apart[..., None])[..., 0])
        score += odds[i] * odds[j] * square
    return score


def _rival(
    baseline: Baseline,
    used: NDArray[np.bool_],
    key: str,
    probability: float,
    shapes: Sequence[Weighted],
    scale: float,
) -> Rival:
    best = [max(shapes, key=lambda one: one.weight)] if shapes else []
    return Rival(key, probability, fitted(baseline, used, [[one] for one in best], scale)[0])


def _with_a_second_reflector(
    found: Programme, baseline: Baseline, rivals: Sequence[Rival], scale: float
) -> Programme:
    """Return a test plan with a second reflector where one tells far more than the TCP does."""
    nodes, states = reflector_nodes(baseline), np.arange(len(found.rows))
    if not nodes:
        return found
    elsewhere = replace(
        subset(found.rows, np.tile(states, len(nodes))), point=np.repeat(np.array(nodes), len(states))
    )
    told, separates = discrimination(baseline, elsewhere, rivals, scale)
    by_node = told.reshape(len(nodes), -1)
    best = int(np.argmax(by_node.sum(axis=1)))
    if separates != found.separates or by_node[best].sum() < max(DECIDES, WORTH * found.score.sum()):
        return found
    point = np.tile([baseline.nominal.tcp, nodes[best]], len(states))
    rows = replace(subset(found.rows, np.repeat(states, 2)), point=point)
    return Programme(rows, separates, np.stack([found.score, by_node[best]], axis=1).ravel())


def as_plain(found: Programme | None) -> list[dict[str, Any]]:
    """Return a test plan as the report has it."""
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
            "discrimination": float(found.score[k]),
        }
        for k in range(len(rows))
    ]


def proposed_csv(result: Diagnosis) -> str:
    """Return the proposed states of a diagnosis as a table to fill in.

    Raises
    ------
    BeamstiffError
        When it proposes none.
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
