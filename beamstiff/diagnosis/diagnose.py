"""The diagnosis: where the gap is, which effect causes it, how far it shrinks, how sure that is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from beamstiff.diagnosis.candidate import Candidate, estimates_of
from beamstiff.diagnosis.decision.attribution import attribute, ceiling, shares
from beamstiff.diagnosis.decision.verdict import SECOND, SLIGHT, Judged, judge, larger_first
from beamstiff.diagnosis.decision.where import where
from beamstiff.diagnosis.decomposed import beside_calibration, diagnosis_of, with_next
from beamstiff.diagnosis.decomposition.apart import Apart, places_apart
from beamstiff.diagnosis.decomposition.causes import NOISE, QUARTER
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.decomposition.folds import FOLDS
from beamstiff.diagnosis.decomposition.forms import OF_GEOMETRY, Shapes
from beamstiff.diagnosis.decomposition.same_mechanics import same_mechanics
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
from beamstiff.diagnosis.inference.library import Library, build_library, by_candidate, seen_by
from beamstiff.diagnosis.inference.linearised import TURNS, beside_the_cause
from beamstiff.diagnosis.inference.noise_scale import noise_prior_of, scale_after
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, OUTLIERS, UNKNOWN, Search, search, weighed_together
from beamstiff.diagnosis.linear_statics import as_loaded
from beamstiff.diagnosis.measured_torques import measured_torques
from beamstiff.diagnosis.next_measurement.test_plan import as_plain, propose_tests
from beamstiff.diagnosis.notes import in_words, notes, notes_of_verdict, order_taken
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.diagnosis.residual.screening import Screened, screen, unlikely
from beamstiff.diagnosis.residual.whitened import Whitened, whiten
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.shared_reading import shared_reading
from beamstiff.errors import BeamstiffError, UnusableError, optional
from beamstiff.identification.problem import LEAST_LOAD
from beamstiff.measure.doubts import LARGE_DISPLACEMENT, counted_once, require_usable
from beamstiff.measure.rows import in_runs, without_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.stages import stage

MOST_ROWS = 4000  # that are diagnosed: they take 3 GB and a minute, and more say hardly more
REPORTED = 8  # candidates whose held-out gap is computed
RIVALS = 3  # candidates that the next measurements are to tell apart at least
LEAST_NONE = 0.05  # probability of no cause, from which it is one of them


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


def diagnose(
    robot: Robot,
    measurements: Measurements,
    *,
    without: Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    seed: int = 0,
    stations: bool = False,
) -> Diagnosis:
    """Diagnose the gap of a robot and a table; as of `beamstiff.diagnose`."""
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices are slower on several threads
        return _diagnose(robot, measurements, Prior(tuple(without), prior or {}), seed, stations)


def _diagnose(robot: Robot, measurements: Measurements, prior: Prior, seed: int, stations: bool) -> Diagnosis:
    require_usable(measurements)
    if stations and measurements.kind != "absolute":
        raise BeamstiffError(
            f"{measurements.source}: displacements know no base frame: stations are for absolute positions"
        )
    every = counted_once(measurements)
    rows = in_runs(every, MOST_ROWS)
    said = measured_torques(robot, rows, prior)
    found = _of_rows(robot, rows, said.informed(prior), seed, stations)
    if found.verdict.key != NONE and (loaded := as_loaded(robot, rows)) is not None:
        found = _of_rows(robot, loaded[0], said.informed(prior), seed, stations)
        found = replace(found, notes=(loaded[1], *found.notes))
    found = with_next(found, seed)
    several = found.decomposition
    causes = several.every if several is not None else ()
    order = order_taken(found.baseline, {found.verdict.effect, *(one.forms[0].effect for one in causes)})
    found = replace(found, notes=(*found.notes, *said.doubts, *said.notes, *order))
    if doubt := shared_reading(found):
        found = replace(found, notes=(*found.notes, doubt))
    if len(rows) == len(every):
        return found
    sample = f"{len(rows)} of {len(every)} rows are diagnosed: ten runs of postures, spread over the table"
    return replace(found, notes=(sample, *found.notes))


def _of_rows(robot: Robot, rows: Measurements, prior: Prior, seed: int, stations: bool) -> Diagnosis:
    rows = replace(rows, wrench=np.where(np.abs(rows.wrench) > LEAST_LOAD, rows.wrench, 0.0))
    absolute = rows.kind == "absolute"
    as_calibrated, why = None, None
    try:
        if absolute:
            as_calibrated, needless = beside_calibration(robot, rows, prior, seed, stations)
            if not needless:
                return as_calibrated()
    except UnusableError:
        raise
    except BeamstiffError as error:
        if stations or rows.targets or rows.camera:  # whose readings say nothing without a calibration
            raise
        why = error
    try:  # the geometry as described
        baseline, library, screened = _screened(robot, rows, prior)
        found = _weighed_one_by_one(library, screened, prior, seed)
    except BeamstiffError as error:  # of readings in another frame that no calibration took up, say why
        raise why or error from None
    if why is not None and found.rms > LARGE_DISPLACEMENT:  # nor is the geometry near what is described
        raise why
    if as_calibrated is not None and _beyond_any_machine(found):
        return as_calibrated()
    usual = _usual_name(found)
    left = found.features["misfit"] > NOISE
    if absolute or not (left or usual) or np.unique(rows.pose).size < FOLDS:
        return found  # of fewer postures than folds those that are held out tell too little
    # neither one cause nor two, weighed in all their forms, leave but noise: more causes at once.
    # What a table states of its noise is left as it is: rows that a crowd moves look as noisy as anything
    stated = baseline if baseline.claimed else screened.baseline
    at = by_candidate(library.hypotheses)
    known: Shapes | None = {key: [library.hypotheses[k].shape for k in places] for key, places in at.items()}
    apart = Apart() if "outliers" in prior.without else places_apart(stated)
    if apart.left_out:
        stated, known = fit_baseline(robot, without_rows(rows, apart.left_out)), None
    several = decompose(robot, stated.rows, prior=prior, seed=seed, baseline=stated, known=known)
    told = several.every
    if found.verdict.key == UNKNOWN:  # what no effect of the library is says at least what it looks like
        told = (*told, *several.unmodelled)
    if not left and (several.verdict is None or several.verdict.key != usual):
        return found
    # of postures that had no say in their selection
    if told and sum(cause.closes for cause in told) >= QUARTER:
        said = notes(screened, whiten(screened.baseline, screened.used))
        return diagnosis_of(replace(several, apart=apart), tuple(said))
    return found


def _beyond_any_machine(found: Diagnosis) -> bool:
    """Return whether the verdict is one error of the geometry that is larger than those of any machine."""
    verdict = found.verdict
    return verdict.effect in OF_GEOMETRY and not all(one.plausible for one in verdict.estimates)


def _usual_name(found: Diagnosis) -> str:
    """Return the usual name of the verdict's mechanics, if it is not told beside it; mostly empty."""
    usual, *_ = same_mechanics(found.baseline.nominal).get(found.verdict.key, ("",))
    return "" if usual in (found.verdict.key, *found.indistinguishable) else usual


def _screened(robot: Robot, rows: Measurements, prior: Prior) -> tuple[Baseline, Library, Screened]:
    """Return the rows, what could be the cause, and the rows with their noise as they show it."""
    stage("fitting the stiffness")
    baseline = fit_baseline(robot, rows)
    if not baseline.used[:, :3].any():
        raise BeamstiffError(
            f"{rows.source}: no row has a measured position: the gap is one of positions (dx dy dz or x y z)"
        )
    library = build_library(baseline, whiten(baseline), prior)
    return baseline, library, screen(baseline, library)


def _weighed_one_by_one(library: Library, screened: Screened, prior: Prior, seed: int) -> Diagnosis:
    """Return the diagnosis of one cause, or two, with the geometry as it is described."""
    stage("weighing causes one by one")
    white = whiten(screened.baseline, screened.used)
    library = seen_by(library, white)
    if not library.hypotheses:
        raise BeamstiffError("no effect is left that these rows could show: measure more, or leave out fewer")
    scales = noise_prior_of(screened.baseline)
    weighed = _weigh(screened, white, library, scales, prior)
    return _diagnosis(weighed, "outliers" not in prior.without, seed)


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


def _diagnosis(weighed: Weighed, may_be_outliers: bool, seed: int) -> Diagnosis:
    screened, linear, white, found = weighed.screened, weighed.linear, weighed.white, weighed.found
    used, outlying = screened.used, screened.outliers
    best, pair = found.named[0], found.pairs[0] if found.pairs else None
    # what one cause leaves is no noise if two close it
    scale = scale_after(white, pair.shapes if pair is not None else [found.shapes[best]], weighed.scales)
    both = None
    if pair is not None and pair.log_weight - found.log_weight[best] > SECOND:
        both = held_out(linear, used, pair.shapes, scale, seed)
    shrinks = {
        key: held_out(linear, used, [found.shapes[key]], scale, seed) for key in found.named[:REPORTED]
    }
    wrong = _still_wrong(screened, linear, found.shapes[best], scale)
    odd_rows = (wrong, screened.strength, screened.isolated)
    by_load = None
    if pair is not None and both is not None and _each_posture_its_own(pair):
        single = held_out(linear, used, [found.shapes[best]], scale, seed, by_load=True)
        by_load = single, held_out(linear, used, pair.shapes, scale, seed, by_load=True)
    judged = judge(found, white.freedom, odd_rows, shrinks[best], both, may_be_outliers, by_load)
    alone = None
    if judged.also not in (None, OUTLIERS):
        alone = {
            key: shrinks.get(key) or held_out(linear, used, [found.shapes[key]], scale, seed)
            for key in (judged.verdict, judged.also)
        }
        judged = larger_first(judged, _sizes(linear, white, found, scale))
    models = _models(judged, found)
    if judged.verdict != UNKNOWN:
        scale = scale_after(white, models, weighed.scales)
    fits = tuple(fitted(linear, used, models, scale)) if models else ()
    candidates = _candidates(linear, used, found, judged, shrinks, scale)
    by_key = {one.key: one for one in candidates}
    also = _also(judged, by_key, fits)
    if len(models) == 2:
        by_key[judged.verdict] = replace(_in_fit(by_key[judged.verdict], fits[0]), shrink=both)
    verdict = by_key[judged.verdict]
    causes = explanations(linear, by_key.values(), verdict, fits if len(models) == 2 else ())
    squares = np.where(used[:, :3], (scale * linear.sigma[:, :3]) ** 2, 0.0).sum()
    attributed = attribute(white, weighed.laws, scale)
    left = [size for one in by_key.values() if one.shrink for size in (one.shrink.before, one.shrink.after)]
    fold, _ = folds(linear, used, np.random.default_rng(seed))
    left_out: list[str] = []
    near = _rivals(judged, found)
    rivals = [(key, judged.probabilities[key], found.shapes[key]) for key in near]
    hidden = []
    # states in which a cause would show, if there is one: any, for the likeliest few are so by chance
    if len(rivals) > 1 and judged.probabilities[NONE] > LEAST_NONE:
        rivals.append((NONE, judged.probabilities[NONE], []))
        others = [key for key in found.named if key not in near]
        hidden = [(key, judged.probabilities[key], found.shapes[key]) for key in others]
    test_plan = None
    with optional("what to measure next", left_out.append):
        test_plan = propose_tests(linear, used, rivals, scale, seed, hidden)
    return Diagnosis(
        baseline=screened.baseline,
        linear=linear,
        rms=shrinks[best].before,
        # no cause can be expected to leave less than all laws together, and none is better than the best
        ceiling=min(ceiling(attributed, white, fold, linear.sigma, scale), *left),
        noise=float(np.sqrt(squares / max(used[:, :3].any(axis=1).sum(), 1))),
        candidates=tuple(by_key.values()),
        verdict=verdict,
        also=also,
        indistinguishable=judged.indistinguishable,
        untestable=weighed.library.untestable,
        outliers=tuple(linear.rows.place(row) for row in outlying.tolist()),
        notes=(
            *notes(screened, white),
            *notes_of_verdict(
                screened,
                verdict.effect,
                scale,
                _off(screened, linear, models, scale) if outlying.size else None,
            ),
            *_unclear(judged),
            *_unmodelled(judged, found),
            *left_out,
        ),
        fits=fits,
        first=alone[judged.verdict] if alone else None,
        where=where(screened.baseline, used, shares(attributed, white, scale, causes, seed)),
        next=as_plain(test_plan),
        features=_features(weighed, judged, both, shrinks[best], scale),
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


def _features(
    weighed: Weighed,
    judged: Judged,
    both: HeldOutError | None,
    first: HeldOutError,
    scale: float,
) -> dict[str, float]:
    """Return what the verdict rests on, as numbers."""
    found, screened = weighed.found, weighed.screened
    best = found.named[0]
    named = judged.features
    parts = {"none": named.none, "two": named.two, "unknown": named.unknown, "of_two": named.unknown_of_two}
    return {
        **{f"{part}_{name}": value for part, terms in parts.items() for name, value in terms.items()},
        "misfit": first.misfit if judged.also in (None, OUTLIERS) or both is None else both.misfit,
        "unknown": found.log_weight[UNKNOWN] - found.log_weight[best],
        "shrink": first.shrink,
        "scale": scale,
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


def _rivals(judged: Judged, found: Search) -> list[str]:
    """Return the effects to distinguish: the likeliest few, and those that hardly are less likely."""
    odds = judged.probabilities
    named = sorted(found.named, key=lambda key: odds.get(key, 0.0), reverse=True)[:REPORTED]
    near = [key for key in named if odds.get(key, 0.0) >= SLIGHT * odds.get(named[0], 0.0)]
    return named[: max(len(near), RIVALS)]


def _candidates(
    baseline: Baseline,
    used: NDArray[np.bool_],
    found: Search,
    judged: Judged,
    shrinks: dict[str, HeldOutError],
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
