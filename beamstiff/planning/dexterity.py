"""Dexterity: how evenly the joints move the tool, from the condition number of the normalised Jacobian.

The condition number after Frobenius (seed 000, eq. 11) of J_N = diag(I/L, I) J (eq. 12) is::

    kappa_F = sqrt(tr(J_N^T J_N) tr((J_N^T J_N)^-1)) / m

1 at an isotropic pose, infinite at a singular one. L is the robot's characteristic length, which makes the
smallest kappa_F over all poses as small as it can be (Angeles, Fundamentals of Robotic Mechanical Systems,
sec. 5.8).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from beamstiff.errors import BeamstiffError
from beamstiff.planning.poses import Grid, closed_posture, joint_ranges, spread
from beamstiff.robot.kinematics import Kinematics, Posture, twist_jacobian
from beamstiff.se3 import Array

SAMPLES = 4096  # random poses and lengths, of which the best start a search
STARTS = 12
OUT_OF_REACH = 50.0  # log kappa_F of a pose that does not close


def normalised_jacobian(kinematics: Kinematics, posture: Posture, length: float) -> Array:
    """Return the Jacobian with translations in characteristic lengths (seed 000, eq. 12), (P, 6, A).

    `posture`: P poses. `length`, m: prismatic variables are counted in it too, so that the entries have no
    unit.
    """
    if not (np.isfinite(length) and length > 0):
        raise BeamstiffError(f"characteristic length: found {length}, expected a positive number of metres")
    jacobian = twist_jacobian(kinematics, posture, kinematics.robot.tcp)
    columns = np.array([length if v.kind == "length" else 1.0 for v in kinematics.robot.actuated])
    rows = np.array([1 / length] * 3 + [1.0] * 3)
    return np.asarray(jacobian * rows[:, None] * columns)


def inverse_condition(matrix: Array) -> Array:
    """Return 1/kappa_F of matrices (..., m, n), between 0 (singular) and 1 (isotropic); (...).

    Where m and n differ, it is that of the smaller Gram matrix.
    """
    values = np.linalg.svd(matrix, compute_uv=False)
    largest, smallest = values[..., :1], values[..., -1:]
    # both sums relative to their largest term: no overflow, and 0 for a singular matrix
    ahead = np.divide(values, largest, out=np.ones_like(values), where=largest > 0.0)
    behind = np.divide(smallest, values, out=np.ones_like(values), where=values > 0.0)
    ratio = np.divide(smallest, largest, out=np.zeros_like(largest), where=largest > 0.0)[..., 0]
    return np.asarray(values.shape[-1] * ratio / np.sqrt((ahead**2).sum(-1) * (behind**2).sum(-1)))


@dataclass(frozen=True)
class CharacteristicLength:
    """The characteristic length of a robot."""

    length: float  # m
    condition: float  # the smallest condition number kappa_F that it gives
    q: Array  # (A,), rad or m: a pose that has it


def characteristic_length(kinematics: Kinematics) -> CharacteristicLength:
    """Return the characteristic length: it minimises kappa_F over pose (angles free) and length."""
    robot = kinematics.robot
    if not robot.actuated:
        raise BeamstiffError(
            f"robot {robot.name!r} has no actuated variable: dexterity has no meaning for it"
        )
    lower, upper = joint_ranges(robot)
    free = np.array([v.kind == "angle" for v in robot.actuated])
    lower, upper = np.where(free, -np.pi, lower), np.where(free, np.pi, upper)
    bounds = np.append(lower, np.log(1e-3 * kinematics.size)), np.append(upper, np.log(10 * kinematics.size))
    step = 1e-6 * np.eye(lower.size + 1)

    def log_condition(points: Array) -> Array:
        posture, closed = closed_posture(kinematics, points[:, :-1])
        length = np.exp(points[closed, -1])
        # lengths differ from pose to pose
        jacobian = normalised_jacobian(kinematics, posture, 1.0)
        prismatic = np.array([v.kind == "length" for v in robot.actuated])
        jacobian = np.where(prismatic, length[:, None, None], 1.0) * jacobian
        jacobian[:, :3] /= length[:, None, None]
        with np.errstate(divide="ignore"):
            found = -np.log(inverse_condition(jacobian))
        return np.nan_to_num(np.minimum(spread(closed, found), OUT_OF_REACH), nan=OUT_OF_REACH)

    def with_gradient(point: Array) -> tuple[float, Array]:
        around = log_condition(np.concatenate([point[None], point + step, point - step]))
        ahead, behind = np.split(around[1:], 2)
        return float(around[0]), (ahead - behind) / 2e-6

    random = np.random.default_rng(0)
    samples = random.uniform(*bounds, (SAMPLES, lower.size + 1))
    samples[:, -1] = np.log(random.uniform(0.01, 1.0, SAMPLES) * kinematics.size)
    values = log_condition(samples)
    limits = [
        (None, None) if angle else end
        for angle, end in zip(np.append(free, False), zip(*bounds, strict=True), strict=True)
    ]
    searches = [
        minimize(
            with_gradient, samples[at], jac=True, method="L-BFGS-B", bounds=limits, options={"ftol": 1e-14}
        )
        for at in np.argsort(values)[:STARTS]
    ]
    best = min(searches, key=lambda search: float(search.fun))
    if best.fun >= 0.5 * OUT_OF_REACH:
        raise BeamstiffError(
            f"robot {robot.name!r}: every pose is singular for {robot.tcp!r}, no length can be found"
        )
    q = np.where(free, np.arctan2(np.sin(best.x[:-1]), np.cos(best.x[:-1])), best.x[:-1])
    return CharacteristicLength(float(np.exp(best.x[-1])), float(np.exp(best.fun)), q)


@dataclass(frozen=True, eq=False)
class DexterityMap:
    """Dexterity over a grid of poses."""

    grid: Grid
    length: float  # m: characteristic length used
    inverse_condition: Array  # (n, m): 1/kappa_F; NaN where loops do not close
    position: Array  # (n, m, 3), m: of the node, base frame
    # (n, m): of the normalised Jacobian, for robots of six actuated variables
    determinant: Array | None


def dexterity_map(kinematics: Kinematics, grid: Grid, length: float) -> DexterityMap:
    """Return the dexterity at every pose of a grid (seed 000, Figure 3)."""
    posture, closed = closed_posture(kinematics, grid.q)
    if not closed.any():
        raise BeamstiffError(f"robot {kinematics.robot.name!r}: no pose of the grid closes its loops")
    jacobian = normalised_jacobian(kinematics, posture, length)
    position = posture.node_positions[:, kinematics.node_index[kinematics.robot.tcp]]
    square = jacobian.shape[1] == jacobian.shape[2]
    return DexterityMap(
        grid=grid,
        length=length,
        inverse_condition=spread(closed, inverse_condition(jacobian)).reshape(grid.shape),
        position=spread(closed, position).reshape(*grid.shape, 3),
        determinant=spread(closed, np.linalg.det(jacobian)).reshape(grid.shape) if square else None,
    )


@dataclass(frozen=True, eq=False)
class WorkspaceMap:
    """The best value that poses of a map reach in each cell of a vertical plane."""

    # x, z: (i + 1,), (k + 1,), m: edges of the cells, base frame
    x: Array
    z: Array
    value: Array  # (i, k): NaN where no pose of the map gets
    pose: np.ndarray  # (i, k) int: the pose of the grid that has the value; -1 where there is none


def workspace_map(dexterity: DexterityMap, cell: float) -> WorkspaceMap:
    """Return the best dexterity of poses in each square cell, of side `cell`, of the plane x z."""
    if not (np.isfinite(cell) and cell > 0):
        raise BeamstiffError(
            f"cells of a workspace map: found the size {cell}, expected a positive one in metres"
        )
    value = dexterity.inverse_condition.reshape(-1)
    position = dexterity.position.reshape(-1, 3)
    used = np.flatnonzero(~np.isnan(value))
    used = used[np.argsort(value[used], kind="stable")]  # the best comes last and stays
    place = position[used][:, [0, 2]].T
    index = np.floor(place / cell).astype(np.int64)
    start = index.min(axis=1)
    i, k = index - start[:, None]
    shape = (int(i.max()) + 1, int(k.max()) + 1)
    best, pose = np.full(shape, np.nan), np.full(shape, -1, dtype=np.int64)
    best[i, k], pose[i, k] = value[used], used
    x, z = (cell * (start[at] + np.arange(shape[at] + 1)) for at in (0, 1))
    return WorkspaceMap(x, z, best, pose)
