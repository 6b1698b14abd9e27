"""How sure a cause is: what the fit would be with another in its place, and without it.

What stands in for a cause alone is found by exchanging its form. What stands in for it together with others,
which look after what the first leaves, is found by selecting anew with the cause forbidden. Forms of causes
are not exact: what they leave of what they should explain grows with it. So a difference D of the criterion
counts ``D / (2 (T + E / R))``, E half the fall that the cause is worth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.causes import MINOR, RunnerUp
from beamstiff.diagnosis.decomposition.fit import Choice, Step, bic, fit_step, impossible, prior_of
from beamstiff.diagnosis.decomposition.folds import Folds
from beamstiff.diagnosis.decomposition.forms import UNMODELLED, Form
from beamstiff.diagnosis.decomposition.open_model import orthonormal
from beamstiff.diagnosis.decomposition.selection import (
    ENOUGH,
    FORMS,
    HeldOut,
    best_first,
    causes_of,
    gain,
    select,
    with_further_forms,
)
from beamstiff.diagnosis.inference.library import ALL_DRIVES, ALL_REVERSED, REVERSED
from beamstiff.diagnosis.prior import RELATIVE, TEMPERING, key_of
from beamstiff.se3 import Array

MOST_RIVALS = 12  # that are looked at: the best by the criterion
MOST = 0.5  # of the squares that a cause moves: what another has to do of it
RANK = 1e-6  # of the largest singular value: what is less is rounding
PLAUSIBLE = 0.05  # of the likeliest: less is told from it
MOST_LOG_ODDS = 690.0  # of which the exponential is finite
SEARCHES = 3  # for what explains the rows without a cause


@dataclass(frozen=True)
class Rival:
    """How sure a cause is.

    Attributes
    ----------
    probability : float
        Of this cause, against others in its place and against none.
    present : float
        Of any cause in its place.
    indistinguishable : tuple of str
        Causes that explain the rows nearly as well in its place, or may do most of what it does beside it.
    forms : tuple of int
        Numbers of the best form of each of these that has one.
    in_library : float
        Probability of effects of the library in its place, together.
    """

    probability: float
    present: float
    indistinguishable: tuple[str, ...]
    forms: tuple[int, ...]
    in_library: float


def rival_of(
    choice: Choice,
    step: Step,
    cause: tuple[int, ...],
    held_out: HeldOut,
    replaced: Sequence[tuple[int, Step]] = (),
) -> Rival:
    """Return how sure a cause of a fit is.

    Parameters
    ----------
    choice : Choice
    step : Step
    cause : tuple of int
        Its forms.
    held_out : function
        Forms of others count only where they help on held-out postures.
    replaced : sequence of (int, Step)
        What others selected anew make of the fit, `instead`.
    """
    own = choice.forms[cause[0]].key
    others = tuple(number for number in step.chosen if number not in cause)
    taken = {choice.forms[number].key for number in others}
    without = fit_step(choice, others)
    best: dict[str, float] = {own: step.bic, "none:null": without.bic}
    form: dict[str, int] = {}
    before = held_out(without)
    most = min(len(cause), FORMS)
    holding = _holding(own)
    for value, number in best_first(choice, without, holding):
        key = choice.forms[number].key
        if value > without.bic or len(best) > MOST_RIVALS:
            break
        if key in form:
            continue
        other = with_further_forms(choice, fit_step(choice, (*others, number)), choice.of_cause[key], most)
        if gain(before, held_out(other)) > 0.0:
            best[key], form[key] = min(other.bic, best.get(key, np.inf)), number
    tempering = tempering_of(step, without)
    for number, found in replaced:
        key = choice.forms[number].key
        if key in holding:
            continue
        best[key] = min(found.bic, best.get(key, np.inf))
        form.setdefault(key, number)
    # what fits better and has not taken its place was no better on held-out postures: no likelier
    best |= {key: max(best[key], step.bic) for key in form}
    least = min(best.values())
    weight = {
        key: 1.0 if value == least else float(np.exp(-(value - least) / (2.0 * tempering)))
        for key, value in best.items()
    }
    alike = [
        key
        for key in sorted(weight, key=lambda key: -weight[key])
        if key not in (own, "none:null") and weight[key] >= PLAUSIBLE * weight[own]
    ]
    same = (*choice.alike.get(own, ()), *_curve_of(choice, own))  # whatever the forms of the model say
    inside = doing_most(choice, step, cause)
    alike += [key for key in (*same, *inside) if key not in (own, *alike, *taken)]
    total = sum(weight.values())
    named = sum(value for key, value in weight.items() if key == own or key in same)
    return Rival(
        named / total,
        presence(step, without),
        tuple(alike),
        tuple(form[key] for key in alike if key in form),
        sum(weight[key] for key, number in form.items() if not choice.forms[number].outside_library) / total,
    )


def doing_most(choice: Choice, step: Step, cause: tuple[int, ...]) -> list[str]:
    """Return causes with fewer parameters that may do most of what a cause does, and it the rest beside them.

    A base that is compliant in all directions holds a compliant first drive: both together fit no worse, and
    nothing says that it is the base that turns about the axis of that drive. What the other does at most of
    what the cause does, m, costs ``|m - P m|^2``, P onto what the cause can do, and its own parameters.
    """
    without = fit_step(choice, [number for number in step.chosen if number not in cause])
    basis = without.basis
    does = _beyond(basis, np.sum([step.moved[number] for number in cause], axis=0)[:, None])[:, 0]
    used = [choice.columns[:, choice.at[k]][:, step.free[step.chosen.index(k)]] for k in cause]
    reach = orthonormal(np.concatenate(used, axis=1), basis)
    now = bic(step.squares, 0, choice.independent, 0.0)
    of = choice.forms[cause[0]]
    no_rivals = {of.key, ALL_DRIVES, ALL_REVERSED}
    if of.key in (ALL_DRIVES, ALL_REVERSED):  # it holds that of each joint
        no_rivals.update(form.key for form in choice.forms if form.effect == of.effect)
    found: dict[str, float] = {}
    for form, at in zip(choice.forms, choice.at, strict=True):
        fewer = at.stop - at.start < reach.shape[1]
        if not fewer or form.outside_library or form.key in no_rivals:
            continue
        columns = _beyond(basis, choice.columns[:, at])
        theta = np.asarray(np.linalg.lstsq(columns, does, rcond=RANK)[0], dtype=np.float64)
        most = columns @ theta
        wrong = (theta[choice.positive[at]] < 0.0).any() or most @ most < MOST * float(does @ does)
        if wrong or impossible(choice, np.arange(at.start, at.stop), theta, np.zeros(theta.size)):
            continue
        left = step.squares + float(np.square(most - reach @ (reach.T @ most)).sum())
        left += float(choice.precision[at] @ theta**2)
        prior = form.log_prior + form.cause_log_prior
        worse = float(bic(left, at.stop - at.start, choice.independent, prior) - now)
        found[form.key] = min(worse, found.get(form.key, np.inf))
    least = -2.0 * tempering_of(step, without) * np.log(PLAUSIBLE)
    return [key for key in sorted(found, key=lambda key: found[key]) if found[key] <= least]


def _beyond(basis: Array, columns: Array) -> Array:
    """Return columns (n, c) without what an orthonormal basis (n, b) reaches of them."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def _curve_of(choice: Choice, key: str) -> list[str]:
    """Return the curve of a joint's angle that moves positions as its balancer does, where there is one.

    What a spring pulls is some curve of the angle, through the drive an error of the joint; of the curve the
    forms have a few orders, of the spring any, so that one may fit better by chance. Measured torques or an
    encoder behind the gear distinguish them: by what is likely beforehand.
    """
    effect, _, joint = key.partition(":")
    curve = key_of("angle-curve", joint)
    if effect != "gravity-compensator" or curve not in choice.of_cause:
        return []
    own, other = (float(choice.log_priors[1][choice.of_cause[one][0]]) for one in (key, curve))
    return [curve] if abs(own - other) < -TEMPERING * np.log(PLAUSIBLE) else []


def _holding(key: str) -> set[str]:
    """Return the cause of all joints that holds this one: no rival, were it better it stood here."""
    return {ALL_REVERSED} if key.partition(":")[0] == REVERSED else set()


def presence(step: Step, without: Step) -> float:
    """Return the probability that there is a cause in the place of one, by the fits with and without it."""
    least = min(step.bic, without.bic)
    nothing = float(np.exp(-(without.bic - least) / (2.0 * TEMPERING))) if np.isfinite(least) else 1.0
    return 1.0 / (1.0 + nothing)


def tempering_of(step: Step, without: Step) -> float:
    """Return by what log odds are divided where a cause is held against another; see the module."""
    fall = without.bic - step.bic  # infinite where without the cause another has a size that no machine has
    return TEMPERING + (max(fall, 0.0) / 2.0 / RELATIVE if np.isfinite(fall) else 0.0)


def instead(
    choice: Choice, step: Step, cause: tuple[int, ...], held_out: HeldOut
) -> Iterator[tuple[int, Step]]:
    """Yield fits without a cause, the others selected anew, and the form that does there what it did.

    Each without what did it in the fits before as well; until one is worth too little.
    """
    others = [number for number in step.chosen if number not in cause]
    before = {choice.forms[number].key for number in step.chosen}
    forbidden = {choice.forms[cause[0]].key}
    tempering = tempering_of(step, fit_step(choice, others))
    own = np.sum([step.moved[number] for number in cause], axis=0)
    for _ in range(SEARCHES):
        found = select(choice, held_out, start=others, forbidden=forbidden, exchange=False)
        new = [n for n in found.chosen if choice.forms[n].key not in before]
        if not new or found.bic > step.bic - 2.0 * tempering * np.log(PLAUSIBLE):
            return
        like = [float(own @ found.moved[n]) / (float(np.linalg.norm(found.moved[n])) or 1.0) for n in new]
        likest = new[int(np.argmax(like))]
        yield likest, found
        forbidden.add(choice.forms[likest].key)


def runner_up(folds: Folds, step: Step, key: str) -> RunnerUp:
    """Return what is selected in place of a cause of a fit, beside the others."""
    choice = folds.choice
    others = [number for number in step.chosen if choice.forms[number].key != key]
    forbidden = {key, *_holding(key)}
    other = select(choice, folds.squared_errors, start=others, forbidden=forbidden, exchange=False)
    new = (choice.forms[number] for number in other.chosen if number not in others)
    keys = (key_of(UNMODELLED, None) if one.outside_library else one.key for one in new)
    log_odds = (other.bic - step.bic) / (2.0 * tempering_of(step, fit_step(choice, others)))
    rms, rms_with = (float(np.sqrt(folds.squared_errors(fit).sum() / folds.rows)) for fit in (other, step))
    odds = float(np.exp(np.clip(log_odds, 0.0, MOST_LOG_ODDS)))
    return RunnerUp(key, tuple(dict.fromkeys(keys)), odds, rms, rms_with)


def with_usual_name(choice: Choice, step: Step) -> Step:
    """Return a fit in which what is one mechanics has its usual name, where the rows do not distinguish them.

    Of all joints that have lost motion those few are the cause that are worth one each; all drives that are
    compliant are the one that is, where the others move little and are causes beside it. Where two causes may
    have a usual name, the one comes first that fits best under it.
    """
    fits = [fit for cause in causes_of(choice, step) for fit in _usually_named(choice, step, cause)]
    if not fits:
        return step
    return with_usual_name(choice, min(fits, key=lambda fit: fit.bic))


def _usually_named(choice: Choice, step: Step, cause: tuple[int, ...]) -> Iterator[Step]:
    """Yield the fit in which a cause has its usual name, if the rows do not distinguish them."""
    keys = {choice.forms[number].key for number in step.chosen}
    own = choice.forms[cause[0]]
    others = tuple(k for k in step.chosen if k not in cause)
    usual = [key for key in choice.alike.get(own.key, ())[:1] if key not in keys]
    alone = [(key, fit_step(choice, (*others, k))) for key in usual for k in choice.of_cause.get(key, ())]
    fits = [with_further_forms(choice, fit, choice.of_cause[key], len(cause)) for key, fit in alone]
    worse = -2.0 * tempering_of(step, fit_step(choice, others)) * float(np.log(PLAUSIBLE))
    if own.key in (ALL_DRIVES, ALL_REVERSED):
        fits = [_some_joints(choice, others, own)]
        # that it is all of them is likelier beforehand: this says nothing of what the others move
        worse = ENOUGH + 2.0 * (prior_of(choice, step.chosen) - prior_of(choice, fits[0].chosen))
    named = min(fits, key=lambda fit: fit.bic, default=None)
    if named and len(named.chosen) > len(others) and named.bic <= step.bic + worse:
        yield named


def _some_joints(choice: Choice, others: tuple[int, ...], every: Form) -> Step:
    """Return a fit with the joints that are worth a cause each, or none.

    None if they are most joints; if drives, all of which are compliant, if the first does not move most.
    """
    joints = [
        k for k, form in enumerate(choice.forms) if form.effect == every.effect and form.key != every.key
    ]
    without = fit_step(choice, others)
    step = with_further_forms(choice, without, joints)
    new = step.chosen[len(others) :]
    if every.key == ALL_REVERSED:
        return step if 2 * len(new) <= len(joints) else without
    first, *rest = [step.moved[number] for number in new] or [np.zeros(choice.count)]
    away = np.sum([np.zeros_like(first), *rest], axis=0)
    return step if away @ away <= MINOR * float(first @ first) else without
