"""Whether measured rotations can be the robot's; else the convention that their numbers were written in.

Where the tracker stands and how its target is turned is not known, ``R = A P B``; but by how much the tool
turns from one posture to another is, whatever A and B. Angles read in another convention, such as those about
fixed axes for those about turned ones, turn by something else.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from beamstiff.errors import BeamstiffError, UnusableError
from beamstiff.measure.orientation import named_orientation
from beamstiff.measure.rows import evenly
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

ROWS = 24  # looked at
SEVERAL = 8  # rows
LEAST = 5e-3  # rad, RMS, from which another convention is looked for: no zero of a joint makes up for one
AMISS = 0.1  # rad, RMS: joints are off by less
SURELY = 10.0  # times nearer
ALIKE = 1.01  # times the best: one convention by several names
ROUNDING = 1e-9  # rad
AXES = [a + b + c for a, b, c in product("XYZ", repeat=3) if a != b != c]
CONVENTIONS = ("rotation vector", *(f"{how} {axes}" for how in ("Euler", "fixed") for axes in AXES))
USUAL = ("rotation vector", "Euler XYZ", "Euler ZYX", "Euler ZYZ", "fixed XYZ", "fixed ZYX")


def require_rotations(table: Measurements, robot: Robot) -> None:
    """Refuse rotations of a table that another convention of orientation makes the robot's."""
    rows, turned = _turned(table, robot)
    if not len(rows) or (left := _unlike(rows, turned)) < LEAST:
        return
    found = {
        (taken, meant): _unlike(_read_as(rows, taken, meant), turned)
        for taken, meant in product(USUAL, CONVENTIONS)
        if taken != meant
    }
    best = min(found.values())
    if best > left / SURELY:
        return
    named = dict[str, str]()  # of several that come to the same one of the same axes, else the most usual
    for (taken, meant), value in sorted(found.items(), key=lambda one: _unusual(*one[0])):
        if value < ALIKE * best + ROUNDING:
            named.setdefault(taken, meant)
    told = " or ".join(f"{meant} in place of {taken}" for taken, meant in named.items())
    raise UnusableError(
        f"{table.source}: between postures the measured rotations differ by {left:.2g} rad (RMS) from those "
        f"of robot {robot.name!r}; read as {told} they agree within {best:.1g} rad: name that convention "
        "where the angles are read (`orientation: Euler XYZ` in a profile, `# orientation: Euler XYZ` in a "
        "table)"
    )


def _unusual(taken: str, meant: str) -> tuple[bool, bool]:
    return taken[-3:] != meant[-3:], meant not in USUAL


def rotation_doubts(table: Measurements, robot: Robot) -> Iterator[str]:
    """Yield that the measured rotations are not the robot's; mostly nothing."""
    rows, turned = _turned(table, robot)
    if len(rows) and (left := _unlike(rows, turned)) > AMISS:
        yield (
            f"between postures the measured rotations differ by {left:.2g} rad (RMS) from those of robot "
            f"{robot.name!r}, whatever their convention: leave out the columns a b c, or see what they are of"
        )


def _turned(table: Measurements, robot: Robot) -> tuple[Array, Array]:
    """Return measured rotations of some rows and the robot's in the same, (R, 3, 3) each; none of too few."""
    none = np.zeros((0, 3, 3)), np.zeros((0, 3, 3))
    rows = np.flatnonzero(~np.isnan(table.rotation).any(axis=1) & table.by_tracker)
    if table.kind != "absolute" or table.camera or len(rows) < SEVERAL:
        return none
    rows = rows[evenly(len(rows), ROWS)]
    kinematics = compile_kinematics(robot)
    try:
        pose = pose_of(kinematics, posture(kinematics, table.q[rows]), robot.tcp)
    except BeamstiffError:  # the loops do not close
        return none
    return rotation_from_vector(table.rotation[rows]), pose[:, :3, :3]


def _unlike(one: Array, other: Array) -> float:
    """Return by how much rotations (R, 3, 3) turn otherwise between rows than others, RMS, rad."""
    angles = [
        np.linalg.norm(vector_from_rotation(each.swapaxes(1, 2) @ np.roll(each, step, axis=0)), axis=1)
        for each in (one, other)
        for step in (1, 3)
    ]
    return float(np.sqrt(np.mean([(angles[0] - angles[2]) ** 2, (angles[1] - angles[3]) ** 2])))


def _read_as(rotations: Array, taken: str, meant: str) -> Array:
    """Return rotations whose numbers in one convention are read in another."""
    numbers = named_orientation(taken).numbers(rotations, np.zeros((len(rotations), 3)))
    return named_orientation(meant).rotations(numbers)
