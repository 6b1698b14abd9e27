"""What stands in for a cause, on hand-made problems in which that is known."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.decomposition.fit import Choice, Step, fit_step
from beamstiff.diagnosis.decomposition.look_alikes import instead, rival_of, tempering_of, with_usual_name
from beamstiff.diagnosis.effects import Quantity
from beamstiff.diagnosis.prior import RELATIVE, TEMPERING
from beamstiff.se3 import Array
from tests.diagnosis.decomposition.test_selection import VALUES, choice_of, form

AWAY = 0.005  # of a cause, that its two look-alikes together do not reproduce


def held_out(step: Step) -> Array:
    """Return squared errors, each value a posture; of so many values few fits change held out."""
    return step.left**2


@pytest.fixture
def made() -> Choice:
    """A cause that two others reproduce together, neither by itself, and one that none does."""
    rng = np.random.default_rng(3)
    first, second, apart, away = rng.standard_normal((4, VALUES))
    both = first + second + AWAY * away
    size = Quantity("size", "N", 1.0)
    names = ("q1", "q2", "q3", "q4")
    forms = [
        replace(form(column[:, None], size), effect="angle-curve", component=name)
        for name, column in zip(names, (both, first, second, apart), strict=True)
    ]
    return choice_of(30.0 * both + 20.0 * apart + rng.standard_normal(VALUES), *forms)


def test_two_causes_that_do_together_what_one_does_are_found_in_its_place(made: Choice) -> None:
    step = fit_step(made, (0, 3))
    found = list(instead(made, step, (0,), held_out))
    assert sorted(found[0][1].chosen) == [1, 2, 3]
    alone = rival_of(made, step, (0,), held_out)
    together = rival_of(made, step, (0,), held_out, found)
    assert alone.indistinguishable == ()
    assert set(together.indistinguishable) & {"angle-curve:q2", "angle-curve:q3"}
    assert together.probability < alone.probability
    assert together.present == pytest.approx(1.0, abs=1e-6)


def test_a_cause_that_none_replaces_is_sure(made: Choice) -> None:
    step = fit_step(made, (0, 3))
    assert list(instead(made, step, (3,), held_out)) == []
    rival = rival_of(made, step, (3,), held_out)
    assert rival.indistinguishable == ()
    assert rival.probability > 0.99


@pytest.mark.parametrize(("curve", "pair"), [("q1", True), ("q2", False)])
def test_a_balancer_and_a_curve_of_its_joint_move_positions_alike(curve: str, pair: bool) -> None:
    """The curve's few orders fit worse, but an encoder's or gear's error may be any, too."""
    rng = np.random.default_rng(5)
    spring, other = rng.standard_normal((2, VALUES))
    size = Quantity("size", "N", 1.0)
    forms = [
        replace(form(column[:, None], size), effect=effect, component=joint)
        for column, effect, joint in (
            (spring, "gravity-compensator", "q1"),
            (other, "angle-curve", curve),
        )
    ]
    choice = choice_of(30.0 * spring + rng.standard_normal(VALUES), *forms)
    rival = rival_of(choice, fit_step(choice, (0,)), (0,), held_out)
    assert rival.indistinguishable == ((f"angle-curve:{curve}",) if pair else ())


@pytest.mark.parametrize(("sizes", "pair"), [((30.0, 3.0), True), ((3.0, 30.0), False)])
def test_a_part_of_a_free_cause_may_do_most_of_it(sizes: tuple[float, float], pair: bool) -> None:
    """Of a base that mostly turns about the first joint's axis, most may be that joint's drive."""
    rng = np.random.default_rng(7)
    turning, tilting = rng.standard_normal((2, VALUES))
    size = Quantity("size", "N", 1.0)
    base = replace(form(np.column_stack([turning, tilting]), size, size), effect="base-compliance")
    drive = replace(form(turning[:, None], size), effect="joint-compliance", component="q1")
    gap = sizes[0] * turning + sizes[1] * tilting + rng.standard_normal(VALUES)
    choice = choice_of(gap, base, drive)
    rival = rival_of(choice, fit_step(choice, (0,)), (0,), held_out)
    assert rival.indistinguishable == (("joint-compliance:q1",) if pair else ())
    assert rival.probability > 0.99  # it is there, however much of it


def test_the_more_a_cause_explains_the_less_a_difference_says(made: Choice) -> None:
    """By log odds over ``T + E / R``, E half of what the criterion falls by the cause."""
    step = fit_step(made, (0, 3))
    for number, other in ((0, 3), (3, 0)):
        without = fit_step(made, (other,))
        expected = TEMPERING + (without.bic - step.bic) / 2.0 / RELATIVE
        assert tempering_of(step, without) == pytest.approx(expected)
        assert number in step.chosen


def test_a_fit_that_no_machine_allows_without_the_cause_leaves_a_probability(made: Choice) -> None:
    """Beside the cause the other is small; without it, it would have to be larger than any machine's."""
    bounded = replace(made, largest=np.where(made.units > 0, 1e-9, np.inf))
    rival = rival_of(bounded, fit_step(made, (0, 3)), (0,), held_out)
    assert 0.0 <= rival.probability <= 1.0
    assert 0.0 <= rival.present <= 1.0


def test_what_fits_better_and_is_no_better_on_held_out_postures_is_no_likelier() -> None:
    """A cause whose rival was found by the fitted rows alone: both are as likely."""
    rng = np.random.default_rng(11)
    first, off = rng.standard_normal((2, VALUES))
    rival = first + 0.3 * off
    size = Quantity("size", "N", 1.0)
    forms = [
        replace(form(column[:, None], size), effect="angle-curve", component=name)
        for name, column in (("q1", first), ("q2", rival))
    ]
    choice = choice_of(20.0 * rival + rng.standard_normal(VALUES), *forms)
    mine, theirs = fit_step(choice, (0,)), fit_step(choice, (1,))
    assert theirs.bic < mine.bic  # the rows fitted speak for the rival
    judged = rival_of(choice, mine, (0,), held_out)
    assert judged.indistinguishable == ("angle-curve:q2",)
    assert judged.probability == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(
    ("effect", "compliances", "named"),
    [
        *(
            (effect, compliances, named)
            for effect in ("joint-compliance", "approach-direction")
            for compliances, named in (
                ((5.0, 0.0, 0.0, 0.0), ["q2"]),
                ((20.0, 0.0, 2.0, 0.0), ["q2", "q4"]),
                ((5.0, 3.0, 2.0, 2.0), [None]),
                ((0.1, 0.0, 0.0, 0.0), [None]),
            )
        ),
        ("joint-compliance", (5.0, 0.0, 2.0, 0.0), [None]),
        ("approach-direction", (5.0, 0.0, 2.0, 0.0), ["q2", "q4"]),  # of lost motion some joints may be
    ],
)
def test_all_joints_are_the_one_that_moves_most_where_the_others_move_little(
    effect: str, compliances: tuple[float, ...], named: list[str | None]
) -> None:
    """Where none is worth a cause by itself, nothing is dropped."""
    rng = np.random.default_rng(5)
    columns = rng.standard_normal((VALUES, 4))
    places = [f"q{at + 2}" for at in range(4)]
    sizes = [Quantity(f"compliance_{name}", "N", 1.0, positive=True) for name in places]
    choice = choice_of(
        columns @ compliances + rng.standard_normal(VALUES),
        replace(form(columns, *sizes), effect=effect, component=None),
        *(replace(form(columns[:, [at]], sizes[at]), effect=effect, component=places[at]) for at in range(4)),
    )
    step = with_usual_name(choice, fit_step(choice, (0,)))
    assert [choice.forms[number].component for number in step.chosen] == named


@pytest.mark.parametrize(("away", "named"), [(0.01, "base-compliance:null"), (0.5, "bearing-tilt:q1")])
def test_one_mechanics_has_its_usual_name_unless_the_rows_distinguish(away: float, named: str) -> None:
    """A bearing on the ground in two forms against the base, whose two forms are nearly the same."""
    rng = np.random.default_rng(6)
    columns = rng.standard_normal((VALUES, 2))
    base = columns + away * rng.standard_normal((VALUES, 2))
    size = Quantity("size", "N", 1.0)
    places = (("bearing-tilt", "q1", columns), ("base-compliance", None, base))
    forms = [
        replace(form(both[:, [at]], size), effect=effect, component=component)
        for effect, component, both in places
        for at in range(2)
    ]
    group = ("base-compliance:null", "bearing-tilt:q1")
    choice = replace(
        choice_of(columns @ [40.0, 20.0] + rng.standard_normal(VALUES), *forms),
        alike=dict.fromkeys(group, group),
    )
    step = with_usual_name(choice, fit_step(choice, (0, 1)))
    assert {choice.forms[number].key for number in step.chosen} == {named}
    assert len(step.chosen) == 2
