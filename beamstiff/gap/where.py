"""Where the gap is: by direction, load, history, time and posture, and by the places that could make it.

Every place gets what it could do at most (`free_laws`); each place's share has its own variance, found by its
marginal likelihood (automatic relevance determination: MacKay, Network 6 (1995) 469), so that what one place
explains the others need not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.load_error import rising
from beamstiff.gap.free_laws import FreeLaw
from beamstiff.gap.whitened import Whitened
from beamstiff.se3 import Array

ROUNDS, SETTLED = 60, 0.02  # of the variances' logarithms
WORST = 5  # poses
SAMPLES = 200


def where(
    baseline: Baseline,
    white: Whitened,
    used: NDArray[np.bool_],
    laws: Sequence[FreeLaw],
    noise: float,
    seed: int,
) -> dict[str, Any]:
    """Return where the gap is, as plain data.

    Parameters
    ----------
    laws : sequence of FreeLaw
        What the places could do.
    noise : float
        Scale of the noise against the sigma the baseline counts with.

    Returns
    -------
    dict
        ``components`` (share of the explainable gap by place, with a 90 % interval), ``directions``,
        ``loads``, ``history`` and ``time`` (RMS of the position gap in mm), ``poses`` (the worst).
    """
    gap = 1e3 * np.where(used[:, :3], baseline.gap[:, :3], np.nan)
    size = np.sqrt(np.nansum(gap**2, axis=1))
    seen: NDArray[np.bool_] = np.any(used[:, :3], axis=1)
    result: dict[str, Any] = {"components": _shares(white, laws, noise, seed)}
    result["directions"] = {axis: _rms(gap[:, k]) for k, axis in enumerate("xyz") if used[:, k].any()}
    load = np.linalg.norm(baseline.rows.wrench[:, :3], axis=1)
    result["loads"] = _by_level(load, size, seen, "N")
    branch = rising(baseline)
    if (branch > 0).any() and (branch < 0).any():
        result["history"] = {
            name: _rms(size[seen & (branch == sign)]) for name, sign in (("loading", 1), ("unloading", -1))
        }
    if np.isfinite(baseline.rows.time).all() and np.ptp(baseline.rows.time) > 0:
        result["time"] = _by_level(baseline.rows.time, size, seen, "s")
    result["joints"] = {
        name: _by_level(baseline.rows.q[:, k], size, seen, "")
        for k, name in enumerate(baseline.rows.variables)
        if np.ptp(baseline.rows.q[:, k]) > 0
    }
    result["poses"] = _worst(baseline, size, seen)
    return result


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if known.size else 0.0


def _by_level(value: Array, size: Array, seen: NDArray[np.bool_], unit: str) -> dict[str, float]:
    """Return the RMS by thirds of a quantity, under what they span."""
    whole = float(np.abs(value).max(initial=0.0)) or 1.0
    value = np.round(value / whole, 6) * whole  # rounding must not split a level
    levels = np.unique(value[seen])
    if levels.size == 1:
        return {f"{levels[0]:.4g} {unit}".strip(): _rms(size[seen])}
    groups = np.array_split(levels, min(3, levels.size))
    return {
        f"{part[0]:.4g} to {part[-1]:.4g} {unit}".strip(): _rms(
            size[seen & (value >= part[0]) & (value <= part[-1])]
        )
        for part in groups
    }


def _worst(baseline: Baseline, size: Array, seen: NDArray[np.bool_]) -> list[dict[str, Any]]:
    rows = baseline.rows
    poses = np.unique(rows.pose[seen])
    rms = np.array([_rms(size[seen & (rows.pose == pose)]) for pose in poses])
    return [
        {
            "pose": int(poses[at]),
            "q": dict(zip(rows.variables, rows.q[np.argmax(rows.pose == poses[at])].tolist(), strict=True)),
            "rms_mm": float(rms[at]),
        }
        for at in np.argsort(-rms)[:WORST]
    ]


def _shares(white: Whitened, laws: Sequence[FreeLaw], noise: float, seed: int) -> list[dict[str, Any]]:
    by_place: dict[str, list[Array]] = {}
    for law in laws:
        by_place.setdefault(law.place, []).append(law.modes)
    parts = {name: np.concatenate(some, axis=1) for name, some in by_place.items()}
    y = white.leave(white.gap[:, None])[:, 0]
    if not parts or not y.any():
        return []
    names = list(parts)
    ends = np.cumsum([0, *(part.shape[1] for part in parts.values())])
    columns = np.concatenate(list(parts.values()), axis=1)
    gram, toward = columns.T @ columns, columns.T @ y
    precision = np.full(len(names), 10.0 * len(names) * columns.shape[0] / max(float(y @ y), 1.0))
    for _ in range(ROUNDS):
        prior = np.repeat(precision, np.diff(ends))
        covariance = np.linalg.inv(gram / noise**2 + np.diag(prior))
        mean = covariance @ toward / noise**2
        before = precision.copy()
        for k in range(len(names)):
            some = slice(ends[k], ends[k + 1])
            free = (ends[k + 1] - ends[k]) - precision[k] * np.trace(covariance[some, some])
            precision[k] = np.clip(max(free, 1e-9) / max(float(mean[some] @ mean[some]), 1e-12), 1e-6, 1e9)
        if np.abs(np.log(precision / before)).max() < SETTLED:
            break
    rng = np.random.default_rng(seed)
    # variances of what the rows show and of what they do not lie many decades apart: rounding may make some
    # negative
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = np.concatenate([mean[None], mean + rng.standard_normal((SAMPLES, mean.size)) @ root.T])
    explained = np.stack(
        [
            ((drawn[:, ends[k] : ends[k + 1]] @ parts[name].T) ** 2).sum(axis=1)
            for k, name in enumerate(names)
        ],
        -1,
    )
    total = max(float(y @ y) - noise**2 * white.freedom, 1e-12)
    whole = np.maximum(explained.sum(axis=1, keepdims=True), total)
    share = explained / whole
    low, high = np.quantile(share[1:], [0.05, 0.95], axis=0)
    order = np.argsort(-share[0])
    return [
        {
            "component": names[k],
            "share": float(share[0, k]),
            "interval": [float(min(low[k], share[0, k])), float(max(high[k], share[0, k]))],
        }
        for k in order
        if share[0, k] > 0.005
    ]
