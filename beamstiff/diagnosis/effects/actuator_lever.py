"""`actuator-lever`: stiffness about the axis follows a lever arm, and so the joint's angle.

A linear drive (ball screw, cylinder, tie rod) between points at distances a and b from the axis acts at the
lever ``h = a b sin(phi) / L``, ``L^2 = a^2 + b^2 - 2 a b cos(phi)``; its stiffness k_s gives
``k = k_s h^2`` about the axis, so the compliance follows 1/h^2 (seed 003, eqs 45 to 47). A screw that is
compliant by its free length besides (``(L - fixed)/EA``, see `Strut`) follows (L - fixed)/h^2: `any crank`
holds those laws too. Where the model has the screw itself, as a strut or a prismatic joint, its lever is
known and its compliance grows with its free length (`free_length`).
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from beamstiff.diagnosis.effects.drive_stiffness import (
    FINE,
    PHASES,
    Following,
    angle_scales,
    scaled_torque,
    values_fitted,
)
from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, named
from beamstiff.diagnosis.effects.free_length import of_slide, of_struts, screws
from beamstiff.diagnosis.effects.torque_laws import axis_at, drive_compliance, drives, unit_of
from beamstiff.diagnosis.residual.baseline import Baseline

RATIOS = (0.15, 0.3, 0.5, 0.7, 0.85)  # of the two arms
FINE_RATIOS = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
GEARS = (1.0, 0.6, 0.3)  # turn of the crank over the joint's
NEARER_DEAD = 0.25
TWICE = 0.5  # of a wave, that which comes twice
VARIES = 0.3  # RMS of the compliance over its mean, usual for a drive of this kind

NEAR_DEAD = 0.35  # of its largest lever, below which nobody lets a screw work
GENTLE = 0.5  # of it, above which most stay

ROUND = np.deg2rad(270.0)  # range of a joint that no rod can serve: its dead points are half a turn apart

STEPS = 91  # through the range: at most three degrees each

Crank = tuple[float, float, float, float]  # ratio, phase, gear, mean square lever


def _components(baseline: Baseline) -> list[str | None]:
    """Return the drives whose range a rod, or a linkage, can serve, or all of them, and the screws."""
    found = _drives(baseline)
    return [*found, *(name for name in screws(baseline) if name not in found)]


def _drives(baseline: Baseline) -> list[str | None]:
    """Return the drives whose range a rod, or a linkage, can serve; all of them where there is none."""
    limits = {variable.name: variable.limits for variable in baseline.nominal.variables}
    found = drives(baseline)

    def served(name: str | None) -> bool:
        axis = axis_at(baseline, str(name))
        own = limits.get(axis.joint.variable or "")
        return own is None or not axis.turns or own[1] - own[0] <= ROUND

    if baseline.stated is not None:  # whoever wrote it into the robot knows better
        return found
    return [name for name in found if served(name)] or found


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    screw = screws(baseline).get(str(component))
    own = [] if screw is None else [of_struts(baseline, str(component), screw)]
    if component not in drives(baseline):
        return own
    axis = axis_at(baseline, str(component))
    if axis.joint.variable is None:
        return own
    if not axis.turns:
        return own or [of_slide(baseline, axis)]
    follow = Following(baseline, axis.joint.variable)
    compliance = drive_compliance(axis)
    unit = f"{unit_of(axis)}/(N*m)"
    cranks = _possible(follow, RATIOS, PHASES, GEARS[:1], NEAR_DEAD)
    family = _possible(follow, FINE_RATIOS, FINE, GEARS, NEARER_DEAD)
    if not family:
        return []

    def laws(q: np.ndarray, some: list[Crank], least: float) -> np.ndarray:
        # beyond the range that was measured a lever may come near its dead point, where no screw works
        columns = [
            square / np.maximum(_lever(gear * q + phase, ratio), least * _largest(ratio)) ** 2
            for ratio, phase, gear, square in some
        ]
        return np.stack(columns, -1) if columns else np.zeros((len(q), 0))

    def any_of(name: str, some: list[Crank], least: float) -> Shape:
        modes = follow.family(lambda q: laws(q, some, least))
        numbers = [f"{k + 1}" for k in range(modes.shape[1])]
        quantities = named("compliance_mode", unit, VARIES * compliance, numbers)
        return Shape(name, scaled_torque(baseline, axis, modes), quantities, prior_factor=3.0, weight=0.5)

    gain = Quantity("mean_compliance", unit, compliance)
    slips = scaled_torque(baseline, axis, follow.varying(lambda q: laws(q, cranks, NEAR_DEAD)))
    gentle = _possible(follow, FINE_RATIOS, FINE, GEARS, GENTLE)
    result = [
        Shape(
            f"crank {ratio:g}, {np.degrees(phase):.0f} deg",
            slips[..., at : at + 1],
            (gain,),
            prior_factor=3.0,
            weight=1.0 / len(cranks),
        )
        for at, (ratio, phase, _, _) in enumerate(cranks)
    ]
    turn = follow.varying(lambda q: np.stack([np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)], -1))
    waves = scaled_torque(baseline, axis, turn)
    once = named("compliance", unit, VARIES * compliance, ("cosine", "sine"))
    twice = named("compliance", unit, TWICE * VARIES * compliance, ("cosine_twice", "sine_twice"))
    return [
        *result,
        Shape("once a turn", waves[..., :2], once, prior_factor=3.0),
        Shape("once and twice a turn", waves, (*once, *twice), prior_factor=3.0, weight=0.5),
        any_of("any crank", family, NEARER_DEAD),
        *([any_of("any gentle crank", gentle, GENTLE)] if gentle else []),
    ]


def _scales(baseline: Baseline, component: str | None) -> Normalisation:
    if component in drives(baseline):
        return angle_scales(baseline, component)
    return values_fitted(baseline, str(component))


def _possible(
    follow: Following, ratios: Sequence[float], phases: np.ndarray, gears: Sequence[float], least: float
) -> list[Crank]:
    """Return the cranks that stay away from their dead points, in all of the range that was measured.

    Between two angles as well: with a dead point in a gap the law there would be anything.
    """
    between = np.linspace(follow.fitted.min(), follow.fitted.max(), STEPS)
    return [
        (ratio, phase, gear, float(follow.share @ _lever(gear * follow.fitted + phase, ratio) ** 2))
        for gear in gears
        for ratio in ratios
        for phase in phases.tolist()
        if _lever(gear * between + phase, ratio).min() > least * _largest(ratio)
    ]


@lru_cache
def _largest(ratio: float) -> float:
    return float(_lever(np.linspace(0, np.pi, 181), ratio).max())


def _lever(angle: np.ndarray, ratio: float) -> np.ndarray:
    return np.asarray(ratio * np.abs(np.sin(angle)) / np.sqrt(1 + ratio**2 - 2 * ratio * np.cos(angle)))


EFFECT = Effect(
    name="actuator-lever",
    family="drive",
    meaning="The drive's stiffness about the axis follows its lever arm (ball screw, tie rod).",
    components=_components,
    shapes=_shapes,
    separation="apply the same torque at four angles of this joint; compare with the drive's drawing",
    look_alikes=("gravity-compensator", "tool-compliance"),
    sources="stiffness x1.2 to 3 over the stroke, engineering estimate",
    scales=_scales,
)
