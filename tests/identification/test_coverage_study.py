"""The study in benchmarks/: intervals hold the truth as often as they say, held-out loads are predicted."""

import io

import numpy as np
import pytest
from rich.console import Console

from beamstiff import load_robot
from beamstiff.identification.input_errors import InputErrors
from benchmarks.coverage_study import ALL_RADIAL, Campaign, Study, campaigns, ir663, kr240, print_study, run

BOTH = {"1/J12.radial + 1/J33.radial", "1/J18.radial + 1/J99.radial + 1/J1010.radial"}


def within(study: Study, chance: float) -> None:
    """Check each interval with two ends, and each bound: beyond `chance` standard deviations it is none."""
    for name, tally in study.tallies.items():
        spread = np.sqrt(0.95 * 0.05 / tally.count)
        assert tally.coverage > 0.95 - chance * spread, name
        if tally.closed == tally.count:
            assert tally.coverage < 0.95 + 0.012 + chance * spread, name
    assert np.percentile(study.predicted, 5) > 0.98
    assert study.chi_square.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("number", range(3))
def test_intervals_of_the_papers_campaigns_hold_the_truth(number: int) -> None:
    within(run(campaigns()[number], 300, seed=number), 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(5))
def test_intervals_hold_the_truth_in_95_percent_of_2000_repetitions(number: int) -> None:
    study = run(campaigns()[number], 2000, seed=number)
    for name, tally in study.tallies.items():
        if tally.closed == tally.count:
            assert tally.coverage == pytest.approx(0.95, abs=0.02), name
        else:
            assert tally.coverage > 0.95, name  # a lower bound
    assert np.percentile(study.predicted, 2.5) > 0.98


def test_springs_in_series_are_bounds_by_themselves_and_intervals_together() -> None:
    study = run(ir663("seven", ("J12.torsional", "J18.torsional", *ALL_RADIAL)), 40)
    assert set(study.tallies) == {"J12.torsional", "J18.torsional", *ALL_RADIAL, *BOTH}
    assert all(study.tallies[name].closed == 0 for name in ALL_RADIAL)
    assert study.tallies["1/J18.radial + 1/J99.radial + 1/J1010.radial"].closed == 40


def test_errors_of_the_inputs_that_nobody_states_break_the_promise() -> None:
    coarse = InputErrors(load=25.0, force=10.0, angle=float(np.radians(0.3)))

    def lowest(campaign: Campaign) -> float:
        return min(tally.coverage for tally in run(campaign, 250).tallies.values())

    assert lowest(kr240("", coarse, InputErrors())) < 0.87
    assert lowest(kr240("", coarse, coarse)) > 0.90


def test_the_table_is_printed() -> None:
    console = Console(width=130, record=True, file=io.StringIO())
    print_study(console, run(ir663("IR-663", load_robot("ir663").identify), 5, drawn=1))
    text = console.export_text()
    assert "IR-663; 5 repetitions" in text
    assert "J1010.radial" in text
    assert "Held-out loads: 99." in text
