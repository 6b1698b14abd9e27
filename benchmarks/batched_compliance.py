"""Print the time a pose from joint values to the 6x6 compliance at the tool, in one call for all poses.

Run as `python benchmarks/batched_compliance.py [POSES [ROBOT ...]]`; 10,000 poses of the IR-663 unless said
otherwise. On one core: the linear algebra gets one thread, for its matrices are small. Times are the best of
five; the poses lie within the robot's limits, and those that cannot close their loops are left out.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, compile_structure, load_robot, posture
from beamstiff.fem.condensation import CHUNK, tcp_compliance
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array


def machine() -> str:
    """Return what the times depend on: processor, cores, versions, threads of the linear algebra."""
    processor = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        models = [line for line in information.read_text().splitlines() if line.startswith("model name")]
        processor = models[0].partition(":")[2].strip() if models else processor
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return (
        f"{processor}, {os.cpu_count()} cores (one used), Python {platform.python_version()}, "
        f"numpy {np.__version__}, {blas['name']} {blas['version']}, "
        f"OPENBLAS_NUM_THREADS {os.environ.get('OPENBLAS_NUM_THREADS', 'unset')}, {CHUNK} poses at a time"
    )


def closing_poses(robot: Robot, count: int) -> Array:
    """Return joint values (P, A) of random poses within the limits that close, rad or m."""
    limits = [variable.limits or (-np.pi / 2, np.pi / 2) for variable in robot.actuated]
    low, high = np.array(limits, dtype=np.float64).reshape(-1, 2).T
    q = np.random.default_rng(0).uniform(low, high, (4 * count, len(low)))
    return q[close_loops(compile_kinematics(robot), q, strict=False).closed][:count]


def best(work: Callable[[], object], times: int = 5) -> float:
    """Return the shortest of several durations, s."""
    durations = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        durations.append(time.perf_counter() - start)
    return min(durations)


def main(count: int = 10_000, *names: str) -> None:
    """Print a row for each robot."""
    table = Table(title=f"Time a pose, microseconds\n{machine()}")
    for heading in ("robot", "poses", "unknowns", "loop closure", "compliance", "both", "one alone"):
        table.add_column(heading, justify="left" if heading == "robot" else "right")
    for name in names or ("ir663",):
        robot = load_robot(name)
        structure = compile_structure(robot)
        q = closing_poses(robot, count)
        poses = posture(structure.kinematics, q)
        one = posture(structure.kinematics, q[:1])
        closing = best(lambda structure=structure, q=q: posture(structure.kinematics, q))
        condensing = best(lambda structure=structure, poses=poses: tcp_compliance(structure, poses))
        alone = best(lambda structure=structure, one=one: tcp_compliance(structure, one))
        micro = 1e6 / len(q)
        table.add_row(
            name,
            f"{len(q)}",
            f"{structure.unknowns.count}",
            f"{closing * micro:.1f}",
            f"{condensing * micro:.1f}",
            f"{(closing + condensing) * micro:.1f}",
            f"{alone * 1e6:.0f}",
        )
    Console().print(table)


if __name__ == "__main__":
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    if not threads.keys() <= os.environ.keys():  # numpy asks once, when it is imported
        sys.exit(subprocess.call([sys.executable, *sys.argv], env=threads | os.environ))
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
