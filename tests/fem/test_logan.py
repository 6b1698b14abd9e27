"""Logan, A First Course in the Finite Element Method, 4th ed., example 5.8: a space frame (kip, inch)."""

import numpy as np

from beamstiff.robot.parts import Material
from beamstiff.robot.sections import Section
from tests.fem.builders import displacement, frame


def test_example_5_8() -> None:
    robot = frame(
        [(0, 0, 0), (-100, 0, 0), (0, 0, -100), (0, -100, 0)],
        beams=[(1, 0), (2, 0), (3, 0)],
        fixed=(1, 2, 3),
        tcp=0,
        section=Section(A=10.0, Iy=100.0, Iz=100.0, J=50.0),
        material=Material(E=30000.0, G=10000.0),
        up=(1, 1, 1),
    )
    found = displacement(robot, {"n0": [0, -50, 0, -1000, 0, 0]})
    printed = np.array([7.098e-5, -0.014, -2.352e-3, -3.996e-3, 1.78e-5, -1.033e-4])
    # a unit of the last printed digit: the source rounds on the way
    digits = np.array([1e-8, 1e-3, 1e-6, 1e-6, 1e-7, 1e-7])
    assert (np.abs(found - printed) <= digits).all()
