"""The next best explanation in place of each cause: what a diagnosis without that cause would name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.causes import Decomposition
from beamstiff.diagnosis.decomposition.fit import build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import folds_of
from beamstiff.diagnosis.decomposition.forms import Form, forms_of
from beamstiff.diagnosis.decomposition.look_alikes import tempering_of
from beamstiff.diagnosis.decomposition.selection import select
from beamstiff.diagnosis.decomposition.unmodelled import UNMODELLED, unmodelled_forms
from beamstiff.diagnosis.prior import Prior
from beamstiff.stages import stage

MOST_LOG_ODDS = 690.0  # of which the exponential is finite


@dataclass(frozen=True)
class RunnerUp:
    """What explains the rows best where a cause is excluded.

    Attributes
    ----------
    cause : str
        That is excluded, ``effect:component``.
    keys : tuple of str
        What is selected in its place, beside the other causes; empty where nothing is.
    odds : float
        How many times less likely that is.
    rms, rms_with : float, m
        Position gap on held-out data with all causes: with these in its place, and with it.
    """

    cause: str
    keys: tuple[str, ...]
    odds: float
    rms: float
    rms_with: float


def runners_up(found: Decomposition, prior: Prior, seed: int) -> tuple[RunnerUp, ...]:
    """Return the next best explanation in place of each cause that has no look-alike.

    The others are selected anew without it, and may come in beside what stands for it.
    """
    alone = [cause for cause in found.causes if not cause.indistinguishable]
    if not alone:
        return ()
    stage("looking for the next best causes")
    forms = [*forms_of(found.model, prior), *unmodelled_forms(found.model)]
    number = {_name(form): at for at, form in reversed(list(enumerate(forms)))}
    every = [form for one in (*found.causes, *found.unclear, *found.unmodelled) for form in one.forms]
    if any(_name(form) not in number for form in every):  # a prior that excludes what was found
        return ()
    choice = build_choice(found.model, forms)
    folds = folds_of(found.model, choice, seed)
    step = fit_step(choice, [number[_name(form)] for form in every])
    rms = float(np.sqrt(folds.squared_errors(step).sum() / folds.rows))
    result = []
    for cause in alone:
        others = [number[_name(form)] for form in every if form.key != cause.key]
        other = select(choice, folds.squared_errors, start=others, forbidden={cause.key}, exchange=False)
        new = [forms[at] for at in other.chosen if at not in others]
        log_odds = (other.bic - step.bic) / (2.0 * tempering_of(step, fit_step(choice, others)))
        after = float(np.sqrt(folds.squared_errors(other).sum() / folds.rows))
        odds = float(np.exp(np.clip(log_odds, 0.0, MOST_LOG_ODDS)))
        result.append(RunnerUp(cause.key, _keys(new), odds, after, rms))
    return tuple(result)


def _name(form: Form) -> tuple[str, str]:
    return form.key, form.shape.name


def _keys(forms: Sequence[Form]) -> tuple[str, ...]:
    """Return the causes of some forms; laws that no effect of the library has are unknown."""
    return tuple(dict.fromkeys("unknown:null" if one.effect == UNMODELLED else one.key for one in forms))
