"""The gap as an ordered list of causes and a remainder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.special import expit

from beamstiff.diagnosis.decomposition.behind_gears import Behind, behind_gears, informed
from beamstiff.diagnosis.decomposition.discrepancy import discrepancy_odds
from beamstiff.diagnosis.decomposition.forms import SLIP, Form, Shapes, by_form, forms_of, shift_of
from beamstiff.diagnosis.decomposition.held_out import (
    Folds,
    closed,
    errors_along,
    folds_of,
    interval,
    ordered,
)
from beamstiff.diagnosis.decomposition.look_alikes import instead, rival_of, with_usual_name
from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of, open_geometry, open_stiffness
from beamstiff.diagnosis.decomposition.remainder import Remainder, remainder_of
from beamstiff.diagnosis.decomposition.selection import (
    ENOUGH,
    Choice,
    Step,
    build_choice,
    fit_step,
    forms_in,
    gain,
    resampled,
    select,
)
from beamstiff.diagnosis.effects.target_slip import slip_row
from beamstiff.diagnosis.inference.library import check_names
from beamstiff.diagnosis.prior import DEFAULT, TEMPERING, Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, fitted_names
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

# what of a calibration is open: all, or with few readings less, down to where the robot stands
OPEN = (None, ("base", "target", "offsets"), ("base", "target"))
VALUES_A_PARAMETER = 2  # measured values that a geometry needs at least, to leave anything to causes
CHANCE = 0.01  # of so large a residual under the stated noise, below which causes are sought
ROUNDS = 3  # of calibrating beside the causes that were found
PRESENT = 0.95  # probability that there is a cause, this one or a look-alike, from which it counts
NAMED = 0.5  # probability that it is this one, from which it is named
MINOR = 0.03  # share of the gap; forms are right to some 15 %, and what that leaves may look like a cause
NOISE = 1.5  # times the stated noise, from which there is a gap: stated noise is seldom known better
HALF, QUARTER = 0.5, 0.25  # shares of the gap from which a cause is the verdict: FORMATS, `verdict`


@dataclass(frozen=True)
class Cause:
    """A cause, and what it closes of the gap after those before it.

    Attributes
    ----------
    forms : tuple of Form
        One; of a target that slipped several times, one for each row.
    theta : tuple of (c,) array
        Parameters of each form, in realistic sizes.
    std : tuple of (c,) array
    probability : float
        That this effect at this component is really there.
    present : float
        That there is a cause in its place, and not a little of everything else.
    closes : float
        Share of the explainable gap on held-out postures.
    closes_interval : (float, float)
        90 %, over the postures.
    rms_after : float, m
    indistinguishable : tuple of str
    rivals : tuple of Form
        The best of each of these.
    """

    forms: tuple[Form, ...]
    theta: tuple[Array, ...]
    std: tuple[Array, ...]
    probability: float
    present: float
    closes: float
    closes_interval: tuple[float, float]
    rms_after: float
    indistinguishable: tuple[str, ...]
    rivals: tuple[Form, ...]

    @property
    def key(self) -> str:
        """``effect:component``."""
        return self.forms[0].key

    @property
    def named(self) -> bool:
        """Whether it is surely this cause, and more than what the form of another may leave."""
        return self.present >= PRESENT and self.probability >= NAMED and self.closes >= MINOR

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows (from 0) at which a target slips; empty for other causes."""
        return tuple(slip_row(form.shape.name) for form in self.forms if form.effect == SLIP)


@dataclass(frozen=True)
class Decomposition:
    """The causes of a gap, those that close most first, and what remains.

    Attributes
    ----------
    model : OpenModel
    causes, unclear : tuple of Cause
        Those that are named, and those that are there but could as well be another.
    remainder : Remainder
        What those that are named leave.
    unexplained : float
        Share of the explainable gap that those that are unclear leave as well.
    rms, noise : float, m
        Held-out position gap of the open model without a cause, and what noise alone would leave.
    change : (t,) array
        Of the open parameters, beside the causes.
    scatter : float
        What is left over the stated noise.
    bic : float
        Of the open model with the causes.
    largest : float
        Probability that the first cause closes more than the second, over the postures.
    behind : tuple of Behind
        What encoders behind the gears say.
    """

    model: OpenModel
    causes: tuple[Cause, ...]
    unclear: tuple[Cause, ...]
    remainder: Remainder
    unexplained: float
    rms: float
    noise: float
    change: Array
    scatter: float
    bic: float
    largest: float
    behind: tuple[Behind, ...] = ()

    @property
    def closes(self) -> float:
        """Share of the explainable gap that all causes close together."""
        return sum(cause.closes for cause in self.causes)

    @property
    def gap_shows(self) -> bool:
        """Whether more is left without a cause than noise makes."""
        return self.scatter > NOISE or bool(self.causes or self.unclear)

    @property
    def verdict(self) -> Cause | None:
        """The first cause, where it closes most of what can be closed."""
        if not self.causes:
            return None
        first, *others = (*self.causes, *self.unclear)
        alone = first.closes >= QUARTER and all(cause.closes < MINOR for cause in others)
        return first if first.named and (first.closes >= HALF or alone) else None


def decompose(
    robot: Robot,
    rows: Measurements,
    *,
    prior: Prior = DEFAULT,
    seed: int = 0,
    stations: bool = False,
    baseline: Baseline | None = None,
    known: Shapes | None = None,
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

    Raises
    ------
    BeamstiffError
        See `calibrate` and `fit_baseline`.
    """
    if rows.kind != "absolute":
        model = open_stiffness(baseline or fit_baseline(robot, rows))
        folds = folds_of(model, build_choice(model, forms_of(model, prior, known=known)), seed)
        return _told(folds, select(folds.choice, folds.squared_errors), seed)
    robot = robot.model_copy(update={"identify": fitted_names(robot)})
    model, parameters = _opened(robot, rows, stations)
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
        step = select(choice, folds.squared_errors)
    for _ in range(ROUNDS):
        chosen = list(forms_in(choice, step).values())
        if not chosen:
            break
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


def _opened(robot: Robot, rows: Measurements, stations: bool) -> tuple[OpenModel, tuple[str, ...] | None]:
    """Return the open model with as much of the geometry free as the readings determine, and what that is."""
    for parameters in OPEN:
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


def _told(folds: Folds, step: Step, seed: int) -> Decomposition:
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
    rivals = [rival_of(choice, step, cause, folds.squared_errors, replaced.get(cause, ())) for cause in order]
    odds = np.array(discrepancy_odds(choice, step, order, [rival.indistinguishable for rival in rivals]))
    causes = {
        cause: Cause(
            forms=tuple(choice.forms[number] for number in cause),
            theta=tuple(thetas[number] for number in cause),
            std=tuple(stds[number] for number in cause),
            probability=rival.probability * float(present),
            present=float(present),
            closes=share,
            closes_interval=(share, share),
            rms_after=0.0,
            indistinguishable=rival.indistinguishable,
            rivals=tuple(choice.forms[number] for number in rival.forms),
        )
        for cause, rival, present, share in zip(
            order, rivals, expit(odds / TEMPERING), closed(errors, noise2), strict=True
        )
    }
    # those that are named alone are the answer, so what each closes is what it closes beside these; but not
    # where one of them helps only beside an undecided one
    first = sorted(order, key=lambda cause: not causes[cause].named)
    along = errors if first == order else errors_along(folds, first)
    count = sum(causes[cause].named for cause in order)
    if min(closed(along, noise2)[:count], default=0.0) >= 0.0:
        order, errors = first, along
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
    if count < len(every):
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


def _improved(folds: Folds, step: Step) -> tuple[Step, dict[tuple[int, ...], list[tuple[int, Step]]]]:
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


def _causes_of(choice: Choice, step: Step) -> list[tuple[int, ...]]:
    """Return the forms of a fit by cause: those of one effect at one component belong together."""
    found: dict[str, list[int]] = {}
    for number in step.chosen:
        found.setdefault(choice.forms[number].key, []).append(number)
    return [tuple(numbers) for numbers in found.values()]
