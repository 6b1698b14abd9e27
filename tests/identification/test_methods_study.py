"""The study in benchmarks/: all methods agree where the optimum is unique, and the time they take.

The times are those of one core's own work, so that what else the machine does counts little.
"""

import io

import numpy as np
import pytest
from rich.console import Console

from beamstiff import load_robot
from beamstiff.identification.identify import identify
from beamstiff.identification.minimise import METHODS, Effort, minimise
from benchmarks.identification_methods import (
    REMAINS,
    SEVEN,
    SUMS,
    Case,
    campaign,
    cases,
    compare,
    print_table,
    print_ways,
)


@pytest.fixture(scope="module", params=[0, pytest.param(1, marks=pytest.mark.slow)], ids=["paper", "told"])
def tried(request: pytest.FixtureRequest) -> Case:
    return cases()[request.param]


def test_all_methods_agree_where_the_optimum_is_unique(tried: Case) -> None:
    results = compare(tried, evaluations=500)
    assert list(results) == list(METHODS)
    for method, result in results.items():
        assert result.difference <= 1e-6, method
        assert result.found.cost <= result.alone.cost * (1 + 1e-12)


def test_the_campaign_is_that_of_the_issue() -> None:
    for tried in cases():
        problem = tried.objective.problem
        assert len(problem.model.pose) == 126
        assert len(np.unique(problem.model.pose)) == 63
        assert len(problem.model.parameters) == 7
        assert np.unique(problem.sigma[problem.used]).tolist() == [3.5e-5]


def test_only_the_sums_of_bearings_in_series_are_unique() -> None:
    """From other starts the bearings end elsewhere, their sums do not; `identify` says so."""
    paper, _ = cases()
    ends = [
        minimise(paper.objective, begin=paper.objective.parameters.begin + shift).theta
        for shift in np.random.default_rng(0).uniform(-1, 1, (3, 7))
    ]
    stiffness = np.exp(ends)
    assert (np.ptp(stiffness[:, 3:], axis=0) > 0.1 * stiffness[0, 3:]).any()
    unique = np.array([paper.unique(theta) for theta in ends])
    assert unique == pytest.approx(np.broadcast_to(unique[0], unique.shape), rel=1e-6)
    robot = load_robot("ir663")
    found = identify(robot, campaign(robot, [[1, 0, 0], [0, 0, -1]]), SEVEN, folds=0)
    assert {frozenset(item.parameters) for item in found.degenerate} == set(map(frozenset, SUMS))


@pytest.mark.slow
def test_a_genetic_search_takes_the_evaluations_that_it_is_given(tried: Case) -> None:
    found = minimise(tried.objective, "genetic", effort=Effort(evaluations=20_000), polish=False)
    assert found.evaluations > 19_000 or found.message.startswith("converged")


def test_the_table_is_printed() -> None:
    tried = cases()[0]
    results = compare(tried, 300, ["trust-region", "linear", "genetic"])
    console = Console(width=120, record=True, file=io.StringIO())
    print_table(console, tried, results)
    print_ways(console, tried, results)
    text = console.export_text()
    for line in ("trust-region", "genetic", "J1010.radial: the methods' values differ by up to a factor of"):
        assert line in text
    assert "nothing in the data tells them apart" in REMAINS
