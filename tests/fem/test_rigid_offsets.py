"""Beams with rigid ends: Weaver & Gere, Matrix Analysis of Framed Structures, 3rd ed., section 6.15.

Of a beam of flexible length L between rigid ends a and b, with both outer ends on hinges, the stiffness is
4 E I / L (1 + 3 a/L + 3 a^2/L^2) near and 2 E I / L (1 + 3 (a + b)/L + 6 a b/L^2) far.
"""

import numpy as np
import pytest

from tests.fem.builders import FREE, RIGID, SECTION, STEEL, compliance, direct_error, frame, solve

a, b, LENGTH = 0.25, 0.4, 1.5
EI = STEEL.E * SECTION.Iz
TOLERANCE = 1e-9


def test_stiffness_of_a_beam_between_rigid_ends() -> None:
    at = np.cumsum([0, a, LENGTH, b])
    points = [(0, 0, 0), *((x, 0, 0) for x in at), (at[-1], 0, 0)]
    hinge = (RIGID, RIGID, FREE, RIGID)
    z = (0, 0, 1)
    parts = {"beams": [(2, 3)], "rigids": [(1, 2), (4, 3)], "joints": [(0, 1, z, hinge), (5, 4, z, hinge)]}
    robot = frame(points, fixed=(0, 5), tcp=1, up=(0, 1, 0), **parts)
    turns = []
    for node in ("n1", "n4"):
        turns.append(solve(robot, {node: [0, 0, 0, 0, 0, 1.0]}).displacement[0, [1, 4], 5])
    near = 4 * EI / LENGTH * (1 + 3 * a / LENGTH + 3 * a**2 / LENGTH**2)
    other = 4 * EI / LENGTH * (1 + 3 * b / LENGTH + 3 * b**2 / LENGTH**2)
    far = 2 * EI / LENGTH * (1 + 3 * (a + b) / LENGTH + 6 * a * b / LENGTH**2)
    expected = np.linalg.inv([[near, far], [far, other]])
    assert np.abs(np.array(turns) - expected).max() <= TOLERANCE * np.abs(expected).max()


ARMS = [(0.3, 0, 0), (0, 0.2, 0), (0.1, -0.4, 0.25)]


def error_on_a_rigid_arm(arm: tuple[float, ...], rigids: int) -> float:
    """Return the error of C at the end of a rigid arm on a beam's tip, by the direct compliances.

    It is X C X^T: a force has a lever on the tip, which carries the arm.
    """
    tip = np.array([LENGTH, 0, 0])
    points = [(0, 0, 0), *(tip + np.array(arm) * at / rigids for at in range(rigids + 1))]
    chain = [(at, at + 1) if at % 2 else (at + 1, at) for at in range(1, rigids + 1)]
    robot = frame(points, beams=[(0, 1)], rigids=chain)
    bare = compliance(frame(points[:2], beams=[(0, 1)]))
    X = np.eye(6)
    X[:3, 3:] = np.cross(np.eye(3), arm).T  # columns e_i x arm: the tip's turn moves the tool by r x arm
    return float(direct_error(compliance(robot), X @ bare @ X.T).max())


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("rigids", [1, 4])
def test_tool_on_a_rigid_arm(arm: tuple[float, ...], rigids: int) -> None:
    assert error_on_a_rigid_arm(arm, rigids) <= TOLERANCE


def test_a_rigid_of_zero_length_welds_two_nodes() -> None:
    apart = frame([(0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 1, 0)], beams=[(0, 1), (2, 3)], rigids=[(1, 2)])
    whole = frame([(0, 0, 0), (1, 0, 0), (1, 1, 0)], beams=[(0, 1), (1, 2)])
    assert compliance(apart) == pytest.approx(compliance(whole), rel=1e-12, abs=1e-20)
