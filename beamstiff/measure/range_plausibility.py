"""Whether values can be in the unit that they were read in: displacements and joint values out of range."""

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import UnusableError, listed
from beamstiff.measure.table import DISPLACEMENT, Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

REACH = 0.1  # of how far the robot reaches: a load that moves its tool farther is none that it carries
ALL = 1 / 30  # of that, which half the rows exceed where a unit is wrong: else it is a row
MILLI, MICRO = 1e-3, 1e-6
TURN = 2 * np.pi


def require_displacements(table: Measurements, robot: Robot) -> None:
    """Refuse displacements beyond a tenth of the robot's reach: they are in another unit."""
    if table.kind != "displacement":
        return
    with np.errstate(over="ignore"):  # numbers beyond reason are told as such
        reach = compile_kinematics(robot).size
        moved = np.sqrt(np.nansum(table.displacement[:, :3] ** 2, axis=1))
    far = np.flatnonzero(moved > REACH * reach)
    if not far.size:
        return
    row = int(far[0])
    largest = DISPLACEMENT[int(np.nanargmax(np.abs(table.displacement[row, :3])))]
    usual = float(np.median(moved[moved > 0]))
    asked = f"is {largest} in um, and read in mm, or in mm, and read in m?"
    if MILLI * usual > REACH * reach > MICRO * usual:
        asked = f"is {largest} in um, and read in m?"
    elif usual < ALL * REACH * reach:
        asked = "is this row misread?"
    raise UnusableError(
        f"{table.place(row)}: {largest}: the tool would have moved {moved[row]:.3g} m, more than a tenth of "
        f"the reach of robot {robot.name!r} ({reach:.3g} m): {asked}"
    )


def require_limits(table: Measurements, robot: Robot) -> None:
    """Refuse readings at angles that lie beyond the robot's limits by more than a turn in most rows: degrees.

    Loads alone, without readings, are asked about and keep their note.
    """
    turns = [at for at, variable in enumerate(robot.actuated) if variable.kind == "angle"]
    limits = [robot.actuated[at].limits for at in turns]
    known = np.array([pair for pair in limits if pair is not None and np.isfinite(pair).all()])
    if not turns or len(known) < len(turns) or not table.measured_mask.any():
        return
    low, high = known.T
    beyond = _beyond(table.q[:, turns], low, high)
    far = (beyond > TURN).any(axis=1)
    if far.sum() <= len(table) / 2:
        return
    row = int(far.argmax())
    at = int(beyond[row].argmax())
    name, value = robot.actuated[turns[at]].name, table.q[row, turns[at]]
    as_degrees = (_beyond(np.radians(table.q[:, turns]), low, high) < TURN).all(axis=1)
    asked = "check the joint columns and their unit"
    if 2 * as_degrees.sum() > len(table):
        asked = f"are the joint columns in degrees? Write {name} [deg], and so for all (in a profile, deg)"
    raise UnusableError(
        f"{table.place(row)}: {name}: {value:.6g} rad lies more than a turn outside the limits "
        f"{low[at]:.4g} to {high[at]:.4g} rad of robot {robot.name!r}, as joint values do in {far.sum()} of "
        f"{len(table)} rows: {asked}"
    )


def _beyond(q: Array, low: Array, high: Array) -> Array:
    """Return by how much angles (N, A) lie outside their limits (A,), rad."""
    return np.maximum(np.maximum(low - q, q - high), 0.0)


def joint_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield joint values outside the robot's limits, or of more than two turns."""
    wound: list[tuple[str, int, float]] = []
    for variable, q in zip(robot.actuated, table.q.T, strict=True):
        row = int(np.abs(q).argmax())
        turns = variable.kind == "angle"
        if turns and abs(q[row]) > 4 * np.pi:
            wound.append((variable.name, row, float(q[row])))
        elif variable.limits is not None:
            low, high = variable.limits
            slack = 1e-6 * (high - low)
            outside = (q < low - slack) | (q > high + slack)
            if outside.any():
                row = int(outside.argmax())
                degrees = f" ({_degrees(q[row])}; {_degrees(low)} to {_degrees(high)})" if turns else ""
                turned = q[outside] - 2 * np.pi * np.round((q[outside] - 0.5 * (low + high)) / (2 * np.pi))
                if turns and ((turned >= low - slack) & (turned <= high + slack)).all():
                    degrees += ": is it off by a full turn?"
                unit = "rad" if turns else "m"
                yield (
                    f"{table.place(row)}: {variable.name}: {q[row]:.6g} {unit} lies outside the limits "
                    f"{low:.6g} to {high:.6g} {unit} of robot {robot.name}{degrees}"
                )
    if wound:
        name, row, value = wound[0]
        others = f" (and so for {listed([other for other, _, _ in wound[1:]], 12)})" if wound[1:] else ""
        yield (
            f"{table.place(row)}: {name}: {value:.6g} rad is more than two turns; if the column is in "
            f"degrees, write {name} [deg]{others}"
        )


def _degrees(angle: float) -> str:
    return f"{np.degrees(angle):.4g} deg"
