"""Optimal designs against published ones, against all choices of small sets and random ones, certificates."""

import itertools
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.planning.designs import (
    CRITERIA,
    Criterion,
    choose_tests,
    criterion_of,
    how_many,
    random_designs,
    upper_bound,
)
from beamstiff.se3 import Array

NAMES = ["a", "b", "c"]


def regression(points: Array, degree: int) -> Array:
    """Return the information of single readings of a polynomial, (N, degree + 1, degree + 1)."""
    rows = np.stack([points**power for power in range(degree + 1)], axis=1)
    return rows[:, :, None] * rows[:, None, :]


def random_tests(seed: int, count: int, components: int = 2) -> Array:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(count, components, 3)) * rng.uniform(0.2, 3.0, 3)
    return rows.swapaxes(1, 2) @ rows


@pytest.mark.parametrize(
    ("criterion", "shares"),
    [("D", (1 / 3, 1 / 3, 1 / 3)), ("A", (1 / 4, 1 / 2, 1 / 4)), ("E", (1 / 5, 3 / 5, 1 / 5))],
)
def test_a_parabola_is_read_at_its_ends_and_middle(criterion: Criterion, shares: tuple[float, ...]) -> None:
    """Pukelsheim, Optimal Design of Experiments (1993), sections 9.5, 9.12 and 9.13, for -1 <= x <= 1."""
    points = np.linspace(-1, 1, 21)
    design = choose_tests(regression(points, 2), 60, NAMES, criterion, repeats=60)
    at, times = np.unique(points[design.chosen], return_counts=True)
    assert at == pytest.approx([-1, 0, 1], abs=1e-12)
    assert times.tolist() == [round(60 * share) for share in shares]
    assert design.efficiency > 0.999


def test_a_cubic_is_read_at_the_zeros_of_a_legendre_polynomial() -> None:
    """D-optimal for degree 3: -1, -1/sqrt(5), 1/sqrt(5), 1, a quarter each (Guest 1958)."""
    points = np.unique(np.concatenate([np.linspace(-1, 1, 41), [-1 / np.sqrt(5), 1 / np.sqrt(5)]]))
    design = choose_tests(regression(points, 3), 40, ["1", "x", "x2", "x3"], "D", repeats=40)
    at, times = np.unique(points[design.chosen], return_counts=True)
    assert at == pytest.approx([-1, -1 / np.sqrt(5), 1 / np.sqrt(5), 1])
    assert times.tolist() == [10, 10, 10, 10]
    assert design.efficiency > 0.9999
    # the equivalence theorem: nothing anywhere would help more than what is there
    assert 40 * design.sensitivity.max() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), repeats=st.integers(1, 2))
def test_small_sets_against_all_choices(criterion: Criterion, seed: int, repeats: int) -> None:
    information = random_tests(seed, 8)
    choices = itertools.combinations(sorted([*range(8)] * repeats), 4)
    best = max(float(criterion_of(information[list(choice)].sum(axis=0), criterion)) for choice in choices)
    design = choose_tests(information, 4, NAMES, criterion, repeats)
    assert np.bincount(design.chosen).max() <= repeats
    assert design.value <= best * (1 + 1e-9)
    assert design.efficiency <= design.value / best * (1 + 1e-9)  # the certificate never promises too much
    assert design.efficiency > 0.5


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_exchange_is_rarely_far_from_the_best(criterion: Criterion) -> None:
    shares = []
    for seed in range(30):
        information = random_tests(seed, 9)
        every = itertools.combinations(range(9), 4)
        best = max(float(criterion_of(information[list(choice)].sum(axis=0), criterion)) for choice in every)
        shares.append(choose_tests(information, 4, NAMES, criterion).value / best)
    assert np.mean(shares) > 0.99
    assert np.mean(np.array(shares) > 1 - 1e-9) > 0.8


@pytest.mark.parametrize("criterion", CRITERIA)
def test_no_random_choice_beats_the_bound_or_the_design(criterion: Criterion) -> None:
    information = random_tests(5, 300, components=3)
    design = choose_tests(information, 12, NAMES, criterion)
    rng = np.random.default_rng(1)
    draws = np.array([rng.choice(300, 12, replace=False) for _ in range(2000)])
    values = criterion_of(information[draws].sum(axis=1), criterion)
    assert values.max() < design.value
    assert design.efficiency > {"D": 0.99, "A": 0.98, "E": 0.93}[criterion]
    bound = upper_bound(information, 12, criterion, 1, information[draws[0]].sum(axis=0))
    assert values.max() < design.value <= bound


def test_what_a_design_says_of_itself_is_so() -> None:
    information = random_tests(6, 40)
    design = choose_tests(information, 9, NAMES, "A")
    total = information[design.chosen].sum(axis=0)
    assert design.covariance == pytest.approx(np.linalg.inv(total))
    assert design.value == pytest.approx(1 / np.trace(np.linalg.inv(total)))
    assert list(design.standard_errors) == NAMES
    assert design.worst == pytest.approx(np.sqrt(np.diag(np.linalg.inv(total))).max())
    assert pytest.approx(np.sqrt(np.linalg.eigvalsh(total)[0])) == design.indices.O3
    assert pytest.approx(np.linalg.det(total) ** (1 / 6) / 3) == design.indices.O1
    # tr(G M) = 1, and G = M^-2 / tr(M^-1) for A
    inverse = np.linalg.inv(total)
    assert design.sensitivity == pytest.approx(
        [np.trace(inverse @ inverse @ one) / np.trace(inverse) for one in information]
    )
    assert design.sensitivity[design.chosen].sum() == pytest.approx(1.0)


def test_d_optimal_designs_do_not_depend_on_the_scale_of_the_parameters() -> None:
    information = random_tests(7, 60)
    scale = np.array([1e-3, 1.0, 1e4])
    one, other = (choose_tests(i, 8, NAMES, "D") for i in (information, information * np.outer(scale, scale)))
    assert sorted(one.chosen) == sorted(other.chosen)
    assert other.efficiency == pytest.approx(one.efficiency, abs=1e-3)


def test_information_in_other_units_of_noise_changes_nothing_but_the_value() -> None:
    information = random_tests(8, 60)
    for criterion in CRITERIA:
        one, other = (choose_tests(factor * information, 8, NAMES, criterion) for factor in (1.0, 1e9))
        assert one.chosen.tolist() == other.chosen.tolist()
        assert other.value == pytest.approx(1e9 * one.value)
        assert other.worst == pytest.approx(one.worst / np.sqrt(1e9))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"count": 9}, "8 candidates for 9 tests, each at most 1 times"),
        ({"count": 0}, "found 0 tests with 1 repeats"),
        ({"repeats": 0}, "found 4 tests with 0 repeats"),
        ({"criterion": "G"}, "criterion: found 'G', expected D, A or E"),
        ({"names": ["a", "b"]}, r"found shape \(8, 3, 3\), expected matrices of the 2 parameters"),
        ({"information": np.full((8, 3, 3), np.nan)}, "entries that are no numbers"),
        (
            {"count": 1, "information": regression(np.linspace(-1, 1, 8), 2)},
            "1 of these tests cannot determine the 3",
        ),
    ],
)
def test_what_cannot_be_chosen_is_refused(arguments: dict, message: str) -> None:
    known = {"information": random_tests(0, 8), "count": 4, "names": NAMES, "criterion": "D", "repeats": 1}
    with pytest.raises(BeamstiffError, match=message):
        choose_tests(**(known | arguments))


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_criterion_of_a_singular_information_is_zero(criterion: Criterion) -> None:
    assert criterion_of(np.diag([1.0, 2.0, 0.0]), criterion) == 0.0
    assert criterion_of(np.zeros((2, 3, 3)), criterion).tolist() == [0.0, 0.0]


def test_the_standard_error_falls_steeply_up_to_the_knee_and_with_the_root_after_it() -> None:
    """Ten alike tests of one parameter and one rare look at the other: enough is when both are seen well."""
    information = random_tests(9, 400)
    curve = how_many(information, NAMES, [2, 3, 4, 6, 8, 12, 16, 24, 32])
    assert (np.diff(curve.worst) < 0).all()
    per_test = curve.worst * np.sqrt(curve.counts)
    after = curve.counts >= curve.knee
    assert per_test[after][0] <= 1.05 * per_test.min()
    assert curve.knee > 2
    assert per_test[0] > 1.05 * per_test.min()
    assert curve.tests_for(curve.worst[3] * 1.0001) == 6
    assert curve.tests_for(curve.worst[-1] / 2) == 4 * 32
    with pytest.raises(BeamstiffError, match="standard error: found 0"):
        curve.tests_for(0.0)
    with pytest.raises(BeamstiffError, match=r"found \[4, 4\], expected growing numbers"):
        how_many(information, NAMES, [4, 4])


def some_information(seed: int) -> Any:
    rows = np.random.default_rng(seed).normal(size=(7, 2, 3)) * [1.0, 10.0, 0.1]
    return rows.swapaxes(1, 2) @ rows


@pytest.mark.parametrize("criterion", CRITERIA)
def test_medians_are_those_of_all_choices(criterion: Any) -> None:
    information = some_information(0)
    drawn = random_designs(information, 3, criterion, draws=4000)
    totals = [information[list(rows)].sum(axis=0) for rows in combinations(range(7), 3)]
    worst = [np.sqrt(np.diagonal(np.linalg.inv(total)).max()) for total in totals]
    value = {
        "D": lambda total: np.linalg.det(total) ** (1 / 3),
        "A": lambda total: 1 / np.trace(np.linalg.inv(total)),
        "E": lambda total: np.linalg.eigvalsh(total)[0],
    }[criterion]
    for quantile in (0.25, 0.5, 0.75):
        low, high = np.quantile(worst, [quantile - 0.05, quantile + 0.05])
        assert low <= np.quantile(drawn.worst, quantile) <= high
        low, high = np.quantile([value(total) for total in totals], [quantile - 0.05, quantile + 0.05])
        assert low <= np.quantile(drawn.values, quantile) <= high
    assert set(np.round(drawn.worst, 9)) <= set(np.round(worst, 9))


@pytest.mark.parametrize("criterion", CRITERIA)
def test_none_beats_the_bound_of_the_optimal_design(criterion: Any) -> None:
    information = some_information(1)
    best = choose_tests(information, 4, ["a", "b", "c"], criterion)
    drawn = random_designs(information, 4, criterion, draws=500)
    assert drawn.values.max() <= best.value / best.efficiency * (1 + 1e-9)


def test_choices_that_do_not_determine_all_count_as_such() -> None:
    one = np.diag([1.0, 0.0]) * np.ones((5, 1, 1))
    drawn = random_designs(one, 2, "D", draws=10)
    assert (drawn.values == 0).all()
    assert np.isinf(drawn.worst).all()


def test_more_tests_than_candidates_are_refused() -> None:
    with pytest.raises(BeamstiffError, match="7 candidates for 8 tests at random"):
        random_designs(some_information(0), 8, "D")
