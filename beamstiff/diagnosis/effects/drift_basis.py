"""Courses that drifts follow: of the time in the campaign, and of the temperature."""

from functools import lru_cache

import numpy as np

from beamstiff.diagnosis.effects.effect import stated_scale
from beamstiff.diagnosis.effects.external import clock
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

DECAYS = (0.1, 0.3, 1.0)  # of the campaign's duration
LAGS = (0.0, 0.05, 0.2)  # of the campaign's duration, by which the machine follows its temperature
WAVES = (1, 2, 3)  # half waves over the campaign, as of a hall that warms and cools
MODES = 5  # of any course


def usual(time: Array) -> dict[str, Array]:
    """Return the courses (N,) that are common, of the time in campaigns."""
    result = {"linear": time - 0.5}
    return result | {f"warming up within {decay:g}": 1 - np.exp(-time / decay) for decay in DECAYS}


def any_course(time: Array) -> dict[str, Array]:
    """Return the main modes (N,) of any course, at times in campaigns: their mean is no drift."""
    mean, mixture = _mixture()
    return {f"mode {k + 1}": mode for k, mode in enumerate(((_table(time) - mean) @ mixture).T)}


def steady(baseline: Baseline) -> dict[str, Array]:
    """Return the courses (N,) of what does not change over the campaign.

    Displacements count from the first unloaded reading: they have all that had drifted by then, *begun*. And
    positions have what the machine grew, moved and turned *before* it was measured. A robot that
    states a drift has both, each where it shows.
    """
    one = np.ones(len(baseline.rows))
    own = {"before": one} if baseline.absolute else {"begun": one}
    return own if baseline.stated is None else {"begun": 0.0 * one, "before": 0.0 * one} | own


def lagged(baseline: Baseline, lag: float) -> Array:
    """Return the temperature less its mean (N,), followed with a first-order lag, a share of the time."""
    rows, time = baseline.rows, clock(baseline)
    warmth: Array = np.nan_to_num(rows.temperature - mean_temperature(baseline))
    if lag == 0:
        return warmth
    result, order = np.zeros_like(warmth), np.argsort(time, kind="stable")
    state, before = float(warmth[order[0]]), float(time[order[0]])
    for row in order.tolist():
        gain = 1 - float(np.exp(-(time[row] - before) / lag))
        state, before = state + gain * (float(warmth[row]) - state), float(time[row])
        result[row] = state
    return result


def mean_temperature(baseline: Baseline) -> float:
    """Return the mean over the rows that were fitted, degC; as stated where it is; 0 without any."""
    stated, warmth = stated_scale(baseline, "temperature"), baseline.fit.rows.temperature
    if stated is not None:
        return stated
    return float(warmth.mean()) if np.isfinite(warmth).all() else 0.0


def _table(time: Array) -> Array:
    """Return courses (N, m) of which any is a mixture."""
    waves = [np.cos(np.pi * k * time) for k in WAVES]
    return np.stack([*usual(time).values(), *waves], -1)


@lru_cache
def _mixture() -> tuple[Array, Array]:
    """Return the mean of the courses (m,) and what mixes them into their main modes, (m, MODES).

    As for `Following`: a course drawn from the family is as large (RMS) as a linear one.
    """
    table = _table(np.linspace(0.0, 1.0, 101))
    mean = table.mean(axis=0)
    size = table.std(axis=0)
    _, _, right = np.linalg.svd((table - mean) / size, full_matrices=False)
    sign = np.where(right @ np.cos(np.arange(right.shape[1])) < 0, -1.0, 1.0)[:MODES]
    mixture: Array = sign * right[:MODES].T * size[0] / np.sqrt(right.shape[1]) / size[:, None]
    return mean, mixture
