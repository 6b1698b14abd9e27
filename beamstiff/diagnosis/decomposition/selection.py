"""Forward selection of causes with removal and exchange, by the BIC (`fit.bic`) and held-out postures."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from beamstiff.diagnosis.decomposition.fit import (
    DRIVES,
    SURELY,
    Choice,
    Step,
    bic,
    fit_step,
    impossible,
    prior_of,
)
from beamstiff.diagnosis.decomposition.forms import REPEATED
from beamstiff.diagnosis.inference.library import ALL_DRIVES, ALL_REVERSED, REVERSED
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

# fall of the BIC from which a cause counts: "very strong" (Kass and Raftery, JASA 90 (1995) 773)
ENOUGH = 10.0
MOST = 100  # forms
# causes: six are a crowd, and of measured robots none asked for ten. A search that asks for more follows a
# law that no form has, with hundreds of parameters (16 GB and half an hour for one table of 360 rows)
CAUSES = 12
ROUNDS = 20  # of revising a fit
TRIED = 30  # forms, best first, of which one has to help on held-out postures
DOUBT = 0.2  # of postures drawn anew, in which a cause may make held-out postures worse
FORMS = 2  # of a cause: no machine's law is quite a form; a second corrects it, a third would the second
SHOWS = 0.5  # parameters that the data determine, below which a form does not show


HeldOut = Callable[["Step"], Array]  # squared errors (P,) of postures, each held out


def best_first(
    choice: Choice,
    step: Step,
    forbidden: Collection[str] = (),
    wanted: Integers | None = None,
    limit: float = np.inf,
) -> Iterator[tuple[float, int]]:
    """Yield the BIC of fits with one form more, and the form's number, best first, up to a limit.

    In the `TRIED` best of the forms with a parameter that would be negative and may as well be 0, it is held
    there, once it is their turn; compliances are kept from giving work away. The fit is not better for it.

    `forbidden`: causes that must not come in. `wanted`: numbers of the forms that may; default all.
    """
    values, bounded = with_each(choice, step, wanted)
    for key in forbidden:
        values[choice.of_cause.get(key, [])] = np.inf
    held = np.flatnonzero(bounded)
    held = held[np.argsort(values[held], kind="stable")]
    values[held[TRIED:]] = np.inf
    coupled = (number for number, matrix in enumerate(choice.matrices) if matrix is not None)
    waiting = {*held[:TRIED].tolist(), *coupled}
    queue = [(float(values[number]), number) for number in np.flatnonzero(np.isfinite(values)).tolist()]
    heapq.heapify(queue)
    while queue:
        value, number = heapq.heappop(queue)
        if value > limit:  # nor is any other better
            return
        if number in waiting:
            waiting.remove(number)
            heapq.heappush(queue, (fit_step(choice, (*step.chosen, number)).bic, number))
        else:
            yield value, number


def with_each(choice: Choice, step: Step, wanted: Integers | None = None) -> tuple[Array, NDArray[np.bool_]]:
    """Return the BIC (f,) of a fit with each form added to it, and which would have a wrong sign (f,).

    The BIC is inf where a form does not show, is of a cause that has all its `FORMS`, stands there already,
    or surely asks for a sign that a parameter cannot have, also if none of the fit's were held at 0: such a
    form is not what is there. So it is where a form is not wanted.
    """
    if wanted is not None:
        return _with_some(choice, step, wanted)
    if step.chosen not in choice.larger:
        choice.larger[step.chosen] = _with_some(choice, step, np.arange(len(choice.forms)))
    values, bounded = choice.larger[step.chosen]
    return values.copy(), bounded


def _with_some(choice: Choice, step: Step, wanted: Integers) -> tuple[Array, NDArray[np.bool_]]:
    result = np.full(len(choice.forms), np.inf)
    bounded = np.zeros(len(choice.forms), dtype=bool)
    known = prior_of(choice, step.chosen)
    forms = [choice.forms[number] for number in step.chosen]
    of_form, of_cause = choice.log_priors
    log_prior = of_form + of_cause
    for form in forms:  # a cause counts once
        same = choice.of_cause[form.key]
        log_prior[same] = of_form[same]
    there = Counter(form.key for form in forms if form.effect not in REPEATED)
    taken = {key for key, number in there.items() if number >= FORMS}
    grouped = [choice.forms[number].key for number in step.chosen if not choice.apart[number]]
    alike = {other for key in grouped for other in choice.alike.get(key, ()) if other != key}
    open_to = np.zeros(len(choice.forms), dtype=bool)
    open_to[wanted] = True
    for key in taken & choice.of_cause.keys():
        open_to[choice.of_cause[key]] = False
    for key in alike & choice.of_cause.keys():
        open_to[choice.of_cause[key]] &= choice.apart[choice.of_cause[key]]
    open_to[list(step.chosen)] = False
    some = [np.flatnonzero(open_to[numbers]) for numbers, _, _ in choice.groups]
    products = np.concatenate([choice.products_of(k) for k in (DRIVES, *step.chosen)])
    free = np.concatenate([step.drives, *step.free]).astype(bool)
    places = np.concatenate([at[own].ravel() for own, (_, at, _) in zip(some, choice.groups, strict=True)])
    beside = _beside(choice, products[free], step.triangle, step.theta, places)
    for own, (numbers, at, gram) in zip(some, choice.groups, strict=True):
        if not own.size:
            continue
        numbers, at, gram = numbers[own], at[own], gram[own]
        theta, variance = _added(choice, beside, at, gram)
        squares = step.squares - (theta * beside[1][at]).sum(axis=1)
        determined = at.shape[1] - (variance * choice.precision[at]).sum(axis=1)
        spread = np.maximum(squares / max(choice.count, 1), 1.0)[:, None]
        wrong = _wrong(choice, at, theta, np.sqrt(variance * spread))
        if wrong.any() and not free.all():  # beside what is held at 0 others seem surer than they are
            beside_all = _beside(choice, products, *step.unbounded, at[wrong].ravel())
            also, of_all = _added(choice, beside_all, at[wrong], gram[wrong])
            wrong[wrong] = _wrong(choice, at[wrong], also, np.sqrt(of_all * spread[wrong]))
        bounded[numbers] = ((theta < 0) & choice.positive[at]).any(axis=1)
        parameters = choice.open_count + step.determined + determined
        values = bic(squares, parameters, choice.independent, known + log_prior[numbers])
        result[numbers] = np.where(wrong | (determined < SHOWS), np.inf, values)
    return result, bounded


def _beside(
    choice: Choice, products: Array, triangle: Array, theta: Array, at: Integers
) -> tuple[Array, Array]:
    """Return what of columns at some places is inside those of a fit, (c, C), and the pull (C,) it leaves."""
    inside = np.zeros((len(theta), len(choice.precision)))
    if not len(theta):
        return inside, choice.pull
    inside[:, at] = solve_triangular(triangle, products[:, at], trans="T", check_finite=False)
    return inside, choice.pull - theta @ products


def _added(choice: Choice, beside: tuple[Array, Array], at: Integers, gram: Array) -> tuple[Array, Array]:
    """Return the parameters (g, c) of forms beside a fit, each added by itself, and their variance."""
    inside, pull = beside
    normal = gram - inside.T[at] @ inside.T[at].swapaxes(1, 2)
    normal[:, np.arange(at.shape[1]), np.arange(at.shape[1])] += choice.precision[at]
    inverse = np.linalg.inv(normal)
    return (inverse @ pull[at][:, :, None])[:, :, 0], np.einsum("gii->gi", inverse)


def _wrong(choice: Choice, at: Integers, theta: Array, std: Array) -> NDArray[np.bool_]:
    """Return whether forms (g,) surely ask for a sign that cannot be, or a size that no machine has."""
    sign = ((theta < -SURELY * std) & choice.positive[at]).any(axis=1)
    return np.asarray(sign | impossible(choice, at, theta, std))


def select(
    choice: Choice,
    held_out: HeldOut,
    most: int = MOST,
    start: Sequence[int] = (),
    forbidden: Collection[str] = (),
    exchange: bool = True,
) -> Step:
    """Return the fit with the causes that the criterion and held-out postures ask for, `most` forms.

    Of more than `CAUSES` those that came first.

    After every cause that comes in, causes that are not needed any more go out. Where no other comes in, one
    that another explains better, or two others, is exchanged.

    `start`: forms to begin with. `forbidden`: causes that must not come in.

    Lost motion of all joints at once stands where that of some does not do as well: else it would hide which
    they are. That it is all of them is likelier beforehand, and says nothing of which. Where it is most of
    them, it hides little.
    """
    step = _select(choice, held_out, most, start, forbidden, exchange)
    if any(choice.forms[number].key == ALL_REVERSED for number in step.chosen):
        start = [number for number in start if choice.forms[number].key != ALL_REVERSED]
        some = _select(choice, held_out, most, start, {*forbidden, ALL_REVERSED}, exchange)
        if some.bic > step.bic + ENOUGH + _likelier(choice, step, some, REVERSED):
            return step
        step = some
    for every in (ALL_REVERSED, ALL_DRIVES):
        if every not in forbidden:
            step = _of_all_joints(choice, step, every)
    return step


def _of_all_joints(choice: Choice, step: Step, every: str) -> Step:
    """Return a fit with an effect of all joints in place of that of most, where it is no worse.

    Those that are missing are there too, but do not show enough by themselves.
    """
    forms, effect = choice.forms, every.partition(":")[0]
    joints = {one.component for one in forms if one.effect == effect and one.component}
    some = {forms[number].component for number in step.chosen if forms[number].effect == effect} & joints
    if every not in choice.of_cause or 2 * len(some) <= len(joints):
        return step
    others = [number for number in step.chosen if forms[number].effect != effect]
    of_all = fit_step(choice, (*others, *choice.of_cause[every].tolist()))
    return of_all if of_all.bic + _likelier(choice, of_all, step, effect) <= step.bic else step


def _likelier(choice: Choice, step: Step, other: Step, effect: str) -> float:
    """Return how far the BIC of a fit is lower than another's for its priors of an effect alone."""
    known, otherwise = (
        prior_of(choice, [number for number in fit.chosen if choice.forms[number].effect == effect])
        for fit in (step, other)
    )
    return 2.0 * max(known - otherwise, 0.0)


def _select(
    choice: Choice,
    held_out: HeldOut,
    most: int,
    start: Sequence[int],
    forbidden: Collection[str],
    exchange: bool,
) -> Step:
    def grown(step: Step) -> Step:
        while len(step.chosen) < most and len(causes_of(choice, step)) < CAUSES:
            if (larger := _larger(choice, step, held_out, forbidden)) is None:
                break
            step = _needed(choice, larger)
        return step

    kept = [number for number in sorted(choice.kept) if choice.forms[number].key not in forbidden]
    step = grown(fit_step(choice, [*dict.fromkeys([*start, *kept])]))
    for _ in range(ROUNDS if exchange else 0):
        before = step
        for numbers in _exchangeable(choice, step):
            if len(step.chosen) < most and {*numbers} <= {*step.chosen}:
                other = _exchanged(choice, step, numbers, held_out, forbidden)
                step = step if other is None else grown(_needed(choice, other))
        if step is before:
            break
    return step


def _larger(choice: Choice, step: Step, held_out: HeldOut, forbidden: Collection[str]) -> Step | None:
    """Return a fit with the form more that helps most; None where none helps enough."""
    if not choice.forms:
        return None
    before = held_out(step)
    for _, new in islice(best_first(choice, step, forbidden, limit=step.bic - ENOUGH), TRIED):
        larger = fit_step(choice, (*step.chosen, new))
        if larger.bic <= step.bic - ENOUGH and gain(before, held_out(larger)) > 0.0:
            return larger
    return None


def gain(before: Array, after: Array) -> float:
    """Return what a cause takes from squared errors (P,), at the bad end of postures drawn anew."""
    return float(np.quantile(resampled(before - after), DOUBT))


def resampled(values: Array) -> Array:
    """Return sums of values (P,) over postures drawn anew, (200,)."""
    drawn = np.random.default_rng(0).integers(len(values), size=(200, len(values)))
    result: Array = values[drawn].sum(axis=1)
    return result


def _needed(choice: Choice, step: Step) -> Step:
    """Return a fit without the forms that it does not need, the least needed first."""
    while step.chosen:
        needs = np.where(np.isin(step.chosen, [*choice.kept]), np.inf, _rises(choice, step))
        least = step.chosen[int(np.argmin(needs))]
        if least in choice.kept:
            break
        without = fit_step(choice, [k for k in step.chosen if k != least])
        if without.bic >= step.bic + ENOUGH:
            break
        step = without
    return step


def _rises(choice: Choice, step: Step) -> list[float]:
    """Return by how much the BIC would rise without each form, signs left as they are.

    Without parameters b the sum of squares is larger by ``b^T (A^-1)_bb^-1 b``, ``A`` the normal matrix.
    """
    root = np.linalg.inv(step.triangle)
    ends = int(step.drives.sum()) + np.cumsum([int(free.sum()) for free in step.free])
    result, prior = [], prior_of(choice, step.chosen)
    for number, end, free in zip(step.chosen, ends.tolist(), step.free, strict=True):
        some = slice(end - int(free.sum()), end)
        own = step.theta[some]
        rise = float(own @ np.linalg.solve(root[some] @ root[some].T, own)) if own.size else 0.0
        others = [k for k in step.chosen if k != number]
        price = own.size * np.log(choice.independent) + 2.0 * (prior_of(choice, others) - prior)
        result.append(choice.independent * float(np.log1p(rise / max(step.squares, 1e-12))) - price)
    return result


def _exchangeable(choice: Choice, step: Step) -> list[tuple[int, ...]]:
    """Return what may be exchanged: each form by itself, and all of a cause."""
    every = dict.fromkeys([(k,) for k in step.chosen] + causes_of(choice, step))
    free = [numbers for numbers in every if not choice.keeps(numbers)]
    return [numbers for numbers in free if choice.forms[numbers[0]].effect not in REPEATED]


def _exchanged(
    choice: Choice, step: Step, numbers: tuple[int, ...], held_out: HeldOut, forbidden: Collection[str]
) -> Step | None:
    """Return a better fit with another form, or two, in the place of some; None: none is better."""
    other = without = fit_step(choice, [k for k in step.chosen if k not in numbers])
    for _ in range(2):
        better = best_first(choice, other, forbidden, limit=other.bic - ENOUGH)
        new = next((number for _, number in better if number not in numbers), None)
        if new is None:
            break
        other = fit_step(choice, (*other.chosen, new))
        if other.bic < step.bic - 1e-6 and gain(held_out(without), held_out(other)) > 0.0:
            return other
    return None


def with_further_forms(choice: Choice, step: Step, wanted: Collection[int], most: int = MOST) -> Step:
    """Return a fit with as many of some forms as the criterion asks for, the best first, `most` of them."""
    while len({*wanted}.intersection(step.chosen)) < most:
        some = np.asarray(wanted, dtype=int)
        better = best_first(choice, step, wanted=some, limit=step.bic - ENOUGH)
        larger = fit_step(choice, (*step.chosen, *(number for _, number in islice(better, 1))))
        # none is left, or no machine is like the fit (both infinite)
        if larger.chosen == step.chosen or larger.bic > step.bic - ENOUGH:
            break
        step = larger
    return step


def causes_of(choice: Choice, step: Step) -> list[tuple[int, ...]]:
    """Return the forms of a fit by cause: those of one effect at one component belong together."""
    found: dict[str, list[int]] = {}
    for number in step.chosen:
        found.setdefault(choice.forms[number].key, []).append(number)
    return [tuple(numbers) for numbers in found.values()]
