"""Values of what is typed: names, quantities, postures, wrenches, frames, and what goes by NAME=VALUE."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from math import inf, pi
from pathlib import Path
from typing import TYPE_CHECKING

from beamstiff.cli.output import note
from beamstiff.errors import BeamstiffError, suggest
from beamstiff.units import number, quantity

if TYPE_CHECKING:
    from beamstiff.identification.input_errors import InputErrors
    from beamstiff.robot.description import Robot
    from beamstiff.se3 import Array

MOST = 4 * pi  # rad, two turns: without limits and a unit, what is more was meant in degrees
MOST_VALUES = 10_000_000  # on one axis of a map
KINDS = {"N/m": "translational stiffness", "N*m/rad": "rotational stiffness", "Pa": "modulus"}
QUATERNION = ("qw", "qx", "qy", "qz")
FRAME = dict.fromkeys("xyz", "length") | dict.fromkeys("abc", "angle") | dict.fromkeys(QUATERNION, "number")
ERRORS = {  # of inputs
    **{"load": "force", "force": "force", "moment": "moment", "angle": "angle", "length": "length"},
    **{"hold_angle": "angle", "hold_length": "length"},
}


def robot_file(robot: str) -> Path:
    """Return the file behind the argument ROBOT, which may be the name of a bundled robot."""
    from beamstiff.robot.library import robot_names, robot_path

    path = Path(robot)
    return robot_path(robot) if not path.exists() and robot in robot_names() else path


def file_names(data: Sequence[str]) -> str:
    """Return the names of files in one line: a comment that they stand in must not end early."""
    return str(BeamstiffError(", ".join(Path(path).name for path in data)))


def parse_names(
    texts: Sequence[str] | None, option: str = "--parameters", example: str = "J12.torsional,J18.torsional"
) -> list[str] | None:
    """Return the names in texts such as ``"J12.torsional,J18.torsional"``, or None where none were given."""
    if not texts:
        return None
    names = [name.strip() for text in texts for name in text.split(",")]
    if not all(names):
        raise BeamstiffError(f"{option}: found {','.join(texts)!r}, expected names such as {example}")
    return names


def without_repaired(robot: Robot, texts: Sequence[str] | None) -> Robot:
    """Return the robot without the effects that are named as repaired."""
    labels = parse_names(texts, "--repaired", "base-compliance,backlash:q2")
    return robot.without_effects(*labels) if labels else robot


def named(
    option: str,
    texts: Iterable[str] | None,
    expected: str,
    known: Container[str] | None = None,
    commas: bool = False,
    once: bool = True,
) -> Iterator[tuple[str, str]]:
    """Yield name and value of texts such as ``"q1=10deg"``.

    `expected`: such as ``"NAME=VALUE"``. `known`: names that there are, typed in any case. `commas`: between
    several in a text. `once`: no name comes twice.
    """
    seen = set[str]()
    for part in (part.strip() for text in texts or () for part in (text.split(",") if commas else [text])):
        name, _, value = (word.strip() for word in part.partition("="))
        name = name if known is None else name.lower()
        if not (name and value) or (known is not None and name not in known):
            raise BeamstiffError(f"{option}: found {part!r}, expected {expected}")
        if once and name in seen:
            raise BeamstiffError(f"{option}: {name} is given twice")
        seen.add(name)
        yield name, value


def parse_quantity(where: str, text: str, kind: str, positive: str = "") -> float:
    """Return a quantity in SI; `where` says what it is of, should it be none, `positive` what it must be."""
    try:
        value = quantity(text, kind)
    except BeamstiffError as error:
        raise BeamstiffError(f"{where}: {error}") from None
    if positive and not value > 0:
        raise BeamstiffError(f"{where}: found {text!r}, expected {positive}")
    return value


def parse_quantities(
    option: str, texts: Iterable[str], kinds: Mapping[str, str], expected: str, positive: str = ""
) -> dict[str, float]:
    """Return quantities, SI, by name, from texts such as ``"x=1.2m,a=90deg"``."""
    return {
        name: parse_quantity(f"{option}: {name}", value, kinds[name], positive)
        for name, value in named(option, texts, expected, kinds, commas=True)
    }


def parse_length(option: str, text: str | None) -> float | None:
    """Return a length above 0, m."""
    return None if text is None else parse_quantity(option, text, "length", "a length above 0")


def side_of(text: str | None) -> float | None:
    """Return the side of a cube, m, of a text with its unit."""
    if text is not None and text.replace(".", "", 1).strip().isdigit():
        raise BeamstiffError(f"--cube: found {text!r}, expected a length with its unit, such as 300mm")
    return parse_length("--cube", text)


def parse_region(text: str | None) -> tuple[tuple[float, float], ...] | None:
    """Return least and largest x, y, z, m, from a text such as ``"x=0.5m:2m,z=300mm:1.8m"``."""
    if text is None:
        return None
    ends, wanted = dict.fromkeys("xyz", (-inf, inf)), "an axis x, y or z with two ends such as z=300mm:1.8m"
    for axis, interval in named("--region", [text], wanted, ends, commas=True):
        low, _, high = (word.strip() for word in interval.partition(":"))
        if not (low and high):
            raise BeamstiffError(f"--region: found '{axis}={interval}', expected {wanted}")
        ends[axis] = (parse_quantity("--region", low, "length"), parse_quantity("--region", high, "length"))
        if ends[axis][0] >= ends[axis][1]:
            raise BeamstiffError(f"--region: found '{axis}={interval}', expected the lower end first")
    return tuple(ends.values())


def parse_variables(robot: Robot, texts: Sequence[str] | None) -> dict[str, float]:
    """Return values of joint variables, SI, from texts such as ``"q1=10deg,q2=0.3"``."""
    from beamstiff.robot.coupling import variable_kinds
    from beamstiff.robot.kinematics import actuated_values

    kinds = variable_kinds(robot)
    values: dict[str, float] = {}
    for name, value in named("--q", texts, _such_as("q1=10deg"), commas=True):
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


def _such_as(example: str) -> str:
    return f"name=value such as {example}, parts separated by commas"


def note_limits(robot: Robot, values: Mapping[str, float]) -> None:
    """Say on stderr which variables lie outside their limits; the numbers hold there all the same."""
    from beamstiff.functions.checks import shown_value
    from beamstiff.robot.coupling import variable_kinds

    for variable in robot.variables:
        value, limits = values[variable.name], variable.limits
        if limits is not None and not limits[0] <= value <= limits[1]:
            low, high, found = (shown_value(robot, variable.name, item) for item in (*limits, value))
            turns = variable_kinds(robot)[variable.name] == "angle" and abs(value) > 2 * pi
            hint = "; a number without a unit is rad" if turns else ""
            note(f"{variable.name} = {found} is outside its limits {low} to {high}{hint}")


def parse_wrench(texts: Sequence[str] | None, option: str = "--wrench") -> list[float] | None:
    """Return a wrench ``[f, m]``, SI, from texts such as ``"fz=-900N,mx=20"``; what is not named is 0."""
    from beamstiff.measure.table import WRENCH

    wrench = dict.fromkeys(WRENCH, 0.0)
    for name, value in named(option, texts, _such_as("fz=-900N"), commas=True):
        if name not in wrench:
            raise BeamstiffError(f"{option}: unknown component {name!r}, expected {', '.join(WRENCH)}")
        wrench[name] = parse_quantity(f"{option}: {name}", value, "force" if name[0] == "f" else "moment")
    return list(wrench.values()) if texts else None


def parse_frame(option: str, text: str | None) -> Array | None:
    """Return a transform (4, 4) from x, y, z and a, b, c (intrinsic Z-Y-X, KUKA's) or a quaternion qw to qz.

    >>> parse_frame("--base", "x=1.2,a=90deg").round(9)[:, [0, 3]].tolist()
    [[0.0, 1.2], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    """
    import numpy as np

    from beamstiff.measure.orientation import KUKA, Quaternion
    from beamstiff.se3 import transform

    if text is None:
        return None
    expected = "parts such as x=1200mm, a=90deg (x, y, z, a, b, c or qw to qz)"
    values = parse_quantities(option, [text], FRAME, expected)
    position, angles, quaternion = (
        np.array([values.get(name, 0.0) for name in names]) for names in ("xyz", "abc", QUATERNION)
    )
    if not values.keys() & set(QUATERNION):
        return transform(KUKA.rotations(angles[None])[0], position)
    if values.keys() & set("abc"):
        raise BeamstiffError(f"{option}: found angles and a quaternion, expected one of the two")
    try:
        return transform(Quaternion().rotations(quaternion[None])[0], position)
    except BeamstiffError as error:
        raise BeamstiffError(f"{option}: {error}") from None


def parse_points(option: str, texts: Sequence[str] | None) -> list[list[float]] | None:
    """Return points x, y, z, m, each of a text such as ``"x=300mm,y=0"``; what is not named is 0."""
    expected = "coordinates such as x=300mm (x, y, z)"
    points = [
        parse_quantities(option, [text], dict.fromkeys("xyz", "length"), expected) for text in texts or ()
    ]
    return [[point.get(axis, 0.0) for axis in "xyz"] for point in points] or None


def parse_grid(robot: Robot, texts: Sequence[str]) -> dict[str, Array]:
    """Return the values on each axis, SI, from texts such as ``"q2=-60deg:60deg:25,q3=..."``."""
    import numpy as np

    from beamstiff.robot.coupling import variable_kinds

    kinds = {**dict.fromkeys("xyz", "length"), **variable_kinds(robot)}
    axes: dict[str, Array] = {}
    wanted = "an axis such as q2=-60deg:60deg:25 or x=800mm:1.6m:17"
    for name, interval in named("--grid", texts, wanted, commas=True):
        words = [word.strip() for word in interval.split(":")]
        if len(words) != 3 or not all(words):
            raise BeamstiffError(f"--grid: found '{name}={interval}', expected {wanted}")
        kind = kinds.get(name, "angle")
        low, high = (parse_quantity(f"--grid: {name}", word, kind) for word in words[:2])
        if not words[2].isascii() or not words[2].isdigit() or int(words[2]) < 2:
            raise BeamstiffError(f"--grid: {name}: found {words[2]!r} values, expected a number of 2 or more")
        if int(words[2]) > MOST_VALUES:
            raise BeamstiffError(f"--grid: {name}: found {words[2]} values, expected at most {MOST_VALUES}")
        if not low < high:
            raise BeamstiffError(f"--grid: found '{name}={interval}', expected the lower end first")
        axes[name] = np.linspace(low, high, int(words[2]))
    return axes


def parse_expected(texts: Sequence[str] | None) -> dict[str, float]:
    """Return expected numbers of causes by name, from texts such as ``"backlash:q2=0.5"``."""
    result, wanted = dict[str, float](), "NAME=NUMBER such as backlash:q2=0.5"
    for name, value in named("--prior", texts, wanted, once=False):
        try:
            result[name] = float(value)
        except ValueError:
            raise BeamstiffError(f"--prior: found '{name}={value}', expected {wanted}") from None
    return result


def parse_deviations(texts: Sequence[str] | None) -> dict[str, list[str]]:
    """Return standard deviations by name, from texts such as ``"f3.d=0.2mm"``; a name may have several."""
    result: dict[str, list[str]] = {}
    for name, value in named("--prior", texts, "NAME=STD such as f3.d=0.2mm", once=False):
        result.setdefault(name, []).append(value)
    return result


def parse_ties(texts: Sequence[str] | None) -> list[list[str]]:
    """Return groups of parameters from texts such as ``"J1.radial,J2.radial"``."""
    groups = [[name.strip() for name in text.split(",")] for text in texts or ()]
    for text, group in zip(texts or (), groups, strict=True):
        if len(group) < 2 or not all(group):
            raise BeamstiffError(f"--tie: found {text!r}, expected two or more names, J1.radial,J2.radial")
    return groups


def parse_bounds(robot: Robot, texts: Sequence[str] | None) -> dict[str, tuple[float | None, float | None]]:
    """Return bounds, SI, from texts such as ``"J1.torsional=1e5:2e9 N*mm/rad"``; an end may be empty."""
    result: dict[str, tuple[float | None, float | None]] = {}
    for name, low, high in _stiffness_pairs(robot, "--bound", texts, "LOW:HIGH"):
        if not (low or high):
            raise BeamstiffError(f"--bound: {name}: found no end, expected LOW:HIGH, one of them at least")
        result[name] = _stiffness(robot, "--bound", name, low), _stiffness(robot, "--bound", name, high)
    return result


def parse_known(robot: Robot, texts: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """Return value and factor, SI, of what is known beforehand, such as ``"J1.torsional=2e6:1.5"``."""
    result: dict[str, tuple[float, float]] = {}
    for name, value, factor in _stiffness_pairs(robot, "--prior", texts, "VALUE:FACTOR"):
        known = _stiffness(robot, "--prior", name, value)
        try:
            times = number(factor)
        except BeamstiffError as error:
            raise BeamstiffError(f"--prior: {name}: factor: {error}") from None
        if known is None:
            raise BeamstiffError(f"--prior: {name}: found no value, expected VALUE:FACTOR")
        result[name] = known, times
    return result


def _stiffness_pairs(
    robot: Robot, option: str, texts: Sequence[str] | None, expected: str
) -> Iterator[tuple[str, str, str]]:
    """Yield name and both ends of texts such as ``"J1.torsional=1e5:2e6"``, an end possibly empty."""
    known = _units(robot) if texts else {}
    for name, values in named(option, texts, f"NAME={expected}"):
        first, colon, second = (word.strip() for word in values.partition(":"))
        if not colon:
            raise BeamstiffError(f"{option}: found '{name}={values}', expected NAME={expected}")
        if name not in known:
            raise BeamstiffError(
                f"{option}: robot {robot.name!r} has no stiffness parameter {name!r}{suggest(name, known)}"
            )
        yield name, first, second


def _stiffness(robot: Robot, option: str, name: str, text: str) -> float | None:
    kind = KINDS[_units(robot)[name]]
    return parse_quantity(f"{option}: {name}", text, kind, "a positive stiffness") if text else None


def _units(robot: Robot) -> Mapping[str, str]:
    from beamstiff.robot.stiffness_parameters import parameter_unit, stiffness_parameters

    return {name: parameter_unit(robot, name) for name in stiffness_parameters(robot)}


def parse_errors(texts: Sequence[str] | None) -> InputErrors | None:
    """Return errors of loads and joint values from texts such as ``"load=1N,angle=0.01deg"``."""
    from beamstiff.identification.input_errors import InputErrors

    expected = f"{', '.join(ERRORS)} with a value, such as angle=0.01deg"
    return InputErrors(**parse_quantities("--input-error", texts, ERRORS, expected)) if texts else None
