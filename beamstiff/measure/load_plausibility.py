"""Whether loads can be those that moved the tool: their sign, their columns, and their unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import UnusableError
from beamstiff.measure.drive_springs import moved_by_loads, springs_of
from beamstiff.measure.misread_columns import NEARER, misread_columns, require_columns
from beamstiff.measure.position_plausibility import BEYOND_NOISE, LOADED
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

GUESSED = 100.0  # times softer, or stiffer, than in the robot file: guesses are off by ten, units by 1000
# N/m: a heavy arm with drives of 1e7 N m/rad at 3 m reach has 1e6, one that is 10 times stiffer is none
STIFFEST = 1e7


def require_loads(table: Measurements, robot: Robot) -> None:
    """Refuse loads that cannot be those of what they moved: another sign, other columns, another unit."""
    done = work_between(table, robot)
    if len(done) >= LOADED and (done < 0).all():
        raise UnusableError(
            f"{table.source}: between the loads of a posture the target moved against the load in all "
            f"{len(done)} rows that tell, which no elastic machine does: reverse the sign of the loads (they "
            "act on the tool, in base axes)"
        )
    require_columns(table, robot)
    for sure, told in _of_the_unit(table, robot):
        if sure:
            raise UnusableError(told)


def work_between(table: Measurements, robot: Robot) -> Array:
    """Return what forces beyond the least of a posture would do of its absolute positions, N m, where sure.

    The measuring frame is turned as the robot lies over the positions; targets may sit beside the load.
    """
    if table.kind != "absolute":
        return np.zeros(0)
    rows, more, moved = moved_by_loads(table, robot)
    done = (more[:, :3] * moved).sum(axis=1)
    std = np.linalg.norm(more[:, :3] * np.nan_to_num(table.sigma[rows, :3]), axis=1) * np.sqrt(2.0)
    return np.asarray(done[np.abs(done) > BEYOND_NOISE * std])


def load_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield that loads or joint values may stand in other columns, signs or units; mostly nothing."""
    misread = [told for _, told in misread_columns(table, robot)]
    yield from misread or (told for _, told in _of_the_unit(table, robot))


def _of_the_unit(table: Measurements, robot: Robot) -> Iterator[tuple[bool, str]]:
    """Yield that loads move the tool many times as far, or as little, as drives of the robot file let them.

    And whether that is sure: what moves less than any robot would is; an arm may be soft, or have soft links.
    """
    if (fitting := springs_of(table, robot)) is None:
        return
    springs, _, more, moved = fitting
    if not springs.left(more, moved) < NEARER * float(np.sqrt((moved**2).sum(axis=1).mean())):
        return
    described = springs.as_described(more, robot)
    times = float((described * moved).sum()) / max(float((described**2).sum()), 1e-300)
    if not described.any() or times <= 0.0 or 1.0 / GUESSED < times < GUESSED:
        return
    forces, displacements = ("kN", "um") if times > 1.0 else ("N", "mm")
    read_forces, read_displacements = ("N", "mm") if times > 1.0 else ("kN", "um")
    asked = f"fx fy fz in {forces}, and read in {read_forces}"
    if table.kind == "displacement":
        asked = f"dx dy dz in {displacements}, and read in {read_displacements}, or {asked}"
    stiff = float(np.linalg.norm(more[:, :3]) / max(float(np.linalg.norm(moved)), 1e-300))
    sure = table.kind == "displacement" and times < 1.0 and stiff > STIFFEST
    start = "If not, these drives are start values, and are fitted."
    otherwise = start if robot.unmeasured else "Or is the stiffness in the robot file a guess?"
    if sure:
        otherwise = f"{stiff:.2g} N/m is no robot; if it is one, state its stiffness in the robot file"
    yield (
        sure,
        f"{table.source}: the loads move the tool {times:.2g} times as far as the drives of robot "
        f"{robot.name!r} let them: are {asked}? {otherwise}",
    )
