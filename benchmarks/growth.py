"""How the cost grows with the size of the work: `python -m benchmarks.growth WHAT SIZE` measures one size.

WHAT is poses, parameters or rows. Each in a process of its own, so that the peak memory is that of this work;
it prints JSON. `benchmarks.speed` puts them together with frames of 1e3 to 1e6 unknowns.
"""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

from beamstiff import Robot, compile_structure, load_robot, posture, tcp_compliance
from beamstiff.measure.table import make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.parts import STIFFNESS_KINDS
from beamstiff.se3 import Array
from benchmarks.batched_compliance import closing_poses
from benchmarks.large_frame import in_a_process as frame_in_a_process

Row = tuple[str, ...]
DIFFERENT = 10_000  # poses; more are the same again
ASKED = 0.05  # how far the exponent in poses may be from 1
PARAMETERS, ROWS = 8, 10_000


def all_finite(robot: Robot, rigid: float = 1e9) -> Robot:
    """Return a robot whose rigid joint directions have a stiffness."""
    names = [f"{joint.name}.{kind}" for joint in robot.joints for kind in STIFFNESS_KINDS]
    return robot.with_parameters({name: rigid for name in names if robot.parameter(name) == np.inf})


def median(work: Callable[[], object], times: int = 5) -> float:
    """Return the median processor time, s, after one run that does not count."""
    work()
    durations = []
    for _ in range(times):
        start = time.process_time()
        work()
        durations.append(time.process_time() - start)
    return statistics.median(durations)


def poses(count: int) -> float:
    """Return the seconds that so many poses of the IR-663 take, joint values to compliance."""
    robot = load_robot("ir663")
    structure = compile_structure(robot)
    q: Array = np.resize(closing_poses(robot, min(count, DIFFERENT)), (count, len(robot.actuated)))
    return median(lambda: tcp_compliance(structure, posture(structure.kinematics, q)))


def ports(parameters: int, count: int) -> float:
    """Return the seconds that one evaluation with derivatives takes, where joint stiffness alone changes."""
    robot = all_finite(load_robot("ir663"))
    kinds = ("axial", "radial", "tilting")  # all stiff: soft hinges beside them go a slower, surer way
    names = [f"{joint.name}.{kind}" for kind in kinds for joint in robot.joints][:parameters]
    rng = np.random.default_rng(0)
    table = make_measurements(
        [variable.name for variable in robot.actuated],
        np.resize(closing_poses(robot, min(count, DIFFERENT)), (count, len(robot.actuated))),
        tcp=robot.tcp,
        wrench=rng.normal(size=(count, 6)) * 1000,
        displacement=np.zeros((count, 6)),
    )
    model = reduce_to_ports(robot, table, names)
    return median(lambda: model.derivatives(model.start, "log"))


KINDS: dict[str, Callable[[int], float]] = {
    "poses": poses,
    "parameters": lambda size: ports(size, ROWS),
    "rows": lambda size: ports(PARAMETERS, size),
}


def in_a_process(what: str, size: int) -> tuple[float, float]:
    """Return seconds and peak memory, B, of one size, from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.growth", what, str(size)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    seconds, peak = json.loads(done.stdout.splitlines()[-1])
    return float(seconds), float(peak)


def growth(large: bool) -> Iterator[Row]:
    """Yield rows: what grows, size, seconds, peak memory, exponent from the size before."""
    yield ("cost against", "size", "seconds", "peak GB", "exponent", "asked")
    decades = (100, 1_000, 10_000, 100_000, *((1_000_000,) if large else ()))
    for what, sizes in (
        ("poses", decades),
        ("parameters", (2, 4, 8, 15)),
        ("rows", decades[:4]),
    ):
        before: tuple[float, float] | None = None
        for size in sizes:
            seconds, peak = in_a_process(what, size)
            slope = exponent(before, (size, seconds))
            asked = ""
            if what == "poses" and size >= 1e6:
                asked = f"1 +- {ASKED}: {'reached' if abs(float(slope) - 1.0) <= ASKED else 'MISSED'}"
            yield (NAMES[what], f"{size:,}", f"{seconds:.3g}", f"{peak / 1e9:.2f}", slope, asked)
            before = (size, seconds)
    for kind, unknowns in (
        ("slender", (1e3, 1e4, 1e5, *((1e6,) if large else ()))),
        ("cube", (1e3, 1e4, 1e5, *((3e5,) if large else ()))),
    ):
        before = None
        for dofs in unknowns:
            report = frame_in_a_process(kind, dofs, "condensation")
            now = (float(report["dofs"]), float(report["plain"]))
            peak = f"{report['peak'] / 1e9:.2f}"
            yield (
                f"unknowns, {kind}, condensation",
                f"{report['dofs']:,}",
                f"{now[1]:.3g}",
                peak,
                exponent(before, now),
                "",
            )
            before = now


NAMES = {
    "poses": "poses, joint values to compliance",
    "parameters": f"parameters, prediction with derivatives of {ROWS:,} rows",
    "rows": f"rows, prediction with derivatives by {PARAMETERS} parameters",
}


def exponent(before: tuple[float, float] | None, now: tuple[float, float]) -> str:
    """Return the slope between two sizes and their costs, both in logarithms; nothing for the first."""
    if before is None:
        return ""
    return f"{np.log(now[1] / before[1]) / np.log(now[0] / before[0]):.2f}"


if __name__ == "__main__":
    spent = KINDS[sys.argv[1]](int(sys.argv[2]))
    print(json.dumps([spent, 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss]))
