"""Sensitivity indices: how far a unit error moves and turns the tool (seed 003, eqs 55, 56)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from beamstiff.calibration.error_jacobian import Geometry
from beamstiff.calibration.parameters import Parameter
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class SensitivityIndices:
    """Norms of the columns of the error Jacobian; t parameters."""

    parameters: tuple[Parameter, ...]
    position: Array  # (N, t): mu_P: m per unit of the parameter, by row
    orientation: Array  # (N, t): mu_Phi: rad per unit

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(item.name for item in self.parameters)

    @property
    def units(self) -> tuple[str, ...]:
        """``"m"`` or ``"rad"``, of each parameter."""
        return tuple(item.unit for item in self.parameters)

    def some(self, names: Collection[str]) -> SensitivityIndices:
        """Return those of some parameters."""
        at = [number for number, item in enumerate(self.parameters) if item.name in names]
        own = tuple(self.parameters[number] for number in at)
        return SensitivityIndices(own, self.position[:, at], self.orientation[:, at])


def sensitivity_indices(geometry: Geometry, theta: Array | None = None) -> SensitivityIndices:
    """Return the sensitivity indices of the geometry's parameters at theta (t,); default as described."""
    at = np.zeros(len(geometry.parameters)) if theta is None else theta
    _, jacobian = geometry.jacobian(at)
    return SensitivityIndices(
        parameters=geometry.parameters,
        position=np.linalg.norm(jacobian[:, :3], axis=1),
        orientation=np.linalg.norm(jacobian[:, 3:], axis=1),
    )
