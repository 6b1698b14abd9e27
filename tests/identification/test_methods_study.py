"""The study in benchmarks/: its campaign is that of the issue, and its tables are printed."""

import io

import numpy as np
from rich.console import Console

from benchmarks.identification_methods import (
    REMAINS,
    cases,
    compare,
    print_table,
    print_ways,
)


def test_the_campaign_is_that_of_the_issue() -> None:
    for tried in cases():
        problem = tried.objective.problem
        assert len(problem.model.pose) == 126
        assert len(np.unique(problem.model.pose)) == 63
        assert len(problem.model.parameters) == 7
        assert np.unique(problem.sigma[problem.used]).tolist() == [3.5e-5]


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
