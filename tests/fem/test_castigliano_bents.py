"""Bents, out of their plane and in space, by Castigliano's theorem: one integral of moments a leg.

Source: Timoshenko & Young, Theory of Structures, 2nd ed., ch. 8; the L-bend's a^3/3EI + b^3/3EI + a b^2/GJ
is in every text (for instance Boresi & Schmidt, Advanced Mechanics of Materials, 6th ed., section 5.4).
"""

import pytest

from beamstiff.robot.sections import Section
from tests.fem.builders import LOADS, STEEL, compliance, displacement, frame

a, b, c = 0.8, 0.5, 0.3
ROUND = Section(A=1e-3, Iy=8e-8, Iz=8e-8, J=1.6e-7)
EI, GJ, EA = STEEL.E * ROUND.Iy, STEEL.G * ROUND.J, STEEL.E * ROUND.A
TOLERANCE = 1e-9


@pytest.mark.parametrize("elements", [1, 3])
def test_L_bend_loaded_across_its_plane(elements: int) -> None:
    first = [(a * at / elements, 0, 0) for at in range(elements + 1)]
    second = [(a, b * at / elements, 0) for at in range(1, elements + 1)]
    count = 2 * elements
    robot = frame([*first, *second], beams=[(at, at + 1) for at in range(count)], section=ROUND)
    expected = a**3 / (3 * EI) + b**3 / (3 * EI) + a * b**2 / GJ
    assert displacement(robot, {robot.tcp: [0, 0, 1, 0, 0, 0]})[2] == pytest.approx(expected, rel=TOLERANCE)


def test_L_bend_loaded_in_its_plane() -> None:
    """Along the second leg a^3/3EI + b/EA, along the first b^3/3EI + a b^2/EI + a/EA; a^2 b/2EI between."""
    robot = frame([(0, 0, 0), (a, 0, 0), (a, b, 0)], beams=[(0, 1), (1, 2)], section=ROUND)
    C = compliance(robot)
    assert C[1, 1] == pytest.approx(a**3 / (3 * EI) + b / EA, rel=TOLERANCE)
    assert C[0, 0] == pytest.approx(b**3 / (3 * EI) + a * b**2 / EI + a / EA, rel=TOLERANCE)
    assert C[0, 1] == pytest.approx(-(a**2) * b / (2 * EI), rel=TOLERANCE)


BENT = frame([(0, 0, 0), (a, 0, 0), (a, b, 0), (a, b, c)], beams=[(0, 1), (1, 2), (2, 3)], section=ROUND)


# legs along x, y and z, as on a pipe: bending and torsion of each leg under a load at the far end
BENT_BY_CASTIGLIANO = {
    "fx": c**3 / (3 * EI) + b * c**2 / GJ + b**3 / (3 * EI) + a * c**2 / EI + a * b**2 / EI + a / EA,
    "fy": c**3 / (3 * EI) + c**2 * b / EI + b / EA + a * c**2 / GJ + a**3 / (3 * EI),
    "fz": c / EA + b**3 / (3 * EI) + a * b**2 / GJ + a**3 / (3 * EI),
    "mx": c / EI + b / EI + a / GJ,
    "my": c / EI + b / GJ + a / EI,
    "mz": c / GJ + b / EI + a / EI,
}


@pytest.mark.parametrize("load", BENT_BY_CASTIGLIANO)
def test_bent_in_space(load: str) -> None:
    at = LOADS.index(load)
    assert compliance(BENT)[at, at] == pytest.approx(BENT_BY_CASTIGLIANO[load], rel=TOLERANCE)
