"""Stiffness of a drive that follows the angle: shared by `actuator-lever` and `gravity-compensator`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamstiff.gap.baseline import Baseline, unloaded_posture
from beamstiff.gap.effects.laws import Axis
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

PHASES = np.arange(0, 2 * np.pi, np.pi / 8)
MODES = 4


def joint_values_of(baseline: Baseline, variable: str) -> Array:
    """Return a joint variable in every row, (N,): actuated ones as read, others with the loops closed."""
    where, pose = unloaded_posture(baseline.nominal, baseline.rows)
    names = compile_kinematics(baseline.nominal).coupling.names
    result: Array = where.values[pose, list(names).index(variable)]
    return result


def scaled_torque(baseline: Baseline, axis: Axis, factor: Array) -> Array:
    """Return the displacement (N, 6) of a slip of `factor` (N,) times the torque."""
    torque = axis.load + axis.dead if baseline.absolute else axis.load
    result: Array = axis.shift * (factor * torque)[:, None]
    return result


class Following:
    """The angle of a joint in the rows and in those that were fitted."""

    def __init__(self, baseline: Baseline, variable: str) -> None:
        self.angle = joint_values_of(baseline, variable)
        self.fitted = self.angle if baseline.fit is baseline else joint_values_of(baseline.fit, variable)

    def varying(self, law: Callable[[Array], Array]) -> Array:
        """Return a law of the angle (N,) less its mean over the fitted rows, which is the drive's own."""
        result: Array = law(self.angle) - law(self.fitted).mean()
        return result

    def family(self, laws: Callable[[Array], Array]) -> Array:
        """Return the main modes (N, MODES) of a family of laws, (N,) to (N, m), each in its usual size.

        Laws drawn from the family, with any factor of mean square 1, have the second moments of the modes
        with standard normal factors (Karhunen and Loeve).
        """
        fitted = laws(self.fitted)
        mean = fitted.mean(axis=0)
        _, values, right = np.linalg.svd(fitted - mean, full_matrices=False)
        kept = values[: min(MODES, values.size)]
        weight = right[: kept.size].T / np.sqrt(fitted.shape[1])
        result: Array = (laws(self.angle) - mean) @ weight
        return result
