"""Effects as the simulated machines have them: one file an effect, those outside the table in `outside_*`.

The files `further_*` and `third_*`, `outside_further` and `outside_third` hold forms of a second and a third
hand, whose authors have not read the diagnosis. Who writes the diagnosis must not read them: what its shapes
miss can only show on forms that they do not know.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.gap.exam.campaign import Truth
from beamstiff.gap.exam.effect import Asked, Effect, joined
from beamstiff.gap.exam.reality import Reality
from beamstiff.gap.exam.truths import (
    actuator_lever,
    backlash,
    base_compliance,
    bearing_tilt,
    frame_misalignment,
    further_coupling,
    further_friction,
    further_geometry,
    further_levers,
    further_measurement,
    further_springs,
    further_structure,
    further_tool,
    geometry_error,
    gravity_compensator,
    hardening,
    hysteresis,
    joint_compliance,
    joint_coupling,
    link_bending,
    load_error,
    outliers,
    outside_drives,
    outside_further,
    outside_structure,
    outside_third,
    payload_error,
    thermal_drift,
    third_coupling,
    third_friction,
    third_geometry,
    third_levers,
    third_measurement,
    third_springs,
    third_structure,
    third_tool,
    tool_compliance,
    tool_offset,
)
from beamstiff.robot.description import Robot

_FIRST: tuple[Effect, ...] = tuple(
    module.EFFECT
    for module in (
        link_bending,
        bearing_tilt,
        base_compliance,
        tool_compliance,
        actuator_lever,
        backlash,
        joint_compliance,
        hardening,
        hysteresis,
        joint_coupling,
        gravity_compensator,
        geometry_error,
        tool_offset,
        load_error,
        frame_misalignment,
        payload_error,
        thermal_drift,
        outliers,
    )
)
_LATER: tuple[dict[str, Effect], ...] = tuple(
    {effect.name: effect for module in modules for effect in module.EFFECTS}
    for modules in (
        (
            further_coupling,
            further_friction,
            further_geometry,
            further_levers,
            further_measurement,
            further_springs,
            further_structure,
            further_tool,
        ),
        (
            third_coupling,
            third_friction,
            third_geometry,
            third_levers,
            third_measurement,
            third_springs,
            third_structure,
            third_tool,
        ),
    )
)
INSIDE: tuple[Effect, ...] = tuple(
    joined(effect, *(hand.get(effect.name) for hand in _LATER)) for effect in _FIRST
)
_OUTSIDE: tuple[tuple[Effect, ...], ...] = (
    (*outside_drives.EFFECTS, *outside_structure.EFFECTS),
    outside_further.EFFECTS,
    outside_third.EFFECTS,
)
OUTSIDE: tuple[Effect, ...] = tuple(effect for hand in _OUTSIDE for effect in hand)
EFFECTS = {effect.name: effect for effect in (*INSIDE, *OUTSIDE)}


def components(robot: Robot, effect: str) -> list[str | None]:
    """Return the components that an effect can sit at on a robot; empty where it cannot."""
    return list(_known(effect).places(robot))


def draw_truth(
    rng: np.random.Generator,
    robot: Robot,
    effect: str,
    size: float | None = None,
    component: str | None = None,
    form: str | None = None,
) -> Truth:
    """Return an effect drawn at random: its component, form and parameters.

    Parameters
    ----------
    rng : Generator
    robot : Robot
        As the model has it.
    effect : str
    size : float or None
        From 0, hardly to be seen, to 1, the largest realistic one; drawn evenly by default.
    component, form : str or None
        Given instead of drawn.

    Raises
    ------
    BeamstiffError
        When the effect is unknown, or cannot sit on this robot or at this component.
    """
    known = _known(effect)
    possible = list(known.places(robot))
    if not possible or (component is not None and component not in possible):
        where = f"at {component!r}" if component else "anywhere"
        raise BeamstiffError(f"robot {robot.name!r} cannot have the effect {effect!r} {where}")
    place = possible[int(rng.integers(len(possible)))] if component is None else component
    kind = known.draw_form(rng) if form is None else form
    if kind not in known.forms:
        raise BeamstiffError(f"effect {effect!r}: found the form {kind!r}, expected one of {known.forms}")
    measure = float(rng.uniform()) if size is None else size
    return Truth(effect, place, kind, known.draw(Asked(rng, robot, place, kind, measure)))


def resized(truth: Truth, robot: Robot, size: float, seed: int) -> Truth:
    """Return an effect of another size at the same component and of the same form.

    What else it has is drawn anew from the seed: with the same seed only the size differs.
    """
    asked = Asked(np.random.default_rng(seed), robot, truth.component, truth.form, size)
    return replace(truth, parameters=_known(truth.effect).draw(asked))


def hand_of(truth: Truth) -> int:
    """Return who wrote the form of an effect: 1 for who writes the diagnosis; 2 and 3 have not read it."""
    for hand, effects in enumerate(_OUTSIDE, start=1):
        if any(effect.name == truth.effect for effect in effects):
            return hand
    return _known(truth.effect).hand_of(truth.form)


def imposed(truth: Truth, reality: Reality) -> Reality:
    """Return a reality with one more effect."""
    return _known(truth.effect).impose(truth, reality)


def _known(effect: str) -> Effect:
    if effect not in EFFECTS:
        raise BeamstiffError(f"unknown effect {effect!r}{suggest(effect, EFFECTS)}")
    return EFFECTS[effect]
