"""The parts of a robot as lines that move, bent as beams bend, and the cameras from which they are seen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.report.html.parts import numbers, places
from beamstiff.report.vtk import beam_shape
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

BENT, STRAIGHT = 9, 3  # points along a beam, and along what stays straight
MOST_LINKS = 2000  # that are drawn
JOINT = 0.035  # of the robot's size: half the length of a joint
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


@dataclass(frozen=True)
class Lines:
    """Lines with a gap after each: n points, how they move, the part that each belongs to."""

    points: Array  # (n, 3), NaN in the gaps
    moved: Array  # (n, 3)
    names: Sequence[str]

    def moving(self, still: bool = False) -> dict[str, Any]:
        """Return the lines as a trace; `still`: they stay where they are."""
        return places(self.points, None if still else self.moved)

    def middles(self) -> dict[str, tuple[Array, Array]]:
        """Return the middle of every line and how it moves, by its name."""
        ends = np.flatnonzero(np.isnan(self.points[:, 0]))
        starts = np.concatenate([[0], ends[:-1] + 1])
        middle = (starts + ends - 1) // 2
        return {self.names[at]: (self.points[at], self.moved[at]) for at in middle.tolist()}


def link_lines(robot: Robot, positions: Array, moved: Array) -> Lines:
    """Return beams, rigids and struts, at most `MOST_LINKS`, at positions (N, 3) that moved by (N, 6)."""
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    parts = [(beam.name, beam.nodes, True) for beam in robot.beams]
    parts += [(rigid.name, rigid.nodes, False) for rigid in robot.rigids]
    parts += [(strut.name, strut.nodes, False) for strut in robot.struts]
    if len(parts) > MOST_LINKS:
        parts = [parts[at] for at in np.linspace(0, len(parts) - 1, MOST_LINKS).astype(int)]

    def lines() -> Iterator[tuple[str, Array, Array]]:
        for name, nodes, bends in parts:
            (a, b), s = (index[node] for node in nodes), np.linspace(0.0, 1.0, BENT if bends else STRAIGHT)
            points, way = (np.outer(1 - s, one[a]) + np.outer(s, one[b]) for one in (positions, moved[:, :3]))
            if bends:
                way = beam_shape(positions[a], positions[b], moved[a], moved[b], s)[:, :3]
            yield name, points, way

    return _joined(lines())


def joint_lines(robot: Robot, q: Array, positions: Array, moved: Array, size: float) -> Lines:
    """Return a short line along the axis of every joint, which turns as its node does."""
    kinematics = compile_kinematics(robot)
    rotations = posture(kinematics, q[None]).transforms[0, :, :3, :3]

    def lines() -> Iterator[tuple[str, Array, Array]]:
        for joint in robot.joints:
            node = kinematics.node_index[joint.nodes[0]]
            direction = rotations[kinematics.frame_index[joint.frame]] @ np.array(joint.axis)
            direction = direction / np.linalg.norm(direction)
            arms = JOINT * size * np.array([-1.0, 0.0, 1.0])[:, None] * direction
            way = moved[node, :3] + np.cross(moved[node, 3:], arms)
            yield component_of(robot, joint), positions[node] + arms, way

    return _joined(lines())


def _joined(lines: Iterator[tuple[str, Array, Array]]) -> Lines:
    points, moved, names = [np.zeros((0, 3))], [np.zeros((0, 3))], list[str]()
    for name, at, way in lines:
        points += [at, np.full((1, 3), np.nan)]
        moved += [way, np.zeros((1, 3))]
        names += [name] * (len(at) + 1)
    return Lines(np.concatenate(points), np.concatenate(moved), names)


def across(moved: Array, reach: Array) -> dict[str, Any]:
    """Return the camera that sees how the tool moved (3,), and the robot that reaches (3,) from its side."""
    seen = np.zeros((2, 2))
    for part, weight in ((moved, 1.0), (reach, SPREAD)):
        if (length := float(np.linalg.norm(part))) > 0.0:
            seen += weight * np.outer(part[:2], part[:2]) / length**2
    eye = np.linalg.eigh(seen)[1][:, 0]  # along which the least is seen
    eye = eye * (-1.0 if eye[1] > 1e-9 or (abs(eye[1]) <= 1e-9 and eye[0] < 0) else 1.0)  # from the front
    eye = np.array([[np.cos(TURNED), -np.sin(TURNED)], [np.sin(TURNED), np.cos(TURNED)]]) @ eye
    place = np.append(DISTANCE * eye, HEIGHT)
    return {"eye": dict(zip("xyz", numbers(place), strict=True)), "center": LOWER}
