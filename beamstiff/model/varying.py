"""Displacements where springs change their compliance with the configuration: a value each row.

Models that let joint compliances vary (over cubes of the workspace, by fuzzy rules, as Gaussian processes)
differ in how they come by these values only. All have the physics in common: whatever positive compliances
come out, the compliance at the TCP is symmetric and positive definite.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.measure.table import make_measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


def displaced(model: PortModel, compliance: Array) -> Array:
    """Return the displacement of every row (N, 6) for compliances (N, m), equal in rows of a pose."""
    if model.by_compliance is not None:
        return model.clamped + (model.by_compliance @ compliance[..., None])[..., 0]
    opened = (_inverse(model, compliance)[model.pose] @ model.force[..., None])[..., 0]
    return model.displaced(opened)


def displaced_with_slopes(model: PortModel, compliance: Array) -> tuple[Array, Array]:
    """Return displacements (N, 6), and derivatives (N, 6, m) by the logarithms of the row's compliances."""
    if model.by_compliance is not None:
        by_log = model.by_compliance * compliance[:, None, :]
        series: Array = model.clamped + by_log.sum(axis=2)
        return series, by_log
    inverse = _inverse(model, compliance)[model.pose]
    opened = (inverse @ model.force[..., None])[..., 0]
    carried = inverse @ model.motion  # (N, p, 6)
    pulled = np.tensordot(opened, model.springs, ([1], [2])) / compliance[..., None]  # (N, m, p)
    return model.displaced(opened), carried.swapaxes(-1, -2) @ pulled.swapaxes(-1, -2)


def _inverse(model: PortModel, compliance: Array) -> Array:
    """Return ``(S + sum_j Phi_j / c_j)^-1`` of every pose, (P, p, p)."""
    _, first = np.unique(model.pose, return_index=True)
    matrix = model.port_stiffness + np.tensordot(1.0 / compliance[first], model.springs, 1)
    size = 1.0 / np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scaled = np.linalg.inv(matrix * size[:, :, None] * size[:, None, :])
    return scaled * size[:, :, None] * size[:, None, :]


def ports_at(robot: Robot, parameters: Sequence[str], q: ArrayLike, wrench: ArrayLike) -> PortModel:
    """Return the robot reduced to the springs that vary, in postures (N, A) under loads (N, 6) at the TCP."""
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=wrench)
    return reduce_to_ports(robot, rows, parameters)
