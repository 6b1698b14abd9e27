"""Chunks in whose middle a process dies."""

import os
import signal
import time
from pathlib import Path

from beamstiff.maps.chunk import Part, compute_chunk
from beamstiff.maps.grid import Box
from beamstiff.maps.job import Job


def dies_once(folder: Path, row: int, job: Job, box: Box) -> Part:
    """Compute a chunk; who takes that which begins with some row is killed, the first time."""
    if box[0].start == row:
        try:
            (folder / "died").touch(exist_ok=False)
        except FileExistsError:
            return compute_chunk(job, box)
        time.sleep(0.5)  # others come through meanwhile
        os.kill(os.getpid(), signal.SIGKILL)
    return compute_chunk(job, box)


def always_dies(_: Job, __: Box) -> Part:
    """Be killed."""
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError
