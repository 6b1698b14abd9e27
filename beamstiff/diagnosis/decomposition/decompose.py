"""The gap as an ordered list of causes and a remainder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from beamstiff.calibration.elastic import felt_names
from beamstiff.diagnosis.decomposition.answer import told, unsteady, without_rivals
from beamstiff.diagnosis.decomposition.applied import unlike_written
from beamstiff.diagnosis.decomposition.behind_gears import behind_gears, informed
from beamstiff.diagnosis.decomposition.causes import HALF, MINOR, NAMED, NOISE, QUARTER, Cause, Decomposition
from beamstiff.diagnosis.decomposition.fit import Choice, Step, build_choice, fit_step, forms_in
from beamstiff.diagnosis.decomposition.folds import Folds, folds_of
from beamstiff.diagnosis.decomposition.forms import Form, Shapes
from beamstiff.diagnosis.decomposition.loads import follows_drives, has_loads
from beamstiff.diagnosis.decomposition.mounting import other_mounting
from beamstiff.diagnosis.decomposition.nested import nested, promised
from beamstiff.diagnosis.decomposition.open_model import (
    OpenModel,
    open_as_determined,
    open_geometry,
    open_stiffness,
)
from beamstiff.diagnosis.decomposition.outlier_influence import Apart, rows_apart
from beamstiff.diagnosis.decomposition.selection import ENOUGH, select
from beamstiff.diagnosis.decomposition.settling import Settings, all_forms, settle, solution_of, unsettled
from beamstiff.diagnosis.effects.approach_direction import without_unknown
from beamstiff.diagnosis.inference.library import REVERSED, check_names
from beamstiff.diagnosis.prior import DEFAULT, Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, fitted_names
from beamstiff.errors import BeamstiffError
from beamstiff.measure.misread_columns import SHOWS
from beamstiff.measure.plausibility import LARGE_DISPLACEMENT
from beamstiff.measure.rows import without_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.stages import stage

# what of a calibration is open: all, or with few readings less, down to where the robot stands
OPEN: tuple[tuple[str, ...] | None, ...] = (None, ("base", "target", "offsets"), ("base", "target"))
CHANCE = 0.01  # of so large a residual under the stated noise, below which causes are sought
ROUNDS = 3  # of calibrating beside the causes that were found


def decompose(
    robot: Robot,
    rows: Measurements,
    *,
    prior: Prior = DEFAULT,
    seed: int = 0,
    stations: bool = False,
    baseline: Baseline | None = None,
    known: Shapes | None = None,
    opened: Sequence[tuple[str, ...] | None] = OPEN,
) -> Decomposition:
    """Return the causes of the gap between a model and rows.

    Parameters
    ----------
    robot : Robot
    rows : Measurements
        Absolute positions: geometry, base frame, reflectors and drives (`fitted_names`) are estimated with
        the causes. Displacements: the drives are.
    prior : Prior
        Of the causes.
    seed : int
        Of the folds.
    stations : bool
        Whether every table of absolute positions has a base frame of its own.
    baseline : Baseline, optional
        Of displacements, where it was fitted already.
    known : mapping of str to sequence of Shape, optional
        Shapes about this baseline that were computed already, by ``effect:component``.
    opened : sequence of groups of a calibration, or None
        What of the geometry of absolute positions is open, the first that the readings determine.

    Raises
    ------
    BeamstiffError
        See `calibrate` and `fit_baseline`.
    """
    if rows.kind != "absolute":
        model = open_stiffness(baseline or fit_baseline(robot, rows))
        return _searched(Settings(robot, None, False, prior, seed), model, all_forms(model, prior, known))
    given, drives = robot, fitted_names(robot)
    loaded = bool(drives) and bool(felt_names(robot, rows, drives))
    robot = robot.model_copy(update={"identify": drives if loaded else ()})
    stage("calibrating")
    found, settings = _beside_geometry(robot, rows, prior, seed, stations, opened, balance=False)
    if not found.every and found.gap_shows and np.isfinite(rows.rotation).any():
        found, settings = _beside_geometry(robot, rows, prior, seed, stations, opened, balance=True)
    short = _short(found)
    if not short:
        return found
    read, unknown = without_unknown(rows, short)
    lost = np.flatnonzero(unknown & rows.measured_mask.any(axis=1))
    if not lost.size or settings.parameters is not None:  # with fewer readings even less would be open
        return found
    try:
        again = decompose(given, read, prior=prior, seed=seed, stations=stations, opened=OPEN[:1])
    except BeamstiffError:
        return found
    return replace(again, first=tuple(map(rows.place, lost.tolist()))) if _short(again) else found


def _beside_geometry(
    robot: Robot,
    rows: Measurements,
    prior: Prior,
    seed: int,
    stations: bool,
    opened: Sequence[tuple[str, ...] | None],
    balance: bool,
) -> tuple[Decomposition, Settings]:
    """Return the causes of absolute positions, sought about a calibration without any, and what held for it.

    `balance`: of that calibration, see `open_geometry`.
    """
    apart, model = Apart(), None
    try:
        model, parameters = open_as_determined(robot, rows, stations, opened, balance)
        if "outliers" not in prior.without:
            apart = rows_apart(model, rows)
        bent = float(np.abs(model.baseline.gap[:, :3]).max()) > LARGE_DISPLACEMENT and not apart.left_out
    except BeamstiffError:
        bent = True
    if bent and "outliers" not in prior.without:
        # a few rows so far off bend any geometry: it is of the robot as described that they stand apart
        coarse = open_geometry(robot, rows, parameters=OPEN[-1], stations=stations)
        apart = rows_apart(coarse, rows)
    if apart.left_out or model is None:
        sound = without_rows(rows, apart.left_out)
        model, parameters = open_as_determined(robot, sound, stations, opened, balance)
    check_names(model.baseline, prior)
    forms = all_forms(model, prior)
    behind = behind_gears(model, forms, prior)
    settings = Settings(robot, parameters, stations, informed(prior, behind) if behind else prior, seed)
    forms = all_forms(model, settings.prior) if behind else forms
    found = _searched(settings, model, forms)
    mounting = other_mounting(model) if found.scatter > SHOWS else None
    return replace(found, behind=tuple(behind), apart=apart, mounting=mounting), settings


def _short(found: Decomposition) -> set[str | None]:
    """Return the joints that a decomposition names as stopping short; None: all."""
    forms = (form for cause in found.causes for form in cause.forms)
    return {form.component for form in forms if form.effect == REVERSED}


def _searched(settings: Settings, model: OpenModel, forms: Sequence[Form]) -> Decomposition:
    """Return the causes, without those that lead astray."""
    choice = build_choice(model, forms)
    folds = folds_of(model, choice, settings.seed)
    step = fit_step(choice, ())
    if _more_than_noise(choice, model, step):
        stage("selecting causes")
        step = select(choice, folds.squared_errors, exchange=False)
    doubted: list[tuple[Settings, Decomposition]] = []
    while True:
        folds, step = _calibrated_beside(settings, folds, step)
        astray = unsteady(folds, step, settings.seed)
        if not astray:
            found = _told(settings, folds, step)
            astray = {one.key for one in found.every if one.astray or one.impossible}
            doubtful = {one.key for one in found.every if _doubtful(one)}
            if model.problem is None:  # of positions see `_as_written`
                doubtful |= unsettled(found, QUARTER)
            if doubtful and not astray:
                doubted.append((settings, found))
            astray |= doubtful
        if not astray:
            return _found_again(*_explaining(settings, found, doubted))
        folds, step = _without(folds, step, astray, settings.seed)
        settings = replace(
            settings, prior=replace(settings.prior, without=(*settings.prior.without, *astray))
        )


def _explaining(
    settings: Settings, found: Decomposition, doubted: Sequence[tuple[Settings, Decomposition]]
) -> tuple[Settings, Decomposition]:
    """Return what is found without doubtful causes, or with them if that alone explains what there is.

    All but noise, or half of what is left without them. Another was likelier in the place of an error of a
    load under the loads as stated alone, linear about these: it does not do as much.
    """
    before, best = min(doubted, key=lambda one: one[1].bic, default=(settings, found))
    if not (best.scatter <= NOISE < found.scatter or best.scatter**2 < HALF * found.scatter**2):
        return settings, found
    return before, without_rivals(best, {one.key for one in best.every if _doubtful(one)})


def _doubtful(cause: Cause) -> bool:
    """Return whether a cause is an error of loads, and likelier another: nothing should be under it."""
    return has_loads(cause.forms) and cause.probability < NAMED


def _found_again(settings: Settings, found: Decomposition) -> Decomposition:
    """Return causes that are found without any tenth of the postures as well, and what they promise.

    The others are no part of the answer: what they explain remains.
    """
    forms = _fitted_forms(found)
    if not forms:
        return found
    stage("selecting causes without each tenth of the postures")
    folds, _ = settings.folds(found.calibrated, forms)
    again = nested(folds, found.every, settings.seed)
    # what an error of a load moves is a product with the drives, which a search that is linear hardly holds
    left_out = [one for one in found.every if again.hangs(one) and not has_loads(one.forms)]
    if left_out:
        rest = (*(cause for cause in found.every if cause not in left_out), *found.unmodelled)
        forms = [form for cause in rest for form in cause.forms]
        left_out = [replace(cause, found_again=again.found(cause)) for cause in left_out]
        model = settle(settings, found.calibrated, found.scatter, forms) or found.calibrated
        found = _told_of(settings, model, forms)
        found = _as_written(settings, found)
        found = replace(found, hanging=tuple(left_out))
    return promised(found, again)


def _without(folds: Folds, step: Step, astray: set[str], seed: int) -> tuple[Folds, Step]:
    """Return the fit without causes that lead astray, nor those that do so in their place: they join them.

    Nor are they among the forms any more: else they would come back for as long as no calibration is found.
    """
    new = astray
    while new:
        astray |= new
        start = [number for number in step.chosen if folds.choice.forms[number].key not in astray]
        step = select(folds.choice, folds.squared_errors, start=start, forbidden=astray, exchange=False)
        new = unsteady(folds, step, seed)
    left = [number for number, form in enumerate(folds.choice.forms) if form.key not in astray]
    folds = folds.of_forms(left)
    return folds, fit_step(folds.choice, [left.index(number) for number in step.chosen])


def _calibrated_beside(settings: Settings, folds: Folds, step: Step) -> tuple[Folds, Step]:
    """Return the causes that are selected beside the calibration beside them, and the folds of that."""
    for turn in range(ROUNDS):
        chosen = list(forms_in(folds.choice, step).values())
        if not chosen:
            break
        stage(f"calibrating beside the causes, round {turn + 1} of at most {ROUNDS}")
        try:
            model = _beside(settings, folds, step, chosen)
        except BeamstiffError:  # beside very free causes the stiffness is anything: the machine may buckle
            break
        folds, same = settings.folds(model, chosen)
        choice = folds.choice
        starts = ((), same)  # anew as well: the calibration took up a part of what is there
        fits = [select(choice, folds.squared_errors, start=one, exchange=False) for one in starts]
        # a fit that is not sound counts only where there is no sound one
        better = min([fit for fit in fits if _sound(folds, fit)] or fits[:1], key=lambda fit: fit.bic)
        # in the order of the forms: two searches that end in one fit differ by rounding alone
        step = select(choice, folds.squared_errors, start=sorted(better.chosen))
        if {choice.forms[number].key for number in step.chosen} == {form.key for form in chosen}:
            break
    return _without_needless_loads(settings, folds, step)


def _sound(folds: Folds, step: Step) -> bool:
    """Return whether causes leave no more of held-out postures than no cause does.

    About another calibration they may follow the postures that they are fitted to, and no others.
    """
    return float(folds.squared_errors(step).sum()) <= float(folds.errors_with(()).sum())


def _beside(settings: Settings, folds: Folds, step: Step, chosen: Sequence[Form]) -> OpenModel:
    """Return the open model that is calibrated beside causes, errors of loads as they settle if they do."""
    carrying = folds.carrying or folds.model
    model = settle(settings, carrying, step.scatter, chosen) if has_loads(chosen) else None
    return model or settings.calibrated(carrying, chosen, solution_of(carrying, chosen))


def _without_needless_loads(settings: Settings, folds: Folds, step: Step) -> tuple[Folds, Step]:
    """Return a fit without errors of loads that it was calibrated beside, where it is no worse so."""
    while keys := sorted({folds.choice.forms[number].key for number in folds.choice.kept}):
        fits = []
        for key in keys:
            chosen = [form for form in forms_in(folds.choice, step).values() if form.key != key]
            try:
                model = _beside(settings, folds, step, chosen)
            except BeamstiffError:
                continue
            others, same = settings.folds(model, chosen)
            fits.append((others, select(others.choice, others.squared_errors, start=same, forbidden=[key])))
        fits = [fit for fit in fits if fit[1].bic <= step.bic and _sound(*fit)]
        if not fits:
            break
        folds, step = min(fits, key=lambda fit: fit[1].bic)
    return folds, step


def _told(settings: Settings, folds: Folds, step: Step) -> Decomposition:
    """Return what the causes say, those that follow the drives on drives as these are fitted beside them.

    As far as that settles and tells the loads that they carry; anew where some of the causes that the drives
    were fitted beside are not told. Of all these fits the one counts that leaves least of held-out postures,
    among those that have settled if there are any.
    """
    found = told(folds, step, settings.seed)
    fits = [(bool(unsettled(found)), found)]
    beside = {folds.choice.forms[number].key for number in step.chosen}
    for _ in range(ROUNDS):
        # laws outside the library come in again where they are needed: they may have made up for the drives
        forms = [form for form in _fitted_forms(found) if not form.outside_library]
        settled = not fits[-1][0]
        follow = any(follows_drives(found.model, form) for form in forms)
        if settled and (not follow or {form.key for form in forms} == beside):
            break
        model = settle(settings, found.calibrated, found.scatter, forms)
        if model is None:
            break
        beside = {form.key for form in forms}
        folds, same = settings.folds(model, forms)
        step = select(folds.choice, folds.squared_errors, start=same)
        if unsteady(folds, step, settings.seed):
            break
        other = told(folds, step, settings.seed)
        fit = bool(unsettled(other)), other
        if settled and (fit[0] or other.left2 > found.left2):
            break
        found = other
        fits.append(fit)
    found = min(fits, key=lambda fit: (fit[0], fit[1].left2))[1]
    forms = _fitted_forms(found)
    loads = [form for form in forms if follows_drives(found.model, form)]
    if 0 < len(loads) < len(forms):  # the others may but make up for drives that are off
        model = settle(settings, found.calibrated, found.scatter, loads)
        if model is not None:
            folds, _ = settings.folds(model, loads)
            step = select(folds.choice, folds.squared_errors)
            better = step.bic < found.bic - ENOUGH and not unsteady(folds, step, settings.seed)
            other = told(folds, step, settings.seed) if better else found
            found = found if unsettled(other) or other.left2 > found.left2 else other
    return _as_written(settings, found)


def _as_written(settings: Settings, found: Decomposition) -> Decomposition:
    """Return causes that move the points alike as effects of a robot: errors of loads that do not settle go.

    Those that close less than the others are moved otherwise for them, the least sure first without which the
    others settle; where there is none, all. What is compliant deforms under these errors too, and each fit is
    linear about those of the one before.
    """
    while loads := [one for one in found.every if has_loads(one.forms)]:
        unlike2 = unlike_written(found) ** 2
        if unlike2 <= MINOR * found.rms**2:
            break
        loads.sort(key=lambda one: (one.named, one.probability))
        for gone in (*([one] for one in loads), loads):
            keys = {one.key for one in gone}
            forms = [form for form in _fitted_forms(found) if form.key not in keys]
            if (model := settle(settings, found.calibrated, found.scatter, forms)) is not None:
                other = _told_of(settings, model, forms)
                if other.left2 < found.left2 + unlike2:
                    found = other
                    break
        else:
            break
    return found


def _told_of(settings: Settings, model: OpenModel, forms: Sequence[Form]) -> Decomposition:
    """Return what these causes say on a model that was calibrated beside them; no other comes in."""
    folds, same = settings.folds(model, forms)
    return told(folds, fit_step(folds.choice, same), settings.seed, final=True)


def _fitted_forms(found: Decomposition) -> list[Form]:
    return [form for cause in (*found.every, *found.unmodelled) for form in cause.forms]


def _more_than_noise(choice: Choice, model: OpenModel, nothing: Step) -> bool:
    """Return whether the open model without a cause leaves more than stated noise would by chance."""
    freedom = choice.freedom - nothing.determined
    return not model.baseline.claimed or bool(stats.chi2.sf(nothing.squares, freedom) < CHANCE)
