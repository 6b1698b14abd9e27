"""`angle-curve`: a joint's error follows its angle, a slide's its position: gear, encoder, rack, screw.

The error of an encoder or gear that turns once with the joint is a Fourier series of its angle,
``dq = sum_k a_k sin(k q) + b_k cos(k q)``. Its mean is the zero of the encoder (`geometry-error`). Every
order is a shape of its own: which ones a joint has is for the data to say.

A slide's series is one of its position: its first wave is twice as long as its travel, half of which is
nearly the line that a wrong scale or pitch is.
"""

from collections.abc import Mapping

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, stated_scale
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

SIZE = 2e-4  # rad: runout of an eccentric wheel or disc of 0.02 mm at 100 mm
SLIDE_SIZE = 1e-4  # m: racks and screws are off by 0.02 to 0.2 mm in a metre
HIGHEST = 30  # order: finer waves need more angles than campaigns visit
VALUES_AN_ORDER = 4  # distinct angles that a sine and a cosine need, with as many left to check them
SAME = np.deg2rad(0.1)  # rad or m: angles and positions closer than this are one


def _components(baseline: Baseline) -> list[str | None]:
    if not baseline.absolute:
        return []
    driven = [item.name for item in baseline.nominal.actuated]
    if baseline.stated is not None:  # a robot that has the effect has it at whatever angles
        return list(driven)
    return [name for name in driven if _values_visited(baseline, name) >= VALUES_AN_ORDER]


def _values_visited(baseline: Baseline, name: str) -> int:
    rows = baseline.fit.rows
    return len(np.unique(np.round(rows.q[:, rows.variables.index(name)] / SAME)))


def _scales(baseline: Baseline, component: str | None) -> Normalisation:
    wave = longest_wave(baseline, str(component))
    return {} if wave is None else {"longest_wave": wave}


def longest_wave(baseline: Baseline, name: str) -> float | None:
    """Return the length of a slide's first wave, m: twice its travel; None of a joint that turns."""
    variable = next(item for item in baseline.nominal.actuated if item.name == name)
    if variable.kind == "angle":
        return None
    if (stated := stated_scale(baseline, "longest_wave")) is not None:
        return stated
    rows = baseline.fit.rows
    low, high = variable.limits or np.quantile(rows.q[:, rows.variables.index(name)], (0.0, 1.0))
    return 2.0 * float(high - low)


def phase(baseline: Baseline, name: str) -> Array:
    """Return the angle of the first wave at every row (N,), rad: of a joint that turns it is its own."""
    value = baseline.rows.q[:, baseline.rows.variables.index(name)]
    return angle_of(value, longest_wave(baseline, name))


def angle_of(value: Array, wave: float | None) -> Array:
    """Return the angle of the first wave, rad, at values of a joint (n,), rad or m; `wave`: of a slide, m."""
    return value if wave is None else 2.0 * np.pi / wave * value


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    name = str(component)
    angle, moved = phase(baseline, name), pose_change(baseline, name)
    slides = longest_wave(baseline, name) is not None
    unit, size = ("m", SLIDE_SIZE) if slides else ("rad", SIZE)
    most = HIGHEST
    if baseline.stated is None:  # a robot that has the effect has it in every order
        most = min(HIGHEST, _values_visited(baseline, name) // VALUES_AN_ORDER)
    return [
        Shape(
            f"order {k}",
            np.stack([moved * course(k * angle)[:, None] for course in (np.sin, np.cos)], axis=-1),
            tuple(Quantity(f"{way}_{k}", unit, size) for way in ("sine", "cosine")),
            prior_factor=30.0,
        )
        for k in range(1, most + 1)
    ]


def joint_error(sizes: Mapping[str, float], angle: Array) -> Array:
    """Return the error (n,) of a joint at angles of its first wave (n,), rad, by sizes of its parameters."""
    result = np.zeros(angle.size)
    for name, size in sizes.items():
        way, _, order = name.partition("_")
        result += size * (np.sin if way == "sine" else np.cos)(int(order) * angle)
    return result


BALANCED = (
    "no position distinguishes a spring balancer from an error that follows the joint's angle: look whether "
    "the joint has one, or record the drives' torques at rest (columns tau_JOINT) and diagnose again"
)

EFFECT = Effect(
    name="angle-curve",
    family="geometry",
    meaning="The error of a joint follows its angle, of a slide its position: gear, encoder, eccentricity, "
    "rack.",
    components=_components,
    shapes=_shapes,
    separation="move this joint alone through its range in small steps, unloaded; read it far from its axis",
    look_alikes=("geometry-error", "gravity-compensator"),
    alike_in_positions={"gravity-compensator": BALANCED},
    scales=_scales,
    sources="UR10 of the public set: amplitudes of 0.05 to 0.3 mrad; eccentricity of wheels 0.02 mm",
)
