"""Random designs, against all of them counted out."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.planning.designs import CRITERIA, choose_tests, random_designs


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
