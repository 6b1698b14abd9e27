"""The search without each tenth of the postures, against searches and least squares made by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.answer import told
from beamstiff.diagnosis.decomposition.causes import HALF, QUARTER, Cause
from beamstiff.diagnosis.decomposition.fit import build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import FOLDS, Folds, folds_of
from beamstiff.diagnosis.decomposition.forms import Form, forms_of
from beamstiff.diagnosis.decomposition.nested import Nested, nested, promised
from beamstiff.diagnosis.decomposition.open_model import open_geometry
from beamstiff.diagnosis.decomposition.selection import causes_of, select
from beamstiff.diagnosis.effects import Quantity, Shape
from beamstiff.se3 import Array
from tests.diagnosis.decomposition.test_decompose import SLIPS_AT, UR10, read


def folds_along(q: Array, causes: tuple[str, ...], further: int = 0) -> Folds:
    """Return the folds of postures that joints stop short in, with as many random forms more."""
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    model = open_geometry(robot, read(robot, q, causes, rng))
    forms = [one for one in forms_of(model) if one.effect == "approach-direction" and one.component]
    forms += [one for one in forms_of(model) if one.effect == "target-slip" and "slip" in causes]
    size = np.linalg.norm(forms[0].columns)
    drawn = rng.standard_normal((further, len(model.residual), 1))
    drawn[:, model.count :] = 0.0
    forms += [random_form(number, size * one / np.linalg.norm(one)) for number, one in enumerate(drawn)]
    return folds_of(model, build_choice(model, forms), 0)


def random_form(number: int, columns: Array) -> Form:
    """Return a form that follows nothing."""
    shape = Shape("drawn", np.zeros((1, 6, 0)), (Quantity("size", "rad", 1e-4),))
    return Form("joint-compliance", f"drawn{number}", shape, columns, 0.0, likely=1.0)


def at_random(count: int) -> Array:
    return np.random.default_rng(2).uniform(-2.5, 2.5, (count, 6))


@pytest.fixture(scope="module")
def three() -> Folds:
    return folds_along(at_random(60), ("three",))


@pytest.fixture(scope="module")
def drawn() -> Folds:
    """Few postures beside many forms that follow nothing: some fit what the noise is by chance."""
    return folds_along(at_random(20), (), further=1500)


def fold_of(folds: Folds) -> Array:
    fold = np.zeros(folds.posture.max() + 1, dtype=int)
    fold[folds.posture] = folds.fold
    return fold


def test_a_posture_of_its_own_is_held_out_by_itself_and_a_short_motion_as_a_whole() -> None:
    drawn = fold_of(folds_along(at_random(40), ()))
    assert np.bincount(drawn).tolist() == [40 // FOLDS] * FOLDS
    corners = at_random(21)
    part = np.arange(0.0, 1.0, 0.02)[:, None]
    motion = np.concatenate([a + part * (b - a) for a, b in pairwise(corners)])
    fold = fold_of(folds_along(motion, ()))
    apart = (np.diff(fold) != 0).mean()
    assert apart < 0.25  # a step is a fiftieth of the way between two at random; drawn one by one it is 0.9
    assert {*fold} == {*range(FOLDS)}


def test_what_is_there_is_found_without_any_fold(three: Folds) -> None:
    found = told(three, select(three.choice, three.squared_errors), 0)
    again = nested(three, found.causes, 0)
    assert {one.key for one in found.causes} >= {f"approach-direction:q{joint}" for joint in (1, 3, 5)}
    for cause in found.causes:
        assert again.found(cause) == 1.0
        assert not again.hangs(cause)


def test_errors_are_those_of_the_causes_that_were_chosen_without_the_fold(three: Folds) -> None:
    """Of folds without a cause they are those of the fit without it, posture by posture."""
    choice = three.choice
    whole = select(choice, three.squared_errors)
    less = fit_step(choice, whole.chosen[1:])
    fits = tuple(less if number % 2 else whole for number in range(FOLDS))
    errors = Nested(three, fits).squared_errors(fits)
    odd = fold_of(three) % 2 == 1
    np.testing.assert_array_equal(errors[odd], three.squared_errors(less)[odd])
    np.testing.assert_array_equal(errors[~odd], three.squared_errors(whole)[~odd])


def test_a_cause_hangs_where_it_is_mostly_missing_and_does_not_help_there(three: Folds) -> None:
    choice = three.choice
    whole = select(choice, three.squared_errors)
    found = told(three, whole, 0)
    real = next(one for one in found.causes if one.key == "approach-direction:q1")
    numbers = next(one for one in causes_of(choice, whole) if choice.forms[one[0]].key == real.key)
    less = fit_step(choice, [number for number in whole.chosen if number not in numbers])
    small = replace(real, closes=QUARTER / 2)
    missed = Nested(three, (less,) * FOLDS)
    assert missed.found(small) == 0.0
    assert not missed.hangs(small)  # it is missing, and would help
    other = next(one for one in choice.forms if one.key == "approach-direction:q6")
    idle = replace(small, forms=(other,), indistinguishable=())
    assert missed.hangs(idle)
    assert not missed.hangs(replace(idle, closes=QUARTER))
    some = int(HALF * FOLDS)
    assert not Nested(three, (whole,) * some + (less,) * some).hangs(replace(small, indistinguishable=()))


@pytest.mark.slow
def test_of_causes_that_fit_by_chance_hardly_anything_is_promised(drawn: Folds) -> None:
    """The best few of many forms close much of the postures that chose them, and nothing of others."""
    step = select(drawn.choice, drawn.squared_errors)
    assert step.chosen
    found = told(drawn, step, 0)
    every: list[Cause] = [*found.causes, *found.unclear]
    closes = sum(one.closes for one in every)
    assert closes > 1.0
    promise = promised(found, nested(drawn, every, 0))
    # a fold that happens to gain counts, one that loses does not
    assert sum(one.closes for one in (*promise.causes, *promise.unclear)) < 0.1 * closes


def test_what_is_there_is_promised_as_before(three: Folds) -> None:
    found = told(three, select(three.choice, three.squared_errors), 0)
    promise = promised(found, nested(three, found.causes, 0))
    assert promise.closes == pytest.approx(found.closes, rel=0.02)
    assert promise.closes <= found.closes


def test_a_slip_is_placed_by_all_postures() -> None:
    """Without a fold its row is known to some postures only, which are no fresh ones."""
    folds = folds_along(at_random(60), ("slip",))
    found = told(folds, select(folds.choice, folds.squared_errors), 0)
    (slip,) = found.causes
    assert slip.rows == (SLIPS_AT,)
    again = nested(folds, found.causes, 0)
    forms = folds.choice.forms
    rows = [
        [forms[k].shape.name for k in fit.chosen if forms[k].effect == "target-slip"] for fit in again.fits
    ]
    assert rows == FOLDS * [[slip.shape]]
    assert promised(found, again).closes == pytest.approx(found.closes, rel=0.01)
