"""Cross-sections of beams: given by their properties, or computed from a shape by closed forms.

Sources: second moments, and torsion of circles and tubes, are elementary. Torsion of the rectangle:
Timoshenko and Goodier, Theory of Elasticity, 3rd ed., art. 109 (the series, exact); of the box: Bredt and the
wall's own torsion, EN 10210-2 with sharp corners (some 6 % low at worst); of the I: its three rectangles
apart (a lower bound). Shear areas with Poisson's ratio 0: circle 6/7 A, tube, rectangle 5/6 A (Cowper,
J. Appl. Mech. 33 (1966) 335); box and I: the walls along the force alone.
"""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from beamstiff.errors import listed
from beamstiff.robot.fields import (
    Described,
    DescriptionError,
    PositiveArea,
    PositiveLength,
    PositiveSecondMoment,
    Truth,
)

DIMENSIONS = {
    "tube": ("outer", "wall"),
    "circle": ("outer",),
    "box": ("width", "height", "wall"),
    "rectangle": ("width", "height"),
    "I": ("width", "height", "web", "flange"),
}
GIVEN = ("A", "Iy", "Iz", "J")


@dataclass(frozen=True)
class SectionProperties:
    """Area m^2, second moments and torsion constant m^4, shear areas m^2 (None: rigid in shear)."""

    A: float
    Iy: float
    Iz: float
    J: float
    Ay: float | None = None
    Az: float | None = None


class Section(Described):
    """A beam's cross-section: given by its properties, or by a shape with its dimensions.

    ``Iy`` resists bending in the local x-z plane, ``Iz`` in the x-y plane; ``Ay``, ``Az`` are shear areas
    (Timoshenko; without them the beam is Euler-Bernoulli).

    Shapes: ``tube`` (outer, wall), ``circle`` (outer), ``box`` (width, height, wall), ``rectangle`` (width,
    height) and ``I`` (width, height, web, flange); width is along local y, height along local z.
    ``shear: true`` computes the shear areas of a shape as well.
    """

    A: PositiveArea | None = None
    Iy: PositiveSecondMoment | None = None
    Iz: PositiveSecondMoment | None = None
    J: PositiveSecondMoment | None = None
    Ay: PositiveArea | None = None
    Az: PositiveArea | None = None
    shape: Literal["tube", "circle", "box", "rectangle", "I"] | None = None
    outer: PositiveLength | None = None
    wall: PositiveLength | None = None
    width: PositiveLength | None = None
    height: PositiveLength | None = None
    web: PositiveLength | None = None
    flange: PositiveLength | None = None
    shear: Truth = False

    @model_validator(mode="after")
    def _complete(self) -> Self:
        expected = GIVEN if self.shape is None else DIMENSIONS[self.shape]
        allowed = {*expected, "Ay", "Az"} if self.shape is None else {*expected, "shape", "shear"}
        missing = [name for name in expected if getattr(self, name) is None]
        surplus = sorted(self.model_fields_set - allowed - {"shear" if not self.shear else ""})
        what = f"the shape {self.shape}" if self.shape else "a section given by its properties"
        if missing:
            raise DescriptionError([((missing[0],), f"is missing: {what} needs {listed(expected)}")])
        if surplus:
            raise DescriptionError(
                [((surplus[0],), f"does not belong to {what}, which needs {listed(expected)}")]
            )
        _check_dimensions(self)
        _check_properties(self)
        return self


def _check_dimensions(section: Section) -> None:
    """Refuse walls that leave no room inside."""
    smallest = min(value for value in (section.outer, section.width, section.height, math.inf) if value)
    for name, limit in (
        ("wall", smallest / 2),
        ("web", section.width),
        ("flange", (section.height or math.inf) / 2),
    ):
        value = getattr(section, name)
        if value is not None and limit is not None and not value < limit:
            raise DescriptionError(
                [((name,), f"found {value} m, expected less than {limit} m for this {section.shape}")]
            )


def _check_properties(section: Section) -> None:
    """Refuse dimensions whose fourth powers leave the range of numbers."""
    try:
        properties = astuple(section_properties(section))
    except OverflowError:
        properties = (math.inf,)
    if not all(value is None or 0 < value < math.inf for value in properties):
        name = GIVEN[0] if section.shape is None else DIMENSIONS[section.shape][0]
        raise DescriptionError(
            [((name,), f"found {getattr(section, name)}: its section properties leave the range of numbers")]
        )


def section_properties(section: Section) -> SectionProperties:
    """Return area, second moments, torsion constant and shear areas of a section.

    >>> section_properties(Section(shape="rectangle", width=0.1, height=0.2)).Iy
    6.666666666666668e-05
    """
    if section.shape is None:
        return SectionProperties(*(getattr(section, name) for name in (*GIVEN, "Ay", "Az")))
    dimensions = [getattr(section, name) for name in DIMENSIONS[section.shape]]
    properties = _SHAPES[section.shape](*dimensions)
    if section.shear:
        return properties
    return SectionProperties(properties.A, properties.Iy, properties.Iz, properties.J)


def _tube(outer: float, wall: float) -> SectionProperties:
    inner = outer - 2 * wall
    area = math.pi * (outer**2 - inner**2) / 4
    second = math.pi * (outer**4 - inner**4) / 64
    # Cowper's hollow circle, nu = 0, m = inner / outer
    m2 = (inner / outer) ** 2
    shear = area * 6 * (1 + m2) ** 2 / (7 + 34 * m2 + 7 * m2**2)
    return SectionProperties(area, second, second, 2 * second, shear, shear)


def _circle(outer: float) -> SectionProperties:
    area, second = math.pi * outer**2 / 4, math.pi * outer**4 / 64
    return SectionProperties(area, second, second, 2 * second, area * 6 / 7, area * 6 / 7)


def _rectangle(width: float, height: float) -> SectionProperties:
    area = width * height
    second = width * height**3 / 12, height * width**3 / 12
    return SectionProperties(area, *second, _torsion_of_rectangle(width, height), area * 5 / 6, area * 5 / 6)


def _torsion_of_rectangle(width: float, height: float) -> float:
    """Return Saint-Venant's torsion constant: a b^3 (1/3 - 64/pi^5 b/a sum tanh(n pi a/2b)/n^5), n odd."""
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 400, 2)
    series = float(np.sum(np.tanh(n * (math.pi / 2 * (a / b))) / n**5.0))
    return a * b**3 * (1 / 3 - 64 / math.pi**5 * (b / a) * series)


def _box(width: float, height: float, wall: float) -> SectionProperties:
    inner_width, inner_height = width - 2 * wall, height - 2 * wall
    enclosed = (width - wall) * (height - wall)
    perimeter = 2 * (width - wall + height - wall)
    return SectionProperties(
        width * height - inner_width * inner_height,
        (width * height**3 - inner_width * inner_height**3) / 12,
        (height * width**3 - inner_height * inner_width**3) / 12,
        4 * enclosed**2 * wall / perimeter + perimeter * wall**3 / 3,
        2 * wall * width,
        2 * wall * height,
    )


def _i_shape(width: float, height: float, web: float, flange: float) -> SectionProperties:
    inner = height - 2 * flange
    return SectionProperties(
        2 * width * flange + inner * web,
        (width * height**3 - (width - web) * inner**3) / 12,
        (2 * flange * width**3 + inner * web**3) / 12,
        # not sums of b t^3 / 3: with thick walls those exceed the polar moment
        2 * _torsion_of_rectangle(width, flange) + _torsion_of_rectangle(inner, web),
        2 * width * flange * 5 / 6,
        height * web,
    )


_SHAPES: dict[str, Callable[..., SectionProperties]] = {
    "tube": _tube,
    "circle": _circle,
    "box": _box,
    "rectangle": _rectangle,
    "I": _i_shape,
}
