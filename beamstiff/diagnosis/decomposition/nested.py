"""What the whole search for causes finds without a tenth of the postures, and how well it predicts these.

Held-out postures say which causes help. So they are no fresh ones for the causes that were chosen by them:
these close more there than they will elsewhere, the more so of few postures (Varma and Simon, BMC
Bioinformatics 7 (2006) 91). Here causes are selected anew without each fold, which then takes no part. How
often a cause comes in is how far it hangs on a few postures (Meinshausen and Bühlmann, J. R. Stat. Soc. B 72
(2010) 417).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamstiff.diagnosis.decomposition.answer import without_weak
from beamstiff.diagnosis.decomposition.applied import unlike_written
from beamstiff.diagnosis.decomposition.causes import HALF, MINOR, QUARTER, Cause, Decomposition
from beamstiff.diagnosis.decomposition.fit import Choice, Step, build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import Folds, folds_of
from beamstiff.diagnosis.decomposition.forms import SLIP
from beamstiff.diagnosis.decomposition.loads import has_loads
from beamstiff.diagnosis.decomposition.look_alikes import with_usual_name
from beamstiff.diagnosis.decomposition.selection import gain, select
from beamstiff.diagnosis.effects.target_slip import slip_row
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class Nested:
    """The fits with the causes that are selected without each fold.

    Attributes
    ----------
    folds : Folds
        Of all postures.
    fits : tuple of Step
        Of all values, one for each fold.
    """

    folds: Folds
    fits: tuple[Step, ...]

    def found(self, cause: Cause) -> float:
        """Return the share of the folds without which a cause is selected, or one it cannot be told from."""
        return float(np.mean(self._with(cause)))

    def hangs(self, cause: Cause) -> bool:
        """Return whether a cause hangs on a few postures.

        Without these it mostly is not selected, nor does it help beside what is selected there. What closes
        much is kept as the likeliest of what looks like it.
        """
        there, choice = self._with(cause), self.folds.choice
        if np.mean(there) >= HALF or cause.closes >= QUARTER:
            return False
        names = {(form.key, form.shape.name) for form in cause.forms}
        own = [k for k, form in enumerate(choice.forms) if (form.key, form.shape.name) in names]
        beside = [fit_step(choice, [*dict.fromkeys((*fit.chosen, *own))]) for fit in self.fits]
        missing = ~np.array(there)[self.fold]
        return gain(self.squared_errors(self.fits)[missing], self.squared_errors(beside)[missing]) <= 0.0

    def _with(self, cause: Cause) -> list[bool]:
        """Return for each fold whether a cause is selected without it."""
        return [_selected(self.folds.choice, fit, cause) for fit in self.fits]

    @cached_property
    def fold(self) -> Integers:
        """Fold of each posture, (P,)."""
        result = np.zeros(int(self.folds.posture.max()) + 1, dtype=np.intp)
        result[self.folds.posture] = self.folds.fold
        return result

    def squared_errors(self, fits: Sequence[Step]) -> Array:
        """Return the sum of squared position errors of each posture (P,), m^2, in the fit without its fold.

        `fits`: of all values, one for each fold.
        """
        return np.asarray(np.choose(self.fold, [self.folds.squared_errors(fit) for fit in fits]))


def nested(folds: Folds, causes: Sequence[Cause], seed: int) -> Nested:
    """Return what is selected without each fold; `seed` of the folds that say so.

    Where some of the `causes` are missing, causes are exchanged as well: that takes most of the time.
    """
    selected = (_without(folds, fold, causes, seed) for fold in range(int(folds.fold.max()) + 1))
    return Nested(
        folds, tuple(fit_step(folds.choice, _slips_at(folds.choice, one, causes)) for one in selected)
    )


def _slips_at(choice: Choice, selected: Sequence[int], causes: Sequence[Cause]) -> tuple[int, ...]:
    """Return forms, with each slip of a target at the nearest row where all postures place one.

    Without a fold that row is not known exactly, and postures held out beside it count on its wrong side;
    postures to come are after all slips.
    """
    slips = {
        number: slip_row(one.shape.name) for number, one in enumerate(choice.forms) if one.effect == SLIP
    }
    known = {(choice.forms[number].key, row): number for number, row in slips.items()}
    placed = {cause.key: cause.rows for cause in causes if cause.rows}
    result = []
    for number in selected:
        key = choice.forms[number].key
        if key in placed:
            nearest = min(placed[key], key=lambda row: abs(row - slips[number]))
            result.append(known.get((key, nearest), number))
        else:
            result.append(number)
    return tuple(dict.fromkeys(result))


def _without(folds: Folds, fold: int, causes: Sequence[Cause], seed: int) -> tuple[int, ...]:
    """Return the forms that are selected without a fold."""
    model, inside = folds.model, folds.fold != fold
    rest, every = model.part(inside), model.with_known(inside)
    choice = build_choice(rest, [replace(one, columns=one.columns[every]) for one in folds.choice.forms])
    choice = replace(choice, kept=folds.choice.kept)
    others = folds_of(rest, choice, seed)
    first = select(choice, others.squared_errors, exchange=False)
    step = with_usual_name(choice, without_weak(others, first))
    if all(_selected(choice, step, cause) for cause in causes if cause.closes >= MINOR):
        return step.chosen
    first = select(choice, others.squared_errors, start=first.chosen)
    return with_usual_name(choice, without_weak(others, first)).chosen


def _selected(choice: Choice, fit: Step, cause: Cause) -> bool:
    """Return whether a fit has a cause, or one that it cannot be told from; of all joints, or some."""
    alike = {cause.key, *cause.indistinguishable}
    every = {form.effect for form in cause.forms if form.component is None}
    return any(choice.forms[k].key in alike or choice.forms[k].effect in every for k in fit.chosen)


def promised(found: Decomposition, again: Nested) -> Decomposition:
    """Return a decomposition whose causes close what they close of postures that did not help to find them.

    All by the same share less than where they were chosen; never more. A fold that they make worse counts as
    one in which nothing was found: it would outweigh all others, though nobody keeps such causes.
    """
    causes = (*found.every, *found.unmodelled)
    told, explainable = sum(cause.closes for cause in causes), found.rms**2 - found.noise**2
    if told <= 0.0 or explainable <= 0.0:
        return found
    nothing = again.folds.squared_errors(fit_step(again.folds.choice, ()))
    by_fold = [
        np.bincount(again.fold, weights=errors) for errors in (again.squared_errors(again.fits), nothing)
    ]
    left = float(np.minimum(*by_fold).sum()) / again.folds.rows
    if any(has_loads(cause.forms) for cause in found.every):
        left += unlike_written(found) ** 2
    kept = float(np.clip((found.rms**2 - left) / explainable / told, 0.0, 1.0))

    def scaled(part: Sequence[Cause]) -> tuple[Cause, ...]:
        return tuple(
            replace(
                one,
                closes=kept * one.closes,
                closes_interval=(kept * one.closes_interval[0], kept * one.closes_interval[1]),
                found_again=again.found(one),
            )
            for one in part
        )

    return replace(found, causes=scaled(found.causes), unclear=scaled(found.unclear))
