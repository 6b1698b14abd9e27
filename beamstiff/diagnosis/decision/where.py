"""Where the gap is: by direction, load, history, time, place and posture; and the places that could make it.

Every place gets what it could do at most (`component_subspaces`), and its share of the gap (`attribution`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.load_error import rising
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.measure.arrays import places_of_each
from beamstiff.measure.table import Measurements
from beamstiff.se3 import Array

WORST = 5  # poses
SAME = 1e-9  # of the largest: what levels differ by from rounding


def where(baseline: Baseline, used: NDArray[np.bool_], components: list[dict[str, Any]]) -> dict[str, Any]:
    """Return where the gap is, as plain data.

    `used`: (N, 6) bool array; values that count.
    `components`: shares of the places (`attribution.shares`).
    Returns ``components`` (share of the explainable gap by place, with a 90 % interval),
    ``directions``, ``loads``, ``history`` and ``time`` (RMS of the position gap in mm), ``joints`` (by thirds
    of every variable), ``regions`` (by thirds of where it was read along the base frame's axes), ``poses``
    (the worst).
    """
    gap = 1e3 * np.where(used[:, :3], baseline.gap[:, :3], np.nan)
    size = np.sqrt(np.nansum(gap**2, axis=1))
    seen: NDArray[np.bool_] = np.any(used[:, :3], axis=1)
    result: dict[str, Any] = {"components": components}
    result["directions"] = {axis: _rms(gap[:, k]) for k, axis in enumerate("xyz") if used[:, k].any()}
    load = np.linalg.norm(baseline.rows.wrench[:, :3], axis=1)
    result["loads"] = _by_level(load, size, seen, "N")
    branch = rising(baseline)
    if (branch > 0).any() and (branch < 0).any():
        result["history"] = {
            name: _rms(size[seen & (branch == sign)]) for name, sign in (("loading", 1), ("unloading", -1))
        }
    if times := _by_time(baseline.rows, size, seen):
        result["time"] = times
    result["joints"] = {
        name: _by_level(baseline.rows.q[:, k], size, seen, "")
        for k, name in enumerate(baseline.rows.variables)
        if np.ptp(baseline.rows.q[:, k]) > 0
    }
    position, _ = baseline.described
    result["regions"] = {
        axis: _by_level(position[:, k], size, seen, "m")
        for k, axis in enumerate("xyz")
        if np.ptp(position[:, k]) > SAME * float(np.abs(position).max())
    }
    result["poses"] = _worst(baseline, size, seen)
    return result


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if known.size else 0.0


def _by_level(value: Array, size: Array, seen: NDArray[np.bool_], unit: str) -> dict[str, float]:
    """Return the RMS by thirds of a quantity, under what they span."""
    least, whole = float(value.min()), float(np.ptp(value))
    if whole <= SAME * float(np.abs(value).max()):
        whole = 0.0
    value = least + np.round((value - least) / (whole or 1.0), 6) * whole  # rounding must not split a level
    levels = np.unique(value[seen])
    parts = np.array_split(levels, min(3, levels.size))
    rms = [_rms(size[seen & (value >= part[0]) & (value <= part[-1])]) for part in parts]
    labels: list[str] = []
    for digits in range(4, 18):  # as many as tell the parts from one another
        ends = [dict.fromkeys(f"{end:.{digits}g}" for end in (part[0], part[-1])) for part in parts]
        labels = [f"{' to '.join(own)} {unit}".strip() for own in ends]
        if len(set(labels)) == len(parts):
            break
    return dict(zip(labels, rms, strict=True))


def _by_time(rows: Measurements, size: Array, seen: NDArray[np.bool_]) -> dict[str, float]:
    """Return the RMS by thirds of the time: of each table by itself, for each has a clock of its own."""
    result: dict[str, float] = {}
    for run in np.unique(rows.run[seen]).tolist():
        own = seen & (rows.run == run)
        table = f"{rows.sources[run]}: " if len(rows.sources) > 1 else ""
        if np.ptp(rows.time[own]) > 0:  # and known: NaN is not
            thirds = _by_level(rows.time[own], size[own], seen[own], "s")
            result |= {f"{table}{part}": rms for part, rms in thirds.items()}
    return result


def _worst(baseline: Baseline, size: Array, seen: NDArray[np.bool_]) -> list[dict[str, Any]]:
    rows = baseline.rows
    shown = np.flatnonzero(seen)
    poses = [shown[at] for at in places_of_each(rows.pose[shown])]
    rms = np.array([_rms(size[at]) for at in poses])
    return [
        {
            "pose": int(rows.pose[poses[at][0]]),
            "q": dict(
                zip(
                    rows.variables,
                    rows.q[np.argmax(rows.pose == rows.pose[poses[at][0]])].tolist(),
                    strict=True,
                )
            ),
            "rms_mm": float(rms[at]),
        }
        for at in np.argsort(-rms)[:WORST]
    ]
