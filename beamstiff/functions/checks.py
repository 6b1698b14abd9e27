"""Options that several functions check alike."""

from collections.abc import Iterable, Sequence
from math import degrees

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError, OptionError, listed, shown, suggest
from beamstiff.planning.candidates import force_loads
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.stiffness_parameters import missing_stiffness
from beamstiff.se3 import Array


def one_of(name: str, value: object, known: Sequence[str]) -> None:
    """Refuse a word that is not among those known."""
    if value not in known:
        raise OptionError(name, f"found {shown(value)}{suggest(value, known)}, expected {', '.join(known)}")


def whole(name: str, value: object, least: int, most: int | None = None) -> None:
    """Refuse what is no whole number between two ends."""
    largest = float("inf") if most is None else most
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= largest:
        span = f"{least} or more" if most is None else f"{least} to {most}"
        raise OptionError(name, f"found {shown(value)}, expected {span}")


def effects_text(effects: Iterable[AddedEffect]) -> str:
    """Return a robot's effects as people read and type them: ``backlash:q2``, ``base-compliance``."""
    return ", ".join(dict.fromkeys(one.label for one in effects))


def names_of(name: str, value: Sequence[str] | None) -> list[str] | None:
    """Return names as a list; a single text is refused, whose letters would count as names.

    Examples
    --------
    >>> names_of("parameters", "J1.torsional")
    Traceback (most recent call last):
    ...
    beamstiff.errors.OptionError: parameters: found 'J1.torsional', expected a list of names
    """
    if value is None:
        return None
    if isinstance(value, str) or not all(value):
        raise OptionError(name, f"found {shown(value)}, expected a list of names")
    return list(value)


def axes_of(name: str, value: Sequence[str]) -> tuple[str, ...]:
    """Return axes of the base, each with a sign or not, such as ``("x", "-z")``."""
    axes = tuple(names_of(name, value) or ())
    try:
        force_loads(1.0, axes)
    except BeamstiffError:
        found = shown(list(axes))
        raise OptionError(name, f"found {found}, expected x, y or z, with a sign or not") from None
    return axes


def left_out(effects: Iterable[AddedEffect], what: str) -> tuple[str, ...]:
    """Return the note that a robot's effects are no part of something; none where it has none."""
    told = effects_text(effects)
    return (f"the robot's effects ({told}) are not part of {what}",) if told else ()


def robot_notes(robot: Robot) -> tuple[str, ...]:
    """Return what to know of a robot that is shown: what is hardly meant, and whether all is rigid."""
    missing = listed(missing_stiffness(robot), 12)
    said = (
        f"no compliance: the joints {missing} are rigid; give them a stiffness (of a URDF: beamstiff convert "
        "IN --joint-stiffness '1e6 N*m/rad' --out OUT)"
    )
    return (*robot_doubts(robot), *([said] if missing else []))


def start_values(robot: Robot) -> tuple[str, ...]:
    """Return the note on stiffness that measurements did not determine; none where they did."""
    names = listed(robot.unmeasured, 6)
    said, them = ("are start values", "them") if len(robot.unmeasured) > 1 else ("is a start value", "it")
    return (f"{names} {said}: no measurement determined {them}",) if names else ()


def model_note(robot: Robot) -> tuple[str, ...]:
    """Return the note of a map that follows a fitted model, and where this was fitted."""
    if robot.model is None:
        return ()
    low, high = (", ".join(f"{value:.3g}" for value in corner) for corner in robot.model.workspace)
    return (
        f"the map follows the robot's model ({robot.model.kind}), fitted with the TCP from {low} to {high}"
        " m; it extrapolates beyond",
    )


def without_model(robot: Robot, what: str) -> tuple[Robot, tuple[str, ...]]:
    """Return a robot without its fitted model, and the note that something does without it."""
    if robot.model is None:
        return robot, ()
    bare = robot.model_copy(update={"model": None})
    return bare, (f"the robot's model ({robot.model.kind}) is not part of {what}: constant springs count",)


def six_numbers(name: str, wrench: ArrayLike) -> Array:
    """Return a wrench ``[f, m]``, (6,)."""
    try:
        load = np.asarray(wrench, dtype=np.float64)
    except (TypeError, ValueError):
        load = np.zeros(0)
    if load.shape != (6,) or not np.isfinite(load).all():
        raise OptionError(name, f"found {str(wrench)[:60]}, expected six numbers fx fy fz mx my mz")
    return load


def shown_value(robot: Robot, name: str, value: float) -> str:
    """Return the value of a variable as people read it: in degrees or millimetres, to a millionth."""
    angle = variable_kinds(robot)[name] == "angle"
    size = round(degrees(value) if angle else 1e3 * value, 6) + 0.0  # closed to rounding; no minus zero
    return f"{size:.6g} {'deg' if angle else 'mm'}"
