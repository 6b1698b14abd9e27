"""Errors on readings that were not fitted: poses left out, other tables; and readings in the base frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identify.geometry.elastic import state_elastic
from beamstiff.identify.geometry.error_jacobian import state_geometry
from beamstiff.identify.geometry.estimate import Estimate, estimate
from beamstiff.identify.geometry.problem import Problem, state_problem
from beamstiff.identify.geometry.result import Calibration, Errors, errors_of
from beamstiff.identify.geometry.statement import Statement
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation


def held_out(
    statement: Statement, problem: Problem, found: Estimate, method: str, folds: int
) -> Array | None:
    """Return the residuals (N, 6) of poses left out, fold by fold; None where too little is left to fit."""
    pose = problem.geometry.pose
    count = int(pose.max()) + 1
    folds = min(folds, count)
    if folds < 2:
        return None
    # folds at random but always the same: tables may be sorted
    fold = np.random.default_rng(0).permutation(count) % folds
    result = np.zeros(problem.used.shape)
    for at in range(folds):
        out = fold[pose] == at
        train, test = problem.some(~out), problem.some(out)
        if train.count <= len(statement.identified):
            return None
        result[out] = test.gap(estimate(train, found.theta, statement.identified, method).theta)
    return result


def gap_of(robot: Robot, rows: Measurements, base: Array | None = None, target: Array | None = None) -> Array:
    """Return measured less predicted, (N, 6), m and rad, for a robot as it is; NaN where not measured.

    Parameters
    ----------
    robot : Robot
    rows : Measurements
        Absolute.
    base : (4, 4) array, optional
        Where the robot's base stands in the measuring frame; default there.
    target : (3, 3) array, optional
        How the target is turned against the frame of the TCP.

    Raises
    ------
    BeamstiffError
        When the rows are displacements, or a pose cannot close its loops.
    """
    if rows.kind != "absolute":
        raise BeamstiffError(f"{rows.source}: found displacements, expected absolute positions (x y z)")
    geometry = state_geometry(robot, rows, ())
    problem = state_problem(geometry, state_elastic(robot, rows, ()), (), np.zeros(0))
    placed = problem.placed(np.zeros(0))
    turn = np.eye(3) if base is None else base[:3, :3]
    shift = np.zeros(3) if base is None else base[:3, 3]
    seen = placed.rotation if target is None else placed.rotation @ target
    moved = replace(placed, position=placed.position @ turn.T + shift, rotation=turn @ seen)
    return np.where(problem.used, problem.gap_from(moved), np.nan)


def errors_on(found: Calibration, rows: Measurements) -> Errors:
    """Return the errors of a calibrated robot on other readings, in the same measuring frame."""
    gap = gap_of(found.robot, rows, found.base, found.target)
    return errors_of(np.nan_to_num(gap), rows.measured_mask)


def in_base_frame(found: Calibration, rows: Measurements) -> Measurements:
    """Return readings in the base frame that a calibration found, of the TCP's frame itself."""
    turn, shift = found.base[:3, :3], found.base[:3, 3]
    rotation = rows.rotation.copy()
    known = ~np.isnan(rotation).any(axis=1)
    if known.any():
        rotation[known] = vector_from_rotation(
            turn.T @ rotation_from_vector(rotation[known]) @ found.target.T
        )
    return replace(rows, position=(rows.position - shift) @ turn, rotation=rotation)
