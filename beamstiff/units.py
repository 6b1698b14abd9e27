"""Quantities at the edge: text with a unit becomes a float in SI, everything inside is SI.

Angle is a dimension of its own here, so that ``90 deg`` given for a length, or ``N*m`` given for a
torsional stiffness (N*m/rad), is an error and not a number.
"""

from __future__ import annotations

import functools
import math
import re
from typing import Any

import pint

from beamstiff.errors import BeamstiffError

# SI unit of each kind of quantity that a file may hold; the names are used in error messages
UNITS: dict[str, str] = {
    "length": "m",
    "angle": "rad",
    "force": "N",
    "moment": "N*m",
    "mass": "kg",
    "time": "s",
    "temperature": "degC",
    "acceleration": "m/s**2",
    "modulus": "Pa",
    "density": "kg/m**3",
    "area": "m**2",
    "second moment of area": "m**4",
    "translational stiffness": "N/m",
    "rotational stiffness": "N*m/rad",
    "number": "",
}

NUMBER = r"[+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*(?P<number>{NUMBER})\s*(?P<unit>[^\d\s].*?)?\s*\Z")
# letters, operators and one-digit exponents: nothing that a unit parser could evaluate at length
_UNIT = re.compile(
    r"[A-Za-zµμΩ°%][A-Za-zµμΩ°_]*(?:\s*(?:\*\*|\^)\s*-?\d)?(?:\s*[*/·]\s*[A-Za-zµμ°][A-Za-zµμ°_]*(?:\s*(?:\*\*|\^)\s*-?\d)?)*\Z"
)
_SPELLINGS = {"Nm": "N*m", "Nmm": "N*mm", "kNm": "kN*m", "°": "deg", "°C": "degC", "C": "degC"}


@functools.lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    registry.define("radian = [angle] = rad")
    return registry


@functools.lru_cache(maxsize=4096)
def unit_factor(unit: str, kind: str) -> tuple[float, float]:
    """Return (factor, offset) with ``SI value = factor * value + offset`` for a unit of the given kind.

    Parameters
    ----------
    unit : str
        A unit such as ``"mm"``, ``"N*mm/rad"``, ``"deg"``.
    kind : str
        A key of `UNITS`.

    Raises
    ------
    BeamstiffError
        When the unit is not known or has another dimension.

    Examples
    --------
    >>> unit_factor("mm", "length")
    (0.001, 0.0)
    """
    registry = _registry()
    target = UNITS[kind]
    expected = f"a unit of {kind} such as {target}" if target else "a plain number without a unit"
    text = unit.strip()
    # compound spellings such as Nm/rad: each letter run is looked up on its own
    text = re.sub(r"[A-Za-z°]+", lambda match: _SPELLINGS.get(match.group(), match.group()), text).replace(
        "·", "*"
    )
    if not _UNIT.match(text):
        raise BeamstiffError(f"found the unit {unit[:60]!r}, expected {expected}")
    try:
        zero, one = (
            registry.Quantity(value, text.replace("^", "**")).to(target or "dimensionless")
            for value in (0.0, 1.0)
        )
    except pint.DimensionalityError:
        raise BeamstiffError(f"found the unit {unit[:60]!r}, expected {expected}") from None
    except Exception:
        raise BeamstiffError(f"unknown unit {unit[:60]!r}, expected {expected}") from None
    offset = float(zero.magnitude)
    factor = float(one.magnitude) - offset
    if kind != "temperature":  # a difference of kelvin is no length: offsets exist for temperature only
        factor, offset = float(one.magnitude), 0.0
    else:
        # pint converts through kelvin and leaves rounding such as 1 - 1e-16 in the factor
        factor, offset = round(factor, 12), round(offset, 9)
    if not (math.isfinite(factor) and factor != 0.0):
        raise BeamstiffError(f"found the unit {unit[:60]!r}, expected {expected}")
    return factor, offset


def number(value: object) -> float:
    """Return a finite float from a number or from text that YAML or CSV left as text, such as ``2e11``.

    Raises
    ------
    BeamstiffError
        When it is not a number, or is NaN or infinite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise BeamstiffError(f"found {_shown(value)}, expected a number")
    if isinstance(value, str) and not re.fullmatch(rf"\s*{NUMBER}\s*", value):
        raise BeamstiffError(f"found {_shown(value)}, expected a number")
    try:
        result = float(value)
    except (OverflowError, ValueError):
        result = math.inf
    if not math.isfinite(result):
        raise BeamstiffError(f"found {_shown(value)}, expected a finite number")
    return result


def quantity(value: object, kind: str) -> float:
    """Return a quantity in SI: a plain number is SI already, text carries its unit.

    Parameters
    ----------
    value : float, int or str
        ``0.047``, ``"47 mm"``, ``"1.72e9 N*mm/rad"`` or ``"2e11"`` (YAML 1.1 reads that as text).
    kind : str
        A key of `UNITS`, for instance ``"length"``.

    Raises
    ------
    BeamstiffError
        When it is not a number, not finite, or its unit is unknown or of the wrong dimension.

    Examples
    --------
    >>> quantity("1047 mm", "length")
    1.047
    >>> quantity("1.5e9 N*mm/rad", "rotational stiffness")
    1500000.0
    """
    if not isinstance(value, str):
        return number(value)
    match = _QUANTITY.match(value) if len(value) < 200 else None
    if match is None:
        unit = UNITS[kind]
        raise BeamstiffError(
            f"found {_shown(value)}, expected a number{f' with a unit of {kind} such as {unit}' if unit else ''}"
        )
    magnitude = number(match["number"])
    if match["unit"] is None:
        return magnitude
    factor, offset = unit_factor(match["unit"], kind)
    result = magnitude * factor + offset
    # 1047 * 0.001 is 1.0470000000000002 in binary: divide where the factor is the inverse of a whole number
    if 0 < factor < 1 and offset == 0.0 and (inverse := round(1 / factor)) * factor == 1.0:
        result = magnitude / inverse
    return number(result)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
