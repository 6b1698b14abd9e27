"""Readings without what a robot's effects add: all else is fitted, or diagnosed, as if it had none."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.diagnosis.residual.baseline import nominal_pose, predict
from beamstiff.errors import BeamstiffError
from beamstiff.measure.registration import check_spread, fit_rigid_motion
from beamstiff.measure.rows import without_displacement
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


def without_effects(
    robot: Robot, rows: Measurements, *, stations: bool = False
) -> tuple[Robot, Measurements]:
    """Return a robot without its effects, and the readings without what these add, to fit the rest.

    Effects that depend on the stiffness (in closed loops, or of the load) count with the robot's present one.
    Absolute positions may be in any measuring frame, or with `stations` in one of each table.

    Raises BeamstiffError as of `effects_displacement`.
    """
    if not robot.effects:
        return robot, rows
    added = effects_displacement(robot, rows)
    if rows.kind == "absolute":
        left = without_displacement(rows, turned(added, measuring_turns(robot, rows, stations=stations)))
    else:
        left = replace(rows, displacement=rows.displacement - added)
    return robot.model_copy(update={"effects": ()}), left


def positions_without_effects(robot: Robot, rows: Measurements, bases: Array) -> Measurements:
    """Return absolute rows without what a robot's effects add, for a calibration of the rest.

    `bases` (S, 4, 4): where the robot's base stands in the measuring frame, or in that of each table.
    """
    table = rows.run.astype(np.intp) if len(bases) > 1 else np.zeros(len(rows), dtype=np.intp)
    return without_displacement(rows, turned(effects_displacement(robot, rows), bases[table, :3, :3]))


def measuring_turns(robot: Robot, rows: Measurements, *, stations: bool = False) -> Array:
    """Return how the base is turned in the measuring frame of absolute rows, (N, 3, 3).

    What the robot, effects included, says is laid over the readings as a rigid body; of each table by itself
    where the tracker, or the robot, was moved between them (`stations`). Too few points turn nothing.
    """
    at = nominal_pose(robot, rows)[0] + predict(robot, rows)[:, :3]
    known = ~np.isnan(rows.position).any(axis=1)
    table = rows.run if stations else np.zeros(len(rows))
    turns = np.tile(np.eye(3), (len(rows), 1, 1))
    for number in np.unique(table):
        own = table == number
        with suppress(BeamstiffError):
            check_spread(at[own & known], rows.source)
            turns[own] = fit_rigid_motion(at[own & known], rows.position[own & known]).rotation
    return turns


def turned(displacement: Array, turn: Array) -> Array:
    """Return displacements ``[d, r]`` (N, 6) in another frame; `turn` (N, 3, 3): how it is turned."""
    parts = [np.einsum("nij,nj->ni", turn, displacement[:, part]) for part in (slice(0, 3), slice(3, 6))]
    return np.concatenate(parts, axis=1)
