"""What it costs to do work in parallel, and what it gains: `python -m benchmarks.parallel_study`.

Overhead: tasks that do nothing, in this process, over processes and over a local cluster of dask. Speed-up: a
bootstrap and an exam over 1, 2 and 4 processes and a cluster of 2, answers compared to the bit first. On a
busy machine the clock tells of the others too: beside it stands the processor time of this process and of
those it started (a cluster's are not counted).
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamstiff import load_robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.exam.blind import Examiner
from beamstiff.exam.cases import Exam
from beamstiff.exam.run import run_exam
from beamstiff.identification.bootstrap import bootstrap
from beamstiff.identification.identify import identify
from beamstiff.identification.statement import Statement, build_identification
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.parallel import parallel_map
from beamstiff.se3 import Array

Row = tuple[str, ...]
EMPTY = 2000  # tasks that do nothing


class Place(NamedTuple):
    """Where work is done."""

    name: str
    where: dict[str, Any]
    count: int


def places(scheduler: str | None, most: int = 4) -> list[Place]:
    """Return this process, several, and a cluster of two if there is one."""
    found = [Place("this process", {}, 1)]
    found += [Place(f"{count} processes", {"processes": count}, count) for count in (2, 4) if count <= most]
    return found if scheduler is None else [*found, Place("2 dask workers", {"scheduler": scheduler}, 2)]


def overhead(everywhere: list[Place], count: int = EMPTY) -> Iterator[Row]:
    """Yield rows: the time to the first result, s, and of each further task, microseconds."""
    yield ("where", "to the first result, s", "us a task")
    for place in everywhere:
        begun = time.perf_counter()
        results = parallel_map(abs, range(count), **place.where)
        next(results)
        first = time.perf_counter()
        left = sum(1 for _ in results)
        each = (time.perf_counter() - first) / left
        yield (place.name, f"{first - begun:.3f}", f"{1e6 * each:.1f}")


def speed_up(work: Callable[..., object], everywhere: list[Place]) -> Iterator[Row]:
    """Yield rows: seconds by the clock, the gain over the first place, processor time.

    Raises
    ------
    AssertionError
        When a place has another answer.
    """
    yield ("where", "clock, s", "speed-up", "per core", "processor time, s")
    alone, expected = 0.0, None
    for place in everywhere:
        begun, before = time.perf_counter(), _processor()
        answer = work(**place.where)
        clock = time.perf_counter() - begun
        if expected is None:
            alone, expected = clock, answer
        assert answer == expected, f"{place.name}: another answer"
        gain = alone / clock
        spent = f"{_processor() - before:.1f}"
        yield (place.name, f"{clock:.1f}", f"{gain:.2f}", f"{gain / place.count:.2f}", spent)


def _processor() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def campaign(poses: int) -> tuple[Statement, Array]:
    """Return the identification of a KR 240-2 from so many poses, and its optimum."""
    robot, random = load_robot("kr240-2"), np.random.default_rng(0)
    names = [variable.name for variable in robot.actuated]
    q, wrench = random.uniform(-1, 1, (poses, 6)), random.normal(size=(poses, 6)) * 800
    known: dict[str, Any] = {"tcp": robot.tcp, "sigma_position": 3e-5, "wrench": wrench}
    still = make_measurements(names, q, **known)
    seen = predict_displacements(robot, still)[:, :3] + 3e-5 * random.normal(size=(poses, 3))
    table = make_measurements(names, q, displacement=seen, **known)
    statement = build_identification(robot, table)
    return statement, statement.theta(identify(robot, table).stiffness)


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20_000)
    parser.add_argument("--poses", type=int, default=300)
    parser.add_argument("--cases", type=int, default=24)
    asked = parser.parse_args()
    load = os.getloadavg()[0]
    busy = f"; BUSY (load {load:.1f}): the clock tells of others" if load > 0.5 else ""
    print(f"{os.cpu_count()} cores{busy}\n")
    with _cluster() as cluster:
        everywhere = places(None if cluster is None else cluster.scheduler_address)
        statement, theta = campaign(asked.poses)

        def drawn(**where: Any) -> bytes:
            return bootstrap(statement, theta, asked.draws, **where).stiffness.tobytes()

        def examined(**where: Any) -> list[object]:
            records = run_exam(Exam(seed=5, robots=("kr240-2",)), asked.cases, Examiner(diagnose), **where)
            return [replace(record, seconds=0.0) for record in records]

        for title, rows in (
            ("Tasks that do nothing", overhead(everywhere)),
            (f"Bootstrap: {asked.draws:,} draws of {asked.poses} poses", speed_up(drawn, everywhere)),
            (f"Exam: {asked.cases} cases of a KR 240-2", speed_up(examined, everywhere)),
        ):
            print(title)
            for row in rows:
                print(" | ".join(row), flush=True)
            print()


def _cluster() -> Any:
    try:
        from distributed import LocalCluster
    except ImportError:
        print("dask.distributed is not installed: no cluster")
        return nullcontext()
    return LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=60)


if __name__ == "__main__":
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    if not threads.keys() <= os.environ.keys():  # numpy asks once, when it is imported
        command = [sys.executable, "-m", "benchmarks.parallel_study", *sys.argv[1:]]
        sys.exit(subprocess.call(command, env=threads | os.environ))
    main()
