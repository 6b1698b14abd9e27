"""Where a map runs through singular poses: lines along which the Jacobian's determinant changes its sign."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator

from beamstiff.errors import BeamstiffError
from beamstiff.planning.dexterity import DexterityMap, normalised_jacobian
from beamstiff.planning.poses import Grid
from beamstiff.robot.kinematics import Kinematics, posture
from beamstiff.se3 import Array

NO_PART = 0.02  # of the largest share: a joint that takes less part in a singular motion is left out
SHORTEST = 3  # points of a line
ALIKE = 0.7  # cosine between the motions lost at neighbouring points of one line
NEWTON = 4  # steps


@dataclass(frozen=True, eq=False)
class SingularLine:
    """A line of singular poses over a grid."""

    points: Array  # (p, 2), rad or m: values of the grid's two variables
    # variables that can move together and leave the tool where it is: for a 6R robot with a spherical wrist,
    # q1 and wrist axes where the wrist's centre lies on axis 1, q2, q3 and wrist axes where the arm is folded
    # or stretched, q4 and q6 where they line up
    joints: tuple[str, ...]


def singular_lines(kinematics: Kinematics, dexterity: DexterityMap) -> list[SingularLine]:
    """Return the lines of a map along which det J = 0 (seed 000, Figure 3b), each with the joints in play."""
    grid = dexterity.grid
    if dexterity.determinant is None:
        raise BeamstiffError(
            f"robot {kinematics.robot.name!r} has {len(kinematics.robot.actuated)} actuated variables: "
            "singular lines need the determinant of a Jacobian of six; look for small 1/kappa_F instead"
        )
    # masked where loops do not close
    field = np.ma.masked_invalid(dexterity.determinant.T)
    found = []

    def jacobian(points: Array) -> Array:
        return _jacobian(kinematics, grid, points, dexterity.length)

    for line in contour_generator(grid.first, grid.second, field).lines(0.0):
        points = _refined(np.asarray(line, dtype=np.float64), jacobian, grid)
        motion = np.linalg.svd(jacobian(points))[2][:, -1]
        # where two lines cross, a contour may turn from one into the other: another motion
        alike = np.abs((motion[1:] * motion[:-1]).sum(axis=1))
        for part in np.split(np.arange(len(points)), 1 + np.flatnonzero(alike < ALIKE)):
            if len(part) >= SHORTEST:
                share = np.abs(motion[part]) / np.abs(motion[part]).max(axis=1, keepdims=True)
                in_play = (np.median(share, axis=0) > NO_PART).tolist()
                found.append(
                    SingularLine(points[part], tuple(itertools.compress(_names(kinematics), in_play)))
                )
    return found


def _jacobian(kinematics: Kinematics, grid: Grid, points: Array, length: float) -> Array:
    """Return the normalised Jacobian (p, 6, 6) at points of the map between those of the grid."""
    q = np.repeat(grid.q[:1], len(points), axis=0)
    for axis, name in enumerate(grid.names):
        q[:, _names(kinematics).index(name)] = points[:, axis]
    return normalised_jacobian(kinematics, posture(kinematics, q), length)


def _refined(points: Array, jacobian: Callable[[Array], Array], grid: Grid) -> Array:
    """Return points of a contour, straight between grid lines, moved onto the line by Newton's method."""
    step = 1e-6 * np.eye(2)
    cell = np.array([np.diff(grid.first).max(), np.diff(grid.second).max()])
    for _ in range(NEWTON):
        around = [np.linalg.det(jacobian(points + shift)) for shift in (0 * step[0], *step, *-step)]
        gradient = np.stack([around[1] - around[3], around[2] - around[4]], axis=1) / 2e-6
        steepness = (gradient**2).sum(axis=1, keepdims=True)
        move = -around[0][:, None] * gradient / np.where(steepness > 0.0, steepness, 1.0)
        # where lines cross the determinant is flat, and a step would leave the neighbourhood
        points = points + np.where((np.abs(move) < cell).all(axis=1, keepdims=True), move, 0.0)
    return points


def _names(kinematics: Kinematics) -> list[str]:
    return [variable.name for variable in kinematics.robot.actuated]
