"""What `beamstiff identify` is told on the command line: ties, bounds, priors, errors of the inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from beamstiff.cli.options import parse_quantities, parse_quantity
from beamstiff.errors import BeamstiffError, suggest
from beamstiff.units import number

if TYPE_CHECKING:
    from beamstiff.identification.input_errors import InputErrors
    from beamstiff.robot.description import Robot

Pair = TypeVar("Pair")

KINDS = {"N/m": "translational stiffness", "N*m/rad": "rotational stiffness", "Pa": "modulus"}
ERRORS = {
    "load": "force",
    "force": "force",
    "moment": "moment",
    "angle": "angle",
    "length": "length",
    "hold_angle": "angle",
    "hold_length": "length",
}


def parse_ties(texts: Sequence[str] | None) -> list[list[str]]:
    """Return groups of parameters from texts such as ``"J1.radial,J2.radial"``."""
    groups = [[name.strip() for name in text.split(",")] for text in texts or ()]
    for text, group in zip(texts or (), groups, strict=True):
        if len(group) < 2 or not all(group):
            raise BeamstiffError(f"--tie: found {text!r}, expected two or more names, J1.radial,J2.radial")
    return groups


def parse_bounds(robot: Robot, texts: Sequence[str] | None) -> dict[str, tuple[float | None, float | None]]:
    """Return bounds, SI, from texts such as ``"J1.torsional=1e5:2e9 N*mm/rad"``; an end may be empty."""

    def pair(name: str, low: str, high: str) -> tuple[float | None, float | None]:
        if not (low or high):
            raise BeamstiffError(f"--bound: {name}: found no end, expected LOW:HIGH, one of them at least")
        return _stiffness(robot, "--bound", name, low), _stiffness(robot, "--bound", name, high)

    return _pairs(robot, "--bound", texts, "LOW:HIGH", pair)


def parse_priors(robot: Robot, texts: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """Return value and factor, SI, of what is known beforehand, such as ``"J1.torsional=2e6:1.5"``."""

    def pair(name: str, value: str, factor: str) -> tuple[float, float]:
        known = _stiffness(robot, "--prior", name, value)
        try:
            times = number(factor)
        except BeamstiffError as error:
            raise BeamstiffError(f"--prior: {name}: factor: {error}") from None
        if known is None:
            raise BeamstiffError(f"--prior: {name}: found no value, expected VALUE:FACTOR")
        return known, times

    return _pairs(robot, "--prior", texts, "VALUE:FACTOR", pair)


def parse_errors(texts: Sequence[str] | None) -> InputErrors | None:
    """Return errors of loads and joint values from texts such as ``"load=1N,angle=0.01deg"``."""
    from beamstiff.identification.input_errors import InputErrors

    if not texts:
        return None
    expected = f"{', '.join(ERRORS)} with a value, such as angle=0.01deg"
    return InputErrors(**parse_quantities("--input-error", texts, ERRORS, expected))


def _pairs(
    robot: Robot,
    option: str,
    texts: Sequence[str] | None,
    expected: str,
    pair: Callable[[str, str, str], Pair],
) -> dict[str, Pair]:
    result: dict[str, Pair] = {}
    known = _units(robot)
    for text in texts or ():
        name, sign, values = (word.strip() for word in text.partition("="))
        first, colon, second = (word.strip() for word in values.partition(":"))
        if not (sign and colon):
            raise BeamstiffError(f"{option}: found {text!r}, expected NAME={expected}")
        if name not in known:
            raise BeamstiffError(
                f"{option}: robot {robot.name!r} has no stiffness parameter {name!r}{suggest(name, known)}"
            )
        if name in result:
            raise BeamstiffError(f"{option}: {name} is given twice")
        result[name] = pair(name, first, second)
    return result


def _stiffness(robot: Robot, option: str, name: str, text: str) -> float | None:
    if not text:
        return None
    value = parse_quantity(f"{option}: {name}", text, KINDS[_units(robot)[name]])
    if value <= 0:
        raise BeamstiffError(f"{option}: {name}: found {text!r}, expected a positive stiffness")
    return value


def _units(robot: Robot) -> Mapping[str, str]:
    from beamstiff.robot.stiffness import parameter_unit, stiffness_parameters

    return {name: parameter_unit(robot, name) for name in stiffness_parameters(robot)}
