"""How commands grow with the rows of a table: `python -m benchmarks.rows_scaling`.

`identify`, `diagnose` and `deflect` of the KR 240-2, five loads in each posture, as they are typed: the table
is read, JSON is written. Each run is a process of its own, whose peak memory the system tells (it begins with
that of the process that started it: tables are made in another). Exponents are those between the two largest
sizes, of what a run takes beyond one of five rows, which is little but the start of Python.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from beamstiff import load_robot, write_measurements
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements

ROBOT = "kr240-2"
SIZES = (1_000, 10_000, 100_000)
LOADS = 5  # in each posture
START = 5  # rows of a run that is nothing but a start
NOISE = (3e-5, 5e-5)  # m, rad
LINEAR = 1.1  # exponent of time and memory, at most
SECONDS, GIGABYTES = 300.0, 2.0  # `identify` of 100,000 rows, at most


def campaign(rows: int, seed: int = 0) -> Measurements:
    """Return readings of a robot with 20 % stiffer drives, whose loads act 2 degrees beside what is told."""
    robot, rng = load_robot(ROBOT), np.random.default_rng(seed)
    postures = -(-rows // LOADS)
    q = np.repeat(rng.uniform(-1, 1, (postures, 6)), LOADS, axis=0)[:rows]
    way = rng.normal(size=(postures, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    force = np.repeat(1500.0 * way, LOADS, axis=0)[:rows]
    force *= np.tile(np.linspace(0.2, 1.0, LOADS), postures)[:rows, None]
    told = np.concatenate([force, np.zeros((rows, 3))], axis=1)
    angle = np.deg2rad(2.0)
    acts = told.copy()
    acts[:, 0] += angle * told[:, 1]
    acts[:, 1] -= angle * told[:, 0]
    table = make_measurements(
        [variable.name for variable in robot.actuated],
        q,
        tcp=robot.tcp,
        wrench=told,
        displacement=np.zeros((rows, 6)),
        sigma_position=NOISE[0],
        sigma_rotation=NOISE[1],
        pose=np.arange(rows) // LOADS,
        time=60.0 * np.arange(rows),
    )
    stiffer = robot.with_parameters({name: 1.2 * robot.parameter(name) for name in robot.identify})
    seen = predict_displacements(stiffer, replace(table, wrench=acts))
    return replace(table, displacement=seen + rng.normal(size=seen.shape) * np.repeat(NOISE, 3))


def write(rows: str, table: str) -> None:
    """Write a campaign of so many rows."""
    write_measurements(campaign(int(rows)), table, load_robot(ROBOT))


def measure(command: str, table: str) -> None:
    """Run a command on a table, and print processor seconds and peak memory, B, as JSON."""
    from beamstiff.cli.main import app

    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        arguments = [command, ROBOT, table, "--json", str(Path(folder, "out.json")), "--quiet"]
        app(arguments, standalone_mode=False)
    spent = time.process_time() - began
    print(json.dumps([spent, 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss]))


def in_a_process(work: str, *arguments: str) -> str:
    """Return what this module prints in a process of its own, on one thread."""
    asked = [sys.executable, "-m", "benchmarks.rows_scaling", work, *arguments]
    one = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(asked, check=True, stdout=subprocess.PIPE, text=True, env=one).stdout


def costs_of(command: str, table: Path) -> tuple[float, float]:
    """Return seconds and peak memory, B, of a command on a table."""
    seconds, peak = json.loads(in_a_process("--measure", command, str(table)).splitlines()[-1])
    return float(seconds), float(peak)


def exponent(sizes: Sequence[int], costs: Sequence[float]) -> float:
    """Return p of ``cost = c rows^p`` between the two largest sizes.

    Examples
    --------
    >>> exponent([10, 100, 1000], [7.0, 20.0, 200.0])
    1.0
    """
    return float(np.log(costs[-1] / costs[-2]) / np.log(sizes[-1] / sizes[-2]))


def scaling(commands: Sequence[str], sizes: Sequence[int]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table: command, rows, seconds, peak memory, target and result."""
    yield ("command", "rows", "processor time, s", "peak GB", "target", "result")
    with tempfile.TemporaryDirectory() as folder:
        tables = {rows: Path(folder, f"{rows}.csv") for rows in (START, *sizes)}
        for rows, table in tables.items():
            in_a_process("--write", str(rows), str(table))
        start = costs_of("deflect", tables[START])
        for command in commands:
            found = []
            for rows in sizes:
                seconds, peak = costs_of(command, tables[rows])
                found.append((seconds - start[0], peak - start[1]))
                target = result = ""
                if (command, rows) == ("identify", SIZES[-1]):
                    target = f"<= {SECONDS:g} s, <= {GIGABYTES:g} GB"
                    result = verdict(seconds <= SECONDS and peak <= GIGABYTES * 1e9)
                yield (command, f"{rows:,}", f"{seconds:.1f}", f"{peak / 1e9:.2f}", target, result)
            if len(sizes) > 1:
                p = [exponent(sizes, costs) for costs in zip(*found, strict=True)]
                fitted = f"{p[0]:.2f}", f"{p[1]:.2f}"
                yield (command, "exponent", *fitted, f"<= {LINEAR:g} each", verdict(max(p) <= LINEAR))


def verdict(reached: bool) -> str:
    """Return a word for whether a target is reached."""
    return "reached" if reached else "MISSED"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--commands", nargs="+", default=["identify", "deflect", "diagnose"])
    parser.add_argument("--measure", nargs=2, metavar=("COMMAND", "TABLE"), help=argparse.SUPPRESS)
    parser.add_argument("--write", nargs=2, metavar=("ROWS", "TABLE"), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.write:
        write(*asked.write)
        return
    if asked.measure:
        measure(*asked.measure)
        return
    for at, row in enumerate(scaling(asked.commands, asked.rows)):
        print(f"| {' | '.join(row)} |", flush=True)
        if at == 0:
            print(f"| {' | '.join('---' for _ in row)} |")


if __name__ == "__main__":
    main()
