"""Compensation on line: how long a call takes, and how far it is from the exact command.

``python -m benchmarks.online_compensation``. Target: at most 0.5 ms a warm call. The KR240-2 of the round
trip (`compensation_study`: nominal controller; real robot with another geometry and weight) along its program
of 30 targets, 0.5 m. Loads are drawn anew for every call; exact is `correct_path`.
"""

from __future__ import annotations

import gc
from dataclasses import dataclass
from time import perf_counter, thread_time

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import load_robot
from beamstiff.compensation.follow import between
from beamstiff.compensation.formats import krl
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.online import OnlineCompensation
from beamstiff.compensation.path import ToolPath, difference
from beamstiff.compensation.path_correction import correct_path
from beamstiff.compensation.process.load import FromPath
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array
from benchmarks.compensation_study import START, krl_program, real_kr240

MOST = 0.5  # ms a warm call
LOADS = np.array([600.0, 600.0, 900.0, 60.0, 60.0, 60.0])  # N and N m: largest component
ROUNDS, REPEATED = 40, 3
STD = {f"J{axis}.torsional": 0.05 for axis in range(1, 7)}  # of the stiffness


@dataclass(frozen=True)
class Row:
    """Times in ms, errors in micrometres and microradians."""

    name: str
    prepare: float  # a target
    calls: int
    warm: float  # share
    median: float
    late: float  # 99 %
    longest: float
    own: float  # longest by the processor's clock: what others of the machine take is left out
    work: float  # the same, of every call the fastest of three: without caches that others emptied
    cold: float  # median of the others
    error: float


def measured(name: str, machine: Machine, path: ToolPath, rounds: int = ROUNDS, middle: bool = False) -> Row:
    """Return times and errors of calls at the targets of a path, or in the middle between them."""
    known = stiffness_parameters(machine.real)
    std = {name: share * known[name] for name, share in STD.items()}
    online = OnlineCompensation(machine, std, np.array([5.0, 5, 5, 1, 1, 1]))
    begin = perf_counter()
    online.prepare(path, None, START)
    prepare = 1e3 * (perf_counter() - begin) / len(path)
    gc.freeze()  # as a controller's program does: collections no longer walk through what was prepared
    poses = path.poses
    if middle:
        poses = between(poses[:-1], poses[1:], np.full(len(poses) - 1, 0.5))
    random = np.random.default_rng(0)
    times: dict[bool, list[float]] = {True: [], False: []}
    own = work = error = 0.0
    for _ in range(rounds):
        loads = random.uniform(-1.0, 1.0, (len(poses), 6)) * LOADS
        commands = np.empty_like(poses)
        clock, warmed = np.zeros((REPEATED, len(poses))), np.zeros(len(poses), np.bool_)
        for row, (pose, load) in enumerate(zip(poses, loads, strict=True)):
            begin, mine = perf_counter(), thread_time()
            answer = online.correct(pose, load)
            clock[0, row] = 1e3 * (thread_time() - mine)
            times[answer.warm].append(1e3 * (perf_counter() - begin))
            warmed[row] = answer.warm
            commands[row] = answer.command
        for again in range(1, REPEATED):  # in turn, so that each has to find its neighbourhood anew
            for row, (pose, load) in enumerate(zip(poses, loads, strict=True)):
                mine = thread_time()
                online.correct(pose, load)
                clock[again, row] = 1e3 * (thread_time() - mine)
        own = max(own, clock[0, warmed].max(initial=0.0))
        work = max(work, clock[:, warmed].min(axis=0).max(initial=0.0))
        exact = correct_path(machine, _table(poses, loads), FromPath(), start=START).commands
        error = max(error, 1e6 * float(np.abs(difference(commands, exact)).max()))
    warm = np.array(times[True])
    return Row(
        name,
        prepare,
        len(warm) + len(times[False]),
        len(warm) / (len(warm) + len(times[False])),
        *(float(value) for value in np.percentile(warm, [50, 99, 100])),
        own,
        work,
        float(np.median(times[False])) if times[False] else 0.0,
        error,
    )


def _table(poses: Array, loads: Array) -> ToolPath:
    count = len(poses)
    names = tuple(f"P{row}" for row in range(count))
    return ToolPath("table", names, np.arange(count), poses, np.ones(count, np.bool_), wrench=loads)


def rows() -> list[Row]:
    """Return all cases."""
    path = krl.read(krl_program(30), "path.src").path
    controller, real = load_robot("kr240-2"), real_kr240()
    smooth = Machine(controller, real.model_copy(update={"effects": ()}))
    return [
        measured("own geometry, weight, springs; at the targets", smooth, path),
        measured("the same; in the middle between targets", smooth, path, middle=True),
        measured("with backlash of joint 3; at the targets", Machine(controller, real), path),
    ]


def main() -> None:
    """Print the table."""
    console = Console(width=130)
    columns = (
        "calls",
        "warm, %",
        "median",
        "99 %",
        "longest",
        "processor",
        "of three",
        "cold",
        "prepare",
        "error, um or urad",
    )
    table = Table(
        "machine", *columns, title=f"ms a call; target: warm at most {MOST} ms", title_justify="left"
    )
    for row in rows():
        table.add_row(
            row.name,
            str(row.calls),
            f"{100 * row.warm:.0f}",
            *(f"{value:.2f}" for value in (row.median, row.late, row.longest, row.own, row.work)),
            f"{row.cold:.0f}",
            f"{row.prepare:.0f}",
            f"{row.error:.3f}",
        )
    console.print(table)


if __name__ == "__main__":
    main()
