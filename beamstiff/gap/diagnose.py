"""The diagnosis: where the gap is, which effect causes it, how far it shrinks, how sure that is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beamstiff.gap.baseline import Baseline, fit_baseline
from beamstiff.gap.evidence import Scales, detection
from beamstiff.gap.heldout import Shrink, Weighted, fitted, held_out
from beamstiff.gap.library import Hypothesis, Library, key_of, state_library
from beamstiff.gap.noise import scale_after, scales_of
from beamstiff.gap.result import Candidate, Diagnosis, estimates_of
from beamstiff.gap.screening import screen
from beamstiff.gap.search import NONE, OUTLIERS, UNKNOWN, Search, search
from beamstiff.gap.whitened import whiten
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot

NULLS = 200  # simulated campaigns without an effect
REPORTED = 8  # candidates whose held-out gap is computed
SURE = 0.95  # probability that the verdict and what is indistinguishable from it hold together
WORTH = 12.0  # points of shrink that a second cause must bring on held-out postures


def diagnose(
    robot: Robot, measurements: Measurements, *, without: Sequence[str] = (), seed: int = 0
) -> Diagnosis:
    """Diagnose the gap between a model and measurements.

    Parameters
    ----------
    robot : Robot
        Its `identify` parameters are fitted first.
    measurements : Measurements
        Displacements or absolute positions.
    without : sequence of str
        Effects, or ``effect:component``, that are no candidates.
    seed : int

    Returns
    -------
    Diagnosis

    Raises
    ------
    BeamstiffError
        When the rows cannot be predicted, or `without` names no effect.
    """
    baseline = fit_baseline(robot, measurements)
    white = whiten(baseline)
    library = state_library(baseline, white, without)
    screened = screen(baseline, library, "outliers" not in without)
    baseline, used, outlying = screened.baseline, screened.used, screened.outliers
    library = state_library(baseline, whiten(baseline, used), without)
    scales = scales_of(baseline)
    chance = _chance(baseline, used, library, scales, seed)
    found = search(baseline, used, library.hypotheses, scales)
    return _verdict(baseline, used, library, scales, found, outlying, chance, screened.noise, seed)


def _chance(
    baseline: Baseline, used: NDArray[np.bool_], library: Library, scales: Scales, seed: int
) -> tuple[float, float]:
    """Return the log odds of any effect, and the share of simulated campaigns without one that reach them."""
    white = whiten(baseline, used)
    nulls = np.random.default_rng(seed).standard_normal((white.gap.size, NULLS))
    odds = detection(white, library.hypotheses, scales, np.concatenate([white.gap[:, None], nulls], axis=1))
    return float(odds[0]), float((1 + (odds[1:] >= odds[0]).sum()) / (1 + NULLS))


def _verdict(
    baseline: Baseline,
    used: NDArray[np.bool_],
    library: Library,
    scales: Scales,
    found: Search,
    outlying: NDArray[np.intp],
    chance: tuple[float, float],
    noises: NDArray[np.float64],
    seed: int,
) -> Diagnosis:
    named = found.named
    probabilities = found.single
    if outlying.size:  # nothing beyond noise in the other rows
        probabilities[OUTLIERS] = probabilities.pop(NONE)
    best = named[0]
    scale = scale_after(baseline, used, [found.shapes[best]], scales)
    shrinks: dict[str, Shrink] = {}
    for key in named[:REPORTED]:
        shrinks[key] = held_out(baseline, used, [found.shapes[key]], scale, seed)
    rows = baseline.rows
    first = shrinks[best]
    noise = float(
        np.sqrt(np.where(used[:, :3], (scale * baseline.sigma[:, :3]) ** 2, 0.0).sum() / used[:, 0].sum())
    )
    order = sorted(probabilities, key=probabilities.__getitem__, reverse=True)
    candidates = []
    for key in order:
        effect, _, component = key.partition(":")
        shapes = found.shapes.get(key, [])
        fits = fitted(baseline, used, [shapes], scale) if key in shrinks else []
        candidates.append(
            Candidate(
                effect=effect,
                component=None if component == "null" else component,
                probability=probabilities[key],
                shape=shapes[0].hypothesis.shape.name if shapes else "",
                estimates=estimates_of(fits[0]) if fits else (),
                shrink=shrinks.get(key),
            )
        )
    by_key = {one.key: one for one in candidates}
    winner = by_key[order[0]]
    models = [found.shapes[winner.key]] if winner.key in found.shapes else []
    mass, rest = winner.probability, []
    for key in order[1:]:
        if mass >= SURE or winner.key not in found.shapes:
            break
        mass += probabilities[key]
        if key in found.shapes:
            rest.append(key)
    pair = found.pairs[0] if found.pairs else None
    features = {
        "log_odds": chance[0],
        "p_value": chance[1],
        "none": found.log_weight[NONE] - found.log_weight[best],
        "unknown": found.log_weight[UNKNOWN] - found.log_weight[best],
        "amiss": found.amiss[best],
        "left": found.left[best],
        "shrink": first.shrink,
        "scale": scale,
        "outliers": float(outlying.size),
        "noise_position": float(noises[0]),
        "noise_rotation": float(noises[1]),
        "pair": (pair.log_weight - found.log_weight[best]) if pair else -np.inf,
    }
    return Diagnosis(
        baseline=baseline,
        rms=first.before,
        noise=noise,
        candidates=tuple(candidates),
        verdict=winner,
        also=None,
        indistinguishable=tuple(rest),
        untestable=library.untestable,
        outliers=tuple(rows.place(row) for row in outlying.tolist()),
        notes=(),
        fits=tuple(fitted(baseline, used, models, scale)) if models else (),
        features=features,
    )


__all__ = ["Hypothesis", "Weighted", "diagnose", "key_of"]
