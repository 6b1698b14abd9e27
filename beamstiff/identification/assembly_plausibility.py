"""What measured displacements say of the way in which the loops of a robot are put together.

Another assembly moves the tool another way, and no stiffness of the springs makes up for that: what the fit
leaves would be taken for an effect that the model lacks.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.minimise import minimise
from beamstiff.identification.statement import build_identification
from beamstiff.identification.validation import position_rms
from beamstiff.measure.position_plausibility import ANOTHER
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics

AMISS = 0.2  # of the displacements: the fit leaves more where an assembly is wrong
ROWS = 60  # looked at
VALUES = 4  # measured ones for each that is fitted: of fewer another assembly may fit by chance


def displacement_doubts(robot: Robot, rows: Measurements, names: Sequence[str]) -> Iterator[str]:
    """Yield that displacements fit the loops put together in another way, with `names` fitted to each."""
    seen = rows.measured_mask[:, :3].any(axis=1) & rows.wrench.any(axis=1)
    if not robot.loops or rows.kind != "displacement" or not seen.any():
        return
    at = np.flatnonzero(seen)
    some = subset(rows, at[np.unique(np.linspace(0, len(at) - 1, ROWS).astype(np.intp))])
    if some.measured_mask[:, :3].sum() < VALUES * max(len(names), 1):
        return
    kinematics = compile_kinematics(robot)
    if not kinematics.closest:
        return
    taken = kinematics.closest[0].name
    moved = np.sqrt(np.nansum(some.displacement[:, :3] ** 2) / len(some))
    stated = _left_by(robot, some, names)
    if not stated > AMISS * moved:
        return
    left = {
        one.name: _left_by(robot.model_copy(update={"assembly": one.name}), some, names)
        for one in every_assembly(kinematics)
        if one.name != taken
    }
    best = min(left, key=left.__getitem__, default=taken)
    if left.get(best, np.inf) < ANOTHER * stated:
        found = f"{1e3 * stated:.3g} mm are left" if np.isfinite(stated) else "they do not close there"
        yield (
            f"{rows.source}: the displacements fit the loops of robot {robot.name!r} put together as "
            f"{best!r} ({1e3 * left[best]:.3g} mm are left), not as {taken!r} ({found}), which was taken: "
            f"write assembly: {best!r} in the robot file, or --assembly={best}"
        )


def _left_by(robot: Robot, rows: Measurements, names: Sequence[str]) -> float:
    """Return the RMS position error, m, that a robot leaves with these values fitted; inf: it is open."""
    try:
        if not names:
            gap = (rows.displacement - rows.along(predict_displacements(robot, rows)))[:, :3]
            return float(np.sqrt(np.nansum(gap**2) / len(rows)))
        statement = build_identification(robot, rows, names)
        fit = minimise(statement.objective)
        return float(position_rms(statement.problem, statement.parameters.stiffness(fit.theta)))
    except BeamstiffError:
        return np.inf
