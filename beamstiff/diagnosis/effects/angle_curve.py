"""`angle-curve`: a joint's error follows its angle: gear, encoder, eccentric wheels.

The error of an encoder or gear that turns once with the joint is a Fourier series of its angle,
``dq = sum_k a_k sin(k q) + b_k cos(k q)``. Its mean is the zero of the encoder (`geometry-error`). Every
order is a shape of its own: which ones a joint has is for the data to say.
"""

from collections.abc import Mapping

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

SIZE = 2e-4  # rad: runout of an eccentric wheel or disc of 0.02 mm at 100 mm
HIGHEST = 30  # order: finer waves need more angles than campaigns visit
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
    most = HIGHEST
    if baseline.stated is None:  # a robot that has the effect has it in every order
        most = min(HIGHEST, _angles_visited(baseline, name) // VALUES_AN_ORDER)
    return [
        Shape(
            f"order {k}",
            np.stack([turn * course(k * angle)[:, None] for course in (np.sin, np.cos)], axis=-1),
            tuple(Quantity(f"{way}_{k}", "rad", SIZE) for way in ("sine", "cosine")),
            prior_factor=30.0,
        )
        for k in range(1, most + 1)
    ]


def joint_error(sizes: Mapping[str, float], angle: Array) -> Array:
    """Return the error (n,) of a joint at some angles (n,), rad, by sizes of the shapes' parameters, rad."""
    result = np.zeros(angle.size)
    for name, size in sizes.items():
        way, _, order = name.partition("_")
        result += size * (np.sin if way == "sine" else np.cos)(int(order) * angle)
    return result


EFFECT = Effect(
    name="angle-curve",
    family="geometry",
    meaning="The error of a joint follows its angle: gear, encoder, eccentricity.",
    components=_components,
    shapes=_shapes,
    separation="move this joint alone through its range in small steps, unloaded; read it far from its axis",
    look_alikes=("geometry-error", "gravity-compensator"),
    sources="UR10 of the public set: amplitudes of 0.05 to 0.3 mrad; eccentricity of wheels 0.02 mm",
)
