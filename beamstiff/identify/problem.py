"""The identification problem: whitened residuals of all measured components, with exact derivatives.

Parameters are the logarithms of stiffness values: stiffness is positive, and its uncertainty is a factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Problem:
    """Residuals ``W (measured - predicted)`` over the measured components.

    Attributes
    ----------
    model : PortModel
        m open stiffness values, N rows.
    measured : (N, 6) array
        Displacement ``[d, r]``; NaN where not measured or not used.
    used : (N, 6) bool array
    sigma : (6,) array
        Standard deviation of each component, m and rad.
    sigma_known : bool
        Whether the noise was stated; if not, it is estimated from the residual.
    groups : (N,) int array
        Rows that share one unloaded reading; -1 where every row has its own.
    """

    model: PortModel
    measured: Array
    used: NDArray[np.bool_]
    sigma: Array
    sigma_known: bool
    groups: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of measured components used."""
        return int(self.used.sum())

    def residuals(self, stiffness: Array) -> Array:
        """Return the whitened residuals, (count,)."""
        return self._whiten(np.where(self.used, self.measured - self.model.predict(stiffness), 0.0))[
            self.used
        ]

    def jacobian(self, stiffness: Array) -> tuple[Array, Array]:
        """Return whitened residuals (count,) and their derivatives (count, m) by the log of the stiffness."""
        predicted, by_stiffness = self.model.derivatives(stiffness)
        residual = self._whiten(np.where(self.used, self.measured - predicted, 0.0))[self.used]
        by_log = np.where(self.used[..., None], -by_stiffness * stiffness, 0.0)
        columns = [self._whiten(by_log[..., at])[self.used] for at in range(stiffness.size)]
        return residual, np.stack(columns, axis=-1) if columns else np.zeros((residual.size, 0))

    def _whiten(self, values: Array) -> Array:
        """Scale by the noise, and decorrelate the rows that were differenced with one unloaded reading.

        For n rows that share a reading the covariance is ``sigma^2 (I + 1 1^T) / 2``: its inverse root takes
        the mean out and puts it back with its own weight.
        """
        scaled = values / self.sigma
        for group in np.unique(self.groups[self.groups >= 0]):
            rows = self.groups == group
            for component in range(6):
                at = rows & self.used[:, component]
                n = int(at.sum())
                if n:
                    mean = scaled[at, component].mean()
                    scaled[at, component] = np.sqrt(2.0) * (scaled[at, component] - mean) + mean / np.sqrt(
                        (1 + n) / 2
                    )
        return scaled


def state_problem(
    robot: Robot, measurements: Measurements, parameters: Sequence[str] | None = None
) -> Problem:
    """Return the identification problem of a robot and its measured displacements.

    Parameters
    ----------
    robot : Robot
    measurements : Measurements
        Displacements, loaded minus unloaded.
    parameters : sequence of str, optional
        Stiffness values to identify; default ``robot.identify``.

    Raises
    ------
    BeamstiffError
        When the rows are absolute positions, carry no load, or are fewer than the parameters.
    """
    if measurements.kind != "displacement":
        raise BeamstiffError(
            f"{measurements.source}: holds absolute positions; "
            "identify needs displacements dx dy dz (loaded minus unloaded)"
        )
    model = reduce_to_ports(robot, measurements, parameters)
    if not (np.abs(measurements.wrench) > 0).any():
        raise BeamstiffError(
            f"{measurements.source}: all loads are zero; without load no stiffness can be identified"
        )
    measured = measurements.displacement.copy()
    sigma_position, sigma_rotation = measurements.sigma_position, measurements.sigma_rotation
    if sigma_rotation is None:
        measured[:, 3:] = np.nan  # metres and radians compare only by their noise
    known = sigma_position is not None
    sigma = np.array([sigma_position or 1e-5] * 3 + [sigma_rotation or 1e-5] * 3)
    used = ~np.isnan(measured)
    if not known and sigma_rotation is not None:
        raise BeamstiffError(
            f"{measurements.source}: sigma_rotation is given, expected sigma_position as well"
        )
    if used.sum() < len(model.parameters):
        raise BeamstiffError(
            f"{measurements.source}: {int(used.sum())} measured components for "
            f"{len(model.parameters)} parameters "
            f"({', '.join(model.parameters)}); measure more, or identify fewer"
        )
    groups = measurements.pose if measurements.shared_unloaded else np.full(len(measurements.pose), -1)
    return Problem(model, measured, used, sigma, known, np.asarray(groups, dtype=np.int64))
