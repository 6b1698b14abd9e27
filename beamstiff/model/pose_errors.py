"""Errors of poses, said with the row of the table that they stand in."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.mechanism import PoseError
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements


@contextmanager
def named_by_row(loads: Measurements, pose: Integers) -> Iterator[None]:
    """Say with an error that names a pose which row has it first; `pose` (N,) is that of each row."""
    try:
        yield
    except PoseError as error:
        if not error.where:  # what is wrong at the only pose is wrong with the robot
            raise
        row = int(np.flatnonzero(pose == error.pose)[0])
        what = str(error).replace(error.where, "", 1)
        raise BeamstiffError(f"{loads.place(row)}: {what}") from None
