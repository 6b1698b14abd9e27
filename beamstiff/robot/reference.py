"""The reference posture of a robot: where its numbers are given unless another posture is asked for."""

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.parts import Variable
from beamstiff.se3 import Array


def reference_posture(robot: Robot) -> Array:
    """Return the actuated joint values (A,) of the reference: mid limits, or a sample that closes."""
    kinematics = compile_kinematics(robot)
    q = sampled_postures(robot, 1000, 0)
    for some in (q[:1], q):
        closure = close_loops(kinematics, some, strict=False)
        if closure.closed.any():
            return np.asarray(some[int(np.argmax(closure.closed))])
    raise BeamstiffError(
        f"robot {robot.name!r}: none of {len(q)} postures closes the loops: {closure.reasons[0]}"
    )


def sampled_postures(robot: Robot, count: int, seed: int) -> Array:
    """Return actuated joint values (1 + count, A): the middle of the limits, then samples within them."""
    limits = np.array([_range(variable) for variable in robot.actuated], dtype=np.float64).reshape(-1, 2)
    drawn = np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    return np.concatenate([limits.mean(axis=1)[None], drawn])


def _range(variable: Variable) -> tuple[float, float]:
    if variable.limits is not None:
        return variable.limits
    return (-np.pi, np.pi) if variable.kind == "angle" else (0.0, 0.0)
