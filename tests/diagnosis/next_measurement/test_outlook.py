"""What a proposal is expected to settle. Truth: simulated log odds, and rows whose answers are known."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import expit, logit

from beamstiff.diagnosis.next_measurement.outlook import DECIDED, SPREAD, chances, outlook
from beamstiff.diagnosis.next_measurement.test_plan import Foretold, best_rows


@pytest.mark.parametrize(
    ("probability", "square", "divided", "then", "outside"),
    [(0.6, 25.0, 1.0, 1.0, 0.0), (0.7, 40.0, 3.0, 5.0, 0.05), (0.5, 9.0, 1.0, 2.0, 0.09)],
)
def test_the_promise_is_how_often_simulated_odds_are_settled(
    probability: float, square: float, divided: float, then: float, outside: float
) -> None:
    rng, many = np.random.default_rng(3), 200_000
    right = np.where(rng.random(many) < probability, 1.0, -1.0)
    gained = right * 0.5 * square + np.sqrt(square) * rng.standard_normal(many)
    odds = (logit(probability) * divided + gained) / then
    left = expit(logit(max(outside, 1e-9)) + SPREAD * rng.standard_normal(many))
    settled = (1.0 - left) * np.maximum(expit(odds), expit(-odds)) >= DECIDED
    settles, turns = chances(probability, square, divided, then, outside)
    assert settles == pytest.approx(settled.mean(), abs=0.015)
    assert turns == pytest.approx((odds < 0.0).mean(), abs=0.005)


def test_a_larger_divisor_and_more_that_is_unknown_promise_less() -> None:
    promised = [chances(0.7, 30.0, 2.0, then, outside)[0] for then, outside in ((2, 0), (6, 0), (6, 0.2))]
    assert promised[0] > promised[1] > promised[2]
    assert chances(0.5, 1e4, outside=0.6)[0] < 0.05


def test_rows_are_chosen_where_causes_differ_in_kind() -> None:
    """The first row moves by 1 mm, and causes differ by 20 um there; the second by 0.1 mm, and by 15 um."""
    mean = np.zeros((2, 3))
    mean[:, 0] = 1e-3, 1e-4
    away = np.zeros((2, 3))
    away[:, 0] = 2e-5, 1.5e-5
    group, noise = np.arange(2), np.full((2, 3), 5e-6)

    def first(amiss: float) -> int:
        off = amiss * np.sqrt((mean**2).mean(axis=1))
        one, other = (Foretold(m, np.zeros((2, 3, 1)), np.eye(1), off) for m in (mean, mean + away))
        picked, score, _ = best_rows([(0.25, one, other)], noise, group, 1, group)
        assert score.sum() > 0.0
        return int(picked[0])

    assert first(0.0) == 0
    assert first(0.12) == 1


def test_parameters_of_which_only_the_sum_is_known_are_no_obstacle() -> None:
    matrix = 1e-4 * np.random.default_rng(4).standard_normal((40, 3, 1)) * np.ones((40, 3, 2))
    open_sum = 1e20 * np.array([[1.0, -1.0], [-1.0, 1.0]]) + np.eye(2)
    far = np.zeros((40, 3))
    far[:, 0] = 1e-3
    told = [(0.25, Foretold(mean, matrix, open_sum), Foretold(-mean, matrix, open_sum)) for mean in (far,)]
    picked, score, _ = best_rows(told, np.full((40, 3), 1e-5), np.arange(40), 5, np.arange(40))
    assert len(set(picked.tolist())) == 5
    assert np.isfinite(score).all()


@pytest.mark.parametrize(("rows", "least", "most"), [(10, 0.1, 0.4), (100, 0.9, 1.0)])
def test_of_fewer_rows_less_is_promised_that_nothing_shows(rows: int, least: float, most: float) -> None:
    none = SimpleNamespace(key="none:null", effect="none", probability=0.98)
    unknown = SimpleNamespace(key="unknown:null", effect="unknown", probability=0.01)
    found: Any = SimpleNamespace(
        verdict=none,
        candidates=(none, unknown),
        next=({"separates": (), "discrimination": 0.0},) * 10,
        features={"unknown": 0.5},
        baseline=SimpleNamespace(
            rows=range(rows), used=np.ones((rows, 3), dtype=bool), tangent=np.zeros((rows, 6, 2))
        ),
    )
    assert least < outlook(found).settles <= most
    assert outlook(found).undecidable == (rows >= 40)
