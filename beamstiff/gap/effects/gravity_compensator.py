"""`gravity-compensator`: a spring balancer across the axis adds torque and stiffness that follow the angle.

A spring k_s of free length l_0 between points at a (base side) and r (link) from the axis stores
``U = k_s (L - l_0)^2 / 2``, ``L^2 = a^2 + r^2 + 2 a r cos(q - q_0)``; its torque is U', its stiffness U''
(Klimchik et al., arXiv 1311.6674).
"""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.drive_stiffness import PHASES, Following, scaled_torque
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.laws import axis_at, drive_compliance, drives
from beamstiff.robot.fields import RIGID

RATIOS = (0.2, 0.5)
FREE_LENGTHS = (0.0, 0.6)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    if axis.joint.variable is None or not axis.turns or axis.stiffness == RIGID:
        return []
    follow = Following(baseline, axis.joint.variable)
    compliance = drive_compliance(axis)
    result = []
    for ratio in RATIOS:
        for free in FREE_LENGTHS:
            for phase in PHASES:

                def spring(q: np.ndarray, phase=phase, ratio=ratio, free=free) -> np.ndarray:  # type: ignore[no-untyped-def]
                    return _spring(q - phase, ratio, free)[1]

                column = scaled_torque(baseline, axis, -follow.varying(spring) * compliance**2)
                if baseline.absolute:  # the balancer's own torque winds the drive up
                    torque = _spring(follow.angle - phase, ratio, free)[0]
                    column = column - axis.shift * (torque * compliance)[:, None]
                name = f"spring {ratio:g}, free {free:g}, {np.degrees(phase):.0f} deg"
                size = Quantity("largest_stiffness", "N*m/rad", 0.1 / compliance)
                result.append(Shape(name, column[..., None], (size,), spread=4.0))
    return result


def _spring(angle: np.ndarray, ratio: float, free: float) -> tuple[np.ndarray, np.ndarray]:
    """Return torque and stiffness of a balancer whose largest stiffness is 1."""

    def energy_slopes(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        length = np.sqrt(1 + ratio**2 + 2 * ratio * np.cos(at))
        first = -ratio * np.sin(at) / length
        second = (-ratio * np.cos(at) - first**2) / length
        left = length - free * (1 - ratio)
        return left * first, first**2 + left * second

    around = np.linspace(0, 2 * np.pi, 181)
    largest = np.abs(energy_slopes(around)[1]).max()
    torque, stiffness = energy_slopes(angle)
    return torque / largest, stiffness / largest


EFFECT = Effect(
    name="gravity-compensator",
    family="drive",
    meaning="A spring balancer across the axis adds a torque and a stiffness that follow the joint's angle.",
    components=drives,
    shapes=_shapes,
    separation="the same loads with the spring disconnected",
    look_alikes=("actuator-lever",),
    sources="several to 30 % of the drive's stiffness (arXiv 1311.6674, 1311.6810)",
)
