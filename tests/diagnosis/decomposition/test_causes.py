"""Which causes are named, and which of them is the verdict."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition import answer
from beamstiff.diagnosis.decomposition.causes import HALF, MINOR, NAMED, PRESENT, QUARTER, Cause
from beamstiff.diagnosis.decomposition.fit import fit_step
from beamstiff.diagnosis.decomposition.forms import SLIP
from beamstiff.diagnosis.decomposition.plain_data import parameters_of
from beamstiff.diagnosis.effects import Quantity
from beamstiff.se3 import Array
from tests.diagnosis.decomposition.test_decompose import found
from tests.diagnosis.decomposition.test_selection import SIZE, VALUES, choice_of, form


def cause(probability: float, present: float, closes: float, shown: float = 1.0) -> Cause:
    one = form(np.ones((VALUES, 1)), Quantity("size", "1", 1.0))
    nothing = (np.zeros(1),)
    interval = (closes, closes)
    return Cause((one,), nothing, nothing, probability, present, closes, shown, interval, 0.0, (), ())


@pytest.mark.parametrize("closes", [0.04, 0.2])
def test_a_small_cause_is_named_where_it_is_likelier_than_not(closes: float) -> None:
    assert cause(NAMED, PRESENT, closes, shown=closes).named
    assert not cause(NAMED - 0.01, PRESENT, closes, shown=closes).named


def test_what_closes_much_is_named_as_the_likeliest_of_what_looks_like_it() -> None:
    assert cause(0.3, PRESENT, QUARTER, shown=QUARTER).named
    assert cause(0.3, PRESENT, 0.1, shown=HALF).named  # or most is left where it alone is missing


def test_what_may_be_a_little_of_everything_is_not_named_whatever_it_closes() -> None:
    assert not cause(PRESENT - 0.01, PRESENT - 0.01, 0.9).named


def test_what_the_form_of_another_may_leave_is_not_named() -> None:
    assert not cause(1.0, 1.0, MINOR - 0.001).named


def test_beside_a_slip_it_is_the_share_of_what_the_slip_leaves_that_counts() -> None:
    one = cause(1.0, 1.0, 0.02)
    assert not one.named
    assert replace(one, least=0.2 * MINOR).named
    several = found("approach", "gear", "slip")[0].decomposition
    assert several is not None
    [slip] = [other for other in several.every if other.forms[0].effect == SLIP]
    assert 0.1 < slip.closes < 0.9
    for other in several.every:
        assert other.least == pytest.approx(MINOR * (1.0 - slip.closes), rel=0.3)


def test_of_two_that_cancel_one_another_neither_is_named() -> None:
    assert not cause(1.0, 1.0, 0.3, shown=MINOR - 0.001).named


def test_parameters_of_two_forms_of_a_cause_are_all_told() -> None:
    one = cause(0.9, PRESENT, 0.5)
    both = replace(
        one, forms=(*one.forms, *one.forms), theta=(np.ones(1), np.zeros(1)), std=(np.ones(1),) * 2
    )
    assert {name: value for name, _, value, *_ in parameters_of(both)} == {"size_1": 1.0, "size_2": 0.0}
    assert [name for name, *_ in parameters_of(one)] == ["size"]


def test_of_causes_that_leave_more_than_no_cause_does_one_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Together both close nine tenths; but the first alone triples what is left: it cancels the second."""
    left = {(): 1.0, (0,): 0.9, (1,): 0.5, (0, 1): 0.1}
    along = {2: ([(0,), (1,)], [1.0, 3.0, 0.1]), 1: ([(1,)], [1.0, 0.5])}
    choice = choice_of(np.ones(VALUES), *(form(column[:, None], SIZE) for column in np.eye(VALUES)[1:3]))
    folds = SimpleNamespace(choice=choice, errors_with=lambda numbers: np.array([left[tuple(numbers)]]))

    def ordered(_: object, causes: list[tuple[int, ...]]) -> tuple[list[tuple[int, ...]], list[Array]]:
        order, errors = along[len(causes)]
        return order, [np.array([error]) for error in errors]

    monkeypatch.setattr(answer, "ordered", ordered)
    monkeypatch.setattr(answer, "causes_of", lambda _, step: [(number,) for number in step.chosen])
    order, errors, shown = answer._without_cancelling(folds, fit_step(choice, (0, 1)), 0.0)
    assert order == [(1,)]
    assert [float(error) for error in np.concatenate(errors)] == [1.0, 0.5]
    assert shown == [0.5]


@pytest.mark.parametrize(("value", "is_one"), [(0.49, False), (-0.54, True)])
def test_a_share_of_more_than_a_half_is_no_size_of_a_machine(value: float, is_one: bool) -> None:
    """As a robot file is refused with it: an instrument does not read half as much again."""
    one = cause(0.9, 0.9, 0.9)
    assert replace(one, theta=(np.array([value]) / one.forms[0].sizes,)).impossible == is_one
