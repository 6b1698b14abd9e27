"""Noise and wrong rows found beside effects, on campaigns of the KR240-2."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from beamstiff.diagnosis.inference.library import Library, build_library
from beamstiff.diagnosis.residual import outlier_screening
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.diagnosis.residual.gross_errors import _chance_of_few, _chance_of_large, mishaps
from beamstiff.diagnosis.residual.noise_variance import Variance
from beamstiff.diagnosis.residual.outlier_screening import Screened, _left_out, screen
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.measure.rows import history_order, subset
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array
from tests.diagnosis import planted
from tests.diagnosis.machines import POSITION, ROTATION, kr240, nominal
from tests.diagnosis.planted import campaign, plan

PLAN = planted.plan(14)
ROWS = len(PLAN.q)


def prepared(rows: Measurements) -> tuple[Baseline, Library]:
    there = fit_baseline(kr240(), rows)
    return there, build_library(there, whiten(there))


@cache
def sound(effect: planted.Effect | None, seed: int) -> tuple[Measurements, Library]:
    """Return a campaign without wrong rows, and what effects could do about its fit."""
    rows = planted.campaign(PLAN, *([effect] if effect else []), seed=seed)
    return rows, prepared(rows)[1]


def screened(rows: Measurements, library: Library | None = None) -> Screened:
    """Return rows screened; of those that differ in a few wrong ones only, with the library of the sound."""
    return screen(*prepared(rows)) if library is None else screen(fit_baseline(kr240(), rows), library)


def wrong(rows: Measurements, which: list[int], size: float) -> Measurements:
    """Return rows of which some are off by a size in one direction each."""
    moved = rows.displacement.copy()
    moved[which, np.arange(len(which)) % 3] += size
    return replace(rows, displacement=moved)


@pytest.mark.parametrize("effect", [None, planted.backlash, planted.base_compliance])
def test_wrong_rows_are_found_whatever_else_there_is_and_no_others(effect: planted.Effect | None) -> None:
    rows, library = sound(effect, 1)
    which = [5, 22, 47, 70]
    found = screened(wrong(rows, which, 2e-3), library)
    assert sorted(found.outliers.tolist()) == which
    assert not found.used[which].any()
    assert found.used.sum() == 6 * (ROWS - 4)


def test_mishaps_are_isolated_and_what_one_posture_has_to_itself_is_not() -> None:
    rows, library = sound(planted.backlash, 1)
    assert screened(wrong(rows, [5, 22, 47, 70], 2e-3), library).isolated
    assert not screened(rows, library).isolated
    heavy = np.argsort(-np.linalg.norm(PLAN.wrench, axis=1), kind="stable")[:5].tolist()
    found = screened(wrong(rows, heavy, 2e-3), library)
    assert found.outliers.size >= 3
    assert not found.isolated  # something gives way under the largest loads
    at_one = np.flatnonzero(PLAN.pose == PLAN.pose[40])[:4].tolist()
    found = screened(wrong(rows, at_one, 2e-3), library)
    assert found.outliers.size >= 3
    assert not found.isolated


def test_rows_of_one_posture_that_are_off_by_the_same_are_one_mishap() -> None:
    rows, library = sound(planted.backlash, 1)
    run = np.flatnonzero(PLAN.pose == PLAN.pose[40])[3:].tolist()  # its load turns there
    moved = rows.displacement.copy()
    moved[run, :3] += [1.5e-3, -1e-3, 1e-3]  # a reflector that was bumped
    found = screened(replace(rows, displacement=moved), library)
    assert sorted(found.outliers.tolist()) == run
    assert found.isolated


def test_sound_rows_are_left_alone() -> None:
    # one table in a thousand may lose a row
    flagged = [screened(*sound(None, seed)).outliers.size for seed in (0, 1, 3)]
    assert flagged == [0] * 3


@pytest.mark.parametrize("effect", [planted.backlash, planted.hysteresis, planted.actuator_lever])
def test_rows_of_an_effect_are_no_outliers(effect: planted.Effect) -> None:
    assert screened(planted.campaign(PLAN, effect, seed=2)).outliers.size == 0


@pytest.mark.parametrize(("position", "rotation"), [(1.0, 1.0), (2.0, 2.0), (0.5, 2.0)])
def test_the_noise_is_what_the_rows_show_whatever_the_table_claims(position: float, rotation: float) -> None:
    rows = planted.campaign(PLAN, planted.base_compliance, seed=3)
    claim = np.repeat([POSITION / position, ROTATION / rotation], 3)
    found = screened(replace(rows, sigma=np.tile(claim, (ROWS, 1))))
    # 252 values each: 4.5 % of sampling, the claim pulls a little towards itself
    np.testing.assert_allclose(np.log(found.noise), np.log([position, rotation]), atol=0.2)
    np.testing.assert_allclose(found.baseline.sigma, np.tile(claim * np.repeat(found.noise, 3), (ROWS, 1)))


def test_where_nothing_is_claimed_the_noise_is_found_from_the_rows_alone() -> None:
    rows = planted.campaign(PLAN, planted.backlash, seed=4, noise=3.0)
    silent = replace(rows, sigma=np.full((ROWS, 6), np.nan), sigma_position=None, sigma_rotation=None)
    sigma = np.median(screened(silent).baseline.sigma, axis=0)
    np.testing.assert_allclose(sigma[:3], 3 * POSITION, rtol=0.2)
    np.testing.assert_allclose(sigma[3:], 3 * ROTATION, rtol=0.2)


def test_many_wrong_rows_are_no_outliers_but_something_else() -> None:
    which = np.random.default_rng(5).permutation(ROWS)[: ROWS // 3].tolist()
    rows, library = sound(None, 1)
    assert screened(wrong(rows, which, 1e-3), library).outliers.size <= 0.15 * ROWS


def test_one_posture_is_screened_without_a_breakdown_where_the_fit_absorbs_nearly_everything() -> None:
    found = screened(subset(planted.campaign(PLAN, seed=7), np.arange(6)))
    assert np.isfinite(found.noise).all()
    assert found.outliers.size == 0


def test_too_few_rows_are_taken_as_they_are() -> None:
    found = screened(subset(planted.campaign(PLAN, seed=8), [2]))
    assert found.noise.tolist() == [1.0, 1.0]
    assert found.outliers.size == 0


def test_a_shape_that_moves_nothing_but_by_rounding_tells_nothing_of_the_noise() -> None:
    rows, library = sound(None, 3)
    there = fit_baseline(kr240(), rows)
    still = replace(library.hypotheses[0].shape, name="still")
    columns = 1e-50 * np.random.default_rng(4).standard_normal((*still.columns.shape[:2], 1))
    nothing = replace(
        library.hypotheses[0],
        component="elsewhere",
        shape=replace(still, columns=columns, parameters=still.parameters[:1]),
    )
    with_it = replace(library, hypotheses=(*library.hypotheses, nothing))
    assert screen(there, with_it).noise.tolist() == screen(there, library).noise.tolist()


@pytest.mark.parametrize("size", [0.01, 0.5])
def test_rows_that_scatter_far_below_the_noise_claimed_are_judged_by_the_claim(size: float) -> None:
    found = screened(planted.campaign(PLAN, seed=1, noise=size))
    assert found.below_claim == (size < 0.3)
    np.testing.assert_allclose(found.noise, 1.0 if found.below_claim else size, rtol=0.25)


def test_rows_left_out_together_are_compared_with_what_the_others_predict() -> None:
    """Against the conditional distribution of a dense Gaussian, the fitted parameters nearly free."""
    rng = np.random.default_rng(6)
    white = whiten(fit_baseline(kr240(), sound(planted.backlash, 1)[0]))
    columns = white.project_out(rng.standard_normal((white.gap.size, 4)))
    scales = Variance(np.array([1.2, 0.9]), 0.3, 2.0)
    some = [5, 6, 40]
    distance, count = _left_out(white, columns, scales, some)
    assert np.flatnonzero(count).tolist() == some
    rotation = (white.component >= 3).astype(np.intp)
    free = 1e4 * white.tangent / np.linalg.norm(white.tangent, axis=0)
    covariance = np.diag(scales.noise[rotation] ** 2 + scales.unknown * white.unknown)
    covariance += scales.library * columns @ columns.T + free @ free.T
    axes = white.unwhiten(np.eye(white.gap.size))  # to the values as they were measured
    covariance, gap = axes @ covariance @ axes.T, axes @ white.gap
    number = np.cumsum(white.used.ravel()).reshape(white.used.shape) - 1
    out = np.concatenate([number[row][white.used[row]] for row in some])
    rest = np.setdiff1d(np.arange(white.gap.size), out)
    gain = np.linalg.solve(covariance[np.ix_(rest, rest)], covariance[np.ix_(rest, out)]).T
    left = gap[out] - gain @ gap[rest]
    apart = covariance[np.ix_(out, out)] - gain @ covariance[np.ix_(rest, out)]
    for row, at in zip(some, np.split(np.arange(out.size), len(some)), strict=True):
        expected = left[at] @ np.linalg.solve(apart[np.ix_(at, at)], left[at])
        assert distance[row] == pytest.approx(expected, rel=1e-4)


def test_what_was_left_out_beside_wrong_rows_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    rows, library = sound(planted.backlash, 1)
    there = fit_baseline(kr240(), wrong(rows, [5, 22, 47, 70], 2e-3))
    each = outlier_screening._left_out
    turns: list[int] = []

    def misled(*args: Any) -> tuple[Array, NDArray[np.intp]]:
        distance, count = each(*args)
        if len(args) == 3 and not turns:  # in the first turn two sound rows look worse than all
            distance = distance.copy()
            distance[[10, 11]] = 1e6
        turns.append(len(args))
        return distance, count

    monkeypatch.setattr(outlier_screening, "_left_out", misled)
    found = screen(there, library)
    assert turns[-1] == 4
    assert sorted(found.outliers.tolist()) == [5, 22, 47, 70]
    assert found.used[[10, 11]].all()


def test_rows_that_are_off_alike_do_not_speak_for_one_another() -> None:
    """A target that is knocked and set right again: all readings between are off by the same."""
    rows, library = sound(planted.backlash, 1)
    struck = history_order(rows)[30:36]
    moved = rows.displacement.copy()
    moved[struck, :3] += [3e-4, -2e-4, 4e-4]
    found = screened(replace(rows, displacement=moved), library)
    assert sorted(found.outliers.tolist()) == sorted(struck.tolist())


# What tells mishaps from what a shape misses: counts of boxes and balls, ranks, and runs


SIX = plan(6)
RUN = [13, 14, 15]  # of the posture of rows 12 to 17
SHIFT = np.array([12.0, -9.0, 4.0, 0.0, 0.0, 0.0])  # sigma


def off_by(values: dict[int, Array]) -> Baseline:
    """Return a baseline of which rows are off by vectors (6,) of so many sigma."""
    there = nominal(kr240(), campaign(SIX, seed=1))
    gap = np.zeros_like(there.gap)
    for row, value in values.items():
        gap[row] = value * there.sigma[row]
    return replace(there, measured=there.predicted + gap)


def under(there: Baseline, steps: list[float]) -> Baseline:
    """Return the same with the loads of the run in one direction, times the steps."""
    predicted = there.predicted.copy()
    predicted[RUN] = np.outer(steps, np.full(6, 1e-3))
    return replace(there, measured=there.gap + predicted, predicted=predicted)


def test_rows_one_after_another_that_are_off_by_the_same_are_one_mishap() -> None:
    rng = np.random.default_rng(2)
    there = off_by({row: SHIFT + rng.standard_normal(6) for row in RUN})
    for steps in ([0.5, 0.0, -0.5], [1.0, 0.5, 0.0]):
        assert mishaps(under(there, steps), RUN) == [RUN]
    assert mishaps(under(there, [0.5, 0.0, -0.5]), [RUN[0], RUN[2]]) == [[RUN[0]], [RUN[2]]]  # one is sound


def test_a_knock_of_the_tracker_strikes_whichever_reflector_is_read() -> None:
    there = under(off_by(dict.fromkeys(RUN, SHIFT)), [0.5, 0.0, -0.5])
    points = np.where(np.arange(len(there.rows)) % 2 == 0, "left", "right")
    of_two = replace(there, rows=replace(there.rows, point=points))
    assert mishaps(of_two, RUN) == [RUN]
    gap = there.gap.copy()
    gap[RUN[1]] *= -1  # the other reflector is off by something else
    apart = replace(of_two, measured=there.predicted + gap)
    assert sorted(mishaps(apart, RUN)) == [[RUN[0], RUN[2]], [RUN[1]]]


def test_what_gives_way_and_stays_so_is_no_mishap() -> None:
    there = off_by(dict.fromkeys(RUN, SHIFT))
    assert mishaps(under(there, [0.6, 1.0, 0.5]), RUN) == [[row] for row in RUN]
    turned = off_by({row: sign * SHIFT for row, sign in zip(RUN, (1, 1, -1), strict=True)})
    assert RUN not in mishaps(under(turned, [0.6, 1.0, -1.0]), RUN)


def test_rows_that_are_off_by_something_else_are_another_mishap() -> None:
    long = list(range(12, 30))
    there = off_by(dict.fromkeys(long, SHIFT) | {30: np.roll(SHIFT, 1)})
    predicted = there.predicted.copy()
    predicted[long] = np.outer(np.cos(np.arange(18.0)), np.full(6, 1e-3))
    there = replace(there, measured=there.gap + predicted, predicted=predicted)
    assert mishaps(there, [*long, 30]) == [long, [30]]


def test_the_chance_of_few_postures_is_that_of_boxes_and_balls() -> None:
    # three balls in three boxes: all in one, in at most two, in any
    assert _chance_of_few(3, [0, 0, 0]) == pytest.approx(1 / 9)
    assert _chance_of_few(3, [0, 0, 1]) == pytest.approx(7 / 9)
    assert _chance_of_few(3, [0, 1, 2]) == pytest.approx(1.0)


def test_the_chance_of_large_moves_is_that_of_uniform_ranks() -> None:
    rng = np.random.default_rng(3)
    moved = rng.permutation(60).astype(np.float64)
    drawn = [_chance_of_large(moved, rng.permutation(60)[:6].tolist()) for _ in range(2000)]
    for share in (0.05, 0.25, 0.5, 0.9):
        assert np.mean(np.array(drawn) < share) == pytest.approx(share, abs=0.04)
