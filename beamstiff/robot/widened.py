"""Kinematics whose frames' parameters are joint variables too: how the machine moves with each of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamstiff.robot.coupling import Coupling
from beamstiff.robot.frames import MOTIONS, Kinematics


def widened(kinematics: Kinematics, parameters: Sequence[tuple[int, int]]) -> Kinematics:
    """Return the kinematics with parameters (frame, motion) of its frames as actuated variables too.

    They stand behind the actuated ones, and count from the present constants: their value is 0.
    """
    joined, extra = kinematics.coupling, len(parameters)
    variables, free, actuated = *joined.matrix.shape, joined.actuated
    matrix = np.zeros((variables + extra, free + extra))
    matrix[:variables, :actuated] = joined.matrix[:, :actuated]
    matrix[:variables, actuated + extra :] = joined.matrix[:, actuated:]
    matrix[variables:, actuated : actuated + extra] = np.eye(extra)
    coefficients = np.zeros((*kinematics.coefficients.shape[:2], variables + extra))
    coefficients[:, :, :variables] = kinematics.coefficients
    names = []
    for at, (frame, motion) in enumerate(parameters):
        coefficients[frame, motion, variables + at] = 1.0
        names.append(f"{kinematics.frame_names[frame]}.{MOTIONS[motion][0]}")
    shifts = [MOTIONS[motion][1] == "shift" for _, motion in parameters]
    return replace(
        kinematics,
        coupling=Coupling(
            names=(*joined.names, *names),
            free=(*joined.free[:actuated], *names, *joined.free[actuated:]),
            actuated=actuated + extra,
            matrix=matrix,
            offset=np.concatenate([joined.offset, np.zeros(extra)]),
        ),
        prismatic=np.concatenate([kinematics.prismatic, np.array(shifts, dtype=np.bool_)]),
        coefficients=coefficients,
    )
