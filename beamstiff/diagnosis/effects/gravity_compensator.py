"""`gravity-compensator`: a spring balancer across the axis adds torque and stiffness that follow the angle.

A spring k_s of free length l_0 between points at a (base side) and r (link) from the axis stores
``U = k_s (L - l_0)^2 / 2``, ``L^2 = a^2 + r^2 + 2 a r cos(q - q_0)``; its torque is U', its stiffness U''
(Klimchik et al., arXiv 1311.6674). Absolute positions show the torque by what it winds up, and whatever the
balancer, its stiffness is how its torque changes with the angle. Displacements show the stiffness alone.
"""

import numpy as np

from beamstiff.diagnosis.effects.angle_curve import BALANCED
from beamstiff.diagnosis.effects.drive_stiffness import PHASES, Following, angle_scales, scaled_torque
from beamstiff.diagnosis.effects.effect import (
    Effect,
    Normalisation,
    Quantities,
    Quantity,
    Shape,
    Term,
    named,
    stated_scale,
)
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, by_slips, drive_compliance, drives
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.robot.fields import RIGID

RATIOS, MIDDLE = (0.15, 0.4, 0.7), 0.4
FREE_LENGTHS = (0.0, 0.4, 0.8)
TORQUE, STIFFNESS = 0, 1  # places of a spring's two
WIND_UP = 1e-3  # rad, of the drive by the balancer's torque: about what the arm's weight does
SPREAD, PRELOADED = 4.0, 8.0  # of stiffness; of torque

LEVEL = 0.5  # cosine to the vertical of the axes that weight turns
FAR = 1.0 / 3.0  # of the longest arm from such an axis to the tool: nobody balances a wrist


def _components(baseline: Baseline) -> list[str | None]:
    """Return the level axes that have much to carry; every drive where nothing says which way is down."""
    down = np.array(baseline.nominal.gravity)
    found = drives(baseline)
    if not down.any() or baseline.stated is not None:  # whoever wrote it into the robot knows better
        return found
    arms: dict[str | None, float] = {}
    for name in found:
        axis = axis_at(baseline, str(name))
        if not axis.turns:
            continue
        place = baseline.places.joints[axis.joint.name]
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

    def softer(stiffness: np.ndarray) -> np.ndarray:
        return scaled_torque(baseline, axis, -stiffness * compliance**2)

    def wound(torque: np.ndarray) -> np.ndarray:
        """Return what torques (N, k) wind up, (N, 6, k): absolute positions alone show it."""
        return by_slips(axis.shift, -torque * compliance * baseline.absolute)

    def numbered(what: str, unit: str, size: float, modes: np.ndarray) -> Quantities:
        return named(what, unit, size, [f"mode_{k + 1}" for k in range(modes.shape[-1])])

    spread = PRELOADED if baseline.absolute else SPREAD
    stiff, turn = 0.1 / compliance, WIND_UP / compliance
    by_torque = baseline.absolute or baseline.stated is not None
    by_stiffness = not baseline.absolute or baseline.stated is not None
    pulls, stiffens = Quantity("largest_torque", "N*m", turn), Quantity("largest_stiffness", "N*m/rad", stiff)
    factors = softer(follow.varying(lambda q: laws(q, springs)))
    result = []
    for at, chosen in enumerate(springs):
        terms: list[Term] = [(factors[..., at], (stiffens,))] if by_stiffness else []
        if by_torque:
            share = _stiffness_of_torque(*chosen[:2])
            torque = share * laws(follow.angle, [chosen], TORQUE)
            terms.insert(0, (wound(torque) + share * factors[..., [at]], (pulls,)))
        ratio, free, phase = chosen
        name = f"spring {ratio:g}, free {free:g}, {np.degrees(phase):.0f} deg"
        result.append(Shape.of(name, *terms, prior_factor=spread, weight=1.0 / len(springs)))
    wholes: list[Term] = []
    if by_torque:
        mixture = follow.mixture(laws(follow.fitted, family, TORQUE))
        torques = laws(follow.angle, family, TORQUE) @ mixture
        slopes = follow.varying(lambda q: laws(q, family) @ mixture)
        wholes.append((wound(torques) + softer(slopes), numbered("torque", "N*m", turn, torques)))
    if by_stiffness:
        modes = softer(follow.family(lambda q: laws(q, family)))
        wholes.append((modes, numbered("stiffness", "N*m/rad", 0.5 * stiff, modes)))
    result.append(Shape.of("any spring", *wholes, prior_factor=spread))
    if not by_torque:
        return result
    about = follow.angle - follow.share @ follow.fitted
    more = (Quantity("torque", "N*m", turn), Quantity("torque_by_angle", "N*m/rad", turn))
    coil = (wound(np.stack([np.ones_like(about), about], -1)), more)
    return [*result, Shape.of("any spring, and a wound one", coil, *wholes, prior_factor=spread)]


def _stiffness_of_torque(ratio: float, free: float) -> float:
    """Return the largest stiffness of a balancer whose largest torque is 1."""
    return float(1.0 / np.abs(_spring(np.linspace(0, 2 * np.pi, 181), ratio, free)[TORQUE]).max())


def _compliance(baseline: Baseline, axis: Axis) -> float:
    """Return the drive's compliance that the balancer's stiffness is counted against."""
    return stated_scale(baseline, "compliance") or drive_compliance(axis)


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
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
    separation="apply the same loads with the balancer's spring disconnected",
    look_alikes=("actuator-lever", "angle-curve"),
    alike_in_positions={"angle-curve": BALANCED},
    sources="several to 30 % of the drive's stiffness (arXiv 1311.6674, 1311.6810)",
    scales=_normalisation,
)
