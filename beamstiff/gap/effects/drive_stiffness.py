"""Stiffness of a drive that follows the angle: shared by `actuator-lever` and `gravity-compensator`."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline
from beamstiff.gap.effects.laws import Axis
from beamstiff.se3 import Array


def joint_values_of(baseline: Baseline, variable: str) -> Array:
    """Return a joint variable in every row, (N,): actuated ones as read, others with the loops closed."""
    from beamstiff.gap.baseline import unloaded_posture
    from beamstiff.robot.kinematics import compile_kinematics

    where, pose = unloaded_posture(baseline.nominal, baseline.rows)
    names = compile_kinematics(baseline.nominal).coupling.names
    result: Array = where.values[pose, list(names).index(variable)]
    return result


def scaled_torque(baseline: Baseline, axis: Axis, factor: Array) -> Array:
    """Return the displacement (N, 6) of a slip of `factor` (N,) times the torque."""
    torque = axis.load + axis.dead if baseline.absolute else axis.load
    result: Array = axis.shift * (factor * torque)[:, None]
    return result


def varying(factor: Array) -> Array:
    """Return a factor (N,) of the stiffness less its mean: a constant part is the drive's own."""
    result: Array = factor - factor.mean()
    return result


PHASES = np.arange(0, 2 * np.pi, np.pi / 8)
