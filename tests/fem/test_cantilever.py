"""A cantilever under each of six end loads.

Sources: Gere, Mechanics of Materials, 6th ed., appendix G (bending) and sections 2.2 and 3.3 (extension,
torsion); shear after Timoshenko, Phil. Mag. 41 (1921) 744.
"""

import numpy as np
import pytest

from beamstiff.robot.sections import Section
from tests.fem.builders import (
    LOADS,
    SECTION,
    SHEAR_SECTION,
    STEEL,
    compliance,
    direct_error,
    frame,
    screw,
    some_rotation,
    turned,
)

LENGTH = 1.3
TOLERANCE = 1e-9


def tip_compliance(section: Section, length: float = LENGTH) -> np.ndarray:
    """Return d by f at the tip in local axes: the closed forms."""
    E, G = STEEL.E, STEEL.G
    shear_y = length / (G * section.Ay) if section.Ay else 0.0
    shear_z = length / (G * section.Az) if section.Az else 0.0
    C = np.zeros((6, 6))
    C[0, 0] = length / (E * section.A)
    C[1, 1] = length**3 / (3 * E * section.Iz) + shear_y
    C[2, 2] = length**3 / (3 * E * section.Iy) + shear_z
    C[3, 3] = length / (G * section.J)
    C[4, 4] = length / (E * section.Iy)
    C[5, 5] = length / (E * section.Iz)
    C[1, 5] = C[5, 1] = length**2 / (2 * E * section.Iz)
    C[2, 4] = C[4, 2] = -(length**2) / (2 * E * section.Iy)
    return C


@pytest.mark.parametrize("load", range(6), ids=LOADS)
@pytest.mark.parametrize("elements", [1, 2, 7])
@pytest.mark.parametrize("section", [SECTION, SHEAR_SECTION], ids=["euler-bernoulli", "timoshenko"])
def test_end_load_gives_the_closed_form(section: Section, elements: int, load: int) -> None:
    points = [(LENGTH * at / elements, 0, 0) for at in range(elements + 1)]
    robot = frame(points, beams=[(at, at + 1) for at in range(elements)], section=section, up=(0, 1, 0))
    assert direct_error(compliance(robot), tip_compliance(section))[:, load].max() <= TOLERANCE


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("elements", [1, 2])
@pytest.mark.parametrize("section", [SECTION, SHEAR_SECTION], ids=["euler-bernoulli", "timoshenko"])
def test_it_bends_about_its_own_axes_however_it_lies(section: Section, elements: int, seed: int) -> None:
    points = [(LENGTH * at / elements, 0, 0) for at in range(elements + 1)]
    robot = frame(points, beams=[(at, at + 1) for at in range(elements)], section=section, up=(0.3, 1, 0))
    rotation = some_rotation(seed)
    found = compliance(turned(robot, rotation, shift=(3.0, -2.0, 1.0)))
    local = screw(rotation).T @ found @ screw(rotation)
    assert direct_error(local, tip_compliance(section)).max() <= TOLERANCE


def test_unequal_elements_read_from_tip_to_root() -> None:
    """The order of an element's nodes turns its axes x and z around, which must not show."""
    points = [(0, 0, 0), (0.1, 0, 0), (0.9, 0, 0), (LENGTH, 0, 0)]
    robot = frame(points, beams=[(1, 0), (2, 1), (3, 2)], section=SHEAR_SECTION, up=(0, 1, 0))
    assert direct_error(compliance(robot), tip_compliance(SHEAR_SECTION)).max() <= TOLERANCE


def test_local_y_lies_in_the_plane_of_the_axis_and_up() -> None:
    """With `up` along y, a force along y meets Iz; with `up` along z it meets Iy."""
    for up, second in (((0, 1, 0), SECTION.Iz), ((0, 0, 1), SECTION.Iy), ((5, 1, 0), SECTION.Iz)):
        robot = frame([(0, 0, 0), (LENGTH, 0, 0)], beams=[(0, 1)], up=up)
        assert compliance(robot)[1, 1] == pytest.approx(LENGTH**3 / (3 * STEEL.E * second), rel=TOLERANCE)
