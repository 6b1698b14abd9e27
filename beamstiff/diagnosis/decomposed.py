"""A diagnosis whose causes come from a decomposition: verdict, candidates and places."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.decision.where import where
from beamstiff.diagnosis.decomposition.answer import naming
from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.decomposition.fit import build_choice
from beamstiff.diagnosis.decomposition.folds import folds_of
from beamstiff.diagnosis.decomposition.forms import OF_GEOMETRY, forms_of
from beamstiff.diagnosis.decomposition.open_model import open_stiffness
from beamstiff.diagnosis.decomposition.plain_data import parameters_of
from beamstiff.diagnosis.decomposition.selection import select
from beamstiff.diagnosis.decomposition.solution import gap_with
from beamstiff.diagnosis.decomposition.unmodelled import unmodelled_forms
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.frame_misalignment import PLACED_SHIFT, PLACED_TURN
from beamstiff.diagnosis.effects.tool_offset import PLACED
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.library import Untestable, nowhere
from beamstiff.diagnosis.misread_loads import misread_loads
from beamstiff.diagnosis.next_measurement.between_causes import propose_between
from beamstiff.diagnosis.next_measurement.test_plan import as_plain
from beamstiff.diagnosis.notes import OF_ALL_AXES, SURE, chosen_for, in_words, unloaded
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.recalibration import unlike
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.residual.outlier_screening import SILENCE
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import BeamstiffError, UnusableError, listed, optional
from beamstiff.measure.misread_columns import NEARER
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.measure.rows import without_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import vector_from_rotation
from beamstiff.stages import stage

AS_DESCRIBED = 2.0  # times the noise, where a calibration leaves but noise: forms of causes are not exact
OWN_FRAME = 20.0  # times a middling misalignment: twice the largest realistic one
SINGLE_ERRORS = 2  # of a geometry as described: its causes come alone or in pairs
STEADIER = 0.7  # of the stated noise, below which what is stated is doubted
LEAST_UNKNOWN = 0.02  # probability that a cause outside the library stands in for the verdict


def beside_calibration(
    robot: Robot, rows: Measurements, prior: Prior, seed: int, stations: bool = False
) -> tuple[Callable[[], Diagnosis], bool]:
    """Return what makes the diagnosis of absolute readings with all that a calibration fits left open.

    And whether it is needless: whether causes, a few errors of the geometry among them, leave hardly more
    without a calibration. Then the geometry is what the robot's description says.

    Raises BeamstiffError where there are too few readings to calibrate by, or the robot has effects;
    UnusableError where the loads are other than the table states, or gravity than the robot file does.
    """
    found = decompose(robot, rows, prior=prior, seed=seed, stations=stations)
    if (doubt := misread_loads(found.model)) and not unlike(found):
        raise UnusableError(doubt)
    if (mounting := found.mounting) is not None:
        left = mounting.left  # without a cause; where that is more, with those that are found under it
        if left >= found.scatter:
            there = robot.model_copy(update={"gravity": mounting.gravity})
            left = decompose(there, rows, prior=prior, seed=seed, stations=stations).scatter / NEARER
        if left < found.scatter:
            raise UnusableError(f"{robot.name}: {mounting.text}")
    told = tuple(chosen_for(robot))
    rows = without_rows(rows, found.apart.left_out)
    # what the tables hold in frames of their own has no geometry as described, nor has a calibrated robot
    needless = False
    if not (stations or robot.calibrated or found.behind):
        if rows.targets or rows.camera:
            found = _simplest(found, robot, rows, prior, seed)
        elif not (_in_own_frame(found, rows) or _reflectors_elsewhere(found, robot, rows)):
            needless = _needless(found, robot, rows, prior, seed)
    return (lambda: diagnosis_of(found, told)), needless


def _needless(found: Decomposition, robot: Robot, rows: Measurements, prior: Prior, seed: int) -> bool:
    """Return whether causes leave hardly more with the geometry as described than beside a calibration."""
    try:
        closed = open_stiffness(fit_baseline(robot, rows))
    except BeamstiffError:  # stiffness that makes up for the geometry may let the machine buckle
        return False
    found_here = {form.effect for cause in (*found.every, *found.unmodelled) for form in cause.forms}
    forms = forms_of(closed, prior, {*OF_GEOMETRY, *found_here})
    choice = build_choice(closed, [*forms, *(unmodelled_forms(closed) if found.unmodelled else ())])
    # more forms than one cause, or two, and these errors are no geometry as described, whatever they leave
    step = select(choice, folds_of(closed, choice, seed).squared_errors, most=2 * (SINGLE_ERRORS + 2))
    freedom = max(choice.freedom - step.determined, 1.0)
    left = float(np.sqrt(step.squares / freedom))
    errors = sum(choice.forms[number].effect in OF_GEOMETRY for number in step.chosen)
    return _leaves_no_more(left, step.determined, found) and errors <= SINGLE_ERRORS


def _in_own_frame(found: Decomposition, rows: Measurements) -> bool:
    """Return whether the readings are in a frame that nobody meant to be the robot's base frame."""
    there = found.model.baseline.rows.position
    whole = ~np.isnan(rows.position + there).any(axis=1)
    motion = fit_rigid_motion(there[whole], rows.position[whole])
    turn = np.linalg.norm(vector_from_rotation(motion.rotation))
    shift = np.linalg.norm(motion.translation)
    return bool(turn > OWN_FRAME * PLACED_TURN or shift > OWN_FRAME * PLACED_SHIFT)


def _reflectors_elsewhere(found: Decomposition, robot: Robot, rows: Measurements) -> bool:
    """Return whether a reflector is not where it is described, by more than one whose place was measured.

    Nothing of the robot is wrong then, but an error of its geometry may look like that. The TCP is no
    reflector that was put on: where it is, is known.
    """
    models = robot, found.model.baseline.robot
    described, there = ({node.name: node for node in one.nodes} for one in models)
    put_on = {*rows.point.tolist()} - {robot.tcp}
    moved = [np.subtract(there[name].at, described[name].at) for name in put_on if name in there]
    return any(np.linalg.norm(by) > 2.0 * PLACED for by in moved)


def _leaves_no_more(left: float, determined: float, found: Decomposition) -> bool:
    """Return whether a geometry as described leaves hardly more than a calibration, `left` times the noise.

    More by what forms of causes are not exact, or by no more than its fewer parameters are worth (BIC). A
    machine may scatter far beside what its instrument reads to: twice that is nothing to be left.
    """
    scatter = max(found.scatter, 1.0)
    fewer = found.model.determined - determined
    worth = np.exp(max(fewer, 0.0) * np.log(found.model.count) / (2.0 * found.model.count))
    return left < max(float(np.sqrt(scatter**2 + AS_DESCRIBED**2 - 1.0)), scatter * float(worth))


def _simplest(
    found: Decomposition, robot: Robot, rows: Measurements, prior: Prior, seed: int
) -> Decomposition:
    """Return the decomposition with the geometry as described, but for set-ups, if it leaves no more."""
    opened = (("base",),) if rows.camera else ((),)
    try:
        closed = decompose(robot, rows, prior=prior, seed=seed, opened=opened)
    except BeamstiffError:  # nothing of the set-ups is open, or the machine may buckle
        return found
    forms = [form for cause in closed.every for form in cause.forms]
    errors = sum(form.effect in OF_GEOMETRY for form in forms)
    needless = errors <= SINGLE_ERRORS and _leaves_no_more(closed.scatter, closed.model.determined, found)
    return closed if needless else found


def diagnosis_of(found: Decomposition, notes: tuple[str, ...] = ()) -> Diagnosis:
    """Return the diagnosis that a decomposition says; of another robot's readings, none."""
    found = _told_alone(found)
    if doubt := unlike(found):
        found, notes = naming(found, (), found.every), (doubt, *notes)  # of another robot nothing is named
    verdict = found.verdict
    baseline = found.model.baseline  # its geometry was fitted beside the causes; nobody has such a model
    calibrated = replace(baseline, measured=baseline.predicted + gap_with(found.model, ()))
    candidates = _candidates(found)
    named = next(one for one in candidates if one.key == (verdict.key if verdict else _nothing(found)))
    return Diagnosis(
        baseline=baseline,
        linear=baseline,
        rms=found.rms,
        noise=found.noise,
        candidates=candidates,
        verdict=named,
        also=None,
        indistinguishable=verdict.indistinguishable if verdict else (),
        untestable=_untestable(found),
        outliers=found.apart.left_out,
        notes=(
            *notes,
            *unloaded(baseline),
            *((found.mounting.text,) if found.mounting else ()),
            *_overclaimed(found),
            *_left_out(found),
            *(one.text for one in found.behind),
        ),
        fits=(),
        ceiling=min([found.rms, found.remainder.rms, *(cause.rms_after for cause in found.written)]),
        where=where(calibrated, baseline.used, _components(found)),
        features={"scatter": found.scatter, "bic": found.bic, "closes": found.closes},
        decomposition=found,
    )


def _overclaimed(found: Decomposition) -> Iterator[str]:
    """Yield that the readings scatter less than stated, by more than chance does."""
    own = sum(theta.size for cause in (*found.every, *found.unmodelled) for theta in cause.theta)
    freedom = max(found.model.count - found.model.determined - own, 1.0)
    by_chance = float(chi2.cdf(found.scatter**2 * freedom, freedom))
    if found.model.baseline.claimed and found.scatter < STEADIER and by_chance < SURE:
        asks = f", which counts per axis: {OF_ALL_AXES}" if found.scatter >= SILENCE else ""
        yield f"the readings scatter by {found.scatter:.2g} times the stated noise{asks}"


def _left_out(found: Decomposition) -> Iterator[str]:
    if found.apart.left_out:
        yield (
            f"left out: {listed(found.apart.said, 6)}. The model that all other readings determine predicts "
            "these elsewhere: correct the table, or measure them again"
        )
    if found.apart.doubtful:
        yield f"{found.apart.doubtful}. Is the table right there?"
    if found.first:
        yield (
            f"left out: {listed(found.first, 6)}: the rows do not say from which side the joints came. To "
            "use them, put a row before them: joint values and time of the previous posture, no reading"
        )
    if found.hanging:
        names = [in_words([cause.key]) for cause in found.hanging]
        yield (
            f"not named as a cause: {listed(names, 6)}: repeated without a tenth of the postures each time, "
            "the search mostly does not find this. Measure more postures"
        )


def _told_alone(found: Decomposition) -> Decomposition:
    """Return a decomposition whose causes leave what those that are told leave, without laws between them.

    The robot as it is written lacks laws that no effect has, and what a cause closes is beside these.
    """
    explainable, left = found.rms**2 - found.noise**2, found.rms**2
    parts: list[tuple[Cause, ...]] = []
    for part in (found.causes, found.unclear):
        closes = np.cumsum([cause.closes for cause in part])
        after = np.sqrt(np.maximum(left - max(explainable, 0.0) * closes, 0.0))
        parts.append(tuple(replace(one, rms_after=float(rms)) for one, rms in zip(part, after, strict=True)))
        left = float(after[-1]) ** 2 if len(part) else left
    return replace(found, causes=parts[0], unclear=parts[1])


def with_next(result: Diagnosis, seed: int) -> Diagnosis:
    """Return a diagnosis with the states that would tell its several causes from others best."""
    found, left_out, test_plan = result.decomposition, list[str](), None
    if found is None or found.model.baseline.rows.camera:  # where it sees the tag is not known
        return result
    stage("choosing what to measure next")
    with optional("what to measure next", left_out.append):
        test_plan = propose_between(found, seed)
    return replace(result, next=as_plain(test_plan), notes=(*result.notes, *left_out))


def estimates_of_cause(cause: Cause) -> tuple[Estimate, ...]:
    """Return the parameters of a cause; of a target, where it slipped and how far."""
    return tuple(
        Estimate(name, value, std, item.unit, realistic, item.positive)
        for name, item, value, std, realistic in parameters_of(cause)
    )


def cause_candidate(cause: Cause) -> Candidate:
    """Return a cause by itself: how sure it is, and its sizes."""
    form = cause.forms[0]
    estimates = estimates_of_cause(cause)
    return Candidate(form.effect, form.component, cause.probability, cause.shape, estimates)


def _nothing(found: Decomposition) -> str:
    return "unknown:null" if found.gap_shows else "none:null"


def _candidates(found: Decomposition) -> tuple[Candidate, ...]:
    """Return causes, `none` and `unknown` with probabilities that sum to 1, the likeliest first.

    The first cause is the verdict's competitor; the remainder's share is the unknown's.
    """
    if not found.causes:
        shows = found.gap_shows
        likely, rest = ("unknown", "none") if shows else ("none", "unknown")
        return (Candidate(likely, None, 0.95), Candidate(rest, None, 0.05))
    first = found.causes[0]
    sure = found.verdict is not None
    unknown = max(LEAST_UNKNOWN, min(found.unexplained, 0.9)) if sure else max(0.5, 1.0 - first.closes)
    share = first.probability * found.largest if sure else 1.0
    alike = list(first.indistinguishable) or [cause.key for cause in found.causes[1:]]
    weights = {first.key: share, **dict.fromkeys(alike, (1.0 - share) / max(len(alike), 1))}
    total = sum(weights.values())
    entries = {key: (1.0 - unknown) * weight / total for key, weight in weights.items()}
    entries["unknown:null"], entries["none:null"] = unknown + entries.pop("unknown:null", 0.0), 0.0
    told = {cause.key: cause for cause in found.causes}
    result = []
    for key in sorted(entries, key=lambda key: -entries[key]):
        effect, _, component = key.partition(":")
        cause = told.get(key)
        result.append(
            Candidate(
                effect=effect,
                component=None if component == "null" else component,
                probability=entries[key],
                shape=cause.shape if cause else "",
                estimates=estimates_of_cause(cause) if cause else (),
                shrink=_shrink(found, cause) if cause else None,
            )
        )
    return tuple(result)


def _shrink(found: Decomposition, cause: Cause) -> HeldOutError:
    low, high = (float(np.clip(value, 0.0, 1.0)) for value in cause.closes_interval)
    return HeldOutError(
        before=found.rms,
        after=cause.rms_after,
        shrink=float(np.clip(cause.closes, 0.0, 1.0)),
        interval=(low, high),
        postures=len(np.unique(found.model.pose)),
        noise=found.noise,
    )


def _components(found: Decomposition) -> list[dict[str, Any]]:
    """Return the share of the explainable gap at each component: of the causes that sit there."""
    shares: dict[str, list[float]] = {}
    for cause in found.causes:
        form = cause.forms[0]
        for place in EFFECTS[form.effect].places(form.component):
            low, high = cause.closes_interval
            before = shares.setdefault(place or form.effect, [0.0, 0.0, 0.0])
            for at, value in enumerate((cause.closes, low, high)):
                before[at] += value / len(EFFECTS[form.effect].places(form.component))
    ordered = sorted(shares.items(), key=lambda item: -item[1][0])
    return [
        {"component": name, "share": float(np.clip(share, 0, 1)), "interval": [max(low, 0.0), min(high, 1.0)]}
        for name, (share, low, high) in ordered
    ]


def _untestable(found: Decomposition) -> tuple[Untestable, ...]:
    return tuple(_hidden(found))


def _hidden(found: Decomposition) -> Iterator[Untestable]:
    baseline = found.model.baseline
    for effect in EFFECTS.values():
        if effect.name != "outliers" and not effect.outside and not effect.components(baseline):
            yield Untestable(effect.name, None, nowhere(effect.name, baseline))
