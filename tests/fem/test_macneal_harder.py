"""MacNeal & Harder, A proposed standard set of problems to test finite element accuracy, Finite Elem. Anal.
Des. 1 (1985) 3-20: straight, twisted and curved cantilevers under unit tip loads (inch, pound).
"""

import math

import numpy as np
import pytest

from beamstiff import Material, Robot, compile_structure
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.robot.sections import Section, section_properties
from tests.fem.builders import at_rest, frame


def compliance(robot: Robot) -> np.ndarray:
    structure = compile_structure(robot)
    return tcp_compliance(structure, at_rest(structure))[0]


def bar(width: float, height: float) -> Section:
    """Return a rectangle with shear, `width` along local y and `height` along local z."""
    return Section(shape="rectangle", width=width, height=height, shear=True)


def material(E: float, nu: float) -> Material:
    return Material(E=E, G=E / (2 * (1 + nu)))


@pytest.mark.parametrize("elements", [1, 6])
def test_straight_beam(elements: int) -> None:
    """6 x 0.2 x 0.1, nu = 0.3: 3.0e-5 along, 0.1081 in plane (depth 0.2), 0.4321 out of plane."""
    points = [(6.0 * at / elements, 0, 0) for at in range(elements + 1)]
    beam = {"section": bar(0.2, 0.1), "material": material(1e7, 0.3), "up": (0, 1, 0)}
    robot = frame(points, beams=[(at, at + 1) for at in range(elements)], **beam)
    C = compliance(robot)
    assert f"{C[0, 0]:.1e}" == "3.0e-05"
    assert f"{C[1, 1]:.4f}" == "0.1081"
    assert f"{C[2, 2]:.4f}" == "0.4321"


def twisted(elements: int) -> np.ndarray:
    """Return the deflections under loads a (across the root's thin side, 0.32) and b (its wide one, 1.1)."""
    length, twist = 12.0, math.pi / 2
    middle = (np.arange(elements) + 0.5) / elements * twist
    robot = frame(
        [(length * at / elements, 0, 0) for at in range(elements + 1)],
        beams=[(at, at + 1) for at in range(elements)],
        section=bar(1.1, 0.32),
        material=material(29e6, 0.22),
        up=[(0.0, math.cos(angle), math.sin(angle)) for angle in middle],
    )
    C = compliance(robot)
    return np.array([C[2, 2], C[1, 1]])


def test_twisted_beam_of_12_elements() -> None:
    """0.005424 and 0.001754, to a unit of the last printed digit (0.001 % and 0.05 %)."""
    assert np.abs(twisted(12) - [0.005424, 0.001754]).max() <= 1e-6


def test_twisted_beam_converges() -> None:
    """To what 200 stepped elements gave elsewhere, 0.005429 and 0.001750, with the square of the element."""
    limit = twisted(200)
    assert [f"{value:.6f}" for value in limit] == ["0.005429", "0.001750"]
    coarse, fine = np.abs(twisted(12) - limit), np.abs(twisted(24) - limit)
    assert coarse / fine == pytest.approx(4.0, rel=0.05)


RADIUS, DEPTH, THICKNESS = 4.22, 0.2, 0.1


def curved_section() -> Section:
    """Return the rectangle with the torsion constant of Roark's table 10.7, case 4, as the printed result.

    The exact series makes it 0.1 % softer, and the deflection out of plane 0.5006.
    """
    wide, thin = DEPTH / 2, THICKNESS / 2
    torsion = wide * thin**3 * (16 / 3 - 3.36 * thin / wide * (1 - thin**4 / (12 * wide**4)))
    exact = section_properties(bar(DEPTH, THICKNESS))
    return Section(A=exact.A, Iy=exact.Iy, Iz=exact.Iz, J=torsion, Ay=exact.Ay, Az=exact.Az)


def curved(elements: int) -> Robot:
    """Return a quarter of a ring as a polygon: from the root at angle 0 to the tip at 90 deg."""
    angles = np.linspace(0, math.pi / 2, elements + 1)
    points = RADIUS * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return frame(
        points.tolist(),
        beams=[(at, at + 1) for at in range(elements)],
        section=curved_section(),
        material=material(1e7, 0.25),
        up=[tuple(points[at] + points[at + 1]) for at in range(elements)],
    )


def tip(elements: int) -> np.ndarray:
    """Return the deflections in the plane (across the tip's tangent) and out of it."""
    C = compliance(curved(elements))
    return np.array([C[1, 1], C[2, 2]])


def by_castigliano() -> np.ndarray:
    """Return the same of the smooth ring: integrals of sin^2 and (1 - cos)^2 over a quarter."""
    made = material(1e7, 0.25)
    section = section_properties(curved_section())
    E, G, quarter = made.E, made.G, math.pi / 4
    sine, versine = quarter, 3 * quarter - 2  # integrals of sin^2 (or cos^2), and of (1 - cos)^2
    in_plane = RADIUS**3 * sine / (E * section.Iz) + RADIUS * sine * (
        1 / (E * section.A) + 1 / (G * section.Ay)
    )
    across = RADIUS**3 * (sine / (E * section.Iy) + versine / (G * section.J))
    across += RADIUS * math.pi / 2 / (G * section.Az)
    return np.array([in_plane, across])


def test_curved_beam_converges_to_the_printed_digits() -> None:
    """Straight beams converge to 0.0886 in plane, 0.5004 out of it; published solids: 0.08734, 0.5022."""
    for elements in (60, 120):
        assert [f"{value:.4f}" for value in tip(elements)] == ["0.0886", "0.5004"]
    assert tip(120) == pytest.approx([0.08734, 0.5022], rel=0.015)


def test_curved_beam_converges_to_castigliano_with_the_square_of_the_element() -> None:
    exact = by_castigliano()
    errors = np.array([np.abs(tip(elements) / exact - 1) for elements in (10, 20, 40)])
    assert errors[0].max() < 6e-3
    assert errors[:-1] / errors[1:] == pytest.approx(4.0, rel=0.02)
    extrapolated = (4 * tip(80) - tip(40)) / 3
    assert np.abs(extrapolated / exact - 1).max() < 1e-6
