"""The study in benchmarks/: its table is printed, and optimal designs beat the papers' choices in it."""

import io

import numpy as np
import pytest
from rich.console import Console

from beamstiff import load_robot
from benchmarks.dexterity_study import LOADS, compare_ir663, compare_kr240, print_dexterity


@pytest.mark.slow
def test_optimal_tests_beat_the_choices_of_both_papers() -> None:
    names = load_robot("kr240-2").identify
    kr240 = compare_kr240(10, np.array(LOADS), names, seeds=10, title="KR240-2").rows
    ir663 = compare_ir663(seeds=5).rows
    assert 1.4 * kr240["optimal, anywhere"] < kr240["random in the zones"]
    [grid] = [value for name, value in ir663.items() if "grid" in name]
    assert 2 * ir663["optimal tests"] < grid
    assert ir663["optimal tests"] <= ir663["optimal poses, both loads"] < ir663["random poses"]


def test_the_published_numbers_stand_beside_ours() -> None:
    console = Console(width=120, record=True, file=io.StringIO())
    print_dexterity(console)
    text = console.export_text()
    for published in ("0.682", "<= 0.016", "<= 0.025", "all of it"):
        assert published in text
    assert "1.2515" in text
