"""A verdict in words: as sure as its probability, and the rows behind it, allow."""

from __future__ import annotations

from dataclasses import replace

import pytest

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.result import Candidate
from beamstiff.report.diagnosis import headline, sized, summary
from tests.gap.machines import POSITION, at_random, elbow, nominal
from tests.gap.planted import diagnosed


def baseline(rows: int) -> Baseline:
    return nominal(elbow(), at_random(elbow(), rows, seed=1, sigma_position=POSITION))


def said(verdict: Candidate, *others: Candidate, rows: int = 20, **features: float) -> tuple[str, str]:
    """Return headline and summary of a diagnosis of so many rows."""
    result = replace(
        diagnosed(None),
        baseline=baseline(rows),
        candidates=(verdict, *others),
        verdict=verdict,
        indistinguishable=(),
        features=features,
    )
    return headline(result), summary(result)


NONE, UNKNOWN = Candidate("none", None, 0.46), Candidate("unknown", None, 0.3)
PLAY = Candidate("backlash", "q2", 0.24)


def test_what_is_less_likely_than_not_is_no_verdict() -> None:
    head, text = said(NONE, UNKNOWN, PLAY)
    assert head == "Undecided"
    assert "\nUndecided: nothing beyond noise (46 %), unknown (30 %), backlash at q2 (24 %)." in text
    assert said(replace(NONE, probability=0.9))[0] == "Nothing beyond noise"
    assert said(replace(PLAY, probability=0.47))[0] == "Likeliest cause: backlash at q2"
    assert said(replace(PLAY, probability=0.7))[0] == "Cause: backlash at q2"
    assert said(PLAY, NONE)[0] == "Undecided; likeliest cause: backlash at q2"


def test_few_rows_are_no_proof_that_there_is_nothing() -> None:
    head, text = said(replace(NONE, probability=0.99), rows=2)
    assert head == "Too few rows to say anything"
    assert "99 %" not in text


@pytest.mark.parametrize(
    ("scale", "words"), [(3.3, "taken 3.3 times as large as stated"), (1.2, "noise alone would")]
)
def test_noise_that_is_not_the_stated_one_is_called_so(scale: float, words: str) -> None:
    assert words in said(NONE, scale=scale, noise_position=1.0)[1]


def test_sizes_are_told_in_mrad() -> None:
    found = diagnosed("backlash")
    name, value, _, _, unit = sized(found.verdict.estimates[0])
    assert (name, unit) == ("half_width", "mrad")
    assert float(value) == pytest.approx(1e3 * found.verdict.estimates[0].value, rel=1e-3)
