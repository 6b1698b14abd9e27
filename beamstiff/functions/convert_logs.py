"""Logs of running machines to tables of measurements."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping

from beamstiff.measure.bags import read_bag
from beamstiff.measure.logs import LogTable, table_of_log
from beamstiff.measure.plateaus import SHORTEST
from beamstiff.robot.description import Robot


def convert_log(
    path: str | os.PathLike[str],
    *,
    points: Mapping[str, str] | None = None,
    skip: Iterable[str] = (),
    lag: float | None = None,
    robot: Robot | None = None,
    shortest: float = SHORTEST,
) -> LogTable:
    """Return a log as a table of measurements (`measure.logs.table_of_log`)."""
    signals, notes = read_bag(path, skip)
    made = table_of_log(
        signals, str(path), points=points, lag=lag, robot=robot, shortest=shortest
    )
    return LogTable(made.text, made.count, (*notes, *made.notes), made.windows, made.lags, made.signals)
