"""Tables of measurements, read, with what looks like a mistake in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.measure.table import Measurements
    from beamstiff.robot.description import Robot


def read_tables(
    paths: Iterable[str], robot: Robot, *, require_measured: bool = True
) -> tuple[list[Measurements], list[str]]:
    """Return tables of measurements, and what in them and in the robot is hardly meant, a sentence each.

    Raises
    ------
    BeamstiffError
        See `beamstiff.measure.read_measurements`.
    """
    from beamstiff.measure import doubts, read_measurements
    from beamstiff.measure.usable import copies_between
    from beamstiff.robot.doubts import robot_doubts

    tables = [read_measurements(path, robot, require_measured=require_measured) for path in paths]
    notes = [*robot_doubts(robot), *(note for table in tables for note in doubts(table, robot))]
    return tables, [*notes, *copies_between(tables)]


@contextmanager
def doubted(notes: Sequence[str]) -> Iterator[None]:
    """Say with an error, in its line, what in the tables may have led to it."""
    from beamstiff.measure.usable import UnusableError

    try:
        yield
    except BeamstiffError as error:
        if not notes or isinstance(error, UnusableError):
            raise
        raise BeamstiffError(f"{error}; it may come from this: {notes[0]}") from error
