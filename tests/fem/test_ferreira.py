"""Ferreira, MATLAB Codes for Finite Element Analysis, example 8.3: a space frame with Iy != Iz (kN, m)."""

import numpy as np

from beamstiff.robot.parts import Material
from beamstiff.robot.sections import Section
from tests.fem.builders import displacement, frame

POINTS = [(0, 0, 0), (3, 0, 0), (0, 0, -3), (0, -4, 0)]


def test_example_8_3() -> None:
    # there local y is across the member and `up` (z; x for members along z); ours lies in their plane
    axes = [np.subtract(POINTS[end], POINTS[0]) for end in (1, 2, 3)]
    ups = [(0, 0, 1), (1, 0, 0), (0, 0, 1)]
    robot = frame(
        POINTS,
        beams=[(0, 1), (0, 2), (0, 3)],
        fixed=(1, 2, 3),
        tcp=0,
        section=Section(A=0.02, Iy=1e-4, Iz=2e-4, J=5e-5),
        material=Material(E=2.1e8, G=8.4e7),
        up=[tuple(np.cross(up, axis)) for up, axis in zip(ups, axes, strict=True)],
    )
    found = displacement(robot, {"n0": [-10, 0, 20, 0, 0, 0]})
    printed = np.array([-7.05, -0.07, 14.18, 1.45, 1.75, 1.14])
    assert np.abs(1e6 * found - printed).max() <= 0.0051
