"""Forms of a fourth author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author4 import (
    drives,
    ends,
    geometry,
    joint_errors,
    levers,
    measurement,
    outside,
    structure,
)

EFFECTS: tuple[Effect, ...] = tuple(
    effect for module in (drives, ends, geometry, levers, measurement, structure) for effect in module.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
# in the table since the exam of crowded machines, which alone draws them
LATER: tuple[Effect, ...] = joint_errors.EFFECTS
