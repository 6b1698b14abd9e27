"""`predict`: the displacement that the model predicts for each row of a table of postures and loads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.functions.robots import as_robot
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements, preload_notes
from beamstiff.robot.coerce import RobotLike
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness import check_stiffness
from beamstiff.se3 import Array
from beamstiff.shown import Shown


@dataclass(frozen=True, eq=False)
class Prediction(Shown):
    """Predicted displacements, N rows.

    Attributes
    ----------
    robot : Robot
    rows : Measurements
        Postures and loads; where they hold measured displacements, these are compared.
    displacement : (N, 6) array, m and rad
        Loaded minus unloaded, base frame.
    preload : bool
        Whether gravity, payload and the load stiffen or soften the machine.
    notes : tuple of str
    """

    robot: Robot
    rows: Measurements
    displacement: Array
    preload: bool
    notes: tuple[str, ...] = ()

    @property
    def gap(self) -> Array:
        """Norm of measured less predicted position of every row, (N,), m; NaN where none was measured."""
        known = self.rows.measured_mask[:, :3] & (self.rows.kind == "displacement")
        gap = np.where(known, self.rows.displacement[:, :3] - self.displacement[:, :3], 0.0)
        return np.asarray(np.where(known.any(axis=1), np.linalg.norm(gap, axis=1), np.nan))

    def to_measurements(self) -> Measurements:
        """Return the rows with the predicted displacements as those measured."""
        rows = self.rows
        how = "predicted by beamstiff" + (" with --preload" if self.preload else "")
        return make_measurements(
            rows.variables,
            rows.q,
            tcp=self.robot.tcp,
            wrench=rows.wrench,
            displacement=self.displacement,
            point=rows.point,
            load_point=rows.load_point,
            pose=rows.pose,
            step=rows.step,
            time=rows.time,
            temperature=rows.temperature,
            metadata={"source": f"{how}, robot {self.robot.name}; loads of {rows.source}"},
            source=rows.source,
            units=rows.units,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: m and rad, a row each."""
        return {"displacement": self.displacement.tolist()}


def predict(robot: RobotLike, data: DataLike, *, preload: bool = False) -> Prediction:
    """Predict the displacement of each row of a table of postures and loads.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Its `effects` are added.
    data : Measurements or path, or several
        Columns of measured displacements may be missing.
    preload : bool
        Add the geometric stiffness K_C of gravity, payload and the row's wrench, on the undeformed geometry.

    Returns
    -------
    Prediction

    Raises
    ------
    BeamstiffError
        When the robot is rigid, a posture cannot be taken, or the machine buckles under a load.

    Examples
    --------
    >>> from beamstiff.measure import make_measurements
    >>> push = make_measurements([], [[]], tcp="tip", wrench=[[0, 0, -100, 0, 0, 0]])
    >>> predict("cantilever", push).displacement.shape
    (1, 6)
    """
    machine = as_robot(robot)
    if not machine.effects:
        check_stiffness(machine)
    tables = as_tables(data, machine, require_measured=False)
    doubts = doubts_of(machine, tables)
    rows = concatenate(tables)
    with doubted(doubts):
        moved = predict_displacements(machine, rows, preload)
        if preload:
            doubts += preload_notes(machine, rows)
        if machine.effects:
            moved = moved + effects_displacement(machine, replace(rows, kind="displacement"))
    return Prediction(machine, rows, moved, preload, tuple(doubts))
