"""`verify`: a robot with its effects on rows that were not fitted."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.verify import Verification
from beamstiff.diagnosis.verify import verify as run
from beamstiff.errors import BeamstiffError, OptionError, listed
from beamstiff.functions.robots import as_robot
from beamstiff.identification.assembly_plausibility import displacement_doubts
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.rows import concatenate, require_tracker
from beamstiff.model.correction import extrapolation_notes
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike
from beamstiff.se3 import Array
from beamstiff.simulators.deflection import mujoco_deflection


def verify(
    robot: RobotLike, data: DataLike, *, refit_frame: bool = False, nominal: RobotLike | None = None
) -> Verification:
    """Compare a robot, without and with its effects, with rows that were not fitted.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    data : Measurements or path, or several
        Displacements, or absolute positions in the robot's base frame.
    refit_frame : bool
        Fit the measuring frame first: it is not the base frame. Changes nothing of displacements.
    nominal : Robot, path, or name of a bundled robot, optional
        The robot before it was calibrated or diagnosed, to compare with; start values of stiffness, which are
        guesses, count as rigid.

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
    require_tracker(rows, "verify")
    doubts = [*doubts_of(machine, tables), *displacement_doubts(machine, rows, fitted_names(machine))]
    with doubted(doubts):
        found = run(machine, rows, refit_frame=refit_frame)
    if nominal is not None:
        before = as_robot(nominal, "nominal")
        found = replace(found, nominal=_nominal_error(before, data, refit_frame))
        if before.unmeasured:
            guesses = listed(before.unmeasured, 3)
            doubts.append(
                f"the nominal robot counts as rigid where its stiffness is a start value: {guesses}"
            )
    if refit_frame and rows.kind != "absolute":
        doubts.append("displacements have no measuring frame to fit: --refit-frame changes nothing")
    return replace(found, notes=(*doubts, *extrapolation_notes(machine, rows.q), *found.notes))


def _nominal_error(robot: Robot, data: DataLike, refit_frame: bool) -> float:
    """Return the error of a robot before its calibration, m; guesses of its stiffness count as rigid."""
    robot = robot.with_parameters(dict.fromkeys(robot.unmeasured, np.inf))
    try:
        rows = concatenate(as_tables(data, robot))  # its joints may stand in another order
        return run(robot.model_copy(update={"effects": ()}), rows, refit_frame=refit_frame).after
    except BeamstiffError as error:
        raise OptionError("nominal", f"robot {robot.name!r}: {error}") from None


@dataclass(frozen=True, eq=False)
class SecondOpinion:
    """Deflections of rows by this package and by a physics engine, N rows."""

    engine: str
    # (N, 6), m and rad: loaded minus unloaded, base frame: with the stiffness of the loaded machine, and the
    # engine's
    displacement: Array
    other: Array
    notes: tuple[str, ...] = ()  # what the engine's model lacks

    @property
    def difference(self) -> Array:
        """Distance of both positions of every row, (N,), m."""
        return np.asarray(np.linalg.norm((self.other - self.displacement)[:, :3], axis=1))

    @property
    def relative(self) -> float:
        """RMS of the distances over that of the displacements."""
        return float(np.linalg.norm(self.difference) / (np.linalg.norm(self.displacement[:, :3]) or 1.0))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: m and rad, a row each."""
        return {
            "engine": self.engine,
            "displacement": self.displacement.tolist(),
            "engine_displacement": self.other.tolist(),
            "relative_difference": self.relative,
            "notes": list(self.notes),
        }


def second_opinion(robot: RobotLike, data: DataLike, *, engine: str = "mujoco") -> SecondOpinion:
    """Compare the deflection of every row with that of the exported model in a physics engine.

    Needs the extra: ``pip install 'beamstiff[mujoco]'``.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    data : Measurements or path, or several
        Postures and loads; measured displacements are not looked at.
    engine : "mujoco"

    Returns
    -------
    SecondOpinion

    Raises
    ------
    BeamstiffError
        When the engine is unknown or missing, or a row has no equilibrium.

    Examples
    --------
    >>> from beamstiff.measure.table import make_measurements
    >>> push = make_measurements([], [[]], tcp="tip", wrench=[[0, 0, -10, 0, 0, 0]])
    >>> second_opinion("cantilever", push).relative < 1e-3
    True
    """
    if engine != "mujoco":
        raise OptionError("engine", f"found {engine!r}, expected mujoco")
    machine = as_robot(robot)
    rows = concatenate(as_tables(data, machine, require_measured=False))
    other, lost = mujoco_deflection(machine, rows)
    return SecondOpinion(engine, predict_displacements(machine, rows, True), other, lost)
