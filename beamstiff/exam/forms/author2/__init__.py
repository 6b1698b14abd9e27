"""Forms of a second author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author2 import (
    coupling,
    friction,
    geometry,
    levers,
    measurement,
    outside,
    springs,
    structure,
    tool,
)

EFFECTS: tuple[Effect, ...] = tuple(
    effect
    for module in (coupling, friction, geometry, levers, measurement, springs, structure, tool)
    for effect in module.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
