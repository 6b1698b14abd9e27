"""Where a map runs through singular poses: lines along which the Jacobian's determinant changes its sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator

from beamstiff.errors import BeamstiffError
from beamstiff.plan.dexterity import DexterityMap, normalised_jacobian
from beamstiff.plan.poses import Grid, Mask, check_node
from beamstiff.robot.kinematics import Kinematics, posture
from beamstiff.se3 import Array

NO_PART = 0.02  # of the largest share: a joint that takes less part in a singular motion is left out
SHORTEST = 3  # points of a line


@dataclass(frozen=True, eq=False)
class SingularLine:
    """A line of singular poses over a grid.

    Attributes
    ----------
    points : (p, 2) array, rad or m
        Values of the grid's two variables, interpolated between its points.
    joints : tuple of str
        Variables that can move together and leave the tool where it is: for a 6R robot with a spherical
        wrist, q1 and wrist axes where the wrist's centre lies on axis 1, q2, q3 and wrist axes where the arm
        is folded or stretched, q4 and q6 where they line up.
    """

    points: Array
    joints: tuple[str, ...]


def singular_lines(
    kinematics: Kinematics, dexterity: DexterityMap, node: str | None = None
) -> list[SingularLine]:
    """Return the lines of a map along which det J = 0 (seed 000, Figure 3b), each with the joints in play.

    Parameters
    ----------
    kinematics : Kinematics
    dexterity : DexterityMap
    node : str, optional
        Default: the TCP.

    Raises
    ------
    BeamstiffError
        When the robot has not six actuated variables, so that its Jacobian has no determinant.
    """
    grid = dexterity.grid
    if dexterity.determinant is None:
        raise BeamstiffError(
            f"robot {kinematics.robot.name!r} has {len(kinematics.robot.actuated)} actuated variables: "
            "singular lines need the determinant of a Jacobian of six; look for small 1/kappa_F instead"
        )
    # masked where loops do not close
    field = np.ma.masked_invalid(dexterity.determinant.T)
    name, found = check_node(kinematics, node), []
    for line in contour_generator(grid.first, grid.second, field).lines(0.0):
        points = np.asarray(line, dtype=np.float64)
        in_play = _in_play(kinematics, grid, points, dexterity.length, name)
        # where two lines cross, a contour may turn from one into the other
        turns = 1 + np.flatnonzero((np.diff(in_play.astype(np.int8), axis=0) != 0).any(axis=1))
        for part in np.split(np.arange(len(points)), turns):
            if len(part) >= SHORTEST:
                found.append(SingularLine(points[part], tuple(_names(kinematics)[in_play[part[0]]].tolist())))
    return found


def _in_play(kinematics: Kinematics, grid: Grid, points: Array, length: float, node: str) -> Mask:
    """Return which variables take part in the motion that the Jacobian loses at each point, (p, A)."""
    names = _names(kinematics).tolist()
    q = np.repeat(grid.q[:1], len(points), axis=0)
    for axis, name in enumerate(grid.names):
        q[:, names.index(name)] = points[:, axis]
    jacobian = normalised_jacobian(kinematics, posture(kinematics, q), length, node)
    motion = np.abs(np.linalg.svd(jacobian)[2][:, -1])
    part: Mask = motion > NO_PART * motion.max(axis=1, keepdims=True)
    return part


def _names(kinematics: Kinematics) -> np.ndarray:
    return np.array([variable.name for variable in kinematics.robot.actuated])
