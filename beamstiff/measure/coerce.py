"""Tables of measurements, however they are given: objects or paths; and what in them is hardly meant."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from beamstiff.errors import BeamstiffError, OptionError, UnusableError, shown
from beamstiff.measure.load_plausibility import require_loads
from beamstiff.measure.plausibility import copies_between, doubts
from beamstiff.measure.position_plausibility import require_joints, require_scale
from beamstiff.measure.range_plausibility import require_displacements, require_limits
from beamstiff.measure.reader import read_measurements
from beamstiff.measure.rotation_plausibility import require_rotations
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.plausibility import robot_doubts

TableLike = Measurements | str | os.PathLike[str]
DataLike = TableLike | Sequence[TableLike]


def as_tables(
    data: DataLike, robot: Robot, *, require_measured: bool = True, what: str = "data"
) -> list[Measurements]:
    """Return tables: themselves, or read from CSV; loads alone are refused if `require_measured`."""
    given = [data] if isinstance(data, Measurements | str | os.PathLike) else data
    if not isinstance(given, Sequence):
        raise _refused(data, what)
    if not given:
        raise BeamstiffError(f"{what}: found no table, expected at least one")
    read = set[Path]()
    tables = []
    for one in given:
        if isinstance(one, Measurements):
            tables.append(one)
            continue
        if not isinstance(one, str | os.PathLike):
            raise _refused(one, what)
        file = Path(one).resolve()
        if file in read:
            raise BeamstiffError(f"{os.fspath(one)}: is given twice, its rows would count twice")
        read.add(file)
        tables.append(read_measurements(Path(one), robot, require_measured=require_measured))
    return tables


def doubts_of(robot: Robot, tables: Sequence[Measurements]) -> list[str]:
    """Return what in a robot and in tables is hardly meant, a sentence each.

    Raises UnusableError where readings or joint values surely are in another unit, or joint values or loads
    in another column or sign.
    """
    for table in tables:
        require_limits(table, robot)
        require_displacements(table, robot)
        require_joints(table, robot)
        require_scale(table, robot)
        require_rotations(table, robot)
        require_loads(table, robot)
    own = (note for table in tables for note in doubts(table, robot))
    return [*robot_doubts(robot), *own, *copies_between(tables)]


@contextmanager
def doubted(notes: Sequence[str]) -> Iterator[None]:
    """Say with an error, in its line, what in the tables may have led to it."""
    doubt = f"; it may come from this: {notes[0]}" if notes else ""
    try:
        with np.errstate(over="raise"):
            yield
    except FloatingPointError as error:
        raise BeamstiffError(
            f"numbers out of range ({error}), expected lengths, loads and stiffness of a real machine; check "
            f"their units{doubt}"
        ) from None
    except BeamstiffError as error:
        if not notes or isinstance(error, UnusableError):
            raise
        raise BeamstiffError(f"{error}{doubt}") from error


def refuse_fitted(tests: Iterable[object], data: DataLike) -> None:
    """Refuse files of readings to test on that are fitted too."""
    given = [data] if isinstance(data, Measurements | str | os.PathLike) else list(data)
    fitted = {Path(one).resolve() for one in given if isinstance(one, str | os.PathLike)}
    for path in tests:
        if isinstance(path, str | os.PathLike) and Path(path).resolve() in fitted:
            raise OptionError("test", f"{os.fspath(path)}: is fitted too, expected readings that are not")


def _refused(value: object, what: str) -> BeamstiffError:
    return BeamstiffError(
        f"{what}: found {shown(value)}, expected measurements, the path of a CSV table, or several of these"
    )
