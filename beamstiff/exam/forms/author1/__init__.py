"""Forms of the author of the diagnosis."""

from beamstiff.exam.effect import Effect
from beamstiff.exam.forms.author1 import drives, geometry, levers, measurement, outside, structure, tool

EFFECTS: tuple[Effect, ...] = tuple(
    effect for module in (structure, tool, levers, drives, geometry, measurement) for effect in module.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
# in the table since the exam of crowded machines, which alone draws them: others keep their cases
LATER: tuple[Effect, ...] = (*geometry.LATER, *tool.LATER)
