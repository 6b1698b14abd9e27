"""What a map will take of memory and disk, and refusing beforehand what does not fit."""

from __future__ import annotations

import shutil
from pathlib import Path

from beamstiff.errors import BeamstiffError
from beamstiff.fem.large.memory import SHARE, free_bytes
from beamstiff.maps.chunk import BLOCK
from beamstiff.maps.job import Job

PROCESS = 120e6  # B, that another process takes before it begins
AT_A_POSE = 400.0  # B at a pose being computed, for each frame and node
COPIES = 3  # of the quantities: gathered, written, and turned over for the file


def refuse_unless_it_fits(job: Job, out: str | Path | None, processes: int) -> None:
    """Refuse a map that memory or disk would not hold."""
    per_pose = job.bytes_of_result
    copies = 1 if out is None else COPIES
    working = processes * (working_bytes(job) + 2 * per_pose * min(job.chunk_size, job.grid.count))
    working += PROCESS * (processes if processes > 1 else 0)
    _check("memory", copies * per_pose, working, SHARE * free_bytes(), job)
    if out is not None:
        try:
            room = float(shutil.disk_usage(Path(out).resolve().parent).free)
            room += sum(part.stat().st_size for part in Path(f"{out}.parts").glob("*"))  # finished chunks
        except OSError:  # said when it is written to
            return
        _check(f"disk at {out}", 2 * per_pose, 0.0, room, job)


def working_bytes(job: Job) -> float:
    """Return what computing takes at a time, B."""
    return BLOCK * AT_A_POSE * (len(job.robot.frames) + len(job.robot.nodes) + 6)


def _check(what: str, per_pose: float, working: float, free: float, job: Job) -> None:
    count = job.grid.count
    needed = count * per_pose + working
    if needed <= free:
        return
    fitting = int(max(0.0, free - working) / per_pose)
    rounded = fitting - fitting % 10 ** max(0, len(str(fitting)) - 2)
    about = f"about {rounded} poses" if fitting else "none"
    raise BeamstiffError(
        f"a map of {count} poses needs {needed / 1e9:.2g} GB of {what}, {free / 1e9:.2g} GB are free: "
        f"{about} would fit; take a coarser grid, fewer quantities or fewer processes"
    )
