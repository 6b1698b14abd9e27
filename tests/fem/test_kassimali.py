"""Kassimali, Matrix Analysis of Structures, 2nd ed., examples 6.6 (frame) and 8.1 (space truss); kip, in."""

import numpy as np

from beamstiff.robot.parts import Material
from beamstiff.robot.sections import Section
from tests.fem.builders import displacement, frame


def test_example_6_6_plane_frame() -> None:
    robot = frame(
        [(0, 0, 0), (120, 240, 0), (360, 240, 0)],
        beams=[(0, 1), (1, 2)],
        fixed=(0, 2),
        tcp=1,
        section=Section(A=11.8, Iy=77.0, Iz=310.0, J=5.0),
        material=Material(E=29000.0, G=11000.0),
        up=[(-2, 1, 0), (0, 1, 0)],
    )
    found = displacement(robot, {"n1": [0, -60, 0, 0, 0, -750]})[[0, 1, 5]]
    # to a unit of the last printed digit: the source rounds on the way
    assert (np.abs(found - [0.021302, -0.06732, -0.0025499]) <= [1e-6, 1e-5, 1e-7]).all()


def test_example_8_1_space_truss() -> None:
    feet = np.array([(0, 0, 0), (216, 0, 0), (144, 192, 0), (-72, 192, 0)], dtype=float)
    top = np.array([72.0, 96.0, 288.0])
    struts = [(at, 4, 10000.0 * 8.4 / float(np.linalg.norm(top - foot))) for at, foot in enumerate(feet)]
    # the TCP needs a rotation: a beam of its own stands aside
    points = [*feet.tolist(), top.tolist(), (500, 0, 0), (500, 0, 1)]
    robot = frame(points, struts=struts, beams=[(5, 6)], fixed=(0, 1, 2, 3, 5))
    found = displacement(robot, {"n4": [0, 50, -100, 0, 0, 0]}, "n4")
    assert [f"{value:.5f}" for value in found[:3]] == ["0.10913", "0.57202", "-0.12104"]
