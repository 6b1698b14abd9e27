"""A tripod of struts by its closed form: Timoshenko & Young, Theory of Structures, 2nd ed., ch. 7."""

import numpy as np
import pytest

from beamstiff.robot.description import Robot
from tests.fem.builders import displacement, frame

TOLERANCE = 1e-9


def with_a_beam(points: np.ndarray, **parts: object) -> Robot:
    """Return a truss with a beam apart from it, for the TCP needs a rotation."""
    count = len(points)
    aside = [(9.0, 9.0, 9.0), (9.0, 9.0, 10.0)]
    return frame([*points.tolist(), *aside], beams=[(count, count + 1)], fixed=(0, 1, 2, count), **parts)


def tripod(r: float, h: float, k: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness (3,) of three legs of length s to an apex over a circle: found, and closed form.

    With k = EA/s of a leg: 3 k (h/s)^2 down, 3/2 k (r/s)^2 aside.
    """
    angles = 2 * np.pi * np.arange(3) / 3
    feet = np.stack([r * np.cos(angles), r * np.sin(angles), np.zeros(3)], axis=1)
    robot = with_a_beam(np.concatenate([feet, [[0, 0, h]]]), struts=[(at, 3, k) for at in range(3)])
    s2 = r**2 + h**2
    found = [1.0 / displacement(robot, {"n3": np.eye(6)[axis]}, "n3")[axis] for axis in range(3)]
    return np.array(found), k * np.array([1.5 * r**2, 1.5 * r**2, 3 * h**2]) / s2


def test_tripod() -> None:
    found, expected = tripod(0.6, 1.1, 4e7)
    assert found == pytest.approx(expected, rel=TOLERANCE)
