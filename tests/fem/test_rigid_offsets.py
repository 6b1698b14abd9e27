"""A tool on a rigid arm: the tip of the beam that carries it turns it about a lever."""

import numpy as np
import pytest

from tests.fem.builders import compliance, direct_error, frame

LENGTH = 1.5
TOLERANCE = 1e-9


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
