"""The gap as an ordered list of causes and a remainder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy import stats
from scipy.special import expit

from beamstiff.diagnosis.decomposition.behind_gears import behind_gears, informed
from beamstiff.diagnosis.decomposition.causes import PRESENT, Cause, Decomposition
from beamstiff.diagnosis.decomposition.discrepancy import discrepancy_odds
from beamstiff.diagnosis.decomposition.fit import Choice, Step, build_choice, fit_step, forms_in
from beamstiff.diagnosis.decomposition.forms import Form, Shapes, by_form, forms_of, shift_of
from beamstiff.diagnosis.decomposition.held_out import (
    Folds,
    closed,
    folds_of,
    interval,
    ordered,
    unweighed,
)
from beamstiff.diagnosis.decomposition.look_alikes import instead, rival_of, with_usual_name
from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of, open_geometry, open_stiffness
from beamstiff.diagnosis.decomposition.remainder import remainder_of
from beamstiff.diagnosis.decomposition.selection import ENOUGH, gain, resampled, select
from beamstiff.diagnosis.inference.library import check_names
from beamstiff.diagnosis.prior import DEFAULT, TEMPERING, Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, fitted_names
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.stages import stage

Numbers = tuple[int, ...]  # of the forms of a cause
# what of a calibration is open: all, or with few readings less, down to where the robot stands
OPEN: tuple[tuple[str, ...] | None, ...] = (None, ("base", "target", "offsets"), ("base", "target"))
VALUES_A_PARAMETER = 2  # measured values that a geometry needs at least, to leave anything to causes
CHANCE = 0.01  # of so large a residual under the stated noise, below which causes are sought
NEGLIGIBLE = 1e-24  # m^2, of a sum of squared position errors: rounding
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
        stage("selecting causes")
        model = open_stiffness(baseline or fit_baseline(robot, rows))
        folds = folds_of(model, build_choice(model, forms_of(model, prior, known=known)), seed)
        return _told(folds, select(folds.choice, folds.squared_errors), seed)
    robot = robot.model_copy(update={"identify": fitted_names(robot)})
    stage("calibrating")
    model, parameters = _opened(robot, rows, stations, opened)
    check_names(model.baseline, prior)
    forms = forms_of(model, prior)
    behind = behind_gears(model, forms, prior)
    if behind:
        prior = informed(prior, behind)
        forms = forms_of(model, prior)
    choice = build_choice(model, forms)
    folds = folds_of(model, choice, seed)
    step = fit_step(choice, ())
    if _more_than_noise(choice, model, step):
        stage("selecting causes")
        step = select(choice, folds.squared_errors)
    for turn in range(ROUNDS):
        chosen = list(forms_in(choice, step).values())
        if not chosen:
            break
        stage(f"calibrating beside the causes, round {turn + 1} of at most {ROUNDS}")
        try:
            model = open_geometry(
                robot,
                model.baseline.rows,
                moved_by(model, chosen),
                parameters=parameters,
                stations=stations,
            )
        except BeamstiffError:  # beside very free causes the stiffness is anything: the machine may buckle
            break
        choice = build_choice(model, forms_of(model, prior))
        folds = folds_of(model, choice, seed)
        step = select(choice, folds.squared_errors)
        if {choice.forms[number].key for number in step.chosen} == {form.key for form in chosen}:
            break
    return replace(_told(folds, step, seed), behind=tuple(behind))


def _opened(
    robot: Robot, rows: Measurements, stations: bool, opened: Sequence[tuple[str, ...] | None]
) -> tuple[OpenModel, tuple[str, ...] | None]:
    """Return the open model with as much of the geometry free as the readings determine, and what that is."""
    for parameters in opened:
        model = open_geometry(robot, rows, parameters=parameters, stations=stations)
        if model.count >= VALUES_A_PARAMETER * model.determined:
            return model, parameters
    raise BeamstiffError(
        f"{rows.source}: {model.count} measured values for {model.determined:.0f} open parameters of the "
        "base frame and reflectors: measure more poses"
    )


def _more_than_noise(choice: Choice, model: OpenModel, nothing: Step) -> bool:
    """Return whether the open model without a cause leaves more than stated noise would by chance."""
    freedom = len(model.residual) - choice.open_count - nothing.determined
    return not model.baseline.claimed or bool(stats.chi2.sf(nothing.squares, freedom) < CHANCE)


def solved(model: OpenModel, chosen: Sequence[Form]) -> tuple[Array, Array]:
    """Return the open parameters and those of the causes, (t + c,), and their covariance, noise as stated.

    The causes first, of what the open parameters leave: what is all but absorbed by these stays what is known
    of it beforehand, however it is shared in the least squares solution of both.
    """
    choice = build_choice(model, chosen)
    step = fit_step(choice, range(len(chosen)))
    used = np.concatenate([step.drives, *step.free])
    size = np.concatenate([np.ones(choice.drives), *(form.sizes for form in chosen)]) / choice.units
    theta, own = np.zeros(used.size), np.zeros((used.size, used.size))
    theta[used] = step.theta
    root = np.linalg.inv(step.triangle)
    own[np.ix_(used, used)] = root @ root.T
    theta, own = theta / size, own / np.outer(size, size)
    theta[: choice.drives] -= model.present
    opened = inverse_of(model.geometry)
    toward = opened @ np.concatenate([model.drives, *(form.columns for form in chosen)], axis=1)
    change = opened @ model.residual - toward @ theta
    covariance = np.block(
        [[opened @ opened.T + toward @ own @ toward.T, -toward @ own], [-own @ toward.T, own]]
    )
    return np.concatenate([change, theta]), covariance


def moved_by(model: OpenModel, chosen: Sequence[Form]) -> Array:
    """Return what causes move the points of all rows, (N, 6), m and rad, as fitted beside what is open."""
    theta, _ = solved(model, chosen)
    return shift_of(chosen, by_form(chosen, theta[model.tangent.shape[1] :]), len(model.baseline.rows))


def gap_with(model: OpenModel, chosen: Sequence[Form]) -> Array:
    """Return measured minus predicted, (N, 6), m and rad, with some causes and all that is open fitted.

    Without a cause: what a calibration by itself leaves. 0 where nothing was measured.
    """
    columns = np.concatenate([model.tangent, *(form.columns for form in chosen)], axis=1)
    left = (model.residual - columns @ solved(model, chosen)[0])[: model.count]
    result = np.zeros(model.used.shape)
    result[model.used] = unweighed(model, left)
    return result


def _told(folds: Folds, step: Step, seed: int) -> Decomposition:
    stage("checking the causes on held-out postures")
    model, choice, least = folds.model, folds.choice, step.bic
    step, replaced = _improved(folds, with_usual_name(choice, _kept(folds, step)))
    order, errors = ordered(folds, _causes_of(choice, step))
    step = fit_step(choice, tuple(number for cause in order for number in cause))
    forms = list(forms_in(choice, step).values())
    noise2 = float((model.baseline.sigma[:, :3][model.used[:, :3]] ** 2).sum())
    total = float(errors[0].sum())
    theta, covariance = solved(model, forms)
    free = len(model.residual) - choice.open_count - step.determined
    scatter = float(np.sqrt(step.squares / max(free, 1.0)))
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * max(scatter, 1.0)
    opened = model.tangent.shape[1]
    thetas = dict(zip(step.chosen, by_form(forms, theta[opened:]), strict=True))
    stds = dict(zip(step.chosen, by_form(forms, std[opened:]), strict=True))
    explainable = max(total - noise2, NEGLIGIBLE)
    causes = {
        cause: replace(
            judged,
            theta=tuple(thetas[k] for k in cause),
            std=tuple(stds[k] for k in cause),
            closes=share,
            shown=shown / explainable,
        )
        for (cause, judged), share, shown in zip(
            _judged(folds, step, order, replaced).items(),
            closed(errors, noise2),
            _shown(folds, order),
            strict=True,
        )
    }
    order, errors = _named_first(folds, order, errors, causes, noise2)
    every = [
        replace(
            causes[cause],
            closes=share,
            closes_interval=interval(before, after, noise2, total, seed),
            rms_after=float(np.sqrt(after.sum() / folds.rows)),
        )
        for cause, share, before, after in zip(
            order, closed(errors, noise2), errors[:-1], errors[1:], strict=True
        )
    ]
    named = [cause for numbers, cause in zip(order, every, strict=True) if causes[numbers].named]
    unclear = [cause for numbers, cause in zip(order, every, strict=True) if not causes[numbers].named]
    rest = remainder_of(model, forms, theta, noise2, total, folds.rows)
    unexplained = rest.share
    if unclear:
        some = [form for cause in named for form in cause.forms]
        rest = remainder_of(model, some, solved(model, some)[0], noise2, total, folds.rows)
    return Decomposition(
        model=model,
        causes=tuple(named),
        unclear=tuple(unclear),
        remainder=rest,
        unexplained=unexplained,
        rms=float(np.sqrt(total / folds.rows)),
        noise=float(np.sqrt(noise2 / folds.rows)),
        change=theta[:opened],
        scatter=scatter,
        bic=least,
        largest=_largest(errors),
    )


def _shown(folds: Folds, order: Sequence[Numbers]) -> list[float]:
    """Return by how much each cause lowers the sum of squared position errors, m^2, in fits of fewer causes.

    With those before it, or with all others, whichever is more.
    """

    def left(causes: Sequence[Numbers]) -> float:
        fit = fit_step(folds.choice, [number for one in causes for number in one])
        return float(folds.squared_errors(fit).sum())

    along = [left(order[:count]) for count in range(len(order) + 1)]
    without = [left([one for one in order if one != cause]) for cause in order]
    return [max(a - b, other - along[-1]) for (a, b), other in zip(pairwise(along), without, strict=True)]


def _judged(
    folds: Folds, step: Step, order: Sequence[Numbers], replaced: Mapping[Numbers, Sequence[tuple[int, Step]]]
) -> dict[Numbers, Cause]:
    """Return how sure each cause of a fit is, its sizes and what it closes left open."""
    choice = folds.choice
    rivals = [rival_of(choice, step, cause, folds.squared_errors, replaced.get(cause, ())) for cause in order]
    odds = np.array(discrepancy_odds(choice, step, order, [rival.indistinguishable for rival in rivals]))
    return {
        cause: Cause(
            forms=tuple(choice.forms[number] for number in cause),
            theta=(),
            std=(),
            probability=rival.probability * float(present),
            present=float(present),
            closes=0.0,
            shown=0.0,
            closes_interval=(0.0, 0.0),
            rms_after=0.0,
            indistinguishable=rival.indistinguishable,
            rivals=tuple(choice.forms[number] for number in rival.forms),
        )
        for cause, rival, present in zip(order, rivals, expit(odds / TEMPERING), strict=True)
    }


def _named_first(
    folds: Folds,
    order: list[Numbers],
    errors: list[Array],
    causes: Mapping[Numbers, Cause],
    noise: float,
) -> tuple[list[Numbers], list[Array]]:
    """Return causes with those that are named first, and the errors (P,) along them.

    Those alone are the answer, so what each closes is what it closes beside these; but not where one of them
    helps only beside an undecided one.
    """
    first = sorted(order, key=lambda cause: not causes[cause].named)
    along = errors if first == order else folds.errors_along(first)
    count = sum(cause.named for cause in causes.values())
    if min(closed(along, noise)[:count], default=0.0) >= 0.0:
        return first, along
    return order, errors


def _kept(folds: Folds, step: Step) -> Step:
    """Return a fit without causes that are not sure enough, or that do not help on held-out postures.

    The least sure goes first; the others are judged again without it.
    """
    choice = folds.choice
    while step.chosen:
        causes = _causes_of(choice, step)
        errors = folds.squared_errors(step)
        fits = [fit_step(choice, [k for k in step.chosen if k not in cause]) for cause in causes]
        gains = [gain(folds.squared_errors(fit), errors) for fit in fits]
        sure = [rival_of(choice, step, cause).present for cause in causes]
        weak = [at for at in range(len(causes)) if sure[at] < PRESENT or gains[at] <= 0.0]
        if not weak:
            break
        step = fits[min(weak, key=lambda at: (gains[at] > 0.0, sure[at]))]
    return step


def _improved(folds: Folds, step: Step) -> tuple[Step, dict[Numbers, list[tuple[int, Step]]]]:
    """Return the fit that none is better than which lacks one of its causes, and such fits by that cause."""
    choice = folds.choice
    for _ in range(ROUNDS + 1):
        causes = _causes_of(choice, step)
        replaced = {cause: list(instead(choice, step, cause, folds.squared_errors)) for cause in causes}
        every = [found for fits in replaced.values() for _, found in fits]
        best = min(every, key=lambda found: found.bic, default=step)
        errors = folds.squared_errors(step)
        better = with_usual_name(choice, _kept(folds, best)) if best.bic <= step.bic - ENOUGH else step
        if better.bic > step.bic - ENOUGH or gain(errors, folds.squared_errors(better)) <= 0.0:
            break
        step = better
    return step, replaced


def _largest(errors: Sequence[Array]) -> float:
    """Return the share of postures drawn anew in which the first cause closes more than the second."""
    if len(errors) < 3:
        return 1.0
    first, second = errors[0] - errors[1], errors[1] - errors[2]
    return float((resampled(first - second) > 0.0).mean())


def _causes_of(choice: Choice, step: Step) -> list[Numbers]:
    """Return the forms of a fit by cause: those of one effect at one component belong together."""
    found: dict[str, list[int]] = {}
    for number in step.chosen:
        found.setdefault(choice.forms[number].key, []).append(number)
    return [tuple(numbers) for numbers in found.values()]
