"""What a selection of causes says: which are sure and named, what each closes, and what remains."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
from scipy.special import expit

from beamstiff.diagnosis.decomposition.causes import MINOR, PRESENT, Cause, Decomposition
from beamstiff.diagnosis.decomposition.discrepancy import presence_odds
from beamstiff.diagnosis.decomposition.fit import Step, fit_step, forms_in
from beamstiff.diagnosis.decomposition.folds import Folds, closed, interval, ordered
from beamstiff.diagnosis.decomposition.forms import SLIP, UNMODELLED, by_form, is_outside
from beamstiff.diagnosis.decomposition.loads import has_loads, solved_beside
from beamstiff.diagnosis.decomposition.look_alikes import (
    Rival,
    instead,
    presence,
    rival_of,
    runner_up,
    with_usual_name,
)
from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of
from beamstiff.diagnosis.decomposition.remainder import Remainder, remainder_of
from beamstiff.diagnosis.decomposition.selection import (
    ENOUGH,
    FORMS,
    TRIED,
    best_first,
    causes_of,
    gain,
    resampled,
    with_further_forms,
)
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.prior import TEMPERING, key_of
from beamstiff.se3 import Array
from beamstiff.stages import stage

Numbers = tuple[int, ...]  # of the forms of a cause
# causes in order, the errors (P,) along them, what each shows, and those that cancel others
Told = tuple[list[Numbers], list[Array], list[float], list[Numbers]]
NEGLIGIBLE = 1e-24  # m^2, of a sum of squared position errors: rounding
SIMPLER = 0.5  # parameters fewer, of which priors take up fractions
ROUNDS = 4  # of putting a better fit in the place of one


def told(folds: Folds, step: Step, seed: int, final: bool = False) -> Decomposition:
    """Return the decomposition that a selection of causes says; `seed` of the intervals.

    `final`: whether no cause is exchanged for others any more.
    """
    stage("checking the causes on held-out postures")
    model, choice, bic = folds.model, folds.choice, step.bic
    step, replaced = without_weak(folds, step), dict[Numbers, list[tuple[int, Step]]]()
    if not final:
        step, replaced = _improved(folds, with_usual_name(choice, step))
        likelier = _with_likelier(folds, step, replaced)
        if likelier is not step:
            step, replaced = likelier, _replaced(folds, likelier)
    noise2 = _noise2(model)
    order, errors, shown = _without_cancelling(folds, step, noise2)
    step = fit_step(choice, tuple(number for cause in order for number in cause))
    forms = list(forms_in(choice, step).values())
    total = float(errors[0].sum())
    theta, covariance = solved_beside(folds.carrying or model, forms)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * max(step.scatter, 1.0)
    opened = model.tangent.shape[1]
    thetas = dict(zip(step.chosen, by_form(forms, theta[opened:]), strict=True))
    stds = dict(zip(step.chosen, by_form(forms, std[opened:]), strict=True))
    shares = closed(errors, noise2)
    slips = sum(
        share for cause, share in zip(order, shares, strict=True) if choice.forms[cause[0]].effect == SLIP
    )
    least = MINOR * float(np.clip(1.0 - slips, MINOR, 1.0))
    causes = {
        cause: replace(
            judged,
            least=least,
            theta=tuple(thetas[k] for k in cause),
            std=tuple(stds[k] for k in cause),
            closes=share,
            shown=own,
        )
        for (cause, judged), share, own in zip(
            _judged(folds, step, order, replaced).items(), shares, shown, strict=True
        )
    }
    order, errors = _named_first(folds, order, errors, causes, noise2)
    astray = _astray(folds, order, errors, noise2, seed)
    every = [
        replace(
            causes[cause],
            closes=share,
            closes_interval=interval(before, after, errors[0], noise2, seed),
            rms_after=float(np.sqrt(after.sum() / folds.rows)),
            astray=cause in astray,
        )
        for cause, share, before, after in zip(
            order, closed(errors, noise2), errors[:-1], errors[1:], strict=True
        )
    ]
    parts: list[list[Cause]] = [[], [], []]
    for numbers, cause in zip(order, every, strict=True):
        parts[_rank(causes[numbers])].append(cause)
    named, unclear, unmodelled = parts
    named = [
        cause if cause.indistinguishable else replace(cause, runner_up=runner_up(folds, step, cause.key))
        for cause in named
    ]
    rest = _rest(model, [*named, *unclear], noise2, total, folds.rows)
    unexplained = rest.share
    if unclear:
        rest = _rest(model, named, noise2, total, folds.rows)
    return Decomposition(
        model=model,
        causes=tuple(named),
        unclear=tuple(unclear),
        unmodelled=tuple(unmodelled),
        remainder=rest,
        unexplained=unexplained,
        rms=float(np.sqrt(total / folds.rows)),
        noise=float(np.sqrt(noise2 / folds.rows)),
        # errors of loads were fitted on these drives: they are no others beside laws that the robot will lack
        change=theta[:opened] + (0.0 if has_loads(forms) else _taken_up(model, unmodelled)),
        scatter=step.scatter,
        bic=bic,
        largest=_largest(errors),
        carrying=folds.carrying,
    )


def without_rivals(found: Decomposition, keys: Collection[str]) -> Decomposition:
    """Return the decomposition in which nothing else is likely in the place of some of its causes."""
    every = [
        replace(one, probability=one.present, indistinguishable=(), rivals=()) if one.key in keys else one
        for one in found.every
    ]
    return naming(found, [one for one in every if one.named], [one for one in every if not one.named])


def naming(found: Decomposition, named: Sequence[Cause], unclear: Sequence[Cause]) -> Decomposition:
    """Return the decomposition in which some causes are named, and others are not: they are left over."""
    rows = int(found.model.used[:, :3].any(axis=1).sum())
    rest = _rest(found.model, named, rows * found.noise**2, rows * found.rms**2, rows)
    return replace(found, causes=tuple(named), unclear=tuple(unclear), remainder=rest)


def unsteady(folds: Folds, step: Step, seed: int) -> set[str]:
    """Return causes of a selection that may make postures worse which were held out, ``effect:component``."""
    order, errors = ordered(folds, causes_of(folds.choice, step))
    astray = _astray(folds, order, errors, _noise2(folds.model), seed)
    return {folds.choice.forms[cause[0]].key for cause in astray}


def _astray(
    folds: Folds, order: Sequence[Numbers], errors: Sequence[Array], noise2: float, seed: int
) -> set[Numbers]:
    """Return causes that may make postures worse which were held out: by their 90 % interval.

    They close much on the average of few postures, and little or less than nothing on most of them: after
    those before them, and beside all others. Causes that share what they move take it from one another.
    """
    found = set()
    told = zip(order, closed(errors, noise2), errors[:-1], errors[1:], strict=True)
    for cause, share, before, after in told:
        if share < MINOR or interval(before, after, errors[0], noise2, seed)[0] >= 0.0:
            continue
        others = folds.errors_with([number for one in order if one != cause for number in one])
        if interval(others, errors[-1], errors[0], noise2, seed)[0] < 0.0:
            found.add(cause)
    return found


def _noise2(model: OpenModel) -> float:
    """Return what noise alone would add to the sum of squared position errors, m^2."""
    return float((model.baseline.sigma[:, :3][model.used[:, :3]] ** 2).sum())


def _without_cancelling(
    folds: Folds, step: Step, noise2: float
) -> tuple[list[Numbers], list[Array], list[float]]:
    """Return causes in order, the errors (P,) along them, and what share of the gap each shows.

    Of several that cancel one another some close less than nothing, and a fit without one is hardly worse:
    what it does the others do too; or some of them leave more than there is without any cause. The one goes
    without which the others do not cancel, that is missed least if there are several; where there is none,
    the one of the cancelling that is missed least, and so on. Another form may do what it did.
    """
    order, errors, shown, cancelling = _cancelling(folds, step, noise2)
    while cancelling:
        missed = [order[at] for at in np.argsort(shown).tolist() if not folds.choice.keeps(order[at])]
        for gone in missed:
            without = fit_step(folds.choice, [number for number in step.chosen if number not in gone])
            told = _cancelling(folds, without, noise2)
            if not told[-1]:
                return (_in_place_of(gone, folds, without, noise2) or told)[:3]
        least = next(cause for cause in missed if cause in cancelling)
        step = fit_step(folds.choice, [number for number in step.chosen if number not in least])
        order, errors, shown, cancelling = _cancelling(folds, step, noise2)
    return order, errors, shown


def _in_place_of(gone: Numbers, folds: Folds, without: Step, noise2: float) -> Told | None:
    """Return what `_cancelling` says of a fit with the best other form in place of one that cancelled causes.

    None where none helps that does not cancel them too: what it did the others do.
    """
    for _, new in islice(best_first(folds.choice, without, limit=without.bic - ENOUGH), TRIED):
        other = fit_step(folds.choice, (*without.chosen, new))
        if new not in gone and gain(folds.squared_errors(without), folds.squared_errors(other)) > 0.0:
            told = _cancelling(folds, other, noise2)
            if not told[-1]:
                return told
    return None


def _cancelling(folds: Folds, step: Step, noise2: float) -> Told:
    """Return the order of causes, the errors along it, what each shows, and those that cancel others."""
    order, errors = ordered(folds, causes_of(folds.choice, step))
    explainable = max(float(errors[0].sum()) - noise2, NEGLIGIBLE)
    shown = [own / explainable for own in _shown(folds, order)]
    shares = closed(errors, noise2)
    free = {at for at, cause in enumerate(order) if not folds.choice.keeps(cause)}
    negative = {at for at in free if shares[at] <= -MINOR}
    cancelling = {at for at in free if shown[at] < MINOR <= abs(shares[at])}
    if max(error.sum() for error in errors) > errors[0].sum():
        cancelling |= negative
    return order, errors, shown, [order[at] for at in sorted(cancelling)] if negative else []


def _rank(cause: Cause) -> int:
    """Return 0 for a cause that is named, 1 for one that is undecided, 2 for an unmodelled law."""
    return 0 if cause.named else 2 if cause.outside_library else 1


def _rest(model: OpenModel, causes: Sequence[Cause], noise2: float, total: float, rows: int) -> Remainder:
    forms = [form for cause in causes for form in cause.forms]
    return remainder_of(model, forms, solved(model, forms)[0], noise2, total, rows)


def _taken_up(model: OpenModel, unmodelled: Sequence[Cause]) -> Array:
    """Return what the open parameters (t,) take up of laws that the robot as written will lack."""
    moved = [law.moved for law in unmodelled if law.nameless and not law.past]
    if not moved:
        return np.zeros(model.tangent.shape[1])
    return np.asarray(inverse_of(model.tangent) @ np.sum(moved, axis=0))


def _shown(folds: Folds, order: Sequence[Numbers]) -> list[float]:
    """Return by how much each cause lowers the sum of squared position errors, m^2, in fits of fewer causes.

    With those before it, or with all others, whichever is more.
    """

    def left(causes: Sequence[Numbers]) -> float:
        return float(folds.errors_with([number for one in causes for number in one]).sum())

    along = [left(order[:count]) for count in range(len(order) + 1)]
    without = [left([one for one in order if one != cause]) for cause in order]
    return [max(a - b, other - along[-1]) for (a, b), other in zip(pairwise(along), without, strict=True)]


def _judged(
    folds: Folds, step: Step, order: Sequence[Numbers], replaced: Mapping[Numbers, Sequence[tuple[int, Step]]]
) -> dict[Numbers, Cause]:
    """Return how sure each cause of a fit is, its sizes and what it closes left open."""
    choice, forms = folds.choice, forms_in(folds.choice, step)
    rivals = [_rival_of(folds, step, cause, replaced.get(cause, ())) for cause in order]
    alike = [rival.indistinguishable for rival in rivals]
    odds = np.array(presence_odds(choice, order, alike))
    if folds.stated is not None:  # without errors of loads what is compliant is not under them either
        kept = np.array([choice.keeps(cause) for cause in order], dtype=bool)
        odds[kept] = np.array(presence_odds(folds.stated.choice, order, alike))[kept]
    return {
        cause: Cause(
            forms=tuple(forms[number] for number in cause),
            theta=(),
            std=(),
            probability=rival.probability * float(present),
            present=float(present),
            closes=0.0,
            shown=0.0,
            closes_interval=(0.0, 0.0),
            rms_after=0.0,
            indistinguishable=_in_library(rival.indistinguishable),
            rivals=tuple(choice.forms[k] for k in rival.forms if not choice.forms[k].outside_library),
        )
        for cause, rival, present in zip(order, rivals, expit(odds / TEMPERING), strict=True)
    }


def _rival_of(folds: Folds, step: Step, cause: Numbers, replaced: Sequence[tuple[int, Step]]) -> Rival:
    """Return how sure a cause is, the error of a load among all causes under loads as stated."""
    if folds.stated is not None and folds.choice.keeps(cause):
        folds = folds.stated
        step = fit_step(folds.choice, step.chosen)
    return rival_of(folds.choice, step, cause, folds.squared_errors, replaced)


def _in_library(keys: Sequence[str]) -> tuple[str, ...]:
    """Return causes with those that no effect of the library has as one: unknown."""
    unknown = key_of(UNMODELLED, None)
    return tuple(dict.fromkeys(unknown if is_outside(key.partition(":")[0]) else key for key in keys))


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
    first = sorted(order, key=lambda cause: _rank(causes[cause]))
    along = errors if first == order else folds.errors_along(first)
    count = sum(cause.named for cause in causes.values())
    if min(closed(along, noise)[:count], default=0.0) >= 0.0:
        return first, along
    return order, errors


def without_weak(folds: Folds, step: Step) -> Step:
    """Return a fit without causes that are not sure enough, or that do not help on held-out postures.

    The least sure goes first; the others are judged again without it. One without which others would have a
    size that no machine has stays.
    """
    choice = folds.choice
    while step.chosen:
        causes = causes_of(choice, step)
        errors = folds.squared_errors(step)
        fits = [fit_step(choice, [k for k in step.chosen if k not in cause]) for cause in causes]
        gains = [gain(folds.squared_errors(fit), errors) for fit in fits]
        sure = [presence(step, fit) for fit in fits]
        weak = [
            at
            for at, fit in enumerate(fits)
            if (sure[at] < PRESENT or gains[at] <= 0.0)
            and np.isfinite(fit.bic)
            and not choice.keeps(causes[at])
        ]
        if not weak:
            break
        step = fits[min(weak, key=lambda at: (gains[at] > 0.0, sure[at]))]
    return step


def _improved(folds: Folds, step: Step) -> tuple[Step, dict[Numbers, list[tuple[int, Step]]]]:
    """Return the fit that none is better than which lacks one of its causes, and such fits by that cause."""
    choice = folds.choice
    for _ in range(ROUNDS):
        replaced = _replaced(folds, step)
        every = [found for fits in replaced.values() for _, found in fits]
        best = min(every, key=lambda found: found.bic, default=step)
        better = with_usual_name(choice, without_weak(folds, best)) if best.bic <= step.bic - ENOUGH else step
        if better.bic > step.bic - ENOUGH or not _no_worse(folds, step, better):
            break
        step = better
    return step, replaced


def _replaced(folds: Folds, step: Step) -> dict[Numbers, list[tuple[int, Step]]]:
    """Return by each cause that may go the fits without it, the others selected anew."""
    causes = [cause for cause in causes_of(folds.choice, step) if not folds.choice.keeps(cause)]
    return {cause: list(instead(folds.choice, step, cause, folds.squared_errors)) for cause in causes}


def _with_likelier(folds: Folds, step: Step, replaced: Mapping[Numbers, Sequence[tuple[int, Step]]]) -> Step:
    """Return a fit in which an effect of the library stands for a law outside it that is less likely.

    Less likely than all of the library that would do in its place: of these the likeliest stands for all.
    """
    choice = folds.choice
    for cause in causes_of(choice, step):
        if not choice.forms[cause[0]].outside_library:
            continue
        rival = _rival_of(folds, step, cause, replaced.get(cause, ()))
        others = tuple(k for k in step.chosen if k not in cause)
        taken = {choice.forms[k].key for k in others}
        form = next((k for k in rival.forms if not choice.forms[k].outside_library), None)
        if form is None or choice.forms[form].key in taken or rival.in_library <= rival.probability:
            continue
        same = choice.of_cause[choice.forms[form].key]
        other = with_further_forms(choice, fit_step(choice, (*others, form)), same, FORMS)
        return _with_likelier(folds, without_weak(folds, other), {})
    return step


def _no_worse(folds: Folds, step: Step, other: Step) -> bool:
    """Return whether another fit helps on held-out postures; if it is simpler, whether it does no harm."""
    errors, of_other = folds.squared_errors(step), folds.squared_errors(other)
    if other.determined < step.determined - SIMPLER:
        return gain(of_other, errors) <= 0.0
    return gain(errors, of_other) > 0.0


def _largest(errors: Sequence[Array]) -> float:
    """Return the share of postures drawn anew in which the first cause closes more than the second."""
    if len(errors) < 3:
        return 1.0
    first, second = errors[0] - errors[1], errors[1] - errors[2]
    return float((resampled(first - second) > 0.0).mean())
