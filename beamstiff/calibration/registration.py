"""Where a calibration starts: the robot laid over the readings as a rigid body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.calibration.estimate import estimate
from beamstiff.calibration.observability import observability
from beamstiff.calibration.parameters import AXES, TURNS, base_names
from beamstiff.calibration.problem import Problem
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rigid_motion import check_spread, fit_rigid_motion
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation


def registered(problem: Problem, theta: Array) -> Array:
    """Return parameters (t,) with the base, and the target's turn, where the readings have them.

    Each only where all of it is sought; a start, not an estimate.
    """
    result = theta.copy()
    at = {item.name: number for number, item in enumerate(problem.parameters)}
    placed = problem.placed(theta)
    turn = np.tile(np.eye(3), (len(problem.rows), 1, 1))
    for station, base in enumerate(base_names(problem.geometry.stations)):
        sought = [at[f"{base}.{name}"] for name in (*AXES, *TURNS) if f"{base}.{name}" in at]
        own = problem.geometry.station == station
        seen = own & problem.used[:, :3].all(axis=1)
        if len(sought) < 6:
            continue
        try:
            check_spread(placed.position[seen], problem.rows.source)
        except BeamstiffError:
            continue  # too few points: the base stays, and observability will say so
        motion = fit_rigid_motion(placed.position[seen], problem.rows.position[seen])
        turn[own] = motion.rotation
        result[sought] = [*motion.translation, *vector_from_rotation(motion.rotation)]
    target = [at[f"target.{name}"] for name in TURNS if f"target.{name}" in at]
    turned = problem.used[:, 3:].all(axis=1)
    if len(target) == 3 and turned.any():
        measured = rotation_from_vector(problem.rows.rotation[turned])
        relative = (turn[turned] @ placed.rotation[turned]).swapaxes(-1, -2) @ measured
        result[target] = Rotation.from_matrix(relative).mean().as_rotvec()
    return result


def rigid_gap(problem: Problem) -> Array:
    """Return the residuals (N, 6) of the robot as described, laid over the readings as a rigid body.

    Base and target are fitted where they are sought, so that what is left is the robot's.
    """
    start = registered(problem, problem.expected)
    placing = [item.name for item in problem.parameters if item.group in ("base", "target")]
    if not placing:
        return problem.gap(start)
    free = replace(problem, prior=np.full(len(start), np.inf))
    _, jacobian = free.linearised(start, deformed=False)
    seen = observability(jacobian, problem.parameters)
    return problem.gap(estimate(free, start, [name for name in placing if name in seen.identified]).theta)
