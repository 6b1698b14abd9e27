"""What effects are worth on postures they did not see, against shares that were put in."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.effects import Quantity, Shape
from beamstiff.diagnosis.held_out.score import (
    Weighted,
    combinations_of,
    fitted,
    folds,
    held_out,
    shift,
    solve,
    stacked,
)
from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array
from tests.diagnosis.machines import POSITION, ROTATION, cycles, elbow, nominal

SIGMA = np.repeat([POSITION, ROTATION], 3)


def campaign(poses: int = 40, loads: int = 3, shared: bool = False) -> Baseline:
    return nominal(elbow(), cycles(elbow(), poses, np.linspace(0.5, 1, loads), shared_unloaded=shared))


def with_gap(there: Baseline, gap: Array) -> Baseline:
    return replace(there, measured=there.predicted + gap)


def weighted(columns: Array, magnitude: float = 1e3, effect: str = "a", weight: float = 1.0) -> Weighted:
    """Return an effect of some columns (N, 6, c), realistic sizes 1."""
    names = tuple(Quantity(f"p{k}", "1", 1.0) for k in range(columns.shape[-1]))
    shape = Shape("only", columns, names)
    one = Hypothesis(effect, None, shape, 1.0, columns.reshape(-1, columns.shape[-1]))
    return Weighted(one, weight, magnitude)


def across(there: Baseline, columns: Array) -> Array:
    """Return columns (N, 6) without what the fitted stiffness explains, in units of the noise."""
    tangent = (there.tangent / SIGMA[:, None]).reshape(columns.size, -1)
    values = (columns / SIGMA).ravel()
    left = values - tangent @ np.linalg.lstsq(tangent, values)[0]
    return left.reshape(columns.shape) * SIGMA


@pytest.mark.parametrize("share", [0.9, 0.5, 0.1])
def test_the_shrink_is_the_share_of_the_gap_that_the_effect_is(share: float) -> None:
    there, rng = campaign(), np.random.default_rng(2)
    effect = across(there, rng.standard_normal((120, 6)) * SIGMA)
    rest = across(there, rng.standard_normal((120, 6)) * SIGMA)
    for part in (slice(3), slice(3, 6)):  # the two apart, and of one size
        own = effect[:, part]
        rest[:, part] -= own * (own * rest[:, part]).sum() / (own**2).sum()
        rest[:, part] *= np.linalg.norm(own) / np.linalg.norm(rest[:, part])
    gap = 20 * (np.sqrt(share) * effect + np.sqrt(1 - share) * rest)
    noise = rng.standard_normal((120, 6)) * SIGMA
    found = held_out(with_gap(there, gap + noise), there.used, [[weighted(effect[..., None])]], 1.0, 0)
    assert found.shrink == pytest.approx(share, abs=0.05)
    low, high = found.interval
    assert low < share < high or found.shrink == pytest.approx(share, abs=0.02)
    assert found.before == pytest.approx(np.sqrt((gap[:, :3] ** 2).sum(axis=1).mean()), rel=0.1)
    assert found.noise == pytest.approx(np.sqrt(3) * POSITION)
    assert found.postures == 40


def test_an_effect_that_is_all_of_it_leaves_the_noise() -> None:
    there, rng = campaign(), np.random.default_rng(3)
    effect = rng.standard_normal((120, 6)) * SIGMA
    gap = 10 * effect + rng.standard_normal((120, 6)) * SIGMA
    found = held_out(with_gap(there, gap), there.used, [[weighted(effect[..., None])]], 1.0, 0)
    assert found.after == pytest.approx(found.noise, rel=0.1)
    assert found.shrink > 0.98


def test_the_misfit_counts_rotations_too() -> None:
    there, rng = campaign(), np.random.default_rng(7)
    effect = rng.standard_normal((120, 6)) * SIGMA
    effect[:, :3] = 0.0
    noise = rng.standard_normal((120, 6)) * SIGMA
    measured = with_gap(there, across(there, 10 * effect) + noise)
    own = [[weighted(across(there, effect)[..., None])]]
    without, with_it = (held_out(measured, there.used, models, 1.0, 0) for models in ([], own))
    assert with_it.misfit == pytest.approx(1.0, abs=0.1)
    assert without.misfit == pytest.approx(np.sqrt((1 + 101) / 2), rel=0.15)
    assert (with_it.open, without.open) == pytest.approx((without.misfit, without.misfit))
    # positions say next to nothing, and yet the effect is worth all that there is
    assert with_it.interval[0] < 0.1
    assert with_it.explained_fraction > 0.95
    assert without.explained_fraction < 0.3


def test_what_fits_each_posture_by_itself_is_worth_nothing_on_others() -> None:
    there, rng = campaign(), np.random.default_rng(4)
    by_pose = np.zeros((120, 6, 40))
    by_pose[np.arange(120), 0, there.rows.pose] = 1.0
    gap = np.zeros((120, 6))
    gap[:, 0] = by_pose[:, 0] @ rng.standard_normal(40) * 30 * POSITION
    found = held_out(with_gap(there, gap), there.used, [[weighted(by_pose)]], 1.0, 0)
    assert found.shrink < 0.05
    assert found.explained_fraction < 0.05


def test_what_each_posture_has_to_itself_is_worth_something_on_its_other_loads() -> None:
    there, rng = campaign(poses=12, loads=10), np.random.default_rng(9)
    own = np.zeros((120, 6, 12))
    pose = np.repeat(np.arange(12), 10)
    own[np.arange(120), :, pose] = np.linalg.norm(there.rows.wrench, axis=1)[:, None] * 1e-6
    gap = own @ rng.standard_normal(12) * 10 + rng.standard_normal((120, 6)) * SIGMA
    by_posture, by_load = (
        held_out(with_gap(there, gap), there.used, [[weighted(own)]], 1.0, 0, by_load=held)
        for held in (False, True)
    )
    assert by_posture.explained_fraction < 0.3
    assert by_load.explained_fraction > 0.95
    assert by_load.misfit == pytest.approx(1.0, abs=0.1)
    assert by_load.postures == by_posture.postures == 12


def test_a_posture_that_an_effect_says_little_of_does_not_spoil_what_it_is_worth() -> None:
    """Of two parameters one shows in a single posture, much: without it nothing is known of it."""
    there, rng = campaign(), np.random.default_rng(8)
    columns = np.zeros((120, 6, 2))
    columns[..., 0] = rng.standard_normal((120, 6)) * SIGMA
    columns[there.rows.pose == 7, :, 1] = 200 * rng.standard_normal((3, 6)) * SIGMA
    gap = columns @ [5.0, 0.5] + rng.standard_normal((120, 6)) * SIGMA
    found = held_out(with_gap(there, gap), there.used, [[weighted(columns, magnitude=1.0)]], 1.0, 0)
    assert found.shrink < 0.3
    assert found.surely == found.explained_fraction > 0.9


def test_a_gap_below_the_noise_has_nothing_to_close() -> None:
    there = campaign()
    found = held_out(with_gap(there, np.zeros((120, 6))), there.used, [[weighted(there.tangent)]], 1.0, 0)
    assert (found.shrink, found.interval) == (0.0, (0.0, 0.0))


def test_values_that_do_not_count_change_nothing() -> None:
    there, rng = campaign(), np.random.default_rng(5)
    effect = rng.standard_normal((120, 6, 1)) * SIGMA[:, None]
    gap = 5 * effect[..., 0] + rng.standard_normal((120, 6)) * SIGMA
    wrong = gap.copy()
    wrong[4] = 1.0
    used = there.used.copy()
    used[4] = False
    one, other = (held_out(with_gap(there, g), used, [[weighted(effect)]], 1.0, 0) for g in (gap, wrong))
    assert one == other


@pytest.mark.parametrize("shared", [False, True], ids=["independent", "shared reading"])
def test_a_fit_is_generalised_least_squares_with_a_prior_of_the_effects_size(shared: bool) -> None:
    there, rng = campaign(poses=6, shared=shared), np.random.default_rng(6)
    gap = rng.standard_normal((18, 6)) * SIGMA * 3
    one = weighted(rng.standard_normal((18, 6, 2)) * SIGMA[:, None], magnitude=0.7)
    found = fitted(with_gap(there, gap), there.used, [[one]], scale=1.5)[0]
    row, component = np.repeat(np.arange(18), 6), np.tile(np.arange(6), 18)
    together = np.eye(108)
    if shared:
        pose = there.rows.pose[row]
        together = 0.5 * (together + (pose[:, None] == pose) * (component[:, None] == component))
    covariance = together * np.outer(*[1.5 * np.tile(SIGMA, 18)] * 2)
    columns = np.concatenate([there.tangent, one.hypothesis.shape.columns], axis=-1).reshape(108, 4)
    weight = np.linalg.inv(covariance)
    inverse = np.linalg.inv(columns.T @ weight @ columns + np.diag([0, 0, 0.7**-2, 0.7**-2]))
    theta = inverse @ columns.T @ weight @ gap.ravel()
    np.testing.assert_allclose(np.concatenate([found.compliance, found.theta]), theta, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, inverse, rtol=1e-6, atol=1e-12 * np.abs(inverse).max())
    moved = shift(there, [found], [[one.hypothesis.shape.columns]])
    np.testing.assert_allclose(moved.ravel(), columns @ theta, rtol=1e-6, atol=1e-12)
    every = stacked(there, found, [one.hypothesis.shape.columns])
    spread = every @ found.covariance @ every.swapaxes(1, 2)
    expected = columns[:6] @ inverse @ columns[:6].T
    np.testing.assert_allclose(spread[0], expected, rtol=1e-5, atol=1e-9 * np.abs(expected).max())


def test_ridge_regression_of_columns_of_any_size_is_the_dense_solution() -> None:
    rng = np.random.default_rng(7)
    columns = rng.standard_normal((20, 3)) * [1e6, 1.0, 1e-6]
    gap, ridge = rng.standard_normal(20), np.array([0.0, 2.0, 1e-13])
    theta, covariance = solve(columns, ridge, gap)
    stacked = np.concatenate([columns, np.diag(np.sqrt(ridge))])
    size = np.array([1e6, 1, 1e-6])
    expected = np.linalg.lstsq(stacked / size, np.concatenate([gap, np.zeros(3)]))[0] / size
    np.testing.assert_allclose(theta, expected, rtol=1e-9)
    assert np.diag(covariance) == pytest.approx(
        np.diag(np.linalg.inv((g := stacked / [1e6, 1, 1e-6]).T @ g)) / np.array([1e12, 1, 1e-12])
    )


@pytest.mark.parametrize("seed", range(8))
def test_of_what_shows_nowhere_nothing_is_told(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((60, 9))
    columns[:, 2] = 0.0
    ridge, gap = np.repeat([0.0, 1.0], [6, 3]), rng.standard_normal(60)
    some = np.arange(9) != 2
    found, covariance = solve(columns, ridge, gap)
    expected, spread = solve(columns[:, some], ridge[some], gap)
    assert found[some] == pytest.approx(expected)
    assert found[2] == 0.0
    np.testing.assert_allclose(covariance[np.ix_(some, some)], spread, rtol=1e-9, atol=1e-15)
    assert not covariance[2].any()


def test_shapes_of_the_first_effect_share_its_weight_beside_the_best_of_the_second() -> None:
    blank = np.zeros((1, 6, 1))
    first = [weighted(blank, weight=0.7), weighted(blank, weight=0.3)]
    second = [weighted(blank, weight=0.2, effect="b"), weighted(blank, weight=0.8, effect="b")]
    found = combinations_of([first, second])
    assert [weight for weight, _ in found] == [0.7, 0.3]
    assert all(shapes[1] is second[1] for _, shapes in found)
    assert combinations_of([]) == [(1.0, [])]


def test_the_model_alone_has_no_negative_stiffness_however_well_that_would_fit() -> None:
    # loads of the wrong sign: the best line has compliances below nothing, the best machine gives way nowhere
    there = campaign()
    backward = with_gap(there, -2.0 * there.predicted)
    whole = np.sqrt((backward.measured[:, :3] ** 2).sum(axis=1).mean())
    assert held_out(backward, there.used, (), 1.0, 0).before == pytest.approx(whole, rel=1e-3)
    softer = with_gap(there, 0.5 * there.predicted)
    assert held_out(softer, there.used, (), 1.0, 0).before < 0.02 * whole


def test_rows_that_are_held_out_tell_nothing_by_an_unloaded_reading_they_share_with_others() -> None:
    there, rng = campaign(poses=6, loads=8, shared=True), np.random.default_rng(4)
    there = with_gap(there, rng.standard_normal((48, 6)) * SIGMA)
    models = [[weighted(rng.standard_normal((48, 6, 2)) * SIGMA[:, None])]]
    fold, _ = folds(there, there.used, np.random.default_rng(0), by_load=True)
    left = np.zeros((48, 6))
    for k in range(fold.max() + 1):
        fits = fitted(there, there.used & (fold != k)[:, None], models, 1.0)
        foretold = shift(there, fits, [[one.hypothesis.shape.columns for one in fit.shapes] for fit in fits])
        left[fold == k] = (there.gap - foretold)[fold == k]
    found = held_out(there, there.used, models, 1.0, 0, by_load=True)
    assert found.after == pytest.approx(np.sqrt((left[:, :3] ** 2).sum(axis=1).mean()))
    assert found.misfit == pytest.approx(np.sqrt(((left / SIGMA) ** 2).mean()))
