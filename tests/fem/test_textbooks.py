"""Frames and trusses of textbooks and of Frame3DD, to the digits that are printed.

They are those of the shared benchmark list too: Logan, A First Course in the Finite Element Method, 4th ed.;
Ferreira, MATLAB Codes for Finite Element Analysis; Kassimali, Matrix Analysis of Structures, 2nd ed.
"""

import numpy as np
import pytest

from beamstiff import Material, Robot, Section
from beamstiff.fem.static_response import Response
from tests.fem.builders import FREE, RIGID, STEEL, displacement, frame, solve


def test_logan_example_5_8_a_space_frame() -> None:  # kip, inch
    points = [(0, 0, 0), (-100, 0, 0), (0, 0, -100), (0, -100, 0)]
    beam = {"section": Section(A=10.0, Iy=100.0, Iz=100.0, J=50.0), "material": Material(E=3e4, G=1e4)}
    robot = frame(points, beams=[(1, 0), (2, 0), (3, 0)], fixed=(1, 2, 3), tcp=0, up=(1, 1, 1), **beam)
    found = displacement(robot, {"n0": [0, -50, 0, -1000, 0, 0]})
    printed = np.array([7.098e-5, -0.014, -2.352e-3, -3.996e-3, 1.78e-5, -1.033e-4])
    # a unit of the last printed digit: the source rounds on the way
    assert (np.abs(found - printed) <= np.array([1e-8, 1e-3, 1e-6, 1e-6, 1e-7, 1e-7])).all()


def test_ferreira_example_8_3_a_space_frame_of_two_second_moments() -> None:  # kN, m
    points = [(0, 0, 0), (3, 0, 0), (0, 0, -3), (0, -4, 0)]
    # there local y is across the member and `up` (z; x for members along z); ours lies in their plane
    axes = [np.subtract(points[end], points[0]) for end in (1, 2, 3)]
    ups = [(0, 0, 1), (1, 0, 0), (0, 0, 1)]
    across = [tuple(np.cross(up, axis)) for up, axis in zip(ups, axes, strict=True)]
    beam = {"section": Section(A=0.02, Iy=1e-4, Iz=2e-4, J=5e-5), "material": Material(E=2.1e8, G=8.4e7)}
    robot = frame(points, beams=[(0, 1), (0, 2), (0, 3)], fixed=(1, 2, 3), tcp=0, up=across, **beam)
    found = displacement(robot, {"n0": [-10, 0, 20, 0, 0, 0]})
    assert np.abs(1e6 * found - np.array([-7.05, -0.07, 14.18, 1.45, 1.75, 1.14])).max() <= 0.0051


def test_kassimali_example_6_6_a_plane_frame() -> None:  # kip, inch
    points, ups = [(0, 0, 0), (120, 240, 0), (360, 240, 0)], [(-2, 1, 0), (0, 1, 0)]
    beam = {"section": Section(A=11.8, Iy=77.0, Iz=310.0, J=5.0), "material": Material(E=29000.0, G=11000.0)}
    robot = frame(points, beams=[(0, 1), (1, 2)], fixed=(0, 2), tcp=1, up=ups, **beam)
    found = displacement(robot, {"n1": [0, -60, 0, 0, 0, -750]})[[0, 1, 5]]
    # to a unit of the last printed digit: the source rounds on the way
    assert (np.abs(found - [0.021302, -0.06732, -0.0025499]) <= [1e-6, 1e-5, 1e-7]).all()


def test_kassimali_example_8_1_a_space_truss() -> None:  # kip, inch
    feet = np.array([(0, 0, 0), (216, 0, 0), (144, 192, 0), (-72, 192, 0)], dtype=float)
    top = np.array([72.0, 96.0, 288.0])
    struts = [(at, 4, 10000.0 * 8.4 / float(np.linalg.norm(top - foot))) for at, foot in enumerate(feet)]
    # the TCP needs a rotation: a beam of its own stands aside
    points = [*feet.tolist(), top.tolist(), (500, 0, 0), (500, 0, 1)]
    robot = frame(points, struts=struts, beams=[(5, 6)], fixed=(0, 1, 2, 3, 5))
    found = displacement(robot, {"n4": [0, 50, -100, 0, 0, 0]}, "n4")
    assert [f"{value:.5f}" for value in found[:3]] == ["0.10913", "0.57202", "-0.12104"]


def test_frame3dd_example_B_a_pyramid_of_shear_beams_under_its_weight() -> None:  # N, mm
    """Printed with geometric stiffness; a linear solver gives 0.0141272, -0.0502277 and -0.0223740 mm."""
    points = [(0, 0, 1000), (-1200, -900, 0), (1200, -900, 0), (1200, 900, 0), (-1200, 900, 0)]
    section = Section(A=36.0, Ay=20.0, Az=20.0, J=1000.0, Iy=492.0, Iz=492.0)
    material = Material(E=200000.0, G=79300.0, density=7.85e-9)
    beam = {"section": section, "material": material, "gravity": (0, 0, -9806.33)}
    robot = frame(points, beams=[(1, 0), (0, 2), (0, 3), (4, 0)], fixed=(1, 2, 3, 4), tcp=0, **beam)
    found = displacement(robot, {"n0": [100, -200, -100, 0, 0, 0]}, gravity=True)
    assert [f"{value:.7f}" for value in found[:3]] == ["0.0141272", "-0.0502277", "-0.0223740"]
    assert [f"{value:.1e}" for value in found[3:5]] == ["3.6e-05", "8.1e-06"]
    # and the program's own digits, as far as its geometric stiffness leaves them
    assert found[:3] == pytest.approx([0.014127, -0.050229, -0.022374], rel=3e-5)
    assert np.abs(found[3:] - [3.7e-5, 9e-6, 0]).max() < 1.5e-6


# Portal frames: Kleinlogel & Haselbach, Rigid Frame Formulas, frames with fixed and with hinged feet


WIDTH, HEIGHT = 3.2, 2.1
COLUMN = Section(A=4e-3, Iy=1.5e-5, Iz=6e-6, J=1e-5)
GIRDER = Section(A=5e-3, Iy=4.0e-5, Iz=9e-6, J=1e-5)
K = GIRDER.Iy / COLUMN.Iy * HEIGHT / WIDTH
FORCE = 5000.0
TOLERANCE = 1e-9


def portal(hinged: bool) -> Robot:
    """Return a portal in the x-z plane: feet n0, n3 on the ground n4, n5, corners n1, n2.

    All members bend about y with Iy: `up` is along y.
    """
    points = [(0, 0, 0), (0, 0, HEIGHT), (WIDTH, 0, HEIGHT), (WIDTH, 0, 0), (0, 0, 0), (WIDTH, 0, 0)]
    foot = (RIGID, RIGID, FREE if hinged else RIGID, RIGID)  # about y
    members = [(0, 1), (1, 2), (2, 3)]
    return frame(
        points,
        beams=members,
        struts=[(i, j, RIGID) for i, j in members],
        joints=[(4, 0, (0, 1, 0), foot), (5, 3, (0, 1, 0), foot)],
        fixed=(4, 5),
        tcp=1,
        section=[COLUMN, GIRDER, COLUMN],
        up=(0, 1, 0),
    )


def end_moments(response: Response) -> np.ndarray:
    """Return the moments at both ends of the three members about the axis across the frame (3, 2)."""
    # `up` along y makes that the local y axis of every member
    return response.beam_forces[0, :, :, 4]


def test_sway_of_the_portal_with_fixed_feet() -> None:
    """M_A = -(P h / 2)(3 k + 1) / N2, M_B = (P h / 2) 3 k / N2, and the sway that goes with it."""
    response = solve(portal(hinged=False), {"n1": [FORCE, 0, 0, 0, 0, 0]})
    N2 = 6 * K + 1
    sway = FORCE * HEIGHT**3 * (3 * K + 2) / (12 * STEEL.E * COLUMN.Iy * N2)
    assert response.displacement[0, [1, 2], 0] == pytest.approx(sway, rel=TOLERANCE)
    moments = np.abs(end_moments(response))
    feet, corners = FORCE * HEIGHT / 2 * (3 * K + 1) / N2, FORCE * HEIGHT / 2 * 3 * K / N2
    assert moments == pytest.approx(
        np.array([[feet, corners], [corners] * 2, [corners, feet]]), rel=TOLERANCE
    )


def test_sway_of_the_portal_with_hinged_feet() -> None:
    """M_B = P h / 2, nothing at the feet."""
    response = solve(portal(hinged=True), {"n1": [FORCE, 0, 0, 0, 0, 0]})
    sway = FORCE * HEIGHT**3 * (2 * K + 1) / (12 * STEEL.E * COLUMN.Iy * K)
    assert response.displacement[0, [1, 2], 0] == pytest.approx(sway, rel=TOLERANCE)
    corner = FORCE * HEIGHT / 2
    expected = np.array([[0, corner], [corner, corner], [corner, 0]])
    assert np.abs(end_moments(response)) == pytest.approx(expected, rel=TOLERANCE, abs=TOLERANCE * corner)


@pytest.mark.parametrize("hinged", [False, True])
def test_uniform_load_on_the_girder(hinged: bool) -> None:
    """Its weight. Fixed feet: M_A = q l^2 / 12 N1, M_B = -q l^2 / 6 N1; hinged: M_B = -q l^2 / 4 N."""
    response = solve(portal(hinged), {}, gravity=True)
    q = 9.81 * STEEL.density * GIRDER.A
    corner = q * WIDTH**2 / (4 * (2 * K + 3)) if hinged else q * WIDTH**2 / (6 * (K + 2))
    foot = 0.0 if hinged else corner / 2
    expected = np.array([[foot, corner], [corner, corner], [corner, foot]])
    assert np.abs(end_moments(response)) == pytest.approx(expected, rel=TOLERANCE, abs=TOLERANCE * corner)
    thrust = (foot + corner) / HEIGHT
    assert np.abs(response.beam_forces[0, 0, 0, 2]) == pytest.approx(thrust, rel=TOLERANCE)
