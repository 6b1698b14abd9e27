"""Parameters that would open a loop which is closed as a point or a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from beamstiff.calibration.error_jacobian import Geometry, widened
from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.closure import HELD
from beamstiff.robot.loops import loop_equations, loop_system
from beamstiff.robot.newton import least_squares


def opening_parameters(geometry: Geometry) -> dict[str, str]:
    """Return the parameters that no passive motion makes up for, each with the loop that they open.

    A planar loop that is closed as a point (``constrain: position``) closes for its nominal geometry only;
    ``constrain: plane`` leaves the third direction to the bearings' play.
    """
    kinematics = geometry.kinematics
    if not kinematics.loops or not geometry.frame_columns:
        return {}
    posture, _, _ = geometry.in_base(kinematics, np.zeros(len(geometry.parameters)), None)
    wide = widened(kinematics, [(frame, motion) for _, frame, motion in geometry.frame_columns])
    system = loop_system(wide)
    joined = kinematics.coupling
    free = posture.values[:, [joined.names.index(name) for name in joined.free]]
    few = free[np.unique(np.linspace(0, len(free) - 1, 8).astype(np.intp))]
    nothing = np.zeros((len(few), len(geometry.frame_columns)))
    few = np.concatenate([few[:, : joined.actuated], nothing, few[:, joined.actuated :]], axis=1)
    _, jacobian = loop_equations(system, few)
    passive = jacobian[:, :, system.actuated :]
    found = {}
    for at, (number, _, _) in enumerate(geometry.frame_columns):
        column = jacobian[:, :, joined.actuated + at]
        left = np.abs(column - (passive @ least_squares(passive, column)[:, :, None])[:, :, 0])
        if left.max() > HELD:
            row = int(left.max(axis=0).argmax())
            ends = zip(kinematics.loops, system.rows, strict=True)
            loop = next(loop.name for loop, part in ends if row < part.stop)
            found[geometry.parameters[number].name] = loop
    return found


def refuse_opening(opening: Mapping[str, str], names: Sequence[str]) -> None:
    """Refuse parameters that were asked for by name and open a loop."""
    if asked := [name for name in names if name in opening]:
        loop = opening[asked[0]]
        raise BeamstiffError(
            f"{listed(asked)}: loop {loop!r} closes with the present value only (constrain: position or "
            "pose); with constrain: plane it closes in its plane"
        )
