"""`angle-curve`: a joint's error follows its angle: gear, encoder, eccentric wheels.

The error of an encoder or gear that turns once with the joint is a Fourier series of the joint's angle,
``dq = sum_k a_k sin(k q) + b_k cos(k q)``. Its mean is the zero of the encoder (`geometry-error`).
"""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.residual.baseline import Baseline

SIZE = 2e-4  # rad: runout of an eccentric wheel or disc of 0.02 mm at 100 mm
HIGHEST = (1, 2, 3, 4, 6, 8, 10, 15, 20, 30)  # orders up to which a series goes
VALUES_AN_ORDER = 4  # distinct angles that a sine and a cosine need, with as many left to check them
SAME = np.deg2rad(0.1)  # angles closer than this are one


def _components(baseline: Baseline) -> list[str | None]:
    if not baseline.absolute:
        return []
    turning = [item.name for item in baseline.nominal.actuated if item.kind == "angle"]
    if baseline.stated is not None:  # a robot that has the effect has it at whatever angles
        return list(turning)
    return [name for name in turning if _angles_visited(baseline, name) >= VALUES_AN_ORDER]


def _angles_visited(baseline: Baseline, name: str) -> int:
    rows = baseline.fit.rows
    return len(np.unique(np.round(rows.q[:, rows.variables.index(name)] / SAME)))


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    name = str(component)
    rows = baseline.rows
    angle = rows.q[:, rows.variables.index(name)]
    turn = pose_change(baseline, name)
    most = _angles_visited(baseline, name) // VALUES_AN_ORDER
    if baseline.stated is not None:
        most = max(HIGHEST)
    highest = [order for order in HIGHEST if order <= most]
    waves = {
        f"{way}_{k}": turn * course(k * angle)[:, None]
        for k in range(1, max(highest, default=0) + 1)
        for way, course in (("sine", np.sin), ("cosine", np.cos))
    }
    return [
        Shape(
            f"orders 1 to {order}" if order > 1 else "order 1",
            np.stack(list(waves.values())[: 2 * order], axis=-1),
            tuple(Quantity(wave, "rad", SIZE) for wave in list(waves)[: 2 * order]),
            spread=30.0,
        )
        for order in highest
    ]


EFFECT = Effect(
    name="angle-curve",
    family="geometry",
    meaning="The error of a joint follows its angle: gear, encoder, eccentricity.",
    components=_components,
    shapes=_shapes,
    separation="this joint alone through its range in small steps, unloaded, read at a long lever",
    look_alikes=("geometry-error", "gravity-compensator"),
    sources="UR10 of the public set: amplitudes of 0.05 to 0.3 mrad; eccentricity of wheels 0.02 mm",
)
