"""What in a table is allowed but hardly meant, such as a load of the wrong sign; and what cannot be used.

The load does positive work on whatever it displaces: ``w . d > 0`` for linear springs, springs that harden,
play and friction alike, as long as the load acts where the displacement is seen. Rows that say otherwise by
more than their noise are rare even where a machine drifts; loads of the wrong sign or frame make many.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from beamstiff.errors import UnusableError, listed
from beamstiff.measure.load_plausibility import load_doubts
from beamstiff.measure.position_plausibility import BEYOND_NOISE, SEVERAL, position_doubts
from beamstiff.measure.range_plausibility import joint_doubts
from beamstiff.measure.rotation_plausibility import rotation_doubts
from beamstiff.measure.rows import subset
from beamstiff.measure.swapped_labels import label_doubts
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

LARGE_DISPLACEMENT = 0.1  # m; a loaded robot moves by millimetres
LARGE_ROTATION = 0.1  # rad
LARGE_SIGMA = (5e-3, 5e-3)  # m, rad; a tape measure
LARGE_FORCE = 1e6  # N, N m
REVERSED = 0.5  # share of such rows that move against their load from which the sign is wrong
# and from which it may be the frame, or the columns: loads in another frame make a third to a half of the
# rows, a machine that drifts by several times its deflections a fifth
MISPLACED = 0.25
FINE = 0.8  # share of readings of other states that differ, of an instrument that reads finely


def doubts(measurements: Measurements, robot: Robot) -> tuple[str, ...]:
    """Return what in a table looks like a mistake of sign, unit or frame, a sentence each: no errors."""
    misread = tuple(position_doubts(measurements, robot))
    loads = () if misread else tuple(load_doubts(measurements, robot))
    return (
        *(misread or loads or _of_the_load(measurements)),
        *(() if misread else rotation_doubts(measurements, robot)),
        *_of_the_noise(measurements),
        *joint_doubts(measurements, robot),
        *_of_sizes(measurements),
        *_of_copies(measurements),
        *_of_the_robot(measurements, robot),
        *label_doubts(measurements, robot),
        *_of_the_times(measurements),
    )


def _of_the_times(table: Measurements) -> Iterator[str]:
    """Yield that times go back within a run, or are missing: drifts and histories of loading follow them."""
    unknown = np.isnan(table.time)
    if unknown.any() and not unknown.all():
        places = listed([table.place(row) for row in np.flatnonzero(unknown).tolist()], 3)
        yield (
            f"{places}: t is empty: the whole table counts as one without t, in the order of its rows; no "
            "drift with time is sought. Fill t in"
        )
    same_run = np.diff(table.run) == 0  # another run begins its clock anew
    back = np.flatnonzero((np.diff(table.time) < 0) & same_run)  # NaN, unknown, is no less
    if back.size:
        others = f", nor in {back.size - 1} other rows" if back.size > 1 else ""
        yield (
            f"{table.place(int(back[0]) + 1)}: t does not increase here{others}: rows are taken in the order "
            "of t; if they were read in the order of the table, correct t"
        )


def work(table: Measurements) -> tuple[Array, Array]:
    """Return the work that the load of each row would do, (N,), and its standard deviation (N,), N m.

    NaN where it is not known: a component that is loaded was not measured, the load acts elsewhere than the
    displacement was seen, there is no load. The standard deviation is 0 where the noise is not stated.
    """
    loaded = table.wrench != 0
    known = (table.kind == "displacement") & (table.point == table.load_point) & loaded.any(axis=1)
    known &= table.by_tracker
    moved = np.where(loaded, table.displacement, 0.0)
    sigma = np.nan_to_num(np.where(loaded, table.sigma, 0.0))
    with np.errstate(over="ignore", invalid="ignore"):  # loads beyond reason are told as such
        done = np.where(known, (table.wrench * moved).sum(axis=1), np.nan)
        return done, np.linalg.norm(table.wrench * sigma, axis=1)


def sure_work(table: Measurements) -> Array:
    """Return the work that loads would do of the rows whose sign is beyond the noise, N m."""
    done, std = work(table)
    return np.asarray(done[np.abs(done) > BEYOND_NOISE * std])


def _of_the_load(table: Measurements) -> Iterator[str]:
    done, std = work(table)
    sure = np.abs(done) > BEYOND_NOISE * std
    told = sure_work(table)
    count, against = len(told), int((told < 0).sum())
    if not count or against < MISPLACED * count:
        return
    stated = bool((std[sure] > 0).all())
    found = (
        f"{table.source}: the tool moved against its load in {against} of {count} rows"
        f"{' (those beyond the noise)' if stated and count < np.isfinite(done).sum() else ''}"
    )
    if against > REVERSED * count:
        yield (
            f"{found}, which no elastic machine does: is the sign of the loads, or of the displacements, "
            "reversed? Loads act on the tool; displacements are loaded minus unloaded"
        )
    elif against >= SEVERAL:
        noise = "" if stated else ", or the noise, which is not stated, as large as the displacements"
        yield (
            f"{found}: are the loads given in another frame than the base's, columns swapped, signs "
            f"mixed{noise}?"
        )


def _of_the_noise(table: Measurements) -> Iterator[str]:
    for key, sigma, limit, part, unit, small in (
        ("sigma_position", table.sigma_position, LARGE_SIGMA[0], slice(0, 3), "m", "mm"),
        ("sigma_rotation", table.sigma_rotation, LARGE_SIGMA[1], slice(3, 6), "rad", "mrad"),
    ):
        largest = np.nan_to_num(np.abs(table.displacement[:, part])).max()
        if sigma is None or not (sigma > limit or sigma > largest > 0):
            continue
        than = f", larger than anything measured ({1e3 * largest:.3g} {small})" if sigma > largest > 0 else ""
        yield (
            f"{table.source}: {key}: {sigma:.3g} {unit} is large{than}; a number without a unit is in "
            f"{unit}, write for instance {key}: 0.02 {small}"
        )


def _of_sizes(table: Measurements) -> Iterator[str]:
    if table.kind == "displacement":
        parts = (
            ("displacement", slice(0, 3), LARGE_DISPLACEMENT, "m", "dx [mm]"),
            ("rotation", slice(3, 6), LARGE_ROTATION, "rad", "rx [deg]"),
        )
        for what, part, limit, unit, header in parts:
            with np.errstate(over="ignore"):
                size = np.sqrt(np.nansum(table.displacement[:, part] ** 2, axis=1))
            row = int(size.argmax())
            if size[row] > limit:
                yield (
                    f"{table.place(row)}: a {what} of {size[row]:.3g} {unit} is large for a loaded "
                    f"robot; a column without a unit is in {unit}, write for instance {header}"
                )
    load = np.abs(table.wrench).max(axis=1)
    row = int(load.argmax())
    if load[row] > LARGE_FORCE:
        yield f"{table.place(row)}: a load of {load[row]:.3g} N or N m is large for a robot"


Reading = tuple[str, str, bytes]


def readings(table: Measurements) -> dict[int, Reading]:
    """Return all that is read in each row that reads anything: state, time and values, to the last digit.

    Empty where readings of other states agree as well: a dial gauge may well read the same again.
    """
    read = np.concatenate([table.displacement, table.position, table.rotation], axis=1)
    columns = [table.q, table.wrench, read, table.time[:, None], table.temperature[:, None]]
    values = np.nan_to_num(np.concatenate(columns, axis=1))
    found = {
        row: (f"{table.point[row]} {table.target[row]}", str(table.load_point[row]), values[row].tobytes())
        for row in np.flatnonzero(np.nan_to_num(read).any(axis=1)).tolist()
    }
    single = read[list({reading: row for row, reading in found.items()}.values())]
    told = (value[np.isfinite(value) & (value != 0)] for value in single.T)
    return {} if any(np.unique(value).size < FINE * value.size for value in told) else found


def copies(table: Measurements) -> list[tuple[int, int]]:
    """Return the rows that are another one to the last digit, each with the first that it is like."""
    first: dict[Reading, int] = {}
    found = []
    for row, reading in readings(table).items():
        if reading in first:
            found.append((row, first[reading]))
        first.setdefault(reading, row)
    return found


def _of_copies(table: Measurements) -> Iterator[str]:
    """Yield that rows were pasted twice: readings of one state agree to the last digit by chance only."""
    found = copies(table)
    if len(found) >= SEVERAL:
        row, like = found[0]
        yield (
            f"{table.place(row)}: {len(found)} rows are copies of others to the last digit (this one of "
            f"{table.place(like)}): each reading counts once, leave the copies out"
        )


def _of_the_robot(table: Measurements, robot: Robot) -> Iterator[str]:
    name = table.metadata.get("robot")
    if name is not None and name != robot.name:
        yield f"{table.source}: the table is of robot {name!r}, here it is read with {robot.name!r}"


def require_usable(table: Measurements) -> None:
    """Refuse displacements that tell nothing of the machine, and positions none of which has x, y and z."""
    if table.kind != "displacement":
        unread = np.isnan(table.position[table.by_tracker])  # other instruments read a single number
        if unread.any(axis=1).all() and not unread.all():
            lost = [axis for axis, column in zip("xyz", unread.T, strict=True) if column.all()]
            which = f": no row has a value in {' or '.join(lost)}" if lost else ""
            raise UnusableError(f"{table.source}: no row has all of x y z{which}; a position needs the three")
        return
    if not np.nan_to_num(table.displacement).any():
        raise UnusableError(
            f"{table.source}: all displacements are 0: found no reading (dx dy dz are loaded minus unloaded)"
        )
    done = sure_work(table)
    if len(done) >= SEVERAL and (done < 0).all():
        raise UnusableError(
            f"{table.source}: the tool moved against its load in all {len(done)} rows that tell, which no "
            "elastic machine does: reverse the sign of the loads (they act on the tool) or of the "
            "displacements (loaded minus unloaded)"
        )


def counted_once(table: Measurements) -> Measurements:
    """Return a table without its copies of rows: readings that agree to the last digit by chance only."""
    again = copies(table)
    if len(again) < SEVERAL:
        return table
    kept = np.ones(len(table), dtype=np.bool_)
    kept[[row for row, _ in again]] = False
    return subset(table, kept)


def copies_between(tables: Sequence[Measurements]) -> Iterator[str]:
    """Yield that rows of one table stand in another as well, where they do."""
    read = [set(readings(table).values()) for table in tables]
    for at, table in enumerate(tables):
        for before, other in enumerate(tables[:at]):
            if (count := len(read[at] & read[before])) >= SEVERAL:
                yield f"{table.source}: {count} rows are copies of rows of {other.source}: each counts once"
