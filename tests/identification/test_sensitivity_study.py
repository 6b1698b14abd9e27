"""The study in benchmarks/: the paper's errors lie between encoders that matter nothing and most of all."""

import io

import numpy as np
from rich.console import Console

from beamstiff.identification.bootstrap import number_of_tests
from beamstiff.identification.sensitivity import sensitivity
from benchmarks.sensitivity_study import ERRORS, campaign, print_number, print_sensitivity


def test_errors_by_source_and_number_of_tests_are_printed_beside_the_paper() -> None:
    console = Console(width=140, record=True, file=io.StringIO())
    statement, rows, theta = campaign(10)
    found = sensitivity(statement, rows, theta, ERRORS, 60)
    spread = dict(zip(found.sources, 3 * found.spread, strict=True))
    assert (spread["angle"] < 0.001).all()
    assert (spread["hold_angle"] > np.array([8, 8, 9, 2, 2, 5]) / 100).all()
    print_sensitivity(console, found)
    statement, _, theta = campaign(23)
    tests = number_of_tests(statement, theta, orders=20)
    assert max(count or 99 for count in tests.enough(0.1).values()) <= 8  # the paper: stable above six
    print_number(console, tests)
    text = console.export_text()
    assert "paper, %" in text
    assert "within 10 % from" in text
