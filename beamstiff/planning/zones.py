"""Zones of a map where something is good, and the lines of singular poses that it runs through."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from scipy import ndimage

from beamstiff.errors import BeamstiffError
from beamstiff.planning.dexterity import DexterityMap, normalised_jacobian
from beamstiff.planning.poses import Grid, Mask
from beamstiff.robot.kinematics import Kinematics, posture
from beamstiff.se3 import Array

FULL_TURN = 2 * np.pi

NO_PART = 0.02  # of the largest share: a joint that takes less part in a singular motion is left out
SHORTEST = 3  # points of a line
ALIKE = 0.7  # cosine between the motions lost at neighbouring points of one line
NEWTON = 4  # steps


@dataclass(frozen=True, eq=False)
class Zone:
    """A contiguous region of a map."""

    grid: Grid
    mask: Mask  # (n, m) bool: points of the grid that belong to it
    # rad or m: smallest ranges of both variables that hold it; past a full turn where it runs
    # over the edge
    ranges: dict[str, tuple[float, float]]
    share: float  # of the grid's points
    best: float  # its best value
    at: dict[str, float]  # rad or m: where that is


def find_zones(grid: Grid, values: Array, least: float) -> list[Zone]:
    """Return the contiguous regions where values (n, m) are at least `least`, the largest first.

    A grid over a full turn of an angle is closed: what runs over its edge is one region. Points where there
    is no value (NaN) belong to none.
    """
    if values.shape != grid.shape:
        raise BeamstiffError(f"zones: found values of shape {values.shape}, expected {grid.shape}")
    with np.errstate(invalid="ignore"):  # NaN is in no zone
        mask = values >= least
    labels, count = ndimage.label(mask)
    number = np.arange(count + 1)
    axes = tuple(zip(grid.names, (grid.first, grid.second), grid.turns, strict=True))
    for axis, (_, ticks, turns) in enumerate(axes):
        if turns and _closed(ticks):
            edges = zip(np.take(labels, 0, axis=axis), np.take(labels, -1, axis=axis), strict=True)
            for a, b in {(int(a), int(b)) for a, b in edges if a and b}:
                number[number == number[b]] = number[a]
    zones = []
    for label in np.unique(number[1:]):
        region = (number[labels] == label) & mask
        i, j = np.unravel_index(np.argmax(np.where(region, values, -np.inf)), grid.shape)
        ranges = {
            name: _range(ticks, region.any(axis=1 - axis), turns)
            for axis, (name, ticks, turns) in enumerate(axes)
        }
        at = {grid.names[0]: float(grid.first[i]), grid.names[1]: float(grid.second[j])}
        zones.append(Zone(grid, region, ranges, float(region.mean()), float(values[i, j]), at))
    return sorted(zones, key=lambda zone: -zone.share)


def _closed(values: Array) -> bool:
    """Return whether values of an angle go all around, so that the first follows on the last."""
    step = float(np.diff(values).max())
    return bool(values[-1] - values[0] + step >= FULL_TURN - 1e-6 * step)


def _range(values: Array, used: Mask, turns: bool) -> tuple[float, float]:
    """Return the smallest range that holds the used values, over the edge of a full turn where shorter."""
    held = values[used]
    if not (turns and _closed(values)) or used.all():
        return float(held[0]), float(held[-1])
    gaps = np.diff(np.append(held, held[0] + FULL_TURN))
    widest = int(np.argmax(gaps))
    start = held[(widest + 1) % held.size]
    return float(start), float(start + FULL_TURN - gaps[widest])


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
