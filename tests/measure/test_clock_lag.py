"""The lag of a clock. Truth: motions written here, shifted by a known time."""

import numpy as np
import pytest

from beamstiff.measure.clock_lag import LagError, clock_lag
from beamstiff.measure.signals import Signal


def recorded(lag: float, drift: float = 0.0, noise: float = 0.0) -> tuple[Signal, Signal]:
    """Return joints, and a point whose clock shows `lag + drift t` more."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 60.0, 0.01)
    at = [0, 3, 5, 9, 10, 14, 17, 24, 27, 33, 34, 41, 45, 52, 54, 60]
    q = np.interp(t, at, [0, 0, 1, 1, 0.3, 0.3, 2, 2, 1.1, 1.1, 1.6, 1.6, 0.2, 0.2, 0.9, 0.9])[:, None]
    seen = np.arange(0.0, 60.0, 0.033)
    read = np.interp(seen, t, q[:, 0])
    x = np.stack([1.2 * np.cos(read), 1.2 * np.sin(read), 0.4 + 0 * read], axis=1)
    x = x + noise * rng.standard_normal(x.shape)
    point = Signal("p", "point", ("x", "y", "z"), seen + lag + drift * seen, x)
    return Signal("j", "joints", ("q1",), t, q), point


@pytest.mark.parametrize("lag", [-4.2, -0.037, 0.0, 3.9])
def test_a_lag_is_found_to_a_few_milliseconds(lag: float) -> None:
    found = clock_lag(*recorded(lag, noise=3e-5))
    assert found.lag == pytest.approx(lag, abs=3e-3)
    assert found.motions == 7


def test_a_drifting_clock_is_corrected_at_both_ends_of_the_record() -> None:
    joints, point = recorded(1.5, drift=8e-5)
    found = clock_lag(joints, point)
    np.testing.assert_allclose(found.corrected(point.time), np.arange(0.0, 60.0, 0.033), atol=5e-3)


def test_a_lag_beyond_the_largest_is_not_made_up() -> None:
    with pytest.raises(LagError, match=r"at any lag|no motion in common|repeats itself"):
        clock_lag(*recorded(12.0), most=2.0)


def test_what_never_moves_tells_no_lag() -> None:
    joints, point = recorded(0.0)
    still = Signal("j", "joints", ("q1",), joints.time, np.zeros_like(joints.values))
    with pytest.raises(LagError, match="j shows no motion, from which the lag of p would follow"):
        clock_lag(still, point)
    with pytest.raises(LagError, match="p: found 5 readings, expected more"):
        clock_lag(joints, Signal("p", "point", ("x", "y", "z"), point.time[:5], point.values[:5]))


def in_rhythm(lag: float, repeated: int = 1) -> tuple[Signal, Signal]:
    """Return two joints that every five seconds move to other angles, and a point of the second link."""
    rng = np.random.default_rng(3)
    angles = np.tile(rng.uniform(-2.0, 2.0, (60 // repeated, 2)), (repeated, 1))
    t = np.arange(0.0, 5.0 * len(angles), 0.02)
    begin = np.minimum((t // 5.0).astype(int), len(angles) - 2)
    share = np.clip((t - 5.0 * begin - 1.0) / 3.0, 0.0, 1.0)[:, None]
    q = angles[begin] + (3 * share**2 - 2 * share**3) * (angles[begin + 1] - angles[begin])
    turned = q[:, 0] + q[:, 1]
    x = np.stack([np.cos(q[:, 0]) + 0.6 * np.cos(turned), np.sin(q[:, 0]) + 0.6 * np.sin(turned), 0 * t], 1)
    return Signal("j", "joints", ("q1", "q2"), t, q), Signal("p", "point", ("x", "y", "z"), t + lag, x)


@pytest.mark.parametrize("lag", [-14.0, 0.3, 6.0])
def test_in_a_rhythm_of_motions_the_places_between_them_tell_the_lag(lag: float) -> None:
    assert clock_lag(*in_rhythm(lag)).lag == pytest.approx(lag, abs=3e-3)


def test_a_motion_that_repeats_itself_tells_no_lag() -> None:
    with pytest.raises(LagError, match="repeats itself"):
        clock_lag(*in_rhythm(0.3, repeated=20))
