"""Windows in which a machine stands still. Truth: records written here, with noise of a known kind."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from beamstiff.measure.plateaus import Window, still_windows
from beamstiff.measure.signals import Signal
from beamstiff.se3 import Array

RATE = 50.0  # Hz


def point(path: Array, noise: Array) -> Signal:
    x = np.stack([path, 0.3 * path, 0 * path], axis=1) + noise
    return Signal("tracker", "point", ("x", "y", "z"), np.arange(len(x)) / RATE, x)


def white(count: int, sigma: float = 2e-5, seed: int = 0) -> Array:
    return sigma * np.random.default_rng(seed).standard_normal((count, 3))


def kept(windows: list[Window]) -> list[tuple[float, float]]:
    return [(one.start, one.end) for one in windows if one.kept]


def test_both_plateaus_beside_a_motion_are_kept_whole_but_for_their_ends() -> None:
    t = np.arange(0.0, 10.0, 1 / RATE)
    windows = still_windows([point(np.interp(t, [4, 6], [0, 0.5]), white(len(t)))])
    (a, b), (c, d) = kept(windows)
    assert a < 0.3
    assert 3.6 < b <= 4.0
    assert 6.0 <= c < 6.4
    assert d > 9.7
    assert any(one.reason == "moves" and one.start <= 4.0 and one.end >= 6.0 for one in windows)


def test_a_creeping_window_is_cut_and_says_how_fast_it_creeps() -> None:
    t = np.arange(0.0, 12.0, 1 / RATE)
    path = np.interp(t, [4, 5, 8, 9], [0, 0.5, 0.5006, 1.0])  # 0.6 mm in 3 s, between two motions
    windows = still_windows([point(path, white(len(t)))])
    assert all(end <= 4.0 or start >= 9.0 for start, end in kept(windows))
    assert len(kept(windows)) == 2
    (reason,) = [one.reason for one in windows if one.reason.startswith("tracker creeps")]
    far, spent = (float(number) for number in re.findall(r"[\d.]+", reason))
    assert far / spent == pytest.approx(0.2, rel=0.15)  # mm/s, over the longest piece of it


def test_a_plateau_of_one_second_between_two_loads_is_kept() -> None:
    t = np.arange(0.0, 12.0, 1 / RATE)
    path = np.interp(t, [4, 4.5, 5.5, 6], [0, 3e-4, 3e-4, 6e-4])
    found = kept(still_windows([point(path, white(len(t)))]))
    assert any(start >= 4.45 and end <= 5.55 for start, end in found)
    assert len(found) == 3


def test_slow_noise_is_no_creep() -> None:
    """Noise that lasts a quarter of a second: 30 plateaus of 3 s, none is cut, whatever the seed."""
    count, lasts = round(3.0 * RATE), np.exp(-1 / RATE / 0.25)
    lost = 0
    for seed in range(30):
        drive = np.random.default_rng(seed).standard_normal((2 * count, 3))
        slow = np.sqrt(1 - lasts**2) * lfilter([1.0], [1.0, -lasts], drive, axis=0)
        noise = 3e-5 * np.sqrt(0.5) * (slow + white(2 * count, 1.0, seed + 100))
        path = np.repeat([0.0, 0.5], count)
        lost += len(kept(still_windows([point(path, noise)]))) < 2
    assert lost == 0


def test_ringing_behind_a_motion_is_left_out() -> None:
    t = np.arange(0.0, 12.0, 1 / RATE)
    since = np.clip(t - 6.0, 0.0, None)
    rings = 5e-4 * np.exp(-since / 0.2) * np.sin(2 * np.pi * 5.0 * since)
    windows = still_windows([point(np.interp(t, [5, 6], [0, 0.5]) + rings, white(len(t)))])
    _, (start, end) = kept(windows)
    assert 5e-4 * np.exp(-(start - 6.0) / 0.2) < 3 * 2e-5  # below the noise of a few readings
    assert end > 11.7


def test_a_window_shorter_than_asked_is_cut_and_says_so() -> None:
    t = np.arange(0.0, 12.0, 1 / RATE)
    path = np.interp(t, [4, 5, 6, 7], [0, 0.5, 0.5, 1.0])
    signal = point(path, white(len(t)))
    assert len(kept(still_windows([signal]))) == 3
    assert len(kept(still_windows([signal], shortest=2.0))) == 2
