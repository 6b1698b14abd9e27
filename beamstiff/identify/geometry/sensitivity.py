"""Sensitivity indices: how far a unit error moves and turns the tool (seed 003, eqs 55, 56)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.identify.geometry.error_jacobian import Geometry
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class SensitivityIndices:
    """Norms of the columns of the error Jacobian; t parameters.

    Attributes
    ----------
    names, units : tuple of str (t)
        Unit ``"m"`` or ``"rad"`` of the parameter.
    position : (N, t) array
        mu_P: m per unit of the parameter, by row.
    orientation : (N, t) array
        mu_Phi: rad per unit.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    position: Array
    orientation: Array


def sensitivity_indices(geometry: Geometry, theta: Array | None = None) -> SensitivityIndices:
    """Return the sensitivity indices of the geometry's parameters.

    Parameters
    ----------
    geometry : Geometry
    theta : (t,) array, optional
        Where; the robot as described by default.
    """
    at = np.zeros(len(geometry.parameters)) if theta is None else theta
    _, jacobian = geometry.jacobian(at)
    return SensitivityIndices(
        names=tuple(item.name for item in geometry.parameters),
        units=tuple(item.unit for item in geometry.parameters),
        position=np.linalg.norm(jacobian[:, :3], axis=1),
        orientation=np.linalg.norm(jacobian[:, 3:], axis=1),
    )
