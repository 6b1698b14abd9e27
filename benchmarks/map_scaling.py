"""How a workspace map scales: `python -m benchmarks.map_scaling [--processes N] [--write]`.

Over joint variables: the IR-663 over both drives (least stiffness, deflection under a load, condition
number). Over positions: the KR 240-2, whose joint values are found first. Both are written as NetCDF.

Growth: processor time of one core against poses. Speed-up: wall clock of one process against several, the
start of the processes included, and against the workers of a dask cluster that runs already. On a busy
machine the wall clock tells of the others too: the last column is what the processor time that was spent
would give on cores of their own.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beamstiff import compile_structure, load_robot, map_workspace

Row = tuple[str, ...]
QUANTITIES = ("stiffness", "deflection", "kappa")
GROWTH, PER_CORE = 0.05, 0.8  # asked: an exponent within 1 +- that, a speed-up per core of that
MEMORY = str(2**28)  # bytes that a worker keeps for its next arrays, as docs/cluster.md says
LENGTH = 0.7  # m, characteristic: the search for it is no part of the map
HELD = {"q2": np.radians(60.0), "q3": np.radians(-200.0), "q5": np.radians(50.0)}
ROTATION = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))  # the tool points along x


class Cost(NamedTuple):
    """What a map took, s: by the clock, of this process, of its children."""

    wall: float
    own: float
    children: float


def over_joints(poses: int) -> dict[str, Any]:
    """Return a map of about so many poses over joint variables."""
    robot, side = load_robot("ir663"), round(poses**0.5)
    over = {variable.name: np.linspace(*(variable.limits or (0.0, 1.0)), side) for variable in robot.actuated}
    return {"robot": robot, "over": over}


def over_positions(poses: int) -> dict[str, Any]:
    """Return a map of about so many poses over positions."""
    side = round(poses ** (1 / 3))
    ends = {"x": (1.2, 2.3), "y": (-0.8, 0.8), "z": (0.5, 1.9)}
    over = {name: np.linspace(*interval, side) for name, interval in ends.items()}
    return {"robot": load_robot("kr240-2"), "over": over, "held": HELD, "orientation": ROTATION}


def cost(work: dict[str, Any], processes: int, scheduler: str | None = None) -> tuple[Cost, float]:
    """Return what a map takes, and a sum of its values, which stays the same."""
    with tempfile.TemporaryDirectory() as folder:
        before, start = _processor(), time.perf_counter()
        found = map_workspace(
            **work,
            quantities=QUANTITIES,
            wrench=[0.0, 0.0, -900.0, 0.0, 0.0, 0.0],
            length=LENGTH,
            out=Path(folder) / "map.nc",
            processes=processes,
            scheduler=scheduler,
        )
        wall, after = time.perf_counter() - start, _processor()
    return Cost(wall, after[0] - before[0], after[1] - before[1]), float(found.deflection.sum())


def _processor() -> tuple[float, float]:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    own, children = (usage.ru_utime + usage.ru_stime for usage in usages)
    return own, children


def median_cost(
    work: dict[str, Any], processes: int, times: int, scheduler: str | None = None
) -> tuple[Cost, float]:
    """Return the medians of several maps."""
    costs, sums = zip(*(cost(work, processes, scheduler) for _ in range(times)), strict=True)
    assert len(set(sums)) == 1, "a map has come out differently"
    return Cost(*(statistics.median(values) for values in zip(*costs, strict=True))), sums[0]


def growth(most: int, times: int) -> Iterator[Row]:
    """Yield rows: poses, seconds, microseconds a pose, exponent of the last decade, what was asked.

    All sizes are measured in turn, several times: the speed of the machine drifts, and an exponent is that of
    neighbours in time.
    """
    yield ("poses", "processor time, s", "us a pose", "exponent", "asked")
    sizes = [10**power for power in range(4, 1 + round(np.log10(most)))]
    cost(over_joints(100), 1)  # programs are written down, modules loaded
    rounds = np.array([[cost(over_joints(size), 1)[0].own for size in sizes] for _ in range(times)])
    seconds = np.median(rounds, axis=0)
    exponents = np.median(np.diff(np.log10(rounds), axis=1), axis=0)
    for at, (size, value) in enumerate(zip(sizes, seconds.tolist(), strict=True)):
        exponent, verdict = "", ""
        if at:
            exponent = f"{exponents[at - 1]:.3f}"
            if size == sizes[-1]:
                reached = "reached" if abs(exponents[at - 1] - 1.0) <= GROWTH else "MISSED"
                verdict = f"1.00 +- {GROWTH}: {reached}"
        yield (f"{size:,}", f"{value:.3g}", f"{1e6 * value / size:.2f}", exponent, verdict)


def speed_up(work: dict[str, Any], most: int, times: int) -> Iterator[Row]:
    """Yield rows: processes, wall clock, speed-up, per core, what was asked, and by processor time."""
    yield (
        "processes",
        "wall clock, s",
        "speed-up",
        "per core",
        "asked",
        "processor time, s",
        "per core, by processor time",
    )
    alone, expected = median_cost(work, 1, times)
    yield ("1", f"{alone.wall:.2f}", "1", "1", "", f"{alone.own:.2f}", "1")
    for processes in sorted({2, most} - {1}):
        told, values = median_cost(work, processes, times)
        assert values == expected, "processes have changed the map"
        gain = alone.wall / told.wall
        verdict = "" if processes < most else f">= {PER_CORE}: {_reached(gain / processes)}"
        # what one process does alone (gathering, writing), then the rest shared evenly
        apart = told.own + told.children / processes
        yield (
            f"{processes}",
            f"{told.wall:.2f}",
            f"{gain:.2f}",
            f"{gain / processes:.2f}",
            verdict,
            f"{told.own:.2f} + {told.children:.2f}",
            f"{alone.own / apart / processes:.2f}",
        )


def over_cluster(works: dict[str, dict[str, Any]], workers: int, times: int) -> Iterator[Row]:
    """Yield rows: each map in one process and on workers that run already, which share the cores with dask.

    Last of all: dask leaves threads behind, beside which processes no longer begin as copies.
    """
    yield ("map", "one process, s", f"{workers} dask workers, s", "speed-up", "per core", "asked")
    for name, work in works.items():
        alone, expected = median_cost(work, 1, times)
        told, values = _on_workers(work, workers, times)
        assert values == expected, "workers have changed the map"
        gain = alone.wall / told.wall
        verdict = f">= {PER_CORE}: {_reached(gain / workers)}"
        yield (
            name,
            f"{alone.wall:.2f}",
            f"{told.wall:.2f}",
            f"{gain:.2f}",
            f"{gain / workers:.2f}",
            verdict,
        )


def _on_workers(work: dict[str, Any], workers: int, times: int) -> tuple[Cost, float]:
    from distributed import LocalCluster

    before = dict(os.environ)  # dask leaves settings behind that slow down processes that start later
    os.environ["MALLOC_TRIM_THRESHOLD_"] = MEMORY
    try:
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
            cost(work, 1, cluster.scheduler_address)  # they have done a map before
            return median_cost(work, 1, times, cluster.scheduler_address)
    finally:
        os.environ.clear()
        os.environ.update(before)


def _reached(per_core: float) -> str:
    return "reached" if per_core >= PER_CORE else "MISSED"


def floors() -> Iterator[Row]:
    """Yield rows: what a pose cannot take less than on this core."""
    yield ("floor", "us a pose")
    from beamstiff.fem.condensation_program import condensation_program
    from benchmarks.speed import floor, flops  # here: processes that are started import this file

    rates, robot = floor(), load_robot("ir663")
    structure = compile_structure(robot)
    tcp = structure.kinematics.node_index[robot.tcp]
    program = condensation_program(structure, (tcp,), (), False)
    assert program is not None
    work, moved = flops(program.program), 8 * (2 + len(QUANTITIES)) + 1
    yield (f"condensation, {work} flops at {rates[0] / 1e9:.0f} GFlop/s", f"{1e6 * work / rates[0]:.3f}")
    yield (f"result, {moved} bytes at {rates[1] / 1e9:.0f} GB/s", f"{1e6 * moved / rates[1]:.4f}")


def main() -> None:
    """Print all tables."""
    from benchmarks.batched_compliance import machine
    from benchmarks.speed import README, others, written

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=1_000_000)
    parser.add_argument("--positions", type=int, default=125_000)
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--write", action="store_true", help="into benchmarks/README.md")
    asked = parser.parse_args()
    load = os.getloadavg()[0]
    busy = ": BUSY, the wall clock tells of others" if load > 0.5 else ""
    intro = (
        f"{', '.join(QUANTITIES)}, written as NetCDF; medians of {asked.times}; load {load:.1f} at the start"
        f"{busy}. Written by `python -m benchmarks.map_scaling --write`."
    )
    print(f"{machine()}\n{intro}")
    joints, positions = over_joints(asked.poses), over_positions(asked.positions)
    tables = [
        written("Maps: floor, IR-663", floors()),
        written("Maps: growth over joint variables, IR-663", growth(asked.poses, asked.times)),
        written(
            f"Maps: {asked.poses:,} poses over joint variables, IR-663",
            speed_up(joints, asked.processes, asked.times),
        ),
        written(
            f"Maps: {asked.positions:,} poses over positions, KR 240-2",
            speed_up(positions, asked.processes, asked.times),
        ),
    ]
    if find_spec("distributed") is not None:
        works = {"joint variables, IR-663": joints, "positions, KR 240-2": positions}
        rows = over_cluster(works, asked.processes, asked.times)
        tables.append(written("Maps: on a dask cluster on the same machine", rows))
    if asked.write:
        first, _, rest = tables[0].partition("\n\n")
        tables[0] = f"{first}\n\n{intro}\n\n{rest}"
        before = README.read_text(encoding="utf-8")
        head = re.split(r"(?m)^(?=## )", before)[0]
        README.write_text(head + "\n".join([*others(before, tables), *tables]), encoding="utf-8")


if __name__ == "__main__":
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    if not threads.keys() <= os.environ.keys():  # numpy asks once, when it is imported
        command = [sys.executable, "-m", "benchmarks.map_scaling", *sys.argv[1:]]
        sys.exit(subprocess.call(command, env=threads | os.environ))
    main()
