"""Raw samples to states, against plain numpy and known distributions."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.measure.samples import average_samples, difference_of_states


@given(st.integers(1, 60), st.integers(1, 3), st.integers(0, 10_000), st.booleans())
def test_states_are_averaged_as_numpy_would_one_by_one(n: int, d: int, seed: int, gaps: bool) -> None:
    random = np.random.default_rng(seed)
    state = random.integers(-3, 3, n)
    samples = random.normal(2000.0, 1e-3, (n, d))
    if gaps:
        samples[random.random((n, d)) < 0.3] = np.nan
    found = average_samples(samples, state)
    assert sorted(found.state) == sorted(set(state))
    assert found.state.tolist() == list(dict.fromkeys(state.tolist()))
    for at, number in enumerate(found.state):
        for column in range(d):
            own = samples[state == number, column]
            own = own[~np.isnan(own)]
            assert found.count[at, column] == len(own)
            if len(own):
                assert found.mean[at, column] == pytest.approx(own.mean(), rel=1e-15)
            else:
                assert np.isnan(found.mean[at, column])
            if len(own) > 1:
                assert found.spread[at, column] == pytest.approx(own.std(ddof=1), rel=1e-6)
                assert found.sigma[at, column] == pytest.approx(own.std(ddof=1) / np.sqrt(len(own)), rel=1e-6)
            else:
                assert np.isnan(found.spread[at, column])
    assert (found.rejected == 0).all()


def test_outliers_are_left_out_when_asked() -> None:
    random = np.random.default_rng(2)
    samples = random.normal(1.0, 1e-5, (200, 3))
    state = np.repeat([0, 1], 100)
    samples[7, 0] += 5e-3  # a beam that was cut, once
    samples[150, 2] -= 1.0
    plain, robust = average_samples(samples, state), average_samples(samples, state, robust=True)
    assert plain.spread[0, 0] > 1e-4
    assert abs(plain.mean[1, 2] - 1) > 5e-3
    np.testing.assert_allclose(robust.mean, 1.0, atol=5e-6)
    np.testing.assert_allclose(robust.spread, 1e-5, rtol=0.3)
    assert robust.rejected[0, 0] == 1
    assert robust.rejected[1, 2] == 1
    assert (robust.count + robust.rejected == 100).all()


def test_of_normal_noise_hardly_anything_is_left_out() -> None:
    found = average_samples(
        np.random.default_rng(3).normal(size=(50_000, 1)), np.zeros(50_000, int), robust=True
    )
    # 3.5 standard deviations: 0.047 % of a normal distribution
    assert found.rejected[0, 0] == pytest.approx(23, abs=20)
    assert found.spread[0, 0] == pytest.approx(1, rel=0.01)


def test_coarse_digits_do_not_make_outliers_of_their_neighbours() -> None:
    # more than half the samples equal: the median deviation is zero
    samples = np.array([1.0] * 6 + [1.01] * 4)[:, None]
    assert average_samples(samples, np.zeros(10, int), robust=True).rejected[0, 0] == 0
    samples = np.array([1.0] * 19 + [9.0])[:, None]
    assert average_samples(samples, np.zeros(20, int), robust=True).mean[0, 0] == 1.0


def test_two_samples_are_never_outliers_of_one_another() -> None:
    found = average_samples([[0.0], [1.0]], [0, 0], robust=True)
    assert found.mean[0, 0] == 0.5
    assert found.rejected[0, 0] == 0


def test_loaded_less_unloaded_has_both_errors() -> None:
    random = np.random.default_rng(4)
    samples = np.concatenate([random.normal(m, 1e-5, (50, 2)) for m in (1.0, 1.002)])
    states = average_samples(samples, np.repeat([10, 20], 50))
    d, sigma = difference_of_states(states, [20], [10])
    np.testing.assert_allclose(d, 2e-3, atol=1e-5)
    np.testing.assert_allclose(sigma, np.hypot(states.sigma[1], states.sigma[0])[None])
    with pytest.raises(BeamstiffError, match="unloaded: found state 30"):
        difference_of_states(states, [20], [30])
    with pytest.raises(BeamstiffError, match="2 loaded and 1 unloaded"):
        difference_of_states(states, [20, 20], [10])


@pytest.mark.parametrize(
    ("samples", "state", "part"),
    [
        (np.zeros((0, 3)), [], "one whole number a sample"),
        (np.zeros((3, 3)), [0, 1], r"shape \(2,\) for 3 samples"),
        (np.zeros((2, 3)), [0.5, 1.0], "float64 values"),
        (np.zeros(3), [0, 0, 0], "samples: "),
        ([[np.inf], [1.0]], [0, 0], "samples: found inf"),
    ],
)
def test_samples_that_make_no_state_are_refused(samples: Any, state: Any, part: str) -> None:
    with pytest.raises(BeamstiffError, match=part):
        average_samples(samples, np.array(state))
