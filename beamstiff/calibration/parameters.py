"""What a geometric calibration may seek: names, kinds, realistic sizes, and in which order they are kept.

A parameter is a deviation from the robot as it is described:

======================  =======================================================================
``f3.d``                a frame's Khalil-Kleinfinger parameter (or Hayati's ``f3.beta``)
``q2``                  the zero of an encoder: added to the variable wherever it stands
``n7.x``                the place of a measured point, in its frame
``base.x``, ``base.rx`` where the robot's base stands in the measuring frame; ``base2.x`` in that of
                        the second table, where each has its own
``target.rx``           how the measured target is turned against the frame of the TCP
``S1.x``                the place of a socket, and what else is sought of instruments without a tracker
``J2.torsional``        a compliance, 1 / stiffness, sought together with the geometry
======================  =======================================================================

A constant that stands beside a variable (``theta: q2 - 90 deg``) goes by the variable's name.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.robot.coupling import frame_expressions, variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.robot.stiffness_parameters import stiffness_parameters

Group = Literal["base", "target", "instrument", "offset", "frame", "compliance"]
AXES = ("x", "y", "z")
TURNS = ("rx", "ry", "rz")
LENGTH, ANGLE = 1e-3, 1e-3  # m, rad: realistic deviations of parts that were machined
PLACED = 0.1  # m, rad: of what was set up for the measurement
USUAL = ("alpha", "d", "r")  # with the variable they place any axis that is not parallel to the one before
# ranks: of what cannot be distinguished the lowest is kept. Compliances come behind geometry:
# one that cannot be negative does not make up for an error of geometry that it looks like
SETUP, OFFSET, NEEDED, SPARE, COMPLIANCE, LAST = range(6)
GEOMETRY: tuple[Group, ...] = ("offset", "frame")  # of which the robot file says something
STANDS: tuple[Group, ...] = ("base", "target", "instrument")  # of what was set up
SOFTER = 10.0  # times the compliance that moves a point by 1 mm where it moves it most, as drives may well be
GROUPS = ("base", "target", "offsets", "frames")


@dataclass(frozen=True)
class Parameter:
    """A parameter of the geometry, or a compliance sought along with it."""

    name: str
    group: Group  # ``"base"``, ``"target"``, ``"instrument"``, ``"offset"``, ``"frame"`` or ``"compliance"``
    unit: str  # ``"m"``, ``"rad"``, or of a compliance ``"m/N"`` or ``"rad/(N*m)"``
    size: float  # a realistic deviation, by which columns of different units compare
    rank: int  # from `SETUP` to `LAST`


def known_parameters(
    robot: Robot, points: Sequence[str], turned: bool, stations: int = 1
) -> tuple[Parameter, ...]:
    """Return all parameters of a robot's geometry that measurements could show.

    `points`: nodes that are measured. `turned`: whether orientations are measured. `stations`: places that
    the robot, or the tracker, stood in.
    """
    units = {"length": "m", "angle": "rad"}
    found: list[Parameter] = []
    for base in base_names(stations):
        found += [Parameter(f"{base}.{axis}", "base", "m", PLACED, SETUP) for axis in AXES]
        found += [Parameter(f"{base}.{axis}", "base", "rad", PLACED, SETUP) for axis in TURNS]
    ends = {name for loop in robot.loops for name in (loop.a, loop.b)}
    for point in points:
        if point not in ends and point not in (
            "target",
            *base_names(stations),
        ):  # a loop's end is moved through its frame
            found += [Parameter(f"{point}.{axis}", "target", "m", PLACED, SETUP) for axis in AXES]
    if turned:
        found += [Parameter(f"target.{axis}", "target", "rad", PLACED, SETUP) for axis in TURNS]
    kinds = variable_kinds(robot)
    for variable in robot.actuated:
        length = kinds[variable.name] == "length"
        unit, size = ("m", LENGTH) if length else ("rad", ANGLE)
        found.append(Parameter(variable.name, "offset", unit, size, OFFSET))
    for frame, expressions in frame_expressions(robot).items():
        for name, kind in FRAME_PARAMETERS.items():
            if not expressions[name].coefficients:
                size = LENGTH if kind == "length" else ANGLE
                rank = NEEDED if name in USUAL else SPARE
                found.append(Parameter(f"{frame}.{name}", "frame", units[kind], size, rank))
    return tuple(found)


def base_names(stations: int) -> list[str]:
    """Return what the places are called that the robot's base has in the measuring frame.

    >>> base_names(1), base_names(2)
    (['base'], ['base1', 'base2'])
    """
    return ["base"] if stations == 1 else [f"base{number + 1}" for number in range(stations)]


def choose_parameters(
    robot: Robot,
    known: Sequence[Parameter],
    names: Sequence[str] | None,
    fixed: Sequence[str] = (),
    last: Sequence[str] = (),
) -> tuple[Parameter, ...]:
    """Return the parameters to seek.

    `names`: parameters, groups (base, target, offsets, frames), frames or reflectors (all of one); default
    all. `fixed`: likewise: what stays as it is. `last`: likewise: what is left out first where it cannot be
    told from others.
    """
    wanted = known if names is None else [item for item in known if item.name in _named(robot, known, names)]
    out = _named(robot, known, fixed)
    left = [item for item in wanted if item.name not in out]
    if not left:
        raise BeamstiffError("nothing is left to calibrate: all parameters are fixed")
    late = _named(robot, known, last)
    return tuple(replace(item, rank=LAST) if item.name in late else item for item in left)


def _named(robot: Robot, known: Sequence[Parameter], names: Sequence[str]) -> set[str]:
    every = {item.name for item in known}
    owners = {frame.name for frame in robot.frames} | {item.name.rpartition(".")[0] for item in known} - {""}
    found: set[str] = set()
    for name in names:
        if name in every:
            found.add(name)
        elif name in GROUPS:
            found |= {item.name for item in known if item.group == name.removesuffix("s")}
        elif name in owners:
            found |= {item.name for item in known if item.name.startswith(f"{name}.")}
        else:
            raise _unknown(robot, name, every | owners)
    return found


def _unknown(robot: Robot, name: str, every: Collection[str]) -> BeamstiffError:
    frame, _, parameter = name.rpartition(".")
    owner = next((item for item in robot.frames if item.name == frame), None)
    if owner is not None and parameter in FRAME_PARAMETERS:
        expression = frame_expressions(robot)[frame][parameter]
        variables = [variable for variable in expression.coefficients if variable in every]
        why = "loop closure makes up for any change"
        if variables:
            why = f"its zero goes by the name {variables[0]!r}"
        return BeamstiffError(f"{name!r} follows {getattr(owner, parameter)!r}: {why}")
    if name in stiffness_parameters(robot):
        return BeamstiffError(f"{name!r} is a stiffness: seek it as a compliance (--compliances {name})")
    groups = ", ".join(GROUPS)
    return BeamstiffError(
        f"robot {robot.name!r} has no geometric parameter {name!r}"
        f"{suggest(name, [*sorted(every), *GROUPS])}; expected a frame's (f3.d), an encoder's zero (q2), "
        f"a measured point's (n7.x), or {groups}"
    )
