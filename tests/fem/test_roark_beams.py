"""Straight beams between supports: Roark's Formulas for Stress and Strain, 8th ed., table 8.1.

Cases 1 (concentrated load at `a` from the left end) and 2 (uniform load), with the ends guided, simply
supported and fixed; the supports are joints with free directions between the beam's end and a fixed node.
Shear terms: table 8.1's beams with w L^2 / (8 G As) and the like added (Timoshenko, Strength of Materials
I, art. 39).
"""

import numpy as np
import pytest

from beamstiff import Robot, Section
from tests.fem.builders import FREE, RIGID, SECTION, SHEAR_SECTION, STEEL, displacement, frame, solve

LENGTH, FORCE = 2.4, 700.0
TOLERANCE = 1e-9

# joint along the beam: (axial, radial, torsional, tilting)
FIXED = (RIGID, RIGID, RIGID, RIGID)
HINGED = (RIGID, RIGID, RIGID, FREE)
ROLLER = (FREE, RIGID, FREE, FREE)


def supported(
    a: float, left: tuple[float, ...], right: tuple[float, ...], section: Section = SECTION
) -> Robot:
    """Return a beam along x with its nodes 0 and 4 fixed, supports 0-1 and 4-3, and node 2 at `a`."""
    points = [(0, 0, 0), (0, 0, 0), (a, 0, 0), (LENGTH, 0, 0), (LENGTH, 0, 0)]
    along = (1, 0, 0)
    parts = {"beams": [(1, 2), (2, 3)], "joints": [(0, 1, along, left), (3, 4, along, right)]}
    return frame(points, fixed=(0, 4), tcp=2, section=section, up=(0, 1, 0), **parts)


SUPPORTS = {"simple": (HINGED, ROLLER), "propped": (FIXED, ROLLER), "fixed": (FIXED, FIXED)}


def under_the_load(case: str, a: float, EI: float) -> float:
    """Return the deflection under a load at `a` of a beam with a fixed or simple left end."""
    b = LENGTH - a
    return {
        "simple": FORCE * a**2 * b**2 / (3 * EI * LENGTH),
        "propped": FORCE * a**3 * b**2 * (4 * LENGTH - a) / (12 * EI * LENGTH**3),
        "fixed": FORCE * a**3 * b**3 / (3 * EI * LENGTH**3),
    }[case]


@pytest.mark.parametrize("case", SUPPORTS)
@pytest.mark.parametrize("a", [0.5, 1.2, 1.9])
@pytest.mark.parametrize("axis", [1, 2], ids=["x-y plane", "x-z plane"])
def test_deflection_under_a_concentrated_load(case: str, a: float, axis: int) -> None:
    load = np.zeros(6)
    load[axis] = FORCE
    second = SECTION.Iz if axis == 1 else SECTION.Iy
    found = displacement(supported(a, *SUPPORTS[case]), {"n2": load})
    assert found[axis] == pytest.approx(under_the_load(case, a, STEEL.E * second), rel=TOLERANCE)


def test_reaction_of_the_prop() -> None:
    """Case 1c with the load in the middle: the prop takes 5/16 of it, the fixed end 3 P L / 16."""
    response = solve(supported(LENGTH / 2, FIXED, ROLLER), {"n2": [0, -FORCE, 0, 0, 0, 0]})
    root, prop = response.beam_forces[0, 0, 0], response.beam_forces[0, 1, 1]
    assert prop[1] == pytest.approx(5 / 16 * FORCE, rel=TOLERANCE)
    assert root[1] == pytest.approx(11 / 16 * FORCE, rel=TOLERANCE)
    assert root[5] == pytest.approx(3 / 16 * FORCE * LENGTH, rel=TOLERANCE)
    assert prop[5] == pytest.approx(0.0, abs=TOLERANCE * FORCE * LENGTH)


def weight_deflection(case: str, w: float, EI: float, GAs: float) -> float:
    """Return the deflection in the middle under uniform load; at the tip for the cantilever."""
    bending = {"cantilever": 1 / 8, "simple": 5 / 384, "propped": 1 / 192, "fixed": 1 / 384}[case]
    shear = {"cantilever": 1 / 2, "simple": 1 / 8, "fixed": 1 / 8}.get(case, 0.0)
    return w * LENGTH**4 * bending / EI + w * LENGTH**2 * shear / GAs


@pytest.mark.parametrize("case", SUPPORTS)
@pytest.mark.parametrize(("gravity", "axis"), [((0, -9.81, 0), 1), ((0, 0, -9.81), 2)])
def test_own_weight_in_the_middle(case: str, gravity: tuple[float, ...], axis: int) -> None:
    robot = supported(LENGTH / 2, *SUPPORTS[case]).model_copy(update={"gravity": gravity})
    w = 9.81 * STEEL.density * SECTION.A
    second = SECTION.Iz if axis == 1 else SECTION.Iy
    expected = -weight_deflection(case, w, STEEL.E * second, np.inf)
    assert displacement(robot, {}, gravity=True)[axis] == pytest.approx(expected, rel=TOLERANCE)


@pytest.mark.parametrize("case", ["simple", "fixed"])
def test_own_weight_of_a_shear_beam_in_the_middle(case: str) -> None:
    robot = supported(LENGTH / 2, *SUPPORTS[case], section=SHEAR_SECTION)
    w = 9.81 * STEEL.density * SECTION.A
    expected = -weight_deflection(case, w, STEEL.E * SECTION.Iy, STEEL.G * SHEAR_SECTION.Az)
    assert displacement(robot, {}, gravity=True)[2] == pytest.approx(expected, rel=TOLERANCE)


@pytest.mark.parametrize("elements", [1, 2, 5])
@pytest.mark.parametrize("section", [SECTION, SHEAR_SECTION], ids=["euler-bernoulli", "timoshenko"])
def test_own_weight_of_a_cantilever(section: Section, elements: int) -> None:
    """Case 2a: q L^4 / 8 E I + q L^2 / 2 G As at the tip, without force there; q L, q L^2 / 2 at the root."""
    points = [(LENGTH * at / elements, 0, 0) for at in range(elements + 1)]
    beams = [(at, at + 1) for at in range(elements)]
    response = solve(frame(points, beams=beams, section=section, up=(0, 1, 0)), {}, gravity=True)
    w = 9.81 * STEEL.density * section.A
    GAs = STEEL.G * section.Az if section.Az else np.inf
    expected = -weight_deflection("cantilever", w, STEEL.E * section.Iy, GAs)
    assert response.displacement[0, -1, 2] == pytest.approx(expected, rel=TOLERANCE)
    root, tip = response.beam_forces[0, 0, 0], response.beam_forces[0, -1, 1]
    assert root == pytest.approx([0, 0, w * LENGTH, 0, -w * LENGTH**2 / 2, 0], rel=TOLERANCE, abs=1e-7)
    assert tip == pytest.approx(np.zeros(6), abs=1e-9 * w * LENGTH**2)


def test_fixed_end_moments_under_own_weight() -> None:
    """Case 2d: q L^2 / 12 at the ends and q L^2 / 24 in the middle, as the members' forces say."""
    response = solve(supported(LENGTH / 2, FIXED, FIXED), {}, gravity=True)
    w = 9.81 * STEEL.density * SECTION.A
    (left, middle), (_, right) = response.beam_forces[0]
    assert left[2] == pytest.approx(w * LENGTH / 2, rel=TOLERANCE)
    assert left[4] == pytest.approx(-w * LENGTH**2 / 12, rel=TOLERANCE)
    assert right[4] == pytest.approx(w * LENGTH**2 / 12, rel=TOLERANCE)
    # sagging in the middle: the left half's right end is held by -q L^2 / 24 about y
    assert middle[4] == pytest.approx(-w * LENGTH**2 / 24, rel=TOLERANCE)
