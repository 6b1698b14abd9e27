"""What is chosen where it explains most of the gap."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.effects.data_selected import best_of, left_by
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array
from tests.diagnosis.machines import at_random, kr240, nominal

SHAPE = (20, 6)


@pytest.fixture
def there() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 20, seed=1))


def seen(there: Baseline, gap: Array) -> Baseline:
    return replace(there, measured=there.predicted + gap)


def drawn(seed: int, count: int = 1) -> Array:
    return 1e-4 * np.random.default_rng(seed).standard_normal((*SHAPE, count))


def test_what_explains_most_beside_the_rest_is_chosen(there: Baseline) -> None:
    rest, some = drawn(1), [drawn(seed) for seed in range(2, 7)]
    left = left_by(seen(there, rest[..., 0] + 0.3 * some[3][..., 0]), rest)
    assert best_of(range(5), left, some.__getitem__) == 3


def test_it_explains_what_least_squares_explain(there: Baseline) -> None:
    rest, some = drawn(1, 2), drawn(2, 3)
    weight = np.repeat([1.0, 0.5], 3)  # rotations by a lever of half a metre
    gap = 1e-4 * np.random.default_rng(3).uniform(-1, 1, SHAPE)  # nothing in it is far off

    def square(columns: Array) -> float:
        flat = (columns * weight[:, None]).reshape(120, -1)
        flat, target = flat / np.linalg.norm(flat, axis=0), (gap * weight).ravel()
        return float(((target - flat @ np.linalg.lstsq(flat, target)[0]) ** 2).sum())

    model = np.concatenate([there.tangent, rest], -1)
    left = left_by(seen(there, gap), rest)
    expected = square(model) - square(np.concatenate([model, some], -1))
    assert left.explained(some) == pytest.approx(expected, rel=1e-6)


def test_of_equals_the_first_is_chosen_whatever_rounding_says(there: Baseline) -> None:
    one, gap = drawn(1, 2), drawn(2)[..., 0]
    turned = one @ np.linalg.qr(np.random.default_rng(3).standard_normal((2, 2)))[0]
    left = left_by(seen(there, gap), np.zeros((*SHAPE, 0)))
    for some in ([one, turned, 7.0 * one], [turned, one]):
        assert best_of(range(len(some)), left, some.__getitem__) == 0


def test_a_wrong_row_does_not_choose(there: Baseline) -> None:
    right, other = drawn(1), drawn(2)
    gap = right[..., 0].copy()
    gap[3] += 100.0 * other[3, :, 0]
    assert best_of([right, other], left_by(seen(there, gap), np.zeros((*SHAPE, 0))), lambda one: one) is right


def test_where_nothing_is_left_nothing_is_chosen(there: Baseline) -> None:
    rest = drawn(1)
    left = left_by(seen(there, rest[..., 0]), rest)
    assert best_of([drawn(2)], left, lambda one: one) is None
    assert best_of([], left, lambda one: one) is None


def test_columns_of_rounding_neither_explain_nor_take_anything(there: Baseline) -> None:
    rest, gap = drawn(1, 2), drawn(2)[..., 0]
    rounding = 1e-13 * drawn(3, 9)
    assert left_by(seen(there, gap), np.concatenate([rest, rounding], -1)).gap == pytest.approx(
        left_by(seen(there, gap), rest).gap
    )
    left = left_by(seen(there, gap), rest)
    absorbed = rest @ np.random.default_rng(4).standard_normal((2, 5))
    assert left.explained(absorbed) == 0.0
    assert best_of([absorbed], left, lambda one: one) is None
