"""`thermal-drift`: the reading drifts with time or temperature, loaded or not."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.effect import Effect, Quantity, Scales, Shape, stated_scale
from beamstiff.gap.effects.outside import campaign, clock, since_pose

DRIFT = 1e-4  # m over the campaign
WARMTH = 2e-5  # m/K
DECAYS = (0.1, 0.3)  # of the campaign's duration


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:  # noqa: ARG001
    rows, fitted, stated = baseline.rows, baseline.fit.rows, baseline.stated is not None
    time = clock(baseline)
    laws = {"time": time - 0.5, "time, warming up": 1 - np.exp(-time / DECAYS[1])}
    laws["time, warming up fast"] = 1 - np.exp(-time / DECAYS[0])
    if not baseline.absolute and (stated or fitted.shared_unloaded):
        since = {
            f"{name}, since the unloaded reading": since_pose(baseline, law) for name, law in laws.items()
        }
        laws = {**laws, **since} if stated else since
    result = [
        Shape(name, _along(law), tuple(Quantity(f"drift_{axis}", "m", DRIFT) for axis in "xyz"))
        for name, law in laws.items()
    ]
    several = np.concatenate([_along(law) for law in (time - 0.5, (time - 0.5) ** 2 - 1 / 12)], -1)
    quantities = tuple(
        Quantity(f"drift_{axis}{power}", "m", DRIFT) for power in ("", "_square") for axis in "xyz"
    )
    result.append(Shape("time, curved", several, quantities))
    if stated or (np.isfinite(fitted.temperature).all() and np.ptp(fitted.temperature) > 0):
        warmth = rows.temperature - _mean_temperature(baseline)
        result.append(
            Shape(
                "temperature",
                _along(np.nan_to_num(warmth)),
                tuple(Quantity(f"expansion_{axis}", "m/K", WARMTH) for axis in "xyz"),
                weight=2.0,
            )
        )
    return result


def _mean_temperature(baseline: Baseline) -> float:
    stated, warmth = stated_scale(baseline, "temperature"), baseline.fit.rows.temperature
    if stated is not None:
        return stated
    return float(warmth.mean()) if np.isfinite(warmth).all() else 0.0


def _scales(baseline: Baseline, component: str | None) -> Scales:  # noqa: ARG001
    return {**asdict(campaign(baseline)), "temperature": _mean_temperature(baseline)}


def _along(law: np.ndarray) -> np.ndarray:
    """Return the displacement (N, 6, 3) along x, y and z that follows a law (N,)."""
    result = np.zeros((len(law), 6, 3))
    result[:, [0, 1, 2], [0, 1, 2]] = law[:, None]
    return result


EFFECT = Effect(
    name="thermal-drift",
    family="measurement",
    meaning="The reading drifts with time or temperature, whatever the load.",
    components=lambda baseline: [None] if len(baseline.rows) > 1 or baseline.stated else [],
    shapes=_shapes,
    separation="re-measure the reference pose now and then",
    look_alikes=("outliers",),
    sources="5 to 50 um/K, engineering estimate",
    scales=_scales,
)
