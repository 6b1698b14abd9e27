"""Poses to look at: grids over two joint variables, and random ones within the limits, loops closed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.columns import Column, to_si
from beamstiff.robot.closure import close_loops, near_fold
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Kinematics, Posture, actuated_values, posture_at
from beamstiff.se3 import Array
from beamstiff.units import UNITS, unit_factor

Mask = NDArray[np.bool_]

DIGIT = {"angle": 2e-3, "length": 2e-4}  # rad, m: the last digit of a proposed posture is worth at most this
ROUNDS = 50  # of drawing random poses, before too few of them are said to close


@dataclass(frozen=True, eq=False)
class Grid:
    """Poses over two actuated variables, the others held; n values of the first, m of the second."""

    names: tuple[str, str]
    # first, second: (n,), (m,), rad or m: growing values
    first: Array
    second: Array
    q: Array  # (n * m, A), rad or m: the second variable runs fastest
    turns: tuple[bool, bool]  # whether each variable is an angle

    @property
    def shape(self) -> tuple[int, int]:
        """The shape (n, m) of what is shown over the grid."""
        return self.first.size, self.second.size


def joint_grid(robot: Robot, over: Mapping[str, ArrayLike], held: Mapping[str, float] | None = None) -> Grid:
    """Return the poses of a grid `over` two actuated variables, growing values; those not `held` are 0."""
    names, held = list(over), dict(held or {})
    if len(names) != 2:
        raise BeamstiffError(f"a map needs two joint variables, found {listed(names) or 'none'}")
    if twice := [name for name in names if name in held]:
        raise BeamstiffError(f"{twice[0]} is on an axis of the map and held: expected one of the two")
    axes = [growing(name, values) for name, values in over.items()]
    first, second = (values.reshape(-1) for values in np.meshgrid(*axes, indexing="ij"))
    q = actuated_values(robot, {**held, names[0]: first, names[1]: second})
    kinds = {variable.name: variable.kind for variable in robot.actuated}
    turns = (kinds[names[0]] == "angle", kinds[names[1]] == "angle")
    return Grid((names[0], names[1]), axes[0], axes[1], q, turns)


def growing(name: str, values: ArrayLike) -> Array:
    """Return the values of an axis of a map, refused where they do not grow."""
    try:
        axis = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise BeamstiffError(f"{name}: found {str(values)[:60]!r}, expected numbers") from None
    if axis.ndim != 1 or axis.size < 2 or not (np.isfinite(axis).all() and (np.diff(axis) > 0).all()):
        raise BeamstiffError(f"{name}: expected at least two growing values, found {axis.tolist()!s:.60}")
    return axis


def closed_posture(kinematics: Kinematics, q: Array) -> tuple[Posture, Mask]:
    """Return the machine at those of the poses (P, A) whose loops close, and which these are (P,)."""
    values, closed, _ = close_loops(kinematics, q, strict=False)
    return posture_at(kinematics, values[closed]), closed


def spread(closed: Mask, values: Array) -> Array:
    """Return values of the closed poses at their places among all, NaN elsewhere."""
    result = np.full((closed.size, *values.shape[1:]), np.nan)
    result[closed] = values
    return result


def joint_ranges(robot: Robot) -> tuple[Array, Array]:
    """Return lower and upper ends (A,) of the actuated variables: their limits, else a full turn."""
    ends = []
    for variable in robot.actuated:
        if variable.limits is None and variable.kind == "length":
            raise BeamstiffError(
                f"variable {variable.name!r} of robot {robot.name!r} is a length without limits: give it "
                "limits, to know which poses there are"
            )
        ends.append(variable.limits or (-np.pi, np.pi))
    lower, upper = np.array(ends, dtype=np.float64).reshape(-1, 2).T
    return lower, upper


def random_poses(kinematics: Kinematics, count: int, random: np.random.Generator) -> Array:
    """Return poses (count, A) drawn evenly within the joint limits: their loops close, and near no fold."""
    lower, upper = joint_ranges(kinematics.robot)
    found = np.zeros((0, lower.size))
    for _ in range(ROUNDS):
        drawn = random.uniform(lower, upper, (max(2 * (count - len(found)), 16), lower.size))
        values, closed, _ = close_loops(kinematics, drawn, strict=False)
        closed[closed] = ~near_fold(kinematics, values[closed])
        found = np.concatenate([found, drawn[closed]])
        if len(found) >= count:
            return found[:count]
    raise BeamstiffError(
        f"robot {kinematics.robot.name!r}: only {len(found)} of {count} poses found whose loops close within "
        "the limits of the joints; check the limits, or the guess of the passive variables"
    )


def rounded_postures(robot: Robot, q: Array, units: Mapping[str, str]) -> Array:
    """Return postures with the digits that a pendant takes, within the limits.

    `q` (n, A): of the actuated variables, rad or m. `units`: in which the pendant takes them, by variable; SI
    else.

    >>> from beamstiff import load_robot
    >>> posture = np.array([[0.12345, -0.5, 0.5, 0.0, 0.0, 0.0]])
    >>> np.degrees(rounded_postures(load_robot("kr500"), posture, {"q1": "deg"}))[0, 0].round(12)
    np.float64(7.1)
    """
    lower, upper = joint_ranges(robot)
    result = q.copy()
    for k, variable in enumerate(robot.actuated):
        unit = units.get(variable.name, UNITS[variable.kind])
        factor, _ = unit_factor(unit, variable.kind)
        decimals = max(0, -int(np.floor(np.log10(DIGIT[variable.kind] / factor))))
        column = Column(variable.name, variable.kind, unit)
        result[:, k] = to_si(np.round(q[:, k] / factor, decimals) + 0.0, column)
    return np.where((result >= lower) & (result <= upper), result, q)
