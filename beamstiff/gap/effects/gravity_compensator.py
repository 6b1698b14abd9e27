"""`gravity-compensator`: a spring balancer across the axis adds torque and stiffness that follow the angle.

A spring k_s of free length l_0 between points at a (base side) and r (link) from the axis stores
``U = k_s (L - l_0)^2 / 2``, ``L^2 = a^2 + r^2 + 2 a r cos(q - q_0)``; its torque is U', its stiffness U''
(Klimchik et al., arXiv 1311.6674).
"""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.drive_stiffness import PHASES, Following, angle_scales, scaled_torque
from beamstiff.gap.effects.effect import Effect, Quantity, Scales, Shape, stated_scale
from beamstiff.gap.effects.laws import Axis, axis_at, drive_compliance, drives, joint_of
from beamstiff.robot.fields import RIGID

RATIOS, MIDDLE = (0.15, 0.4, 0.7), 0.4
FREE_LENGTHS = (0.0, 0.4, 0.8)
TORQUE, STIFFNESS = 0, 1  # places of a spring's two


LEVEL = 0.5  # cosine to the vertical of the axes that weight turns
FAR = 1.0 / 3.0  # of the longest arm from such an axis to the tool: nobody balances a wrist


def _components(baseline: Baseline) -> list[str | None]:
    """Return the level axes that have much to carry; every drive where nothing says which way is down."""
    down = np.array(baseline.nominal.gravity)
    found = drives(baseline)
    if not down.any():
        return found
    arms: dict[str | None, float] = {}
    for name in found:
        place = baseline.places.joints[joint_of(baseline, str(name)).name]
        upright = np.abs(place.turn[:, :, 0] @ down) / np.linalg.norm(down)
        if float(np.median(upright)) < LEVEL:
            arms[name] = float(np.median(np.linalg.norm(place.shift[:, :3, 3], axis=1)))
    return [name for name, arm in arms.items() if arm >= FAR * max(arms.values())]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    axis = axis_at(baseline, str(component))
    if axis.joint.variable is None or not axis.turns or axis.stiffness == RIGID:
        return []
    follow = Following(baseline, axis.joint.variable)
    compliance = _compliance(baseline, axis)
    family = [(ratio, free, phase) for ratio in RATIOS for free in FREE_LENGTHS for phase in PHASES]
    # without a free length a spring half a turn on is the same with the other sign
    springs = [
        (MIDDLE, free, phase) for free in FREE_LENGTHS[::2] for phase in PHASES if free or phase < np.pi
    ]

    def laws(q: np.ndarray, chosen: list[tuple[float, float, float]], of: int = STIFFNESS) -> np.ndarray:
        return np.stack([_spring(q - phase, ratio, free)[of] for ratio, free, phase in chosen], -1)

    def column(stiffness: np.ndarray, torque: np.ndarray) -> np.ndarray:
        shift = scaled_torque(baseline, axis, -stiffness * compliance**2)
        # of absolute positions the balancer's own torque winds the drive up
        return shift - axis.shift * (torque * compliance)[:, None] if baseline.absolute else shift

    size = Quantity("largest_stiffness", "N*m/rad", 0.1 / compliance)
    stiffness = follow.varying(lambda q: laws(q, springs)).T
    torques = [_spring(follow.angle - phase, ratio, free)[0] for ratio, free, phase in springs]
    result = [
        Shape(
            f"spring {ratio:g}, free {free:g}, {np.degrees(phase):.0f} deg",
            column(factor, torque)[..., None],
            (size,),
            spread=4.0,
            weight=1.0 / len(springs),
        )
        for (ratio, free, phase), factor, torque in zip(springs, stiffness, torques, strict=True)
    ]
    if baseline.absolute:  # the torque is seen far more than the stiffness that comes with it
        mixture = follow.mixture(laws(follow.fitted, family, TORQUE))
        factors = follow.varying(lambda q: laws(q, family)) @ mixture
        whole = list(map(column, factors.T, (laws(follow.angle, family, TORQUE) @ mixture).T))
        quantity, unit, large = "torque_mode", "N*m", 0.25 * size.size
    else:
        whole = [column(mode, np.zeros(len(mode))) for mode in follow.family(lambda q: laws(q, family)).T]
        quantity, unit, large = "stiffness_mode", "N*m/rad", 0.5 * size.size
    names = tuple(Quantity(f"{quantity}_{k + 1}", unit, large) for k in range(len(whole)))
    return [*result, Shape("any spring", np.stack(whole, -1), names, spread=4.0)]


def _compliance(baseline: Baseline, axis: Axis) -> float:
    """Return the drive's compliance that the balancer's stiffness is counted against."""
    return stated_scale(baseline, "compliance") or drive_compliance(axis)


def _scales(baseline: Baseline, component: str | None) -> Scales:
    compliance = _compliance(baseline, axis_at(baseline, str(component)))
    return {**angle_scales(baseline, component), "compliance": compliance}


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
    components=_components,
    shapes=_shapes,
    separation="the same loads with the spring disconnected",
    look_alikes=("actuator-lever",),
    sources="several to 30 % of the drive's stiffness (arXiv 1311.6674, 1311.6810)",
    scales=_scales,
)
