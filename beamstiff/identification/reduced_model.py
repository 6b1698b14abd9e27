"""The reduced model: springs identifiable only in combination become one, the others rigid or free."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.degeneracy import Degeneracy
from beamstiff.identification.series_parallel import Joined, Spring
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID


@dataclass(frozen=True)
class Lumped:
    """A group that became one spring."""

    kept: str  # the parameter that carries all, as stiff as the whole group
    value: float
    # the others: infinite where they are rigid now (in series), 0 where they are free (in parallel)
    gone: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: what is kept, its value, and which of the others are rigid or free."""
        rigid, free = ([name for name, became in self.gone.items() if became == end] for end in (RIGID, FREE))
        return {"kept": self.kept, "value": self.value, "rigid": rigid, "free": free}


@dataclass(frozen=True)
class Reduced:
    """A robot without what its measurements cannot determine."""

    robot: Robot  # lists under `identify` what is left to identify
    lumped: tuple[Lumped, ...]
    # parameters that stay at their value, since they are never loaded or others make up for them
    held: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {"lumped": [one.to_dict() for one in self.lumped], "held": list(self.held)}


def reduce_model(
    robot: Robot, degeneracy: Degeneracy, values: Mapping[str, float], parameters: Sequence[str] | None = None
) -> Reduced:
    """Return the robot with every group as one spring: on the rows at hand it does the same as before.

    `degeneracy`: from `find_degeneracy`. `values`, SI: stiffness at hand, such as the identified one, of
    every parameter; becomes the robot's, but for what is never loaded. `parameters`: all that were to be
    identified; default ``robot.identify``.

    In series the most compliant spring is kept, in parallel the stiffest: it is the most like the whole.
    Under other loads than those of the rows the reduced robot may differ.
    """
    names = list(robot.identify if parameters is None else parameters)
    lumped = tuple(_lump(group, values) for group in degeneracy.joined)
    gone = {name: value for one in lumped for name, value in one.gone.items()}
    silent = [item.name for item in degeneracy.silent]
    held = silent + [name for group in degeneracy.mixed for name in group.held]
    beams = {f"{beam.name}.E" for beam in robot.beams}
    if stiff := [name for name in gone if name in beams]:
        raise BeamstiffError(
            f"{stiff[0]}: only acts together with others, and a beam is never rigid or free: replace it by a "
            "rigid, or leave it out of what is identified"
        )
    known = {name: value for name, value in values.items() if name not in silent}
    changed = robot.with_parameters({**known, **gone, **{one.kept: one.value for one in lumped}})
    left = tuple(name for name in names if name not in gone and name not in held)
    return Reduced(changed.model_copy(update={"identify": left}), lumped, tuple(held))


def _lump(group: Joined, values: Mapping[str, float]) -> Lumped:
    """Return a group as one of its springs."""
    kept, gone = _leader(group, values)
    factor = _factor(group, kept)
    whole = group.stiffness(values)
    return Lumped(kept, whole * factor, gone)


def _leader(group: Joined, values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Return the spring that is most like the whole, and what becomes of the others."""
    inside = np.array(
        [
            ratio * part.stiffness(values) ** (1 if group.kind == "parallel" else -1)
            for part, ratio in zip(group.parts, group.ratios, strict=True)
        ]
    )
    most = int(np.argmax(inside))
    gone: dict[str, float] = {}
    for at, part in enumerate(group.parts):
        if at != most:
            gone |= _become(part, RIGID if group.kind == "series" else FREE)
    chosen = group.parts[most]
    if isinstance(chosen, Spring):
        return chosen.name, gone
    name, more = _leader(chosen, values)
    return name, gone | more


def _become(part: Spring | Joined, value: float) -> dict[str, float]:
    """Return the members of a part that is rigid or free as a whole, and nothing between hangs loose."""
    if isinstance(part, Spring):
        return {part.name: value}
    first, *others = part.parts
    alike = (part.kind == "series") == (value == RIGID)
    rest = value if alike else FREE if value == RIGID else RIGID
    result = _become(first, value)
    for other in others:
        result |= _become(other, rest)
    return result


def _factor(group: Joined, kept: str) -> float:
    """Return the stiffness of a member over that of the whole when it carries all: from the ratios."""
    at = next(at for at, part in enumerate(group.parts) if kept in part.members)
    part, ratio = group.parts[at], group.ratios[at]
    own = ratio if group.kind == "series" else 1.0 / ratio
    return own if isinstance(part, Spring) else own * _factor(part, kept)
