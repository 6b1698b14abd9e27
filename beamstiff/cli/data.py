"""Tables of measurements, read; what looks like a mistake in them is said before anything is made of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from beamstiff.cli.output import say

if TYPE_CHECKING:
    from beamstiff.measure.table import Measurements
    from beamstiff.robot.description import Robot


def read_tables(
    paths: Iterable[str], robot: Robot, quiet: bool, *, require_measured: bool = True
) -> tuple[list[Measurements], list[str]]:
    """Return tables of measurements, and the notes about them, which were said.

    They are said at once, so that they stand before the error that a mistake leads to.

    Raises
    ------
    BeamstiffError
        See `beamstiff.measure.read_measurements`.
    """
    from beamstiff.measure import doubts, read_measurements
    from beamstiff.robot.doubts import robot_doubts

    tables = [read_measurements(path, robot, require_measured=require_measured) for path in paths]
    notes = [*robot_doubts(robot), *(note for table in tables for note in doubts(table, robot))]
    for note in notes:
        say(f"note: {note}", quiet)
    return tables, notes
