"""`predict`: the displacement, or position, that the model predicts for each row of a table."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.diagnosis.residual.baseline import predict as predict_rows
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import compile_structure
from beamstiff.functions.checks import start_values
from beamstiff.functions.robots import as_robot
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.rows import concatenate, require_tracker, subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.correction import extrapolation_notes, model_correction, model_std
from beamstiff.model.linear import predict_displacements, preload_notes
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import posture
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.stiffness_parameters import check_stiffness
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation
from beamstiff.shown import Shown

SMALL_TURN = 0.05  # rad: its square, what a linear model leaves out, is a four-hundredth


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Shown):
    """Predicted displacements, N rows."""

    robot: Robot
    rows: Measurements  # postures and loads; where they hold measured displacements, these are compared
    # (N, 6), m and rad: loaded minus unloaded, base frame. Of absolute rows: off the undeformed machine, by
    # its own weight, payload and load
    displacement: Array
    preload: bool  # whether gravity, payload and the load stiffen or soften the machine
    notes: tuple[str, ...] = ()
    # (N, 6), m and rad: of absolute rows: position of the point read, rotation vector of the TCP, base frame
    pose: Array | None = None
    std: Array | None = None  # (N, 6), m and rad: of `displacement`, if the model is a Gaussian process

    @property
    def gap(self) -> Array:
        """Norm of measured less predicted position of every row, (N,), m; NaN where none was measured."""
        known = self.rows.measured_mask[:, :3]
        if self.pose is None:
            gap = np.where(known, self.rows.displacement[:, :3] - self.displacement[:, :3], 0.0)
        else:
            gap = np.where(known, self.rows.position - self.pose[:, :3], 0.0)
        return np.asarray(np.where(known.any(axis=1), np.linalg.norm(gap, axis=1), np.nan))

    def energy_shares(self, row: int) -> dict[str, float]:
        """Return the share of every part in the strain energy of a row, the largest first: what is compliant.

        Beams and struts by their names, springs as ``J2.torsional``. Under the load of the row, and under the
        weight where the table has positions; by the linear model, without the robot's effects. Empty where
        nothing deforms.
        """
        rows, robot = subset(self.rows, [row]), self.robot.model_copy(update={"effects": (), "model": None})
        structure = compile_structure(robot)
        loads = nodal_loads(structure, 1, {str(rows.load_point[0]): rows.wrench})
        where = posture(structure.kinematics, rows.q)
        response = respond(structure, where, loads, gravity=self.pose is not None)
        shares = {name: float(share[0]) for name, share in response.energy_shares().items()}
        largest = sorted(shares, key=lambda name: -shares[name])
        return {name: shares[name] for name in largest if shares[name] > 0.0}

    def to_measurements(self) -> Measurements:
        """Return the rows with the predicted displacements, or poses, as those measured."""
        rows = self.rows
        pose, turned = self.pose, rows.measured_mask[:, 3:].any()
        how = "predicted by beamstiff" + (" with --preload" if self.preload and pose is None else "")
        return make_measurements(
            rows.variables,
            rows.q,
            tcp=self.robot.tcp,
            wrench=rows.wrench,
            displacement=self.displacement if pose is None else None,
            position=None if pose is None else pose[:, :3],
            rotation=pose[:, 3:] if pose is not None and turned else None,
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
        pose = {} if self.pose is None else {"pose": self.pose.tolist()}
        std = {} if self.std is None else {"std": self.std.tolist()}
        return {"displacement": self.displacement.tolist(), **pose, **std}


def predict(robot: RobotLike, data: DataLike, *, preload: bool = False) -> Prediction:
    """Predict the displacement of each row of a table of postures and loads.

    Of absolute rows (x y z) it predicts where the points are, in the base frame: under the machine's own
    weight, payload and load, each with the stiffness that these leave.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Its `effects` are added.
    data : Measurements or path, or several
        Columns of measured displacements may be missing.
    preload : bool
        Equilibria to second order in gravity, payload and the row's wrench, with their K_C.

    Returns
    -------
    Prediction

    Raises
    ------
    BeamstiffError
        When the robot is rigid, a posture cannot be taken, or the machine buckles under a load.

    Examples
    --------
    >>> from beamstiff.measure.table import make_measurements
    >>> push = make_measurements([], [[]], tcp="tip", wrench=[[0, 0, -100, 0, 0, 0]])
    >>> predict("cantilever", push).displacement.shape
    (1, 6)
    """
    machine = as_robot(robot)
    if not machine.effects:
        check_stiffness(machine)
    tables = as_tables(data, machine, require_measured=False)
    doubts = [*doubts_of(machine, tables), *start_values(machine)]
    rows = concatenate(tables)
    require_tracker(rows, "deflect")
    with doubted(doubts):
        if rows.kind == "absolute":
            return _positions(machine, rows, (*doubts, *extrapolation_notes(machine, rows.q)))
        moved = predict_displacements(machine, rows, preload) + model_correction(machine, rows)
        if preload:
            doubts += preload_notes(machine, rows)
        if machine.effects:
            moved = moved + effects_displacement(machine, replace(rows, kind="displacement"))
    notes = (*doubts, *extrapolation_notes(machine, rows.q), *_too_far(moved))
    return Prediction(machine, rows, moved, preload, notes, std=model_std(machine, rows))


def _too_far(moved: Array) -> tuple[str, ...]:
    """Return the note on displacements (N, 6), m and rad, that are too large for a linear model."""
    turn = float(np.linalg.norm(moved[:, 3:], axis=1).max(initial=0.0))
    if turn <= SMALL_TURN:
        return ()
    return (
        f"the tool turns by up to {turn:.2g} rad, which is no small displacement: check the loads, and the "
        "units of stiffness and materials in the robot file",
    )


def _positions(robot: Robot, rows: Measurements, notes: tuple[str, ...]) -> Prediction:
    moved = predict_rows(robot, rows)
    position, rotation = nominal_pose(robot, rows)
    turned = vector_from_rotation(rotation_from_vector(moved[:, 3:]) @ rotation)
    pose = np.concatenate([position + moved[:, :3], turned], axis=1)
    return Prediction(robot, rows, moved, True, notes, pose)
