"""Joint variables on the command line: read from `--q`, shown in degrees and millimetres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees

from beamstiff.cli.output import say
from beamstiff.errors import BeamstiffError
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import actuated_values
from beamstiff.units import quantity


def parse_variables(robot: Robot, texts: Sequence[str]) -> dict[str, float]:
    """Return values of joint variables, SI, from texts such as ``"q1=10deg,q2=0.3"``.

    Raises
    ------
    BeamstiffError
        When a part is not ``name=value``, a name is unknown, passive or given twice, or a unit is wrong.
    """
    kinds = variable_kinds(robot)
    values: dict[str, float] = {}
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, value = (word.strip() for word in part.partition("="))
        if not (name and equals and value):
            raise BeamstiffError(
                f"--q: found {part!r}, expected name=value such as q1=10deg, parts separated by commas"
            )
        if name in values:
            raise BeamstiffError(f"--q: {name} is given twice")
        try:
            actuated_values(robot, {name: 0.0})
        except BeamstiffError as error:
            raise BeamstiffError(f"--q: {error}") from None
        try:
            values[name] = quantity(value, kinds[name])
        except BeamstiffError as error:
            raise BeamstiffError(f"--q: {name}: {error}") from None
    return values


def note_limits(robot: Robot, values: Mapping[str, float], quiet: bool) -> None:
    """Say on stderr which variables lie outside their limits; the numbers hold there all the same."""
    for variable in robot.variables:
        value, limits = values[variable.name], variable.limits
        if limits is not None and not limits[0] <= value <= limits[1]:
            low, high, found = (shown_value(robot, variable.name, item) for item in (*limits, value))
            say(f"note: {variable.name} = {found} is outside its limits {low} to {high}", quiet)


def shown_value(robot: Robot, name: str, value: float) -> str:
    """Return the value of a variable as people read it: in degrees or millimetres."""
    return f"{degrees(value):.6g} deg" if variable_kinds(robot)[name] == "angle" else f"{1e3 * value:.6g} mm"
