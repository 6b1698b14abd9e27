"""Stiffness of a drive that follows the angle: shared by `actuator-lever` and `gravity-compensator`."""

from collections.abc import Callable

import numpy as np

from beamstiff.diagnosis.effects.effect import Normalisation
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, by_slips, counted
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

PHASES = np.arange(0, 2 * np.pi, np.pi / 8)
MODES = 6
FINE = np.arange(0, 2 * np.pi, np.pi / 12)


def scaled_torque(baseline: Baseline, axis: Axis, factors: Array) -> Array:
    """Return the displacements (N, 6, c) of slips of `factors` (N, c) times the torque."""
    return by_slips(axis.shift, factors * counted(baseline, axis)[:, None])


def fitted_angles(baseline: Baseline, variable: str) -> tuple[Array, Array]:
    """Return the joint's values in the rows that were fitted, and how many rows have each."""
    if baseline.stated is not None and "angles" in baseline.stated:
        return np.atleast_1d(baseline.stated["angles"]), np.atleast_1d(baseline.stated["counts"])
    angles, counts = np.unique(baseline.fit.joint_values[variable], return_counts=True)
    return angles, counts.astype(np.float64)


def angle_scales(baseline: Baseline, component: str | None) -> Normalisation:
    """Return the scales of effects that follow the angle: what of them varied over the rows fitted."""
    variable = axis_at(baseline, str(component)).joint.variable
    return {} if variable is None else values_fitted(baseline, variable)


def values_fitted(baseline: Baseline, variable: str) -> Normalisation:
    """Return the scales of effects that follow a variable: its values in the rows fitted, rows of each."""
    angles, counts = fitted_angles(baseline, variable)
    return {"angles": tuple(angles.tolist()), "counts": tuple(counts.tolist())}


class Following:
    """The angle of a joint in the rows, and in those that were fitted with the share of rows of each."""

    def __init__(self, baseline: Baseline, variable: str) -> None:
        self.angle = baseline.joint_values[variable]
        self.fitted, counts = fitted_angles(baseline, variable)
        self.share = counts / counts.sum()

    def varying(self, law: Callable[[Array], Array]) -> Array:
        """Return a law of the angle (N, ...) less its mean over the fitted rows, the drive's own."""
        return np.asarray(law(self.angle) - self.share @ law(self.fitted))

    def family(self, laws: Callable[[Array], Array]) -> Array:
        """Return the main modes (N, MODES) of a family of laws, (N,) to (N, m), each in its usual size.

        Laws drawn from the family, each varying by 1 (RMS over the fitted rows), have the second moments of
        the modes with standard normal factors (Karhunen and Loeve).
        """
        fitted = laws(self.fitted)
        mean = self.share @ fitted
        return np.asarray((laws(self.angle) - mean) @ self.mixture(fitted - mean))

    def mixture(self, fitted: Array) -> Array:
        """Return what mixes a family of laws at the fitted angles (F, m) into its main modes, (m, MODES)."""
        size = np.sqrt(self.share @ fitted**2)
        size = np.where(size > 0, size, np.inf)
        _, values, right = np.linalg.svd(np.sqrt(self.share)[:, None] * fitted / size, full_matrices=False)
        kept = values[: min(MODES, values.size)]
        # a mode's sign is free, but parameters that were written must mean the same on every machine
        sign = np.where(right @ np.cos(np.arange(fitted.shape[1])) < 0, -1.0, 1.0)[: kept.size]
        return np.asarray(sign * right[: kept.size].T / np.sqrt(fitted.shape[1]) / size[:, None])
