"""What to measure next where several causes make up the gap.

A cause and a look-alike in its place, each fitted with all other causes and all that is open, foretell new
rows as ``m = M theta`` with covariance ``M C M^T``; the rows that tell most are those of the expected
discrimination of `test_plan`. Where no cause has a look-alike, those tell most that bound the causes'
parameters best: the expected information of a reading, ``log det(1 + M C M^T / sigma^2) / 2`` (Lindley,
Ann. Math. Statist. 27 (1956) 986), each beside what the rows before it told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition
from beamstiff.diagnosis.decomposition.forms import Form
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.next_measurement.candidates import load_cycles, most_often, noise_of
from beamstiff.diagnosis.next_measurement.test_plan import (
    DECIDES,
    SETTLED,
    Foretold,
    Pair,
    Programme,
    best_rows,
    most_cycles,
    undecided,
    ways_to_load,
)
from beamstiff.diagnosis.predictions import columns_at
from beamstiff.diagnosis.residual.baseline import Baseline, at_rows
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array


def propose_between(found: Decomposition, seed: int) -> Programme | None:
    """Return the states that tell causes from their look-alikes best, or bound them; None without a cause.

    Each is read at the point that the table reads most often.

    Raises BeamstiffError when no posture can be reached.
    """
    causes = found.every
    if not causes:
        return None
    batch = found.model.baseline.rows.batch
    single = ways_to_load(batch, [cause.key for cause in causes]) == (True,)
    rows, cycle, posture = load_cycles(found.model.baseline, seed, single)
    most = most_cycles(batch, cycle)
    rows = replace(rows, point=np.full(len(rows), most_often(found.model.baseline.rows.point)))
    sigma = np.median(found.model.baseline.sigma[:, :3], axis=0)
    noise = noise_of(rows, max(found.scatter, 1.0) * sigma)
    ahead = Ahead(found, rows)
    pairs, separates = _pairs(ahead, causes)
    picked, score, told = np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
    if pairs:
        picked, score, told = best_rows(pairs, noise, cycle, most, posture)
    if score.sum() < DECIDES:
        forms = [form for cause in causes for form in cause.forms]
        return _bounding(ahead.foretold(forms), rows, cycle, most, posture, noise)
    return Programme(subset(rows, picked), separates, score, undecided(pairs, separates, told))


@dataclass(frozen=True, eq=False)
class Ahead:
    """New rows, as a decomposition sees them."""

    found: Decomposition
    rows: Measurements

    @cached_property
    def baseline(self) -> Baseline:
        """The model at the new rows."""
        return at_rows(self.found.model.baseline, self.rows)

    @cached_property
    def opened(self) -> Array:
        """What a unit of each open parameter adds, (R, 3, t)."""
        problem = self.found.model.problem
        every = self.baseline.tangent if problem is None else problem.ahead(self.baseline.robot, self.rows)
        return every[:, :3]

    @cached_property
    def known(self) -> dict[Form, Array]:
        """Columns of forms that were asked for."""
        return {}

    def columns(self, form: Form) -> Array:
        """Return what a form adds, of realistic sizes, (R, 3, c); a slip, and what postures show, is past."""
        if form.past:
            return np.zeros((len(self.rows), 3, form.sizes.size))
        if form not in self.known:
            self.known[form] = columns_at(self.baseline, form)[:, :3] * form.sizes
        return self.known[form]

    def foretold(self, forms: Sequence[Form], key: str = "") -> Foretold:
        """Return what some forms, fitted with all that is open, foretell; `key` of what they explain.

        Raises BeamstiffError when a form does not exist there.
        """
        matrix = np.concatenate([self.opened, *(self.columns(form) for form in forms)], axis=2)
        theta, covariance = solved(self.found.model, forms)
        scale = max(self.found.scatter, 1.0) ** 2
        return Foretold(matrix @ theta, matrix, scale * covariance, key=key)


def _pairs(ahead: Ahead, causes: Sequence[Cause]) -> tuple[list[Pair], tuple[str, ...]]:
    """Return causes beside their look-alikes as they foretell rows, and which these are."""
    pairs, separates = list[Pair](), dict[str, None]()
    for cause in (one for one in causes if one.probability < SETTLED):
        others = [form for one in causes if one is not cause for form in one.forms]
        explained = []
        for key, forms in [(cause.key, cause.forms), *((rival.key, (rival,)) for rival in cause.rivals)]:
            try:
                explained.append((key, ahead.foretold([*others, *forms], key)))
            except BeamstiffError:  # what it would be there is not known
                continue
        if len(explained) < 2 or explained[0][0] != cause.key:
            continue
        share = (1.0 - cause.probability) / (len(explained) - 1)
        odds = [cause.probability, *[share] * (len(explained) - 1)]
        for (p, (key, one)), (q, (rival, other)) in combinations(zip(odds, explained, strict=True), 2):
            if not alike_in_positions(key, rival, ahead.found.model.baseline):
                pairs.append((p * q, one, other))
                separates |= dict.fromkeys((key, rival))
    return pairs, tuple(separates)


def alike_in_positions(key: str, other: str, baseline: Baseline) -> str:
    """Return what else than positions distinguishes two causes, an instruction; empty if they may.

    Fitted forms of such causes differ where no row is, and would be fitted anew to rows from there.
    """
    (effect, _, place), (rival, _, same) = key.partition(":"), other.partition(":")
    if place != same or not baseline.absolute or np.isfinite(baseline.rows.torque).any():
        return ""
    return EFFECTS[effect].alike_in_positions.get(rival, "") if effect in EFFECTS else ""


def _bounding(
    one: Foretold,
    rows: Measurements,
    cycle: NDArray[np.intp],
    most: int,
    posture: NDArray[np.intp],
    noise: Array,
) -> Programme:
    """Return the cycles that bound the parameters best, each beside those before it."""
    scaled = one.matrix / noise[..., None]
    parts = {k: scaled[cycle == k].reshape(-1, scaled.shape[2]) for k in np.unique(cycle).tolist()}
    covariance = one.covariance
    chosen: list[int] = []
    told: list[float] = []
    free = dict(parts)
    while free and len(chosen) < most:
        gains = {k: _information(part, covariance) for k, part in free.items()}
        best = max(gains, key=gains.__getitem__)
        chosen.append(best)
        told.append(gains[best])
        part = free[best]
        gain = covariance @ part.T @ np.linalg.inv(np.eye(len(part)) + part @ covariance @ part.T)
        covariance = covariance - gain @ part @ covariance
        taken = posture[cycle == best][0]
        free = {k: part for k, part in free.items() if posture[cycle == k][0] != taken}
    picked = np.concatenate([np.flatnonzero(cycle == k) for k in chosen])
    score = np.concatenate(
        [
            np.full((cycle == k).sum(), value / (cycle == k).sum())
            for k, value in zip(chosen, told, strict=True)
        ]
    )
    return Programme(subset(rows, picked), (), score)


def _information(part: Array, covariance: Array) -> float:
    return 0.5 * float(np.linalg.slogdet(np.eye(len(part)) + part @ covariance @ part.T)[1])
