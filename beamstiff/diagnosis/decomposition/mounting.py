"""Whether gravity acts along another axis of the base than the robot file says, as on a wall or a ceiling.

What the weight moves is linear in gravity: with compliances c of the drives a point moves by
``(A_w + sum_i g_i A_i) c``, A_w of the row's load and A_i of the weight along axis i. Each direction asks for
compliances of its own, none negative; the geometry is free beside them. Another direction than the stated one
is told where it leaves less than half, without any cause.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from beamstiff.calibration.elastic import elastic_displacement
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.residual.baseline import own_direction
from beamstiff.measure.misread_columns import ALIKE, NEARER, SHOWS
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

STIFF = 1e9  # N m/rad, N/m: of drives that are rigid, about which the columns of compliances are linear
SLANT = 1e-3  # to which a slanted direction is sought
START = 0.3  # beside an axis, where that search starts


@dataclass(frozen=True)
class Mounting:
    """Gravity that fits better than that of the robot file.

    `gravity`: m/s^2, base axes. `stated`, `left`: what each leaves of the positions without a cause, RMS over
    the noise.
    """

    gravity: tuple[float, float, float]
    stated: float
    left: float

    @property
    def text(self) -> str:
        """Return it as a sentence."""
        return (
            f"with gravity {list(self.gravity)} m/s^2 (base axes) the weight explains the positions "
            f"{self.stated / self.left:.2g} times as well as with that of the robot file: how is the robot "
            "mounted? `gravity` in the robot file, or beamstiff convert --gravity, states it"
        )


def other_mounting(model: OpenModel) -> Mounting | None:
    """Return gravity that leaves less than half of what the stated one leaves; None if there is none."""
    robot = model.baseline.robot
    size = float(np.linalg.norm(robot.gravity))
    names = _drives(robot)
    if model.problem is None or not names or not size or not robot.masses:
        return None
    left_over = _left_over(model, names, size)
    stated = left_over(np.array(robot.gravity) / size)
    if stated < SHOWS:
        return None
    axes = [sign * axis for axis, sign in product(np.eye(3), (1.0, -1.0))]
    best = min(axes, key=left_over)
    found: OptimizeResult = minimize(left_over, (best + START).tolist(), method="Nelder-Mead", tol=SLANT)
    slanted = found.x / np.linalg.norm(found.x)
    if left_over(best) > ALIKE * left_over(slanted):
        best = slanted
    if left_over(best) > NEARER * stated:
        return None
    x, y, z = (float(f"{value:.3g}") + 0.0 for value in np.round(size * best, 2))
    return Mounting((x, y, z), stated, left_over(best))


def _drives(robot: Robot) -> list[str]:
    """Return the stiffness values of the driven joints about, or along, their own axes."""
    driven = {variable.name for variable in robot.actuated}
    moved = [joint.name for joint in robot.joints if joint.variable in driven]
    return [f"{name}.{own_direction(robot, name)}" for name in moved]


def _left_over(model: OpenModel, names: list[str], size: float) -> Callable[[Array], float]:
    """Return what the best compliances leave under gravity along a vector (3,), RMS over the noise."""
    robot, rows, basis = model.baseline.robot, model.baseline.rows, model.open_basis
    stiff = robot.with_parameters(dict.fromkeys(names, STIFF))

    def moved_by(gravity: Array, wrench: Array) -> Array:
        """Return the displacement with rigid drives, and its slopes by their compliances, (n + p, 1 + d)."""
        loaded = stiff.model_copy(update={"gravity": tuple(gravity.tolist())})
        under = replace(rows, wrench=wrench)
        ports = reduce_to_ports(loaded, under, names, gravity=True)
        slopes = ports.derivatives(np.full(len(names), STIFF), by="compliance")[1]
        every = np.concatenate([elastic_displacement(loaded, under)[..., None], slopes], axis=2)
        return model.beside_geometry(every)

    by_wrench = moved_by(np.zeros(3), rows.wrench)
    by_axis = [moved_by(size * axis, np.zeros_like(rows.wrench)) for axis in np.eye(3)]
    whole = model.residual[:, None] - basis @ (basis.T @ model.residual[:, None])
    whole = whole + model.beside_geometry(elastic_displacement(robot, rows)[..., None])
    # all that is asked is within the columns: their triangular factor says as much as they do
    small = np.asarray(np.linalg.qr(np.concatenate([whole, by_wrench, *by_axis], axis=1), mode="r"))
    target, (loads, *weights) = small[:, 0], np.split(small[:, 1:], 4, axis=1)

    def left_over(gravity: Array) -> float:
        direction = gravity / np.linalg.norm(gravity)
        moved = loads + sum(share * weight for share, weight in zip(direction, weights, strict=True))
        return model.left_by_drives(moved[:, 1:], target - moved[:, 0])

    return left_over
