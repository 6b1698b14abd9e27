"""Forms of a second author, who has not read the diagnosis; who writes the diagnosis must not read these."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author2 import drives, geometry, levers, measurement, outside, structure, tool

EFFECTS: tuple[Effect, ...] = tuple(
    effect for module in (drives, geometry, levers, measurement, structure, tool) for effect in module.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
