"""`map_workspace`: a map, chunk by chunk, here, over processes or over a cluster."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.large.memory import SHARE, free_bytes
from beamstiff.files import remove_drafts
from beamstiff.maps.chunk import BLOCK, Part, compute_chunk, compute_poses
from beamstiff.maps.dataset import check_format, empty_dataset, put, save_dataset
from beamstiff.maps.job import Job, build_job
from beamstiff.maps.parts import Parts
from beamstiff.maps.quantities import Reason
from beamstiff.maps.summary import reason_counts
from beamstiff.parallel import check_places, parallel_map
from beamstiff.robot.reader import RobotLike, as_robot

if TYPE_CHECKING:
    import xarray


Progress = Callable[[int, int], None]
TRIED = 32  # poses, before all of them
AWAY = (Reason.LIMITS, Reason.LOOP_OPEN, Reason.OUT_OF_REACH, Reason.OTHER_CONFIGURATION)
NOTHING = (Reason.SINGULAR, Reason.MECHANISM, Reason.RIGID)

PROCESS = 120e6  # B, that another process takes before it begins
AT_A_POSE = 400.0  # B at a pose being computed, for each frame and node
COPIES = 3  # of the quantities: gathered, written, and turned over for the file


def map_workspace(
    robot: RobotLike,
    over: Mapping[str, ArrayLike],
    *,
    held: Mapping[str, float] | None = None,
    orientation: ArrayLike | Literal["free"] | None = None,
    quantities: Sequence[str] = ("stiffness",),
    wrench: ArrayLike | None = None,
    gravity: bool = False,
    direction: ArrayLike | None = None,
    length: float | None = None,
    out: str | Path | None = None,
    processes: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
    attributes: Mapping[str, str] | None = None,
) -> xarray.Dataset:
    """Return quantities over a grid of poses; write them where a file is named.

    Poses are computed in chunks. Where a file is named, each finished chunk is kept in a folder beside it
    (``<out>.parts``), so that the same call goes on where one was cut off; the folder goes when the map is
    written. What is computed depends on neither processes nor interruptions, to the bit.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    over : mapping of str to values, rad or m
        An axis each, growing values: actuated variables, or x, y, z of the TCP in the base frame.
    held : mapping of str to float, rad or m
        The other joint variables; those not named are 0. Over positions: the posture whose configuration
        the map keeps to.
    orientation : (3, 3) array or "free", optional
        Of the TCP over positions. Default: as in the posture held; free where a robot has fewer than six
        actuated variables.
    quantities : sequence of str
        Names in `beamstiff.maps.quantities.QUANTITIES`.
    wrench : (6,) array, optional
        ``[f, m]`` on the TCP, base frame, N and N m, for deflection and displacement.
    gravity : bool
        Add what dead weight and payload do to deflection and displacement.
    direction : (3,) array, optional
        Base frame, for ``stiffness_along``.
    length : float, optional, m
        Characteristic length of the Jacobian; default: that of the robot.
    out : path, optional
        Ending in .nc (NetCDF 3) or .zarr (extra ``zarr``).
    processes : int
        How many compute; a script then needs ``if __name__ == "__main__":``.
    scheduler : str, optional
        Of dask, ``tcp://host:port``: its workers compute.
    progress : callable, optional
        Called with how many poses are done, and how many there are.
    attributes : mapping of str to str, optional
        More to be told in the file, such as the command.

    Returns
    -------
    xarray.Dataset
        Quantities over the axes, with units; ``reason`` says where and why there is NaN; over positions ``q``
        holds the joint values.

    Raises
    ------
    BeamstiffError
        When something asked for cannot be used; no pose has a value; memory or disk would not hold the map;
        or the folder of chunks holds those of another map.

    Examples
    --------
    >>> import numpy as np
    >>> from beamstiff import load_robot, map_workspace
    >>> found = map_workspace(
    ...     load_robot("kr240-2"),
    ...     {"q2": np.linspace(0.3, 1.2, 3), "q3": [-1.5, -1.0]},
    ...     held={"q5": 0.8},
    ...     quantities=["stiffness", "kappa"],
    ... )
    >>> print((found.stiffness / 1e3).values.round(1), "N/mm")
    [[531.5 764.4]
     [705.4 794.9]
     [705.4 794.9]] N/mm
    """
    check_places(processes, scheduler)
    job = build_job(as_robot(robot), over, held, orientation, quantities, wrench, gravity, direction, length)
    if out is not None:
        check_format(job, out)
    refuse_unless_it_fits(job, out, processes)
    _refuse_what_never_works(job)
    with nullcontext() if out is None else Parts(out, job.stated()) as parts:
        if out is not None:
            remove_drafts(Path(out).resolve().parent, Path(out).resolve().name)
        dataset = _computed(job, parts, processes, scheduler, progress, attributes)
        if out is not None and parts is not None:
            with _what_is_kept(parts, job.grid.count, job.grid.count):
                save_dataset(dataset, out)
            parts.remove()
    return dataset


def _computed(
    job: Job,
    parts: Parts | None,
    processes: int,
    scheduler: str | None,
    progress: Progress | None,
    attributes: Mapping[str, str] | None,
) -> xarray.Dataset:
    """Return the map of a job; chunks are read from parts, and kept there."""
    dataset, total, done = empty_dataset(job, attributes), job.grid.count, 0
    examples: dict[int, tuple[int, str]] = {}

    def take(number: int, part: Part) -> None:
        nonlocal done
        put(dataset, job.boxes[number], part)
        for reason, text in part.examples.items():
            if reason not in examples or number < examples[reason][0]:
                examples[reason] = number, text
        done += part.reasons.size
        if progress is not None:
            progress(done, total)

    missing = []
    for number in range(len(job.boxes)):
        part = None if parts is None else parts.read(number)
        if part is None:
            missing.append(number)
        else:
            take(number, part)
    for number, part in _chunks(job, missing, processes, scheduler):
        if parts is not None:
            with _what_is_kept(parts, done, total):
                parts.write(number, part)
        take(number, part)
    for reason, (_, text) in sorted(examples.items()):
        dataset["reason"].attrs[f"example_{Reason(reason).label}"] = text
    if all(np.isnan(dataset[name].values).all() for name in job.quantities):
        if parts is not None:
            parts.remove()
        raise BeamstiffError(f"no pose of the map has a value: {_why_not(dataset)}")
    return dataset


def _chunks(
    job: Job, numbers: Sequence[int], processes: int, scheduler: str | None
) -> Iterator[tuple[int, Part]]:
    """Yield chunks as they are ready; a process that dies costs those it had, while others come through."""
    left = list(numbers)
    while left:
        todo = tuple(left)
        boxes = (job.boxes[number] for number in todo)
        try:
            for at, part in parallel_map(
                partial(compute_chunk, job), boxes, processes=processes, scheduler=scheduler
            ):
                left.remove(todo[at])
                yield todo[at], part
        except BeamstiffError as error:
            if not isinstance(error.__cause__, BrokenProcessPool) or len(left) == len(todo):
                raise


def _refuse_what_never_works(job: Job) -> None:
    """Compute some poses: where the robot is a mechanism or rigid at all it reaches, say so at once."""
    numbers = np.random.default_rng(0).integers(0, job.grid.count, TRIED)
    places = np.unravel_index(np.unique(numbers), job.grid.shape)
    points = np.stack([axis[at] for axis, at in zip(job.grid.axes, places, strict=True)], axis=1)
    part = compute_poses(job, points)
    reached = part.reasons[~np.isin(part.reasons, AWAY)]
    if reached.size and np.isin(reached, NOTHING).all():
        told = part.examples[int(reached[0])]
        name = f"robot {job.robot.name!r}"
        raise BeamstiffError(told if told.startswith(name) else f"{name}: {told}")


@contextmanager
def _what_is_kept(parts: Parts, done: int, total: int) -> Iterator[None]:
    """Say of a fault of the disk what it has not cost."""
    try:
        yield
    except BeamstiffError as error:
        raise BeamstiffError(
            f"{error}; {done} of {total} poses are kept in {parts.folder}: make room and do the same again"
        ) from None


def _why_not(dataset: xarray.Dataset) -> str:
    counts = reason_counts(dataset)
    return listed(
        f"{count} x {label} ({dataset['reason'].attrs.get(f'example_{label}', '')})"
        for label, count in counts.items()
    )


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
