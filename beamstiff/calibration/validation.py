"""Errors on readings that were not fitted: poses left out, other tables; and readings in the base frame."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamstiff.calibration.elastic import build_elastic
from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.instruments import begun, turned_rows
from beamstiff.calibration.least_squares import estimate
from beamstiff.calibration.problem import Problem, build_problem
from beamstiff.calibration.result import Calibration, Errors, errors_of
from beamstiff.errors import BeamstiffError
from beamstiff.identification.models.split import configurations
from beamstiff.measure.camera import unscaled
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation


def held_out(
    identified: Sequence[str], problem: Problem, begin: Array, method: str, folds: int
) -> Array | None:
    """Return the residuals (N, 6) of poses left out, fold by fold; None where too little is left to fit.

    `identified`: what is fitted without them, from `begin` (t,). Rows of one pose leave together, also where
    the encoders read it a little differently each time.
    """
    pose = configurations(problem.rows)
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
        if train.count <= len(identified):
            return None
        result[out] = test.gap(estimate(train, begin, identified, method).theta)
    return result


def gap_of(robot: Robot, rows: Measurements, base: Array | None = None, target: Array | None = None) -> Array:
    """Return measured less predicted, (N, 6), m and rad, for a robot as it is; NaN where not measured.

    `rows`: absolute. `base` (4, 4) or (N, 4, 4): where the robot's base stands in the measuring frame;
    default there. `target` (3, 3): how the target is turned against the frame of the TCP.
    """
    if rows.kind != "absolute":
        raise BeamstiffError(f"{rows.source}: found displacements, expected absolute positions (x y z)")
    geometry = build_geometry(robot, rows, ())
    problem = build_problem(geometry, build_elastic(robot, rows, ()), (), np.zeros(0))
    placed = problem.placed(np.zeros(0))
    stands = np.eye(4) if base is None else base
    turn, shift = stands[..., :3, :3], stands[..., :3, 3]
    seen = placed.rotation if target is None else placed.rotation @ target
    position = (turn @ placed.position[:, :, None])[:, :, 0] + shift
    moved = replace(placed, position=position, rotation=turn @ seen)
    if rows.targets:  # set-ups that are not known are where they fit best
        problem = replace(problem, geometry=replace(geometry, rows=begun(rows, position)))
    return np.where(problem.used, problem.gap_from(moved, np.zeros(0)), np.nan)


def errors_on(found: Calibration, rows: Measurements, station: int = 0) -> Errors:
    """Return the errors of a calibrated robot on other readings, in the measuring frame of a station."""
    known = {one.name: one for one in found.targets}
    rows = unscaled(rows, _values(found))
    rows = replace(rows, targets=tuple(known.get(one.name, one) for one in rows.targets))
    gap = gap_of(found.robot, rows, found.bases[station], found.target)
    return errors_of(np.nan_to_num(gap), rows.measured_mask)


def _values(found: Calibration) -> dict[str, float]:
    return {one.name: one.value for one in found.parameters}


def in_base_frame(found: Calibration, rows: Measurements) -> Measurements:
    """Return readings in the base frame that a calibration found, of the TCP's frame itself.

    Where each table had a base of its own, the tables must come in the same order.
    """
    rows = unscaled(rows, _values(found))
    stands = found.bases[rows.run if len(found.bases) > 1 else np.zeros(len(rows), dtype=np.intp)]
    back, shift = stands[:, :3, :3].swapaxes(-1, -2), stands[:, :3, 3]
    rotation = rows.rotation.copy()
    known = ~np.isnan(rotation).any(axis=1)
    if known.any():
        seen = back[known] @ rotation_from_vector(rotation[known]) @ found.target.T
        rotation[known] = vector_from_rotation(seen)
    position = (back @ (rows.position - shift)[:, :, None])[:, :, 0]
    there = replace(rows, position=position, rotation=rotation)
    if rows.camera:
        ways = [(back @ part[:, :, None])[:, :, 0] for part in (rows.direction, rows.sight)]
        there = replace(there, direction=ways[0], sight=ways[1])
    if not rows.targets:
        return there
    there = replace(there, position=np.where(rows.by_tracker[:, None], position, rows.position))
    there = replace(there, targets=found.targets)
    return turned_rows(there, stands[0, :3, :3], shift[0], found.predicted[:, :3])
