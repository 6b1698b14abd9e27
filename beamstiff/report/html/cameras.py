"""Where the robot is seen from in three dimensions, and how large it is drawn."""

from typing import Any

import numpy as np

from beamstiff.report.html.parts import numbers
from beamstiff.se3 import Array

DIAGONAL = 1.6  # of the figure's own lengths: that of its box, as in report.js; a wide robot must fit too
CAMERAS = {
    "oblique": {"eye": {"x": 1.25, "y": -1.45, "z": 0.65}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}},
    "front (along x)": {"eye": {"x": 1.9, "y": 0.0, "z": 0.0}},
    "side (along y)": {"eye": {"x": 0.0, "y": -1.9, "z": 0.0}},
    "top (along z)": {"eye": {"x": 0.0, "y": -0.01, "z": 2.0}},
}
# of the camera that looks across the deflection: from the axis, above the middle, and how far it is turned so
# that the axis that points at it is seen too
DISTANCE, HEIGHT, TURNED = 1.9, 0.5, np.radians(18.0)
LOWER = {"x": 0.0, "y": 0.0, "z": -0.12}  # what it looks at: room for the axes' names below
SPREAD = 0.3  # weight of the robot's own spread beside its deflection's, where the camera is chosen


def across(moved: Array, reach: Array) -> dict[str, Any]:
    """Return the camera that sees how the tool moved, and the robot from its side.

    `moved` (3,): of the tool. `reach` (3,): from the base to the tool.
    """
    seen = np.zeros((2, 2))
    for part, weight in ((moved, 1.0), (reach, SPREAD)):
        if (length := float(np.linalg.norm(part))) > 0.0:
            seen += weight * np.outer(part[:2], part[:2]) / length**2
    eye = np.linalg.eigh(seen)[1][:, 0]  # along which the least is seen
    eye = eye * (-1.0 if eye[1] > 1e-9 or (abs(eye[1]) <= 1e-9 and eye[0] < 0) else 1.0)  # from the front
    eye = np.array([[np.cos(TURNED), -np.sin(TURNED)], [np.sin(TURNED), np.cos(TURNED)]]) @ eye
    place = np.append(DISTANCE * eye, HEIGHT)
    return {"eye": dict(zip("xyz", numbers(place), strict=True)), "center": LOWER}
