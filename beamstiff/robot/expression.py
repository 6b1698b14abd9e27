"""Linear expressions of joint variables, with a tiny grammar of our own (never `eval`).

::

    expression := ["+"|"-"] term (("+"|"-") term)*
    term       := factor (("*"|"/") factor)*        at most one variable in a term, never as a divisor
    factor     := number [unit] | "pi" | variable

``q2 - 90 deg``, ``-q5``, ``2*q1 + pi/2``, ``"5 mm/rad * q1"``. A number without a unit is SI.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.units import NUMBER, UNITS, check_turn, in_si, number, unit_factor

_NAME = r"[A-Za-z_][A-Za-z0-9_]*"
_UNSIGNED = NUMBER.removeprefix("[+-]?")
_FACTOR = re.compile(
    rf"\s*(?:(?P<number>{_UNSIGNED})(?:\s*(?P<unit>[A-Za-zµ°][A-Za-zµ°^0-9]*(?:/[A-Za-zµ°]+)?))?|(?P<name>{_NAME}))\s*"
)
_SIGN = re.compile(r"\s*([+-])\s*")


@dataclass(frozen=True)
class Expression:
    """``constant + sum(coefficient * variable)``, SI.

    >>> parse_expression("q2 - 90 deg", "angle", {"q2": "angle"})
    Expression(constant=-1.5707963267948966, coefficients={'q2': 1.0})
    """

    constant: float = 0.0
    coefficients: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [f"{coefficient!r}*{name}" for name, coefficient in self.coefficients.items()]
        return " + ".join([*parts, repr(self.constant)] if self.constant or not parts else parts)


def parse_expression(text: object, kind: str, variables: Mapping[str, str]) -> Expression:
    """Return the linear expression that a number (SI) or text stands for.

    Its value is of a kind, ``"angle"`` or ``"length"``, and so is every variable that may be used.
    """
    if not isinstance(text, str):
        return _checked(Expression(number(text)), text, kind)
    if len(text) > 500:
        raise BeamstiffError(f"found an expression of {len(text)} characters, expected at most 500")
    coefficients: dict[str, float] = {}
    constant, at, sign, first = 0.0, 0, 1.0, True
    while True:
        match = _SIGN.match(text, at)
        if match:
            sign, at = (-1.0 if match[1] == "-" else 1.0), match.end()
        elif not first:
            break
        value, variable, at = _term(text, at, kind, variables)
        if variable is None:
            constant += sign * value
        else:
            coefficients[variable] = coefficients.get(variable, 0.0) + sign * value
        sign, first = 1.0, False
        if at >= len(text):
            break
        if text[at] not in "+-":
            raise _not_linear(text)
    if not all(map(math.isfinite, [constant, *coefficients.values()])):
        raise BeamstiffError(f"found {shown(text)}, expected finite numbers")
    kept = {name: value for name, value in coefficients.items() if value != 0.0}
    return _checked(Expression(constant, kept), text, kind)


def _checked(expression: Expression, text: object, kind: str) -> Expression:
    if kind == "angle":
        check_turn(expression.constant, text)
    return expression


def _term(text: str, at: int, kind: str, variables: Mapping[str, str]) -> tuple[float, str | None, int]:
    """Read one product; returns its factor, its variable if any, and where it ends."""
    value, variable, operator, unit = 1.0, None, "*", ""
    while True:
        match = _FACTOR.match(text, at)
        if not match or match.end() == at:
            raise _not_linear(text)
        at = match.end()
        name = match["name"]
        if name == "pi" and name not in variables:
            factor = math.pi
        elif name is not None:
            if name not in variables:
                raise BeamstiffError(
                    f"found the unknown variable {name!r} in {shown(text)}{suggest(name, variables)}"
                )
            if variable is not None or operator == "/":
                raise _not_linear(text)
            variable, factor = name, 1.0
        else:
            factor = number(match["number"])
            if match["unit"]:
                if unit or operator == "/":
                    raise _not_linear(text)
                unit = match["unit"]
        if operator == "/":
            if factor == 0.0:
                raise BeamstiffError(f"found a division by zero in {shown(text)}")
            value /= factor
        else:
            value *= factor
        if at < len(text) and text[at] in "*/":
            operator, at = text[at], at + 1
            continue
        break
    if variable is None:
        try:
            return in_si(value, unit, kind) if unit else value, None, at
        except BeamstiffError:
            if unit in variables:  # 2 q1
                raise _not_linear(text) from None
            raise
    return value * _coefficient_factor(text, unit, kind, variables[variable]), variable, at


def _coefficient_factor(text: str, unit: str, kind: str, variable_kind: str) -> float:
    """Return the SI factor of a coefficient's unit, which turns the variable's kind into the expression's."""
    if kind == variable_kind:
        if unit:
            raise BeamstiffError(
                f"found the unit {unit!r} on a coefficient in {shown(text)}, expected a plain number"
            )
        return 1.0
    ratio = f"{UNITS[kind]}/{UNITS[variable_kind]}"
    if "/" not in unit:
        article = {"angle": "an", "length": "a"}
        raise BeamstiffError(
            f"found {shown(text)}: {article[variable_kind]} {variable_kind} where {article[kind]} {kind} is "
            f"expected; give the coefficient a unit such as {ratio}"
        )
    top, bottom = unit.split("/", 1)
    return unit_factor(top, kind)[0] / unit_factor(bottom, variable_kind)[0]


def _not_linear(text: str) -> BeamstiffError:
    return BeamstiffError(
        f"found {shown(text)}, expected a linear expression of variables "
        "such as 'q2 - 90 deg' or '2*q1 + 0.1'"
    )
