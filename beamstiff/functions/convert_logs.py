"""Logs of running machines to tables of measurements."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from beamstiff.errors import BeamstiffError
from beamstiff.files import read_text
from beamstiff.measure.bags import is_bag, read_bag
from beamstiff.measure.logs import LogTable, table_of_log
from beamstiff.measure.plateaus import SHORTEST
from beamstiff.measure.point_lists import signals_of
from beamstiff.measure.profiles import Profile
from beamstiff.measure.signals import Signal
from beamstiff.robot.description import Robot

LARGEST = 1 << 30  # bytes of a log in columns


def convert_log(
    path: str | os.PathLike[str],
    profile: Profile | None = None,
    joints: str | os.PathLike[str] | None = None,
    joints_profile: Profile | None = None,
    *,
    points: Mapping[str, str] | None = None,
    skip: Iterable[str] = (),
    lag: float | None = None,
    robot: Robot | None = None,
    shortest: float = SHORTEST,
) -> LogTable:
    """Return a log as a table of measurements (`measure.logs.table_of_log`).

    `path`: a bag, or columns that `profile` names. `joints`: the log of the robot, where it is another file.
    """
    signals, notes = _read(path, profile, skip)
    if joints is not None:
        more, others = _read(joints, joints_profile, ())
        signals = [one for one in signals if one.kind != "joints"] + [
            one for one in more if one.kind not in ("point", "pose")
        ]
        notes += others
    made = table_of_log(signals, str(path), points=points, lag=lag, robot=robot, shortest=shortest)
    return replace(made, notes=(*notes, *made.notes))


def _read(
    path: str | os.PathLike[str], profile: Profile | None, skip: Iterable[str]
) -> tuple[list[Signal], list[str]]:
    if is_bag(path):
        return read_bag(path, skip)
    if profile is None or not profile.samples:
        raise BeamstiffError(
            f"{path}: is no bag; a log in columns needs a profile with `samples: true` "
            "(or --joints-profile ur-rtde, kuka-rsi)"
        )
    return signals_of(read_text(Path(path), LARGEST), profile, str(path)), []
