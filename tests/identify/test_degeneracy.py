"""Springs that only act together are found, on random graphs by construction and on the papers' robots."""

from __future__ import annotations

import pytest

from beamstiff.identify.degeneracy import find_degeneracy
from beamstiff.identify.problem import state_problem
from benchmarks.degeneracy_graphs import faults, random_case


@pytest.mark.parametrize("planted", [True, False])
def test_groups_are_exact_on_random_graphs(planted: bool) -> None:
    wrong, groups = {}, 0
    for seed in range(200):
        case = random_case(seed, planted)
        groups += len(case.series) + len(case.parallel)
        found = find_degeneracy(state_problem(case.robot, case.tests))
        if fault := faults(case, found):
            wrong[seed] = fault
    assert wrong == {}
    assert groups > 200 if planted else groups == 0
