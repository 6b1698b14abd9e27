"""What to measure next: the states where rival explanations predict what the noise cannot hide.

Rivals i and j, fitted to the rows, predict displacements m_i and m_j of a new row with covariances S_i and
S_j of their parameters. The expected discrimination of a row (Box & Hill, Technometrics 9 (1967) 57, with
the covariance of the estimates) is::

    sum over i < j  p_i p_j (m_i - m_j)^T (S_i + S_j + 2 sigma^2)^-1 (m_i - m_j)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.gap.baseline import Baseline, at_rows
from beamstiff.gap.heldout import Weighted, fitted, shift, stacked_covariance
from beamstiff.gap.result import Diagnosis, columns_at
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.plan.candidates import candidate_poses
from beamstiff.plan.poses import closed_posture, random_poses, rounded_postures
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

POSES, MANY = 24, 400  # postures to choose from, of so many drawn
NEAR = 0.15  # of the machine's size: as far from where the tool was seen it is likely to be seen as well
PROGRAMME = 6  # poses that are proposed
AXES = 3  # along which each is loaded
STEPS = (0.5, 1.0, 0.5, -0.5, -1.0)  # of the largest load: a cycle shows history and reversal


@dataclass(frozen=True)
class Programme:
    """States to measure, and which rivals they separate.

    Attributes
    ----------
    rows : Measurements
        Poses and loads; nothing measured.
    separates : tuple of str
    score : (R,) array
        Expected discrimination of each row.
    """

    rows: Measurements
    separates: tuple[str, ...]
    score: Array


def programme(
    baseline: Baseline,
    used: NDArray[np.bool_],
    rivals: Sequence[tuple[str, float, Sequence[Weighted]]],
    scale: float,
    seed: int,
) -> Programme | None:
    """Return the load cycles that tell rivals apart best; None where there is nothing to tell apart.

    Parameters
    ----------
    rivals : sequence of (key, probability, shapes)
        Without shapes the rival is the model as it is.
    scale : float
        Of the noise.
    """
    if len(rivals) < 2 or baseline.absolute:
        return None
    rows, cycle = _candidates(baseline, seed)
    there = at_rows(baseline, rows)
    means, covariances, kept = [], [], []
    for key, probability, shapes in rivals:
        best = [max(shapes, key=lambda one: one.weight)] if shapes else []
        fit = fitted(baseline, used, [[one] for one in best], scale)[0]
        try:
            columns = [columns_at(there, one.hypothesis) for one in best]
        except BeamstiffError:  # what it would be there is not known
            continue
        kept.append((key, probability))
        means.append(shift(there, [fit], [columns]))
        covariances.append(stacked_covariance(there, fit, columns))
    if len(kept) < 2:
        return None
    noise = 2 * np.diag((scale * np.median(baseline.sigma, axis=0)) ** 2)
    score = np.zeros(len(rows))
    for i, j in combinations(range(len(kept)), 2):
        apart = (means[i] - means[j])[:, :3]
        total = (covariances[i] + covariances[j])[:, :3, :3] + noise[:3, :3]
        told = np.einsum("na,na->n", apart, np.linalg.solve(total, apart[..., None])[..., 0])
        score += kept[i][1] * kept[j][1] * told
    whole = np.array([score[cycle == k].sum() for k in range(int(cycle.max()) + 1)])
    chosen: list[int] = []
    for k in np.argsort(-whole):
        if all(k // AXES != other // AXES for other in chosen):  # another posture each time
            chosen.append(int(k))
        if len(chosen) == PROGRAMME:
            break
    picked = np.concatenate([np.flatnonzero(cycle == k) for k in chosen])
    return Programme(subset(rows, picked), tuple(key for key, _ in kept), score[picked])


def _candidates(baseline: Baseline, seed: int) -> tuple[Measurements, NDArray[np.intp]]:
    """Return load cycles at random poses within the limits, and which cycle each row is of."""
    rows, robot = baseline.rows, baseline.nominal
    q = _postures(baseline, np.random.default_rng(seed))
    largest = float(np.linalg.norm(rows.wrench[:, :3], axis=1).max(initial=0.0)) or 500.0
    largest = float(f"{largest:.3g}")
    all_q, wrench, pose, step, cycle = [], [], [], [], []
    for number, values in enumerate(q):
        for axis in range(AXES):
            for at, share in enumerate(STEPS):
                all_q.append(values)
                wrench.append(np.eye(6)[axis] * (share * largest) + 0.0)  # no -0
                pose.append(AXES * number + axis)
                step.append(at)
                cycle.append(AXES * number + axis)
    proposed = make_measurements(
        list(rows.variables),
        np.array(all_q),
        tcp=robot.tcp,
        wrench=np.array(wrench),
        displacement=np.full((len(all_q), 6), np.nan),
        pose=pose,
        step=step,
        time=np.arange(len(all_q), dtype=np.float64) * 60.0,
        source="<next>",
    )
    return proposed, np.array(cycle, dtype=np.intp)


def _postures(baseline: Baseline, rng: np.random.Generator) -> Array:
    """Return postures (n, A): measured ones, and others where the tool can be measured, as it seems.

    That is the region that the rows state; otherwise near where the tool was seen: nothing else tells of the
    floor, the pedestal and what the tracker sees.
    """
    rows = baseline.rows
    kinematics = compile_kinematics(baseline.nominal)
    tcp = kinematics.node_index[baseline.nominal.tcp]
    known = np.unique(rows.q, axis=0)
    seen = closed_posture(kinematics, known)[0].node_positions[:, tcp]
    if rows.region is not None:
        known = known[inside(rows.region, seen)]
        others = candidate_poses(kinematics, POSES, int(rng.integers(1 << 31)), rows.region)
    else:
        others = random_poses(kinematics, MANY, rng)
    others = rounded_postures(baseline.nominal, others, rows.units)
    where, closed = closed_posture(kinematics, others)
    others, at = others[closed], where.node_positions[:, tcp]
    if rows.region is not None:
        others = others[inside(rows.region, at)]
    else:
        far = np.linalg.norm(at[:, None] - seen[None], axis=2).min(axis=1)
        others = others[far <= NEAR * kinematics.size]
    return np.concatenate([known[rng.permutation(len(known))[: POSES // 2]], others[:POSES]])


def inside(region: Sequence[tuple[float, float]], positions: Array) -> NDArray[np.bool_]:
    """Return which positions (n, 3) lie in a region, (n,)."""
    low, high = np.asarray(region, dtype=np.float64).T
    return np.asarray(((positions >= low) & (positions <= high)).all(axis=1))


def as_plain(found: Programme | None) -> list[dict[str, Any]]:
    """Return a programme as the report has it."""
    if found is None:
        return []
    rows = found.rows
    return [
        {
            "q": dict(zip(rows.variables, rows.q[k].tolist(), strict=True)),
            "wrench": rows.wrench[k].tolist(),
            "separates": list(found.separates),
            "discrimination": float(found.score[k]),
        }
        for k in range(len(rows))
    ]


def programme_csv(result: Diagnosis) -> str:
    """Return the proposed states of a diagnosis as a table to fill in.

    Raises
    ------
    BeamstiffError
        When it proposes none.
    """
    if not result.next:
        raise BeamstiffError("--next: this diagnosis has no rivals to tell apart, so no states to propose")
    rows = result.baseline.rows
    proposed = make_measurements(
        list(rows.variables),
        [[item["q"][name] for name in rows.variables] for item in result.next],
        tcp=result.baseline.nominal.tcp,
        wrench=[item["wrench"] for item in result.next],
        displacement=np.full((len(result.next), 6), np.nan),
        sigma_position=rows.sigma_position,  # who measured before measures again
        sigma_rotation=rows.sigma_rotation,
        metadata={"robot": result.baseline.nominal.name},
        source="<next>",
        units=rows.units,
    )
    return measurements_to_csv(proposed, result.baseline.nominal)
