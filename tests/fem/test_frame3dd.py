"""Frame3DD, example B: a pyramid of shear beams under its own weight and a load at the top (N, mm).

The numbers are the program's printed results, with geometric stiffness switched on there; a linear solver
gives 0.0141272, -0.0502277 and -0.0223740 mm, 3.59e-5 and 8.1e-6 rad.
"""

import numpy as np
import pytest

from beamstiff.robot.parts import Material
from beamstiff.robot.sections import Section
from tests.fem.builders import displacement, frame

POINTS = [(0, 0, 1000), (-1200, -900, 0), (1200, -900, 0), (1200, 900, 0), (-1200, 900, 0)]


def test_example_B_first_load_case() -> None:
    robot = frame(
        POINTS,
        beams=[(1, 0), (0, 2), (0, 3), (4, 0)],
        fixed=(1, 2, 3, 4),
        tcp=0,
        section=Section(A=36.0, Ay=20.0, Az=20.0, J=1000.0, Iy=492.0, Iz=492.0),
        material=Material(E=200000.0, G=79300.0, density=7.85e-9),
        gravity=(0, 0, -9806.33),
    )
    found = displacement(robot, {"n0": [100, -200, -100, 0, 0, 0]}, gravity=True)
    assert [f"{value:.7f}" for value in found[:3]] == ["0.0141272", "-0.0502277", "-0.0223740"]
    assert [f"{value:.1e}" for value in found[3:5]] == ["3.6e-05", "8.1e-06"]
    # and the program's own digits, as far as its geometric stiffness leaves them
    assert found[:3] == pytest.approx([0.014127, -0.050229, -0.022374], rel=3e-5)
    assert np.abs(found[3:] - [3.7e-5, 9e-6, 0]).max() < 1.5e-6
