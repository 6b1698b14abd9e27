"""Causes weighed one by one and two by two, with the geometry as it is described."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.candidate import Candidate, estimates_of
from beamstiff.diagnosis.decision.attribution import attribute, ceiling, shares
from beamstiff.diagnosis.decision.verdict import SECOND, SLIGHT, Judged, judge, larger_first
from beamstiff.diagnosis.decision.where import where
from beamstiff.diagnosis.held_out.explained import explanations
from beamstiff.diagnosis.held_out.score import (
    Fitted,
    HeldOutError,
    Weighted,
    fitted,
    folds,
    held_out,
    parts_of,
    shift,
)
from beamstiff.diagnosis.inference.component_subspaces import ComponentSubspace, component_subspaces
from beamstiff.diagnosis.inference.evidence import NoisePrior
from beamstiff.diagnosis.inference.library import Library, build_library, seen_by
from beamstiff.diagnosis.inference.linearised import TURNS, beside_the_cause
from beamstiff.diagnosis.inference.noise_scale import noise_prior_of, scale_after
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, OUTLIERS, UNKNOWN, Search, search, weighed_together
from beamstiff.diagnosis.next_measurement.test_plan import as_plain, propose_tests
from beamstiff.diagnosis.notes import in_words, notes, notes_of_verdict
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.outlier_screening import Screened, unlikely
from beamstiff.diagnosis.residual.whitened import Whitened, whiten
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import BeamstiffError, optional
from beamstiff.se3 import Array
from beamstiff.stages import stage

REPORTED = 8  # candidates whose held-out gap is computed
RIVALS = 3  # candidates that the next measurements are to tell apart at least
LEAST_NONE = 0.05  # probability of no cause, from which it is one of them

Rival = tuple[str, float, Sequence[Weighted]]  # its key, probability and shapes


@dataclass(frozen=True)
class Weighed:
    """Rows about one linearisation, and what every cause is worth of them.

    `linear`: the one about whose stiffness effects are linear.
    """

    screened: Screened
    linear: Baseline
    white: Whitened
    library: Library
    laws: Sequence[ComponentSubspace]
    found: Search
    scales: NoisePrior


def weigh_one_by_one(library: Library, screened: Screened, prior: Prior, seed: int) -> Diagnosis:
    """Return the diagnosis of one cause, or two, with the geometry as it is described.

    Raises BeamstiffError where the rows show no effect of the library at all.
    """
    stage("weighing causes one by one")
    white = whiten(screened.baseline, screened.used)
    library = seen_by(library, white)
    if not library.hypotheses:
        raise BeamstiffError("no effect is left that these rows could show: measure more, or leave out fewer")
    scales = noise_prior_of(screened.baseline)
    weighed = _weigh(screened, white, library, scales, prior)
    return _diagnosis(weighed, _decide(weighed, "outliers" not in prior.without, seed), seed)


def _weigh(
    screened: Screened, white: Whitened, library: Library, scales: NoisePrior, prior: Prior
) -> Weighed:
    """Return what every cause is worth, about the stiffness that the likeliest leaves."""
    linear = screened.baseline
    for turn in range(1 + TURNS):
        laws = component_subspaces(linear, library, white)
        found = search(white, library.hypotheses, scales, laws)
        moved = beside_the_cause(linear, white, found, scales) if turn < TURNS else None
        if moved is None:
            break
        linear, white = moved, whiten(moved, screened.used)
        library = build_library(linear, white, prior)
    found = weighed_together(white, library.hypotheses, scales, laws, found)
    return Weighed(screened, linear, white, library, laws, found, scales)


@dataclass(frozen=True)
class Decided:
    """What is decided of the causes, and the fits that it rests on.

    `best`: held-out error of the likeliest cause; `both`: of the likeliest two, where they are far likelier.
    `alone`: of the first of two causes by itself. `scale`: of the noise, beside what is named.
    """

    judged: Judged
    shrinks: Mapping[str, HeldOutError]
    best: HeldOutError
    both: HeldOutError | None
    alone: HeldOutError | None
    models: list[list[Weighted]]
    fits: tuple[Fitted, ...]
    scale: float


def _decide(weighed: Weighed, may_be_outliers: bool, seed: int) -> Decided:
    """Return what the held-out postures decide of the causes that were weighed."""
    screened, linear, white, found = weighed.screened, weighed.linear, weighed.white, weighed.found
    best, pair = found.named[0], found.pairs[0] if found.pairs else None
    # what one cause leaves is no noise if two close it
    scale = scale_after(white, pair.shapes if pair is not None else [found.shapes[best]], weighed.scales)

    def held(shapes: Sequence[Sequence[Weighted]], *, by_load: bool = False) -> HeldOutError:
        return held_out(linear, screened.used, shapes, scale, seed, by_load=by_load)

    both, by_load = None, None
    if pair is not None and pair.log_weight - found.log_weight[best] > SECOND:
        both = held(pair.shapes)
        if _each_posture_its_own(pair):
            by_load = held([found.shapes[best]], by_load=True), held(pair.shapes, by_load=True)
    shrinks = {key: held([found.shapes[key]]) for key in found.named[:REPORTED]}
    odd_rows = (
        _still_wrong(screened, linear, found.shapes[best], scale),
        screened.strength,
        screened.isolated,
    )
    judged = judge(found, white.freedom, odd_rows, shrinks[best], both, may_be_outliers, by_load)
    alone = None
    if judged.also not in (None, OUTLIERS):
        judged = larger_first(judged, _sizes(linear, white, found, scale))
        alone = shrinks.get(judged.verdict) or held([found.shapes[judged.verdict]])
    models = _models(judged, found)
    if judged.verdict != UNKNOWN:
        scale = scale_after(white, models, weighed.scales)
    fits = tuple(fitted(linear, screened.used, models, scale)) if models else ()
    return Decided(judged, shrinks, shrinks[best], both, alone, models, fits, scale)


def _diagnosis(weighed: Weighed, decided: Decided, seed: int) -> Diagnosis:
    """Return all that a diagnosis tells of what is decided."""
    screened, linear, white, found = weighed.screened, weighed.linear, weighed.white, weighed.found
    used, judged, scale = screened.used, decided.judged, decided.scale
    candidates = _candidates(linear, used, found, judged, decided.shrinks, scale)
    by_key = {one.key: one for one in candidates}
    also = _also(judged, by_key, decided.fits)
    two = len(decided.models) == 2
    if two:
        first = _in_fit(by_key[judged.verdict], decided.fits[0])
        by_key[judged.verdict] = replace(first, shrink=decided.both)
    verdict = by_key[judged.verdict]
    causes = explanations(linear, by_key.values(), verdict, decided.fits if two else ())
    squares = np.where(used[:, :3], (scale * linear.sigma[:, :3]) ** 2, 0.0).sum()
    attributed = attribute(white, weighed.laws, scale)
    left = [size for one in by_key.values() if one.shrink for size in (one.shrink.before, one.shrink.after)]
    fold, _ = folds(linear, used, np.random.default_rng(seed))
    left_out: list[str] = []
    test_plan = None
    with optional("what to measure next", left_out.append):
        rivals, hidden = _rivals(judged, found)
        test_plan = propose_tests(linear, used, rivals, scale, seed, hidden)
    off = _off(screened, linear, decided.models, scale) if screened.outliers.size else None
    return Diagnosis(
        baseline=screened.baseline,
        linear=linear,
        rms=decided.best.before,
        # no cause can be expected to leave less than all laws together, and none is better than the best
        ceiling=min(ceiling(attributed, white, fold, linear.sigma, scale), *left),
        noise=float(np.sqrt(squares / max(used[:, :3].any(axis=1).sum(), 1))),
        candidates=tuple(by_key.values()),
        verdict=verdict,
        also=also,
        indistinguishable=judged.indistinguishable,
        untestable=weighed.library.untestable,
        outliers=tuple(linear.rows.place(row) for row in screened.outliers.tolist()),
        notes=(
            *notes(screened, white),
            *notes_of_verdict(screened, verdict.effect, scale, off),
            *_unclear(judged),
            *_unmodelled(judged, found),
            *left_out,
        ),
        fits=decided.fits,
        first=decided.alone,
        where=where(screened.baseline, used, shares(attributed, white, scale, causes, seed)),
        next=as_plain(test_plan),
        features=_features(weighed, decided),
    )


def _still_wrong(screened: Screened, baseline: Baseline, shapes: Sequence[Weighted], scale: float) -> int:
    """Return how many of the rows that were left out the likeliest cause does not explain either."""
    if not screened.outliers.size:
        return 0
    used, off = baseline.used, _off(screened, baseline, [shapes], scale)
    off = np.where(used, off / (scale * baseline.sigma), 0.0)[screened.outliers]
    return int(unlikely((off**2).sum(axis=1), used[screened.outliers].sum(axis=1), len(used)).sum())


def _off(screened: Screened, baseline: Baseline, models: Sequence[Sequence[Weighted]], scale: float) -> Array:
    """Return how far rows are from what effects, fitted to the rows without outliers, predict, (N, 6)."""
    fits = fitted(baseline, screened.used, models, scale)
    moved = shift(baseline, fits, [[one.hypothesis.shape.columns for one in fit.shapes] for fit in fits])
    return np.where(baseline.used, baseline.gap - moved, 0.0)


def _each_posture_its_own(pair: Pair) -> bool:
    """Return whether a pair has parameters of some postures alone, which tell nothing of new ones."""
    shapes = [one.hypothesis.shape for shapes in pair.shapes for one in shapes]
    return any(quantity.posture_specific for shape in shapes for quantity in shape.parameters)


def _sizes(linear: Baseline, white: Whitened, found: Search, scale: float) -> dict[str, float]:
    """Return the share of the gap that each of two causes takes away, as large as both together say it is."""
    pair = found.pairs[0]
    parts = parts_of(linear, fitted(linear, white.used, pair.shapes, scale))
    gap = white.project_out(white.gap[:, None])
    left = gap - white.project_out(white.whiten(np.stack(parts, axis=-1)))
    closed = 1.0 - (left**2).sum(axis=0) / (gap**2).sum()
    return dict(zip((pair.first, pair.second), closed.tolist(), strict=True))


def _models(judged: Judged, found: Search) -> list[list[Weighted]]:
    """Return the shapes of the causes that are named: of two, each beside the other."""
    if judged.also not in (None, OUTLIERS):
        return list(found.pairs[0].shapes)
    return [found.shapes[judged.verdict]] if judged.verdict in found.shapes else []


def _also(judged: Judged, by_key: Mapping[str, Candidate], fits: Sequence[Fitted]) -> Candidate | None:
    """Return the second cause, as it is beside the first."""
    if judged.also is None:
        return None
    if judged.also == OUTLIERS:
        return Candidate("outliers", None, judged.also_probability)
    return replace(_in_fit(by_key[judged.also], fits[0]), probability=judged.also_probability)


def _in_fit(cause: Candidate, fit: Fitted) -> Candidate:
    """Return one of two causes as it is beside the other."""
    at = [one.hypothesis.key for one in fit.shapes].index(cause.key)
    return replace(cause, estimates=estimates_of(fit, at), shape=fit.shapes[at].hypothesis.shape.name)


def _features(weighed: Weighed, decided: Decided) -> dict[str, float]:
    """Return what the verdict rests on, as numbers."""
    found, screened, judged, both = weighed.found, weighed.screened, decided.judged, decided.both
    named = judged.features
    parts = {"none": named.none, "two": named.two, "unknown": named.unknown, "of_two": named.unknown_of_two}
    misfit = decided.best.misfit if both is None or judged.also in (None, OUTLIERS) else both.misfit
    return {
        **{f"{part}_{name}": value for part, terms in parts.items() for name, value in terms.items()},
        "misfit": misfit,
        "unknown": found.log_weight[UNKNOWN] - found.log_weight[found.named[0]],
        "shrink": decided.best.shrink,
        "scale": decided.scale,
        "outliers": float(screened.outliers.size),
        "outlier_strength": screened.strength,
        "noise_position": float(screened.noise[0]),
        "noise_rotation": float(screened.noise[1]),
    }


def _unclear(judged: Judged) -> Iterator[str]:
    if judged.unclear:
        are = "are two causes" if judged.verdict == UNKNOWN else "is a second cause"
        yield f"there {are}, and it is not clear which: {in_words(judged.unclear)}"


def _unmodelled(judged: Judged, found: Search) -> Iterator[str]:
    """Yield what a place seems to do where that explains more than any effect of the library."""
    best = max(found.unmodelled, key=found.unmodelled.__getitem__, default=None)
    if judged.verdict != UNKNOWN or best is None:
        return
    if found.unmodelled[best] > max(found.log_weight[found.named[0]], found.log_weight[UNKNOWN]):
        yield f"most of the gap looks as if {best[0]} {best[1]}, which is no effect of the library"


def _rivals(judged: Judged, found: Search) -> tuple[list[Rival], list[Rival]]:
    """Return the effects to distinguish, the likeliest few and those hardly less likely, and all others.

    The others only where there may be no cause: states in which a cause would show, if there is one, are
    those in which any does, for the likeliest few are so by chance.
    """
    odds = judged.probabilities
    named = sorted(found.named, key=lambda key: odds.get(key, 0.0), reverse=True)[:REPORTED]
    near = [key for key in named if odds.get(key, 0.0) >= SLIGHT * odds.get(named[0], 0.0)]
    near = named[: max(len(near), RIVALS)]
    others = [key for key in found.named if key not in near]
    rivals: list[Rival] = [(key, odds[key], found.shapes[key]) for key in near]
    if len(rivals) < 2 or odds[NONE] <= LEAST_NONE:
        return rivals, []
    hidden: list[Rival] = [(key, odds[key], found.shapes[key]) for key in others]
    return [*rivals, (NONE, odds[NONE], [])], hidden


def _candidates(
    baseline: Baseline,
    used: NDArray[np.bool_],
    found: Search,
    judged: Judged,
    shrinks: Mapping[str, HeldOutError],
    scale: float,
) -> tuple[Candidate, ...]:
    order = sorted(judged.probabilities, key=lambda key: (judged.probabilities[key], key), reverse=True)
    result = []
    for key in order:
        effect, _, component = key.partition(":")
        shapes = found.shapes.get(key, [])
        fits = fitted(baseline, used, [shapes], scale) if key in shrinks else []
        result.append(
            Candidate(
                effect=effect,
                component=None if component == "null" else component,
                probability=judged.probabilities[key],
                shape=shapes[0].hypothesis.shape.name if shapes else "",
                estimates=estimates_of(fits[0]) if fits else (),
                shrink=shrinks.get(key),
            )
        )
    return tuple(result)
