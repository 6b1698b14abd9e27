"""Forms of a fourth author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author4 import (
    coupling,
    ends,
    friction,
    geometry,
    joint_errors,
    levers,
    measurement,
    outside,
    springs,
    structure,
)

EFFECTS: tuple[Effect, ...] = tuple(
    effect
    for module in (coupling, ends, friction, geometry, levers, measurement, springs, structure)
    for effect in module.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
# in the table since the exam of crowded machines, which alone draws them
LATER: tuple[Effect, ...] = joint_errors.EFFECTS
