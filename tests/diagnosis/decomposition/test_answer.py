"""Which of two fits stands, by hand-made errors on held-out postures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition import answer
from beamstiff.diagnosis.decomposition.answer import _no_worse, without_rivals
from beamstiff.diagnosis.decomposition.decompose import _explaining
from beamstiff.diagnosis.decomposition.fit import Step, build_choice
from beamstiff.diagnosis.decomposition.folds import Folds, folds_of
from beamstiff.diagnosis.decomposition.forms import forms_of
from beamstiff.diagnosis.decomposition.selection import causes_of, select
from beamstiff.se3 import Array
from tests.diagnosis.decomposition.test_decompose import found

POSTURES = 30


@pytest.mark.parametrize(
    ("parameters", "times", "stands"),
    [
        (2.0, 1.0, True),  # a simpler fit that leaves as much
        (2.0, 2.0, False),  # and one that leaves more
        (6.0, 1.0, False),  # one with as many parameters has to help
        (5.8, 1.0, False),
        (6.0, 0.5, True),
        (9.0, 0.5, True),
    ],
)
def test_a_simpler_fit_needs_to_do_no_harm_and_another_to_help(
    parameters: float, times: float, stands: bool
) -> None:
    left: Array = np.random.default_rng(0).chisquare(3, POSTURES)
    fits = {
        "now": SimpleNamespace(determined=6.0, left=left),
        "other": SimpleNamespace(determined=parameters, left=times * left),
    }
    folds = SimpleNamespace(squared_errors=lambda fit: fit.left)
    assert _no_worse(folds, fits["now"], fits["other"]) == stands


@pytest.mark.parametrize(("left", "kept"), [(9.0, True), (1.2, False)])
def test_doubtful_causes_stay_where_without_them_a_gap_is_left(left: float, kept: bool) -> None:
    sound = replace(found("approach", "gear")[0].decomposition, scatter=1.0, bic=0.0)
    rest = replace(sound, causes=(), unclear=sound.every, scatter=left, bic=100.0)
    settings, told = _explaining("after", rest, [("before", sound)])
    assert (settings, told.scatter) == (("before", 1.0) if kept else ("after", left))


@pytest.mark.parametrize(("without", "kept"), [(13.0, False), (15.0, True)])
def test_a_doubtful_cause_stays_where_without_it_twice_the_squares_are_left(
    without: float, kept: bool
) -> None:
    sound = found("approach", "gear")[0].decomposition
    doubted, rest = replace(sound, scatter=10.0), replace(sound, scatter=without)
    settings, told = _explaining("after", rest, [("before", doubted)])
    assert (settings, told.scatter) == (("before", 10.0) if kept else ("after", without))


def test_a_doubtful_cause_that_stays_has_no_rivals_and_joins_those_that_are_named() -> None:
    sound = found("approach", "gear")[0].decomposition
    first, *others = sound.causes
    doubt = replace(first, probability=0.2, indistinguishable=("backlash:q2",), closes=0.2, shown=0.2)
    assert not doubt.named
    told = without_rivals(replace(sound, causes=tuple(others), unclear=(doubt,)), {first.key})
    assert {one.key for one in told.causes} == {one.key for one in sound.causes}
    (again,) = [one for one in told.every if one.key == first.key]
    assert (again.indistinguishable, again.probability) == ((), first.present)
    assert told.remainder.rms == pytest.approx(sound.remainder.rms, rel=1e-3)


def test_another_form_may_do_the_work_of_one_that_cancels_others(monkeypatch: pytest.MonkeyPatch) -> None:
    model = found("approach", "gear")[0].decomposition.model
    forms = [form for form in forms_of(model) if form.key in ("angle-curve:q2", "approach-direction:null")]
    choice = build_choice(model, forms)
    folds = folds_of(model, choice, 0)
    step = select(choice, folds.squared_errors)
    (gone,) = causes_of(choice, step)
    cancelling = answer._cancelling

    def said(folds: Folds, step: Step, noise2: float) -> answer.Told:  # as if this form cancelled others
        order, errors, shown, _ = cancelling(folds, step, noise2)
        return order, errors, shown, [cause for cause in order if cause == gone]

    monkeypatch.setattr(answer, "_cancelling", said)
    order, _, _ = answer._without_cancelling(folds, step, answer._noise2(model))
    ((other,),) = order
    assert forms[other].key == "angle-curve:q2"
    assert forms[gone[0]].key == "approach-direction:null"
