"""The selection against a second formulation: explicit least squares of each fold, and hand-made problems."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.answer import without_weak
from beamstiff.diagnosis.decomposition.fit import Choice, build_choice, fit_step, forms_in, prior_of
from beamstiff.diagnosis.decomposition.folds import Folds, folds_of, interval, ordered, unweighed
from beamstiff.diagnosis.decomposition.forms import Form, forms_of, stacked
from beamstiff.diagnosis.decomposition.look_alikes import with_usual_name
from beamstiff.diagnosis.decomposition.open_model import OpenModel, open_geometry
from beamstiff.diagnosis.decomposition.selection import (
    _of_all_joints,
    best_first,
    causes_of,
    select,
    with_each,
    with_further_forms,
)
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.effects import Quantity, Shape
from beamstiff.diagnosis.inference.library import ALL_REVERSED
from beamstiff.diagnosis.prior import TEMPERING
from tests.diagnosis.decomposition.test_decompose import UR10, found, table

VALUES = 60
SIZE = Quantity("size", "N", 1.0)


def form(columns: np.ndarray, *parameters: Quantity) -> Form:
    shape = Shape("by hand", np.zeros((1, 6, 0)), parameters)
    return Form("joint-compliance", "q2", shape, columns, 0.0, likely=1.0)


def choice_of(
    residual: np.ndarray, *forms: Form, drives: np.ndarray | None = None, present: Sequence[float] = ()
) -> Choice:
    """Return forms to choose from beside one open parameter that they do not touch, and drives."""
    count = len(residual)
    geometry, drives = np.eye(count)[:, :1], drives if drives is not None else np.zeros((count, 0))
    model = SimpleNamespace(
        open_basis=geometry,
        drives=drives,
        present=np.array(present),
        realistic=np.full(len(present), np.inf),
        residual=residual,
        count=count,
        independent=float(count),
        given=load_robot(UR10),
    )
    return build_choice(model, forms)


@pytest.fixture(scope="module")
def folds() -> Folds:
    model = open_geometry(*table(("approach", "gear"), 45))
    joints = [one for one in forms_of(model) if one.component is not None]
    kept = [one for one in joints if one.effect in ("approach-direction", "angle-curve")]
    return folds_of(model, build_choice(model, kept), 0)


def test_held_out_errors_are_those_of_fits_without_the_fold(folds: Folds) -> None:
    model, step = folds.model, select(folds.choice, folds.squared_errors)
    assert len(step.chosen) >= 2
    for tried in (fit_step(folds.choice, ()), step):
        matrix, right = stacked(model, list(forms_in(folds.choice, tried).values()))
        left = np.zeros(model.count)
        for one in range(folds.fold.max() + 1):
            out = np.flatnonzero(folds.fold == one)
            theta = np.linalg.lstsq(np.delete(matrix, out, axis=0), np.delete(right, out), rcond=1e-12)[0]
            left[out] = right[out] - matrix[out] @ theta
        squares = unweighed(model, left)[folds.position] ** 2
        assert folds.squared_errors(tried).sum() == pytest.approx(squares.sum(), rel=1e-3)


def test_errors_along_causes_leave_each_as_large_as_all_say(folds: Folds) -> None:
    """Sizes from the fit to all other postures; of what is missing the open parameters take what they can."""
    model, step = folds.model, select(folds.choice, folds.squared_errors)
    step = fit_step(folds.choice, step.chosen[:2])
    matrix, right = stacked(model, list(forms_in(folds.choice, step).values()))
    opened = matrix.shape[1] - sum(one.columns.shape[1] for one in forms_in(folds.choice, step).values())
    first = opened + folds.choice.forms[step.chosen[0]].columns.shape[1]
    left = np.zeros(model.count)
    for one in range(folds.fold.max() + 1):
        out = np.flatnonzero(folds.fold == one)
        rest = np.delete(matrix, out, axis=0)
        theta = np.linalg.lstsq(rest, np.delete(right, out), rcond=1e-12)[0]
        moved = matrix[:, opened:first] @ theta[opened:first]
        again = np.linalg.lstsq(rest[:, :opened], np.delete(right - moved, out), rcond=1e-12)[0]
        left[out] = (right - moved)[out] - matrix[out, :opened] @ again
    nothing, with_first, with_both = folds.errors_along([(number,) for number in step.chosen])
    squares = unweighed(model, left)[folds.position] ** 2
    assert with_first.sum() == pytest.approx(squares.sum(), rel=1e-3)
    np.testing.assert_allclose(with_both, folds.squared_errors(step), rtol=1e-6)
    np.testing.assert_allclose(nothing, folds.squared_errors(fit_step(folds.choice, ())))


def test_causes_come_in_the_order_of_what_they_close(folds: Folds) -> None:
    step = select(folds.choice, folds.squared_errors)
    order, errors = ordered(folds, [(number,) for number in step.chosen])
    sums = [error.sum() for error in errors]
    assert sums == sorted(sums, reverse=True)
    assert folds.choice.forms[order[0][0]].key == "approach-direction:q2"


def test_no_parameter_takes_a_sign_that_it_cannot_have() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((VALUES, 2))
    residual = columns @ [3.0, -2.0] + 0.1 * rng.standard_normal(VALUES)
    pair = [Quantity("first", "N", 1.0, positive=True), Quantity("second", "N", 1.0, positive=True)]
    step = fit_step(choice_of(residual, form(columns, *pair)), (0,))
    assert step.free[0].tolist() == [True, False]
    alone = np.linalg.lstsq(columns[1:, :1], residual[1:], rcond=None)[1][0]
    assert step.squares == pytest.approx(alone, rel=0.05)


@pytest.mark.parametrize(("least", "possible"), [(-2.1, True), (-1.99, True), (-1.5, False)])
def test_a_fit_that_wants_less_than_there_can_be_is_no_machine(least: float, possible: bool) -> None:
    """-2 is wanted, known to 0.13: what is less than there can be by noise alone may be so."""
    rng = np.random.default_rng(0)
    column = rng.standard_normal((VALUES, 1))
    residual = -2.0 * column[:, 0] + rng.standard_normal(VALUES)
    made = choice_of(residual, form(column, Quantity("mass", "kg", 1.0, least=least)))
    assert np.isfinite(fit_step(made, (0,)).bic) == possible
    assert np.isfinite(with_each(made, fit_step(made, ()))[0][0]) == possible


@pytest.mark.parametrize(("change", "known"), [(0.5, True), (-3.0, False)])
def test_no_drive_gives_less_than_nothing(change: float, known: bool) -> None:
    rng = np.random.default_rng(2)
    drive, column = rng.standard_normal((2, VALUES, 1))
    column[0] = drive[0] = 0.0
    residual = (change * drive + 2.0 * column)[:, 0] + 0.01 * rng.standard_normal(VALUES)
    made = choice_of(residual, form(column, Quantity("any", "m", 1.0)), drives=drive, present=[1.0])
    step = fit_step(made, (0,))
    assert step.drives.tolist() == [known]
    compliance = step.theta[0] / np.linalg.norm(drive) if known else 0.0  # of the drive, in all
    assert compliance == pytest.approx(1.0 + change if known else 0.0, abs=0.01)
    assert (np.linalg.norm(step.left) < 0.02 * np.sqrt(VALUES)) == known


@pytest.mark.parametrize(("second", "tried"), [(-0.05, True), (-2.0, False)])
def test_a_form_is_tried_though_chance_puts_a_part_of_it_below_zero(second: float, tried: bool) -> None:
    """Of a compliance in two directions one is often 0: its estimate is negative every other time."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((VALUES, 2))
    noise = rng.standard_normal(VALUES)
    noise -= columns @ np.linalg.lstsq(columns, noise)[0]  # the estimate is what stands above
    residual = columns @ [3.0, second] + noise
    pair = [Quantity("first", "N", 1.0, positive=True), Quantity("second", "N", 1.0, positive=True)]
    choice = choice_of(residual, form(columns, *pair))
    nothing = fit_step(choice, ())
    assert fit_step(choice, (0,)).free[0].tolist() == [True, False]
    alone = fit_step(choice, (0,)).bic
    assert np.isfinite(alone)
    assert list(best_first(choice, nothing)) == ([(alone, 0)] if tried else [])


@pytest.mark.parametrize(("coupling", "bounded"), [(1.0, False), (4.0, True)])
def test_a_coupling_stays_within_what_it_couples(coupling: float, bounded: bool) -> None:
    """``c_ab^2 <= c_aa c_bb``: of compliances 2 and 3 at most 2.45; both grow for a larger one."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((VALUES, 3))
    residual = columns @ [2.0, 3.0, coupling] + 0.01 * rng.standard_normal(VALUES)
    y, z = (Quantity(f"compliance_{axis}", "m/N", 1.0, positive=True) for axis in "yz")
    both = Quantity("compliance_yz", "m/N", 1.0, within=(y.name, z.name))
    choice = choice_of(residual, form(columns, y, z, both))
    step = fit_step(choice, (0,))
    own, other, shared = step.theta * choice.units[step.at]
    if bounded:
        assert shared**2 == pytest.approx(own * other, rel=1e-4)
        assert own > 2.0
        assert other > 3.0
    else:
        assert (own, other, shared) == pytest.approx((2.0, 3.0, 1.0), abs=0.01)


def test_the_prior_of_a_cause_counts_once_however_many_forms_it_has() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3, VALUES, 1))
    size = Quantity("size", "N", 1.0)
    orders = [replace(form(column, size), effect="angle-curve", likely=0.1) for column in columns]
    one, other, apart = orders
    apart = replace(apart, component="q3")
    made = choice_of(rng.standard_normal(VALUES), one, other, apart)
    own = TEMPERING * np.log(0.1)
    assert prior_of(made, (0,)) == pytest.approx(own)
    assert prior_of(made, (0, 1)) == pytest.approx(own)
    assert prior_of(made, (0, 1, 2)) == pytest.approx(2 * own)
    after, _ = with_each(made, fit_step(made, (0,)))
    for number in (1, 2):
        assert after[number] == pytest.approx(fit_step(made, (0, number)).bic, abs=0.05)


@pytest.mark.parametrize(("size", "stays"), [(0.95, True), (0.5, False)])
def test_a_cause_stays_without_which_another_has_a_size_that_no_machine_has(size: float, stays: bool) -> None:
    """The second helps on no held-out posture; but without it the first takes half of it up, to 1.2 m."""
    first, second = 1000.0 * np.eye(VALUES)[:, 1:3].T
    second = 0.5 * first + np.sqrt(0.75) * second
    choice = choice_of(
        size * first + 0.5 * second,
        form(first[:, None], Quantity("moved", "m", 1.0)),
        replace(form(second[:, None], Quantity("size", "N", 1.0)), component="q3"),
    )
    folds = SimpleNamespace(
        choice=choice, squared_errors=lambda step: np.full(10, 1.0 if 0 in step.chosen else 2.0)
    )
    kept = without_weak(folds, fit_step(choice, (0, 1)))
    assert kept.chosen == ((0, 1) if stays else (0,))


@pytest.mark.parametrize(("shares", "chosen"), [((1.0,), 1), ((1.0, 0.5), 2), ((1.0, 0.5, 0.4), 2)])
def test_a_law_between_forms_is_a_cause_of_two_and_no_more(shares: tuple[float, ...], chosen: int) -> None:
    """What a third form would explain is left: another cause does not come in for it unless it is there."""
    rng = np.random.default_rng(4)
    columns, other = rng.standard_normal((3, VALUES, 1)), rng.standard_normal((VALUES, 1))
    law = sum(20.0 * share * column[:, 0] for share, column in zip(shares, columns, strict=False))
    forms = [replace(form(one, SIZE), effect="bearing-tilt") for one in columns]
    apart = replace(form(other, SIZE), effect="link-bending")
    made = choice_of(law + rng.standard_normal(VALUES), *forms, apart)
    step = select(made, lambda step: step.left**2)
    assert len(step.chosen) == chosen
    assert causes_of(made, step) == [step.chosen]
    further = with_further_forms(made, fit_step(made, (0,)), made.of_cause["bearing-tilt:q2"], 2)
    assert further.chosen[:1] == (0,)
    assert len(further.chosen) == chosen


def test_further_forms_end_where_no_machine_is_like_the_fit_and_none_is_left() -> None:
    decomposition = found()[0].decomposition
    forms = forms_of(decomposition.model, wanted=["angle-curve"])[:1]
    choice = build_choice(decomposition.model, forms)
    impossible = replace(fit_step(choice, (0,)), bic=np.inf)
    choice.fits[0,] = impossible
    assert with_further_forms(choice, impossible, [0]) is impossible


@pytest.mark.parametrize(("found", "others", "together"), [(4, 0.5, True), (3, 0.5, False), (4, 0.0, False)])
def test_lost_motion_of_most_joints_is_one_of_all_where_the_others_have_some(
    found: int, others: float, together: bool
) -> None:
    """What each of the others has shows by itself too little to come in."""
    columns = np.linalg.qr(np.random.default_rng(0).standard_normal((VALUES, 6)))[0].T
    sizes = np.where(np.arange(6) < found, 20.0, 3.0 * others)
    each = Quantity("half_lost_motion", "N", 1.0)  # of a unit without a largest size
    one = replace(form(columns[0][:, None], each), effect="approach-direction", likely=0.1)
    joints = [replace(one, component=f"q{k + 1}", columns=columns[k][:, None]) for k in range(6)]
    names = tuple(replace(each, name=f"half_lost_motion_q{k + 1}") for k in range(6))
    shape = replace(one.shape, parameters=names)
    made = choice_of(sizes @ columns, *joints, replace(one, component=None, columns=columns.T, shape=shape))
    if 2 * found <= len(joints):  # of all joints those few are told that are worth a cause each
        told = with_usual_name(made, fit_step(made, [len(joints)])).chosen
        assert sorted(told) == ([len(joints)] if others else [*range(found)])
    singles = fit_step(made, range(found))
    assert _of_all_joints(made, singles, ALL_REVERSED).chosen == ((6,) if together else singles.chosen)


# What is left out of a fit stays out, and nothing else with it


def matrices_of_compliances(model: OpenModel) -> list[Form]:
    effects = ("base-compliance", "tool-compliance", "bearing-tilt", "link-bending")
    return [form for form in forms_of(model, wanted=effects) if len(form.couplings)]


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_with_parameters_left_out_is_the_same_when_it_is_solved_again(seed: int) -> None:
    rng, model = np.random.default_rng(seed), found()[0].decomposition.model
    forms = matrices_of_compliances(model)
    assert forms
    left_out = 0
    for form in forms:
        moved = form.columns @ rng.standard_normal(form.sizes.size)  # gives work away: no machine does
        noise = rng.standard_normal(len(model.residual))
        given = replace(model, residual=30.0 * moved / np.linalg.norm(moved) * np.sqrt(model.count) + noise)
        choice = build_choice(given, [form])
        step = fit_step(choice, (0,))
        (once,) = forms_in(choice, step).values()
        left_out += int((~step.free[0]).sum())
        theta = solved(given, [once])[0][-form.sizes.size :]
        basis = given.open_basis
        left = given.residual - form.columns @ theta
        left = left - basis @ (basis.T @ left)
        # the bounds of couplings are reached in steps
        assert left @ left == pytest.approx(step.left @ step.left, rel=1e-5)
    assert left_out > 0


def test_a_share_that_is_the_same_at_every_posture_is_certain_however_much_their_gaps_differ() -> None:
    first = np.random.default_rng(1).exponential(size=40)
    np.testing.assert_allclose(interval(first, 0.1 * first, first, 0.0, 0), (0.9, 0.9), rtol=1e-12)
    low, high = interval(first, first[::-1], first, 0.0, 0)
    assert low < -0.1
    assert high > 0.1
    assert interval(first, 0.5 * first, first, 2.0 * first.max() * 40, 0) == (0.0, 0.0)  # no gap above noise
