"""A bent in space by Castigliano's theorem: one integral of moments a leg.

Source: Timoshenko & Young, Theory of Structures, 2nd ed., ch. 8.
"""

import pytest

from beamstiff.robot.sections import Section
from tests.fem.builders import LOADS, STEEL, compliance, frame

a, b, c = 0.8, 0.5, 0.3
ROUND = Section(A=1e-3, Iy=8e-8, Iz=8e-8, J=1.6e-7)
EI, GJ, EA = STEEL.E * ROUND.Iy, STEEL.G * ROUND.J, STEEL.E * ROUND.A
TOLERANCE = 1e-9


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
