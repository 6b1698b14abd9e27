"""What in a table no analysis can use: readings that are all 0 or all against their load; copies of rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.measure.doubts import SEVERAL, copies, readings, sure_work
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements


class UnusableError(BeamstiffError):
    """Displacements that tell nothing of the machine; the message says all there is to say."""


def require_usable(table: Measurements) -> None:
    """Refuse displacements that tell nothing of the machine."""
    if table.kind != "displacement":
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
