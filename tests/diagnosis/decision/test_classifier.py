"""The three logistic models of the decision: their sense, and that a fit finds what made the data."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit

from beamstiff.diagnosis.decision.classifier import (
    Features,
    coefficients_of_file,
    features_of,
    shares_of,
)
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.pair_evidence import Pair
from beamstiff.diagnosis.inference.search import NONE, UNKNOWN, Search
from benchmarks.decision_study import logistic, of_unknown

HALF = HeldOutError(4e-4, 3e-4, 0.5, (0.4, 0.6), postures=14, misfit=6.0)
GOOD = replace(HALF, after=5.2e-5, shrink=0.99, misfit=1.02)


def features(
    none: float = -100.0,
    left: float = 0.1,
    free: float = -20.0,
    law: float = -50.0,
    ahead: float = 60.0,
    both: HeldOutError | None = None,
    freedom: int = 400,
    by_load: Any = None,
) -> Features:
    pair = Pair("a:1", "b:2", ahead, 0.02, ([], []))
    search = Search(
        {"a:1": 0.0, NONE: none, UNKNOWN: -60.0}, (pair,), {}, {"a:1": left}, {"q1": free}, {("q1", "x"): law}
    )
    return features_of(search, freedom, HALF, both, by_load)


FLOATS = st.floats(-300.0, 300.0)


@given(none=FLOATS, left=st.floats(0.0, 2.0), free=FLOATS, law=FLOATS, freedom=st.integers(0, 5000))
def test_shares_are_probabilities(none: float, left: float, free: float, law: float, freedom: int) -> None:
    for both in (None, GOOD):
        found = shares_of(features(none, left, free, law, both=both, freedom=freedom))
        every = np.array([found.none, found.unknown, found.one, found.two])
        assert (every >= 0.0).all()
        assert every.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("share", "name", "values"),
    [
        ("none", "none", (-200.0, -20.0, 0.0, 20.0)),
        ("unknown", "left", (0.0, 0.1, 0.5, 1.0)),
        ("unknown", "free", (-60.0, 0.0, 60.0)),
        ("unknown", "law", (-60.0, 10.0, 60.0)),
        ("two", "ahead", (9.0, 20.0, 200.0)),
    ],
)
def test_what_speaks_for_an_answer_makes_it_likely(share: str, name: str, values: tuple[float, ...]) -> None:
    both = GOOD if share == "two" else None
    told = [getattr(shares_of(features(**{"both": both, name: value})), share) for value in values]
    assert told == sorted(told)
    assert told[-1] > told[0] + 0.01


def test_a_second_cause_that_was_not_weighed_is_none() -> None:
    assert shares_of(features(both=None)).two == 0.0


def test_a_second_cause_counts_by_what_it_closes_of_other_postures_or_of_other_loads() -> None:
    useless, by_load = shares_of(features(both=HALF)), (HALF, GOOD)
    assert shares_of(features(both=HALF, by_load=by_load)).two > useless.two
    assert shares_of(features(both=HALF, by_load=by_load)).two == shares_of(features(both=GOOD)).two


def test_of_few_values_what_is_left_says_nothing() -> None:
    few = [shares_of(features(left=left, freedom=50)).unknown for left in (0.0, 1.0)]
    assert few[0] == few[1]


def test_no_coefficient_goes_against_the_sense_of_its_feature() -> None:
    every = coefficients_of_file()
    for model, names in {
        "none": ["evidence"],
        "two": ["evidence", "closed"],
        "unknown": ["left", "free"],
    }.items():
        assert min(every[model][name] for name in names) >= 0.0
    assert every["unknown"]["few"] <= 0.0
    assert every["none"].keys() == {"constant", *features().none}
    assert every["two"].keys() == {"constant", *features(both=GOOD).two}
    assert every["unknown"].keys() | {"unmodelled"} == {"constant", *features().unknown}


def test_the_fit_finds_the_model_that_drew_the_data() -> None:
    rng = np.random.default_rng(1)
    x = rng.standard_normal((20_000, 2)) * [3.0, 0.5]
    right = rng.uniform(size=len(x)) < expit(-1.0 + x @ [0.4, 1.5])
    found = logistic([{"a": a, "b": b} for a, b in x.tolist()], right)
    assert [found[name] for name in ("constant", "a", "b")] == pytest.approx([-1.0, 0.4, 1.5], abs=0.1)
    assert logistic([{"a": -a, "b": b} for a, b in x.tolist()], right)["a"] == 0.0


def test_the_fit_of_the_unknown_finds_its_law() -> None:
    rng = np.random.default_rng(2)
    names, n = ("left", "free", "unmodelled", "few"), 3000
    columns = [rng.uniform(0, 2, n), rng.normal(0, 10, n), rng.normal(0, 8, n), rng.uniform(0, 2.4, n)]
    x = np.column_stack(columns)
    odds = np.logaddexp(-1.5 + x[:, :2] @ [2.0, 0.1], x[:, 2] - 2.0 * x[:, 3])
    right = rng.uniform(size=n) < expit(odds)
    found = of_unknown([dict(zip(names, row, strict=True)) for row in x.tolist()], right)
    assert found == pytest.approx({"constant": -1.5, "left": 2.0, "free": 0.1, "few": -2.0}, abs=0.4)
