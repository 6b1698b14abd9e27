"""Quantities at the edge: text with a unit becomes a float in SI, everything inside is SI.

Angle is a dimension of its own here, so that ``90 deg`` given for a length, or ``N*m`` given for a
torsional stiffness (N*m/rad), is an error and not a number.
"""

from __future__ import annotations

import functools
import math
import re
from numbers import Real
from typing import TYPE_CHECKING, Any

from beamstiff.errors import BeamstiffError, shown

if TYPE_CHECKING:
    import pint

# SI unit of each kind of quantity that a file may hold; the names are used in error messages
UNITS: dict[str, str] = {
    "length": "m",
    "angle": "rad",
    "force": "N",
    "moment": "N*m",
    "mass": "kg",
    "time": "s",
    "temperature": "degC",
    "speed": "m/s",
    "angular speed": "rad/s",
    "acceleration": "m/s**2",
    "modulus": "Pa",
    "density": "kg/m**3",
    "area": "m**2",
    "second moment of area": "m**4",
    "translational stiffness": "N/m",
    "rotational stiffness": "N*m/rad",
    "number": "",
}

# The units of robots, machines and workshops. Not pint's own list: there radian has no dimension, and h, e, u
# or C are constants and units that nobody means here.
_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s
gram = [mass] = g
kelvin = [temperature] = K
radian = [angle] = rad
count = []
percent = 0.01 * count = pct
degree = 0.017453292519943295 * radian = deg
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
gon = 0.9 * degree = _ = gradian
turn = 360 * degree = rev = revolution
minute = 60 * second = min
hour = 60 * minute = h
degree_Celsius = kelvin; offset: 273.15 = degC = celsius
degree_Fahrenheit = 5 / 9 * kelvin; offset: 233.15 + 200 / 9 = degF = fahrenheit
newton = kilogram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
joule = newton * meter = J
bar = 1e5 * pascal
tonne = 1e3 * kilogram = t
kilogram_force = 9.80665 * newton = kgf = kilopond = kp
standard_gravity = 9.80665 * meter / second ** 2 = g_n
inch = 0.0254 * meter = in
foot = 12 * inch = ft = feet
pound = 0.45359237 * kilogram = lb = lbm
pound_force = 4.4482216152605 * newton = lbf
pound_force_per_square_inch = pound_force / inch ** 2 = psi
kilopound_force_per_square_inch = 1e3 * psi = ksi
"""

# [0-9], not \\d: float() reads the digits of every script, a person checking the file may not
MOST_TURN = 1e6  # rad; beyond, the digits of an angle are lost in its turns
NUMBER = r"[+-]?(?:[0-9]+(?:_[0-9]+)*\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_NUMBER = re.compile(rf"\s*{NUMBER}\s*\Z")
_QUANTITY = re.compile(rf"\s*(?P<number>{NUMBER})\s*(?P<unit>[A-Za-zµμ°%].*?)?\s*\Z")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?[0-9]+,[0-9]")
# letters, operators and one-digit exponents: nothing that a unit parser could evaluate at length
_FACTOR = r"[A-Za-zµμ%][A-Za-zµμ_]*(?:\s*\*\*\s*-?[0-9])?"
_UNIT = re.compile(rf"{_FACTOR}(?:\s*[*/]\s*{_FACTOR})*\Z")
_LONGEST = 200
_SPELLINGS = (
    (r"\^", "**"),
    ("[·⋅]", "*"),
    ("²", "**2"),
    ("³", "**3"),
    ("⁴", "**4"),
    ("°C", "degC"),
    ("°F", "degF"),
    ("°", "deg"),
    (r"\AC\Z", "degC"),
    ("%", "percent"),
    (r"\b([kM]?N)([mc]?m)\b", r"\1*\2"),  # Nm, kNm, Nmm
    (r"\b([µμcm]?m)([234])\b", r"\1**\2"),  # mm2, cm4
    (r"(?<=[\w)])[ \t]+(?=[A-Za-zµμ])", "*"),  # N mm/rad
)


@functools.lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint  # a sixth of a second, and a file in SI does without

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(None, autoconvert_offset_to_baseunit=True)
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry


@functools.lru_cache(maxsize=4096)
def unit_factor(unit: str, kind: str) -> tuple[float, float]:
    """Return (factor, offset) with ``SI value = factor * value + offset`` for a unit of the given kind.

    `unit`: a unit such as ``"mm"``, ``"N*mm/rad"``, ``"deg"``. `kind`: a key of `UNITS`.

    >>> unit_factor("mm", "length")
    (0.001, 0.0)
    """
    target = UNITS[kind]
    expected = f"a unit of {kind} such as {target}" if target else "a plain number without a unit"
    text = _spelled(unit.strip())
    if len(unit) > _LONGEST or not _UNIT.match(text):
        raise BeamstiffError(f"found the unit {shown(unit)}, expected {expected}")
    registry = _registry()
    try:
        source = registry.parse_units(text)
        destination = registry.parse_units(target or "count")
        same = source.dimensionality == destination.dimensionality
        zero, one, many = (
            float(registry.Quantity(value, source).to(destination).magnitude) if same else math.nan
            for value in (0.0, 1.0, 1e9)
        )
    except Exception:  # pint raises its own, tokenizer's and arithmetic errors
        raise BeamstiffError(f"unknown unit {shown(unit)}, expected {expected}") from None
    if not same:
        hint = ""
        moment = registry.parse_units("N*m").dimensionality
        if kind == "rotational stiffness" and source.dimensionality == moment:
            hint = f": a stiffness about an axis is a moment per angle, {shown(unit)[1:-1]}/rad"
        raise BeamstiffError(f"found the unit {shown(unit)}, expected {expected}{hint}")
    if kind == "temperature":  # the only one with offsets; from afar, for pint goes through kelvin and rounds
        factor, offset = _without_rounding((many - zero) / 1e9), zero
    else:
        factor, offset = _without_rounding(one), 0.0
    if not (math.isfinite(factor) and factor > 0.0):
        raise BeamstiffError(f"found the unit {shown(unit)}, expected {expected}")
    return factor, offset


def _spelled(text: str) -> str:
    for pattern, replacement in _SPELLINGS:
        text = re.sub(pattern, replacement, text)
    return text


def _without_rounding(factor: float) -> float:
    """Return the short decimal that a product of powers of ten is meant to be: 1e-12 for mm**4."""
    short = float(f"{factor:.12g}")
    return short if abs(short - factor) <= 1e-15 * factor else factor


def number(value: object) -> float:
    """Return a finite float from a number or from text that YAML or CSV left as text, such as ``2e11``."""
    if type(value) is float and math.isfinite(value):  # most values of a large file
        return value
    if isinstance(value, bool) or not isinstance(value, Real | str):
        raise BeamstiffError(f"found {shown(value)}, expected a number")
    if isinstance(value, str) and not (len(value) <= _LONGEST and _NUMBER.match(value)):
        raise BeamstiffError(f"found {shown(value)}, expected a number")
    try:
        result = float(value)
    except (OverflowError, ValueError):
        result = math.inf
    if not math.isfinite(result):
        raise BeamstiffError(f"found {shown(value)}, expected a finite number")
    return result


def check_turn(angle: float, found: object) -> float:
    """Return an angle, rad; one so large that its digits are lost in its turns is refused."""
    if abs(angle) > MOST_TURN:
        raise BeamstiffError(f"found {shown(found)}, expected an angle of at most {MOST_TURN:g} rad")
    return angle


def quantity(value: object, kind: str) -> float:
    """Return a quantity in SI: a plain number is SI already, text carries its unit.

    `value`: ``0.047``, ``"47 mm"``, ``"1.72e9 N*mm/rad"`` or ``"2e11"`` (YAML 1.1 reads that as text).
    `kind`: a key of `UNITS`, for instance ``"length"``.

    >>> quantity("1047 mm", "length")
    1.047
    >>> quantity("1.5e9 N*mm/rad", "rotational stiffness")
    1500000.0
    """
    result = _quantity(value, kind)
    return check_turn(result, value) if kind == "angle" else result


def _quantity(value: object, kind: str) -> float:
    if not isinstance(value, str):
        return number(value)
    match = _QUANTITY.match(value) if len(value) <= _LONGEST else None
    if match is None:
        unit = UNITS[kind]
        with_unit = f" with a unit of {kind} such as {unit}" if unit else ""
        point = ": decimals follow a point, not a comma" if _DECIMAL_COMMA.match(value) else ""
        raise BeamstiffError(f"found {shown(value)}, expected a number{with_unit}{point}")
    magnitude = number(match["number"])
    if match["unit"] is None:
        return magnitude
    return in_si(magnitude, match["unit"], kind)


def in_si(magnitude: float, unit: str, kind: str) -> float:
    """Return a magnitude with its unit in SI, as exact as decimals are: ``473 mm`` is ``0.473``.

    >>> in_si(473.0, "mm", "length")
    0.473
    >>> 473.0 * 0.001 == 0.473
    False
    """
    return number(scaled(magnitude, *unit_factor(unit, kind)))


def scaled(magnitude: Any, factor: float, offset: float) -> Any:
    """Return a number or an array in SI: times the factor, plus the offset."""
    # 473 * 0.001 is 0.47300000000000003: where the factor is one over a whole number, dividing rounds once
    if 0 < factor < 1 and offset == 0.0 and (inverse := round(1 / factor)) * factor == 1.0:
        return magnitude / inverse
    return magnitude * factor + offset


def with_unit(text: object) -> tuple[float, str]:
    """Return magnitude and unit of a quantity of any dimension.

    >>> with_unit("2e-7 rad/(N*m)")
    (2e-07, 'rad/(N*m)')
    """
    match = _QUANTITY.match(text) if isinstance(text, str) and len(text) <= _LONGEST else None
    if match is None or match["unit"] is None:
        raise BeamstiffError(
            f"found {shown(text)}, expected a number, or text with a unit such as '0.1 mrad'"
        )
    _parsed_unit(match["unit"])
    return number(match["number"]), match["unit"]


def in_unit(value: object, unit: str) -> float:
    """Return a quantity in a coherent SI unit: a plain number is in it already, text carries its unit.

    >>> in_unit("0.2 mrad/kN/m", "rad/(N*m)")
    2e-07
    """
    if not isinstance(value, str) or _NUMBER.match(value):
        return number(value)
    magnitude, own = with_unit(value)
    source, target = _parsed_unit(own), _parsed_unit(unit)
    if source.dimensionality != target.dimensionality:
        raise BeamstiffError(f"found the unit {shown(own)}, expected a unit such as {unit or '1'}")
    factor = float(_registry().Quantity(1.0, source).to(target).magnitude)
    return number(magnitude * _without_rounding(factor))


def unit_size(unit: str) -> float:
    """Return how many of the coherent SI unit one of a unit is, whatever its dimension.

    >>> unit_size("N*mm/rad")
    0.001
    """
    one = _registry().Quantity(1.0, _parsed_unit(unit))
    grams: Any = one.dimensionality.get("[mass]", 0)  # pint's base is the gram, SI's the kilogram
    return _without_rounding(float(one.to_base_units().magnitude) / 1000.0**grams)


def _parsed_unit(unit: str) -> Any:
    """Return a unit of any dimension; a divisor in parentheses, and 1 over something, are units too."""
    text = unit.strip().replace("**", "^")
    text = re.sub(r"/\s*\(([^()]*)\)", lambda divisor: "/" + re.sub(r"[*·\s]+", "/", divisor[1]), text)
    text = _spelled(re.sub(r"\A1\s*(?=/|\Z)", "count", text))
    if len(unit) > _LONGEST or not _UNIT.match(text):
        raise BeamstiffError(f"found the unit {shown(unit)}, expected one such as rad/(N*m)")
    try:
        return _registry().parse_units(text)
    except Exception:  # pint raises its own, tokenizer's and arithmetic errors
        raise BeamstiffError(f"unknown unit {shown(unit)}") from None
