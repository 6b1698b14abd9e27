"""Kinematic parameters that deviate by cube of the workspace (seed 001, eqs 1, 2 and 12).

Per joint the zero of its encoder, and the `alpha`, `d` and `r` of its frame: 24 of six joints in a row.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.robot.closure import close_loops
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.frames import MOTIONS, Kinematics, widened
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture_at, twist_jacobian
from beamstiff.se3 import Array, vector_from_rotation

OF_A_FRAME = ("alpha", "d", "r")


@dataclass(frozen=True, eq=False)
class CubeDeviations:
    """K kinematic parameters by cube, off what the robot says."""

    parameters: tuple[str, ...]
    values: Array  # (C, K), m and rad


def kinematic_parameters(robot: Robot) -> tuple[str, ...]:
    """Return the encoders' zeros, and what is constant of the frames' alpha, d and r.

    Of a robot with closed loops the zeros alone: most other deviations would open a loop.
    """
    zeros = [variable.name for variable in robot.actuated]
    if robot.loops:
        return tuple(zeros)
    frames = [
        f"{frame}.{name}"
        for frame, expressions in frame_expressions(robot).items()
        for name in OF_A_FRAME
        if not expressions[name].coefficients
    ]
    return (*zeros, *frames)


@dataclass(frozen=True, eq=False)
class Deviating:
    """A robot whose kinematic parameters may differ from row to row."""

    robot: Robot
    kinematics: Kinematics  # the frames' parameters behind the actuated variables
    columns: tuple[int, ...]  # (K,): of each parameter, among these

    def offsets(self, q: Array, deviations: Array) -> Array:
        """Return what deviations (N, K) move the unloaded TCP in postures (N, A), (N, 6) ``[d, r]``."""
        before, after = (self._tcp(q, some) for some in (0.0 * deviations, deviations))
        turned = after[:, :3, :3] @ before[:, :3, :3].swapaxes(-1, -2)
        return np.hstack([after[:, :3, 3] - before[:, :3, 3], vector_from_rotation(turned)])

    def jacobian(self, q: Array, deviations: Array) -> Array:
        """Return the derivatives of the TCP's place by the deviations, (N, 6, K)."""
        where = posture_at(self.kinematics, self._values(q, deviations))
        twists = twist_jacobian(self.kinematics, where, self.robot.tcp)
        return twists[:, :, list(self.columns)]

    def _tcp(self, q: Array, deviations: Array) -> Array:
        where = posture_at(self.kinematics, self._values(q, deviations))
        return pose_of(self.kinematics, where, self.robot.tcp)

    def _values(self, q: Array, deviations: Array) -> Array:
        wide = np.zeros((len(q), self.kinematics.coupling.actuated))
        wide[:, : q.shape[1]] = q
        wide[:, list(self.columns)] += deviations
        return close_loops(self.kinematics, wide)[0]


def deviating(robot: Robot, parameters: Sequence[str]) -> Deviating:
    """Return a robot with kinematic parameters, by name, that may differ from row to row."""
    kinematics = compile_kinematics(robot)
    actuated = [variable.name for variable in robot.actuated]
    known = kinematic_parameters(robot)
    motions = [name for name, _, _ in MOTIONS]
    frames: list[tuple[int, int]] = []
    columns = []
    for name in parameters:
        if name not in known:
            raise BeamstiffError(
                f"unknown kinematic parameter {name!r}{suggest(name, known)}; known: {listed(known, 30)}"
            )
        if name in actuated:
            columns.append(actuated.index(name))
            continue
        frame, _, motion = name.rpartition(".")
        columns.append(len(actuated) + len(frames))
        frames.append((kinematics.frame_index[frame], motions.index(motion)))
    return Deviating(robot, widened(kinematics, frames) if frames else kinematics, tuple(columns))
