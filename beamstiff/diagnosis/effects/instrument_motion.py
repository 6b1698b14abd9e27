"""`instrument-motion`: the instrument moves with the applied force. No effect of the formats: see `outside`.

Its stand tilts about two horizontal axes, and rises or sinks, each with each part of the force: what yields
under a stand is a floor, which is compliant vertically.
"""

import numpy as np

from beamstiff.diagnosis.effects.drifts import along, turning
from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

TILT = 1e-7  # rad/N
RISE = 3e-7  # m/N, of a stand some metres from the base about which it counts


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    up, first, second = _upright(np.asarray(baseline.nominal.gravity, dtype=np.float64))
    columns, parameters = [], []
    for axis, force in zip("xyz", baseline.rows.wrench[:, :3].T, strict=True):
        turned = turning(baseline, force)
        columns += [turned @ first, turned @ second, along(force) @ up]
        parameters += [Quantity(f"tilt_about_{about}_per_f{axis}", "rad/N", TILT) for about in "xy"]
        parameters.append(Quantity(f"rise_per_f{axis}", "m/N", RISE))
    return [Shape("tilts and sinks with the force", np.stack(columns, axis=-1), tuple(parameters))]


def _upright(gravity: Array) -> tuple[Array, Array, Array]:
    """Return up, and the two horizontal axes (3,) nearest the x and y axes of the base frame; up is z if so.

    Without gravity up is z; where x is vertical the first horizontal axis is y.
    """
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    level = np.eye(3) - np.outer(up, up)
    first = level[np.argmax(np.linalg.norm(level[:2], axis=1) > 0.5)]
    first = first / np.linalg.norm(first)
    return up, first, np.cross(up, first)


EFFECT = Effect(
    name="instrument-motion",
    family="measurement",
    meaning="The stand of the instrument moves with the applied force.",
    components=lambda baseline: [None] if baseline.rows.wrench[:, :3].any() else [],
    shapes=_shapes,
    separation=(
        "read a reflector that stands on the ground beside the robot while the load pulls; what was read "
        "without load is not affected"
    ),
    look_alikes=("base-compliance",),
    place="readings",
    outside=True,
)
