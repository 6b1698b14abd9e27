"""A cause against a mixture of everything else: what is there is missed by it, a stand-in is not."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.discrepancy import discrepancy_odds, presence_odds
from beamstiff.diagnosis.decomposition.fit import Choice, bic, fit_step
from beamstiff.diagnosis.decomposition.forms import Form
from beamstiff.diagnosis.effects import Quantity
from beamstiff.se3 import Array
from tests.diagnosis.decomposition.test_selection import choice_of, form

VALUES, OTHERS = 120, 12
EFFECTS = ("backlash", "hardening", "hysteresis", "angle-curve", "approach-direction", "load-error")


def forms(rng: np.random.Generator) -> list[Form]:
    """Return a form of joint-compliance, and twelve of other effects at two places each."""
    columns = rng.standard_normal((1 + OTHERS, VALUES, 1))
    first, *others = [form(column, Quantity("size", "N", 1.0)) for column in columns]
    places = [(effect, f"q{k}") for effect in EFFECTS for k in (1, 2)]
    return [
        first,
        *(replace(one, effect=e, component=c) for one, (e, c) in zip(others, places, strict=True)),
    ]


def odds_of_the_first(residual: Array, some: list[Form]) -> float:
    made = choice_of(residual, *some)
    return discrepancy_odds(made, fit_step(made, (0,)), [(0,)], [()])[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_cause_that_is_there_is_missed_by_a_mixture_of_all_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    some = forms(rng)
    residual = 3.0 * some[0].columns[:, 0] + rng.standard_normal(VALUES)
    assert odds_of_the_first(residual, some) > 50.0


@pytest.mark.parametrize("seed", range(5))
def test_what_only_resembles_a_mixture_of_others_is_not_there(seed: int) -> None:
    """Half of its column is the sum of all others, and that sum is the truth: alone it explains half."""
    rng = np.random.default_rng(seed)
    some = forms(rng)
    every = sum(one.columns[:, 0] for one in some[1:]) / np.sqrt(OTHERS)
    some[0] = replace(some[0], columns=(every + some[0].columns[:, 0])[:, None])
    residual = 5.0 * every + rng.standard_normal(VALUES)
    alone = choice_of(residual, some[0])
    assert fit_step(alone, ()).bic - fit_step(alone, (0,)).bic > 30.0  # by itself it seems sure
    assert odds_of_the_first(residual, some) < 0.0


def test_without_other_effects_the_odds_are_those_of_the_fits_alone() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.standard_normal((2, VALUES, 1))
    some = [form(column, Quantity("size", "N", 1.0)) for column in (first, second)]
    some[1] = replace(some[1], component="q3")  # another place of the same effect is no part of the mixture
    residual = first[:, 0] + rng.standard_normal(VALUES)
    residual[0] = 0.0  # the open parameter takes it up

    def by_hand(columns: Array) -> float:
        left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
        return float(bic(left @ left, columns.shape[1], VALUES - 1, 0.0))

    column = np.where(np.arange(VALUES)[:, None] == 0, 0.0, first)
    expected = 0.5 * (by_hand(column[:, :0]) - by_hand(column))
    assert odds_of_the_first(residual, some) == pytest.approx(expected, abs=0.05)


def test_what_it_is_not_distinguished_from_is_no_part_of_the_mixture() -> None:
    rng = np.random.default_rng(2)
    some = forms(rng)
    some[1] = replace(some[1], columns=some[0].columns)  # backlash:q1, the same column
    residual = 3.0 * some[0].columns[:, 0] + rng.standard_normal(VALUES)
    made: Choice = choice_of(residual, *some)
    step = fit_step(made, (0,))
    with_twin, without = (discrepancy_odds(made, step, [(0,)], [alike])[0] for alike in ([], ["backlash:q1"]))
    assert with_twin < without - 20.0
    assert without > 50.0


def test_whether_something_is_compliant_is_apart_from_which() -> None:
    """A link that moves the tool as the drive does is no part of its mixture, whatever its name."""
    rng = np.random.default_rng(3)
    some = forms(rng)
    some[1] = replace(some[1], effect="link-bending", component="link2", columns=some[0].columns)
    residual = 3.0 * some[0].columns[:, 0] + rng.standard_normal(VALUES)
    assert odds_of_the_first(residual, some) > 50.0


def with_a_wide_one(rng: np.random.Generator) -> list[Form]:
    """Return forms of a drive, of a base of eight columns that can do what it does, and of ten others."""
    drive, *others = forms(rng)
    columns = rng.standard_normal((VALUES, 8))
    columns[:, 0] = drive.columns[:, 0] - 0.1 * columns[:, 1]
    eight = tuple(Quantity(f"size{k}", "N", 1.0) for k in range(8))
    wide = replace(form(columns, *eight), effect="base-compliance", component=None)
    return [drive, wide, *others[2:]]


@pytest.mark.parametrize("seed", range(5))
def test_an_idle_cause_that_could_take_the_part_of_another_is_no_doubt_about_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    some = with_a_wide_one(rng)
    residual = some[0].columns[:, 0] + rng.standard_normal(VALUES)
    made = choice_of(residual, *some)
    together = discrepancy_odds(made, fit_step(made, (0, 1)), [(0,), (1,)], [(), ()])
    drive, wide = presence_odds(made, [(0,), (1,)], [(), ()])
    assert together[0] < 0.1  # beside the other nothing says that it is there
    assert together[1] < 0.0
    assert drive > 20.0
    assert wide == together[1]


@pytest.mark.parametrize("seed", range(5))
def test_what_only_a_wide_cause_explains_is_not_left_to_a_narrow_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    some = with_a_wide_one(rng)
    residual = some[1].columns.sum(axis=1) + rng.standard_normal(VALUES)
    drive, wide = presence_odds(choice_of(residual, *some), [(0,), (1,)], [(), ()])
    assert drive < 0.1
    assert wide > 50.0
