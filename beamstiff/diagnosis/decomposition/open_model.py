"""The model with all that was fitted left open: geometry, frames, reflectors and drives beside the causes.

A rigid calibration takes up part of every cause (the sag of a machine stands in its base frame then). So the
causes are not sought in what a calibration leaves, but beside it: residual and tangent are those of one least
squares problem, linear about the calibrated robot, and a cause counts by what the tangent cannot take up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.calibrate import calibrate, calibrated
from beamstiff.calibration.problem import Problem
from beamstiff.calibration.statement import state_calibration
from beamstiff.calibration.validation import in_base_frame
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.identification.problem import whitening
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

INDEPENDENT = 1e-7  # singular value of unit columns, of the largest, below which a direction is rounding


@dataclass(frozen=True, eq=False)
class OpenModel:
    """A least squares problem in units of the stated noise; n measured values, t open parameters.

    Attributes
    ----------
    baseline : Baseline
        About which effects are linear: calibrated where the geometry is open, nothing fitted to the rows.
    residual : (n,) array
    tangent : (n, t) array
    pose : (n,) int array
        Posture of every value.
    weigh : (n, n) sparse array
        Turns measured values into these units.
    problem : Problem or None
        The calibration, where the geometry is open.
    """

    baseline: Baseline
    residual: Array
    tangent: Array
    pose: Integers
    weigh: object
    problem: Problem | None = None

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which components count, (N, 6)."""
        return self.baseline.used

    def weighed(self, columns: Array) -> Array:
        """Return columns (N, 6, c) of the rows in units of the noise, (n, c)."""
        result: Array = self.weigh @ columns[self.used]
        return result

    def robot(self, change: Array) -> Robot:
        """Return the robot with the open parameters changed by (t,)."""
        if self.problem is None:
            fitted = self.baseline.fitted
            compliance = np.array([1.0 / self.baseline.robot.parameter(name) for name in fitted]) + change
            least = 1e-4 / np.array([self.baseline.robot.parameter(name) for name in fitted])
            values = 1.0 / np.maximum(compliance, least)
            return self.baseline.robot.with_parameters(dict(zip(fitted, values.tolist(), strict=True)))
        found = calibrated(self.baseline.nominal, self.problem, self.problem.expected + change)
        return found


def open_geometry(robot: Robot, rows: Measurements, moved: Array | None = None) -> OpenModel:
    """Return the open model of absolute readings: geometry, base frame, reflectors and drives are free.

    Parameters
    ----------
    robot : Robot
        Where the calibration starts.
    rows : Measurements
        In any measuring frame.
    moved : (N, 6) array, optional
        What causes move the points, in the frame of the rows: the model is linear about the calibration beside
        them.

    Raises
    ------
    BeamstiffError
        As of `calibrate`: too few readings, a pose that does not close its loops.
    """
    bare = robot.model_copy(update={"identify": ()})
    sound = rows if moved is None else replace(rows, position=rows.position - moved[:, :3])
    found = calibrate(bare, sound, compliances=robot.identify, folds=0)
    there = in_base_frame(found, rows)
    soft = [name for name in robot.identify if 0.0 < found.robot.parameter(name) < np.inf]
    problem = state_calibration(found.robot, there, compliances=soft).problem
    theta = problem.expected
    residual, tangent = problem.linearised(theta)
    baseline = fit_baseline(found.robot.model_copy(update={"identify": ()}), there, keep=())
    baseline = replace(baseline, used=problem.used, sigma=problem.sigma)
    weigh = whitening(problem.sigma, problem.used, baseline.sharing)
    return OpenModel(baseline, residual, tangent, there.pose[np.nonzero(problem.used)[0]], weigh, problem)


def open_stiffness(baseline: Baseline) -> OpenModel:
    """Return the open model of a fitted baseline: its stiffness values are free, the geometry is not."""
    weigh = whitening(baseline.sigma, baseline.used, baseline.sharing)
    pose = baseline.rows.pose[np.nonzero(baseline.used)[0]]
    residual, tangent = weigh @ baseline.gap[baseline.used], weigh @ baseline.tangent[baseline.used]
    return OpenModel(baseline, residual, tangent, pose, weigh)


def orthonormal(columns: Array, beside: Array | None = None, least: float = INDEPENDENT) -> Array:
    """Return an orthonormal basis (n, k) of columns (n, c), of what another basis (n, b) leaves of them."""
    if not columns.shape[1]:
        return columns
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0, size, 1.0)
    if beside is not None:
        unit = unit - beside @ (beside.T @ unit)
    left, values, _ = np.linalg.svd(unit, full_matrices=False)
    return np.asarray(left[:, values > least])
