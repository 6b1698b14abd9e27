"""`verify`: a robot with its effects on rows that were not fitted."""

from __future__ import annotations

from dataclasses import replace

from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.verify import Verification
from beamstiff.diagnosis.verify import verify as run
from beamstiff.functions.robots import as_robot
from beamstiff.identification.assembly_doubts import displacement_doubts
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.rows import concatenate
from beamstiff.model.correction import extrapolation_notes
from beamstiff.robot.coerce import RobotLike


def verify(robot: RobotLike, data: DataLike, *, refit_frame: bool = False) -> Verification:
    """Compare a robot, without and with its effects, with rows that were not fitted.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    data : Measurements or path, or several
        Displacements, or absolute positions in the robot's base frame.
    refit_frame : bool
        Fit the measuring frame first: it is not the base frame.

    Returns
    -------
    Verification

    Raises
    ------
    BeamstiffError
        When no position is measured or the rows cannot be predicted.
    """
    machine = as_robot(robot)
    tables = as_tables(data, machine)
    rows = concatenate(tables)
    doubts = [*doubts_of(machine, tables), *displacement_doubts(machine, rows, fitted_names(machine))]
    with doubted(doubts):
        found = run(machine, rows, refit_frame=refit_frame)
    return replace(found, notes=(*doubts, *extrapolation_notes(machine, rows.q)))
