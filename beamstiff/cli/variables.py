"""Joint variables, wrenches and frames on the command line, such as ``x=1200mm,z=0.6,a=90deg``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from math import pi
from typing import TYPE_CHECKING

from beamstiff.cli.options import parse_quantities, parse_quantity
from beamstiff.cli.output import note
from beamstiff.errors import BeamstiffError
from beamstiff.functions.checks import shown_value
from beamstiff.measure.table import WRENCH
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import actuated_values

if TYPE_CHECKING:
    from beamstiff.se3 import Array

MOST = 4 * pi  # rad, two turns: without limits and a unit, what is more was meant in degrees
FRAME = {
    **dict.fromkeys("xyz", "length"),
    **dict.fromkeys("abc", "angle"),
    **dict.fromkeys(("qw", "qx", "qy", "qz"), "number"),
}


def parse_variables(robot: Robot, texts: Sequence[str]) -> dict[str, float]:
    """Return values of joint variables, SI, from texts such as ``"q1=10deg,q2=0.3"``."""
    kinds = variable_kinds(robot)
    values: dict[str, float] = {}
    for name, value in _parts("--q", texts, "q1=10deg"):
        try:
            actuated_values(robot, {name: 0.0})
        except BeamstiffError as error:
            raise BeamstiffError(f"--q: {error}") from None
        values[name] = parse_quantity(f"--q: {name}", value, kinds[name])
        limits = next(one.limits for one in robot.variables if one.name == name)
        low, high = limits or (-MOST, MOST)
        outside = not min(low, -2 * pi) <= values[name] <= max(high, 2 * pi)
        if kinds[name] == "angle" and outside and re.fullmatch(r"[-+.\deE]+", value):
            raise BeamstiffError(
                f"--q: {name}: found {value} rad, beyond {'its limits' if limits else 'two turns'}; "
                f"in degrees write {name}={value}deg"
            )
    return values


def parse_wrench(texts: Sequence[str], option: str = "--wrench") -> list[float]:
    """Return a wrench ``[f, m]``, SI, from texts such as ``"fz=-900N,mx=20"``; what is not named is 0."""
    wrench = dict.fromkeys(WRENCH, 0.0)
    for name, value in _parts(option, texts, "fz=-900N"):
        if name not in wrench:
            raise BeamstiffError(f"{option}: unknown component {name!r}, expected {', '.join(WRENCH)}")
        kind = "force" if name.startswith("f") else "moment"
        wrench[name] = parse_quantity(f"{option}: {name}", value, kind)
    return list(wrench.values())


def _parts(option: str, texts: Sequence[str], example: str) -> Iterator[tuple[str, str]]:
    """Yield name and value of every part of texts such as ``"q1=10deg,q2=0.3"``."""
    seen: set[str] = set()
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, value = (word.strip() for word in part.partition("="))
        if not (name and equals and value):
            raise BeamstiffError(
                f"{option}: found {part!r}, expected name=value such as {example}, parts separated by commas"
            )
        if name in seen:
            raise BeamstiffError(f"{option}: {name} is given twice")
        seen.add(name)
        yield name, value


def note_limits(robot: Robot, values: Mapping[str, float]) -> None:
    """Say on stderr which variables lie outside their limits; the numbers hold there all the same."""
    for variable in robot.variables:
        value, limits = values[variable.name], variable.limits
        if limits is not None and not limits[0] <= value <= limits[1]:
            low, high, found = (shown_value(robot, variable.name, item) for item in (*limits, value))
            hint = ""
            if variable_kinds(robot)[variable.name] == "angle" and abs(value) > 2 * pi:
                hint = "; a number without a unit is rad"
            note(f"{variable.name} = {found} is outside its limits {low} to {high}{hint}")


def parse_frame(option: str, text: str) -> Array:
    """Return a transform (4, 4) from x, y, z and a, b, c (intrinsic Z-Y-X, KUKA's) or a quaternion qw to qz.

    >>> parse_frame("--base", "x=1.2,a=90deg").round(9)[:, [0, 3]].tolist()
    [[0.0, 1.2], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    """
    import numpy as np

    from beamstiff.measure.orientation import KUKA, Quaternion
    from beamstiff.se3 import transform

    expected = "parts such as x=1200mm, a=90deg (x, y, z, a, b, c or qw to qz)"
    values = parse_quantities(option, [text], FRAME, expected, fold=True)
    position = np.array([values.get(axis, 0.0) for axis in "xyz"])
    quaternion = [values.get(name, 0.0) for name in ("qw", "qx", "qy", "qz")]
    if any(name.startswith("q") for name in values):
        if any(name in values for name in "abc"):
            raise BeamstiffError(f"{option}: found angles and a quaternion, expected one of the two")
        try:
            rotation = Quaternion().rotations(np.array([quaternion]))[0]
        except BeamstiffError as error:
            raise BeamstiffError(f"{option}: {error}") from None
    else:
        rotation = KUKA.rotations(np.array([[values.get(axis, 0.0) for axis in "abc"]]))[0]
    return transform(rotation, position)
