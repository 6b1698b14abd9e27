"""Print what every method of `identify` finds, how many evaluations and how long it takes, on one core.

Run as `python benchmarks/identification_methods.py [EVALUATIONS]`, at most 20,000 evaluations unless said
otherwise. Two synthetic campaigns on the KUKA IR-663, each 63 poses with two directions of a load of 900 N
(126 rows), positions only, noise 0.035 mm, seven open stiffness values, starts off by up to a factor of 3:

- the paper's own (Marie, Courteille, Maurine identify by a genetic algorithm): loads along x and z, two
  drives and the five bearings in the plane. Of the bearings only two sums of compliances can be known, so
  that the optimum is unique in four values; along the others the methods end where their ways led.
- loads across the plane too, and seven values that are all told: drives, coupler, tilting of three bearings
  and the modulus of the arm. The loops carry load past these springs: an evaluation solves all poses anew.

The differences are those of the unique values to the best of all methods, relative; `alone` is before the
trust region polishes what a method without curvature found, or tries again from balanced values.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, load_robot
from beamstiff.identification.minimise import GLOBAL, METHODS, POLISHED, Effort, Minimum, minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import build_parameters
from beamstiff.identification.problem import build_problem
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array

SEVEN = (
    "J12.torsional",
    "J18.torsional",
    "J12.radial",
    "J18.radial",
    "J33.radial",
    "J99.radial",
    "J1010.radial",
)
SUMS = (("J12.radial", "J33.radial"), ("J18.radial", "J99.radial", "J1010.radial"))
SOFT = {"J12.tilting": 1e6, "J33.tilting": 5e5, "J18.tilting": 1e5, "arm.E": 7e10}
TOLD = ("J12.torsional", "J18.torsional", "J1010.radial", *SOFT)
NOISE, FORCE = 3.5e-5, 900.0
REMAINS = """What remains different, and why
- Values of which only a sum is known: nothing in the data tells them apart (springs in series).
- Without polish, the global methods: they search a factor of 1e3 about the start. What bearings as stiff as
  the paper's give way lies within the noise, and the best sum for J12 and J33 is that of springs 1e4 times
  softer; and a population, or a random walk, is still wide after the evaluations allowed.
- Without polish, MMA and BOBYQA: both are stopped early, for the trust region to finish. The one takes a
  diagonal for the curvature and would crawl along valleys; the other has costs alone, which near the bottom
  differ by less than their rounding (left to itself it ends 1e-6 to 5e-6 off)."""
Q2, Q8 = np.linspace(-24.15, 36.83, 9), np.linspace(33.04, 62.90, 7)  # deg, the range of the paper's table 4


def campaign(truth: Robot, directions: ArrayLike, seed: int = 0) -> Measurements:
    """Return 126 rows as measured on a robot: 63 poses, a load in each of two directions."""
    poses = np.radians(np.stack(np.meshgrid(Q2, Q8, indexing="ij"), axis=-1).reshape(-1, 2))
    ways = np.asarray(directions, dtype=np.float64)
    wrench = np.zeros((2 * len(poses), 6))
    wrench[:, :3] = np.tile(FORCE * ways / np.linalg.norm(ways, axis=1, keepdims=True), (len(poses), 1))
    names = [variable.name for variable in truth.actuated]
    table = make_measurements(
        names,
        np.repeat(poses, 2, axis=0),
        tcp=truth.tcp,
        wrench=wrench,
        displacement=np.zeros((len(wrench), 3)),
        sigma_position=NOISE,
        source="campaign",
    )
    noise = NOISE * np.random.default_rng(seed).standard_normal((len(wrench), 6))
    noise[:, 3:] = np.nan
    return replace(table, displacement=predict_displacements(truth, table) + noise)


@dataclass(frozen=True)
class Case:
    """An identification that all methods try.

    Attributes
    ----------
    title : str
    objective : Objective
    sums : tuple of tuples of str
        Parameters of which only the sum of their compliances is unique.
    """

    title: str
    objective: Objective
    sums: tuple[tuple[str, ...], ...] = ()

    def unique(self, theta: Array) -> Array:
        """Return the compliances, and sums of them, that the data tell."""
        names = self.objective.parameters.names
        compliance = dict(zip(names, 1 / self.objective.parameters.stiffness(theta), strict=True))
        summed = {name for names in self.sums for name in names}
        alone = [value for name, value in compliance.items() if name not in summed]
        return np.array([*alone, *(sum(compliance[name] for name in group) for group in self.sums)])


def case(
    title: str,
    truth: Robot,
    names: Sequence[str],
    directions: ArrayLike,
    sums: tuple[tuple[str, ...], ...] = (),
) -> Case:
    """Return an identification that starts off by up to a factor of 3, either way."""
    factors = 10 ** np.random.default_rng(1).uniform(-0.5, 0.5, len(names))
    start = truth.with_parameters(
        {name: truth.parameter(name) * factor for name, factor in zip(names, factors, strict=True)}
    )
    problem = build_problem(start, campaign(truth, directions), names)
    return Case(title, Objective(problem, build_parameters(names, problem.model.start)), sums)


def cases() -> list[Case]:
    """Return both campaigns."""
    robot = load_robot("ir663")
    return [
        case("The paper's seven values, loads along x and z", robot, SEVEN, [[1, 0, 0], [0, 0, -1]], SUMS),
        case(
            "Seven values that are all told, loads across the plane too",
            robot.with_parameters(SOFT),
            TOLD,
            [[1, 1, 0], [0, 1, -1]],
        ),
    ]


@dataclass(frozen=True)
class Result:
    """What a method did.

    Attributes
    ----------
    found, alone : Minimum
        With and without polish.
    seconds : float
        Of one core, after set-up, polish included.
    difference, difference_alone : float
        Greatest relative difference of the unique values to the best of all.
    """

    found: Minimum
    alone: Minimum
    seconds: float
    difference: float
    difference_alone: float


def timed(work: Callable[[], Minimum], times: int) -> tuple[Minimum, float]:
    """Return a result, and the shortest of several durations on the processor, s."""
    durations = []
    for _ in range(times):
        start = time.process_time()
        found = work()
        durations.append(time.process_time() - start)
    return found, min(durations)


def compare(
    tried: Case, evaluations: int = 20_000, methods: Sequence[str] = tuple(METHODS)
) -> dict[str, Result]:
    """Return what each method finds."""
    effort = Effort(evaluations=evaluations)
    runs = {}
    for method in methods:
        times = 1 if method in GLOBAL else 3
        found, seconds = timed(lambda method=method: minimise(tried.objective, method, effort=effort), times)
        alone = minimise(tried.objective, method, effort=effort, polish=False)
        runs[method] = found, alone, seconds
    best = tried.unique(min((run[0] for run in runs.values()), key=lambda found: found.cost).theta)

    def off(found: Minimum) -> float:
        return float(np.abs(tried.unique(found.theta) / best - 1).max())

    return {
        method: Result(found, alone, seconds, off(found), off(alone))
        for method, (found, alone, seconds) in runs.items()
    }


def machine() -> str:
    """Return what the times depend on."""
    information = Path("/proc/cpuinfo")
    processor = platform.processor() or platform.machine()
    if information.exists():
        models = [line for line in information.read_text().splitlines() if line.startswith("model name")]
        processor = models[0].partition(":")[2].strip() if models else processor
    return f"{processor}, one core, Python {platform.python_version()}, numpy {np.__version__}"


def print_table(console: Console, tried: Case, results: dict[str, Result]) -> None:
    """Print a row for each method."""
    table = Table(title=tried.title)
    for heading in ("method", "evaluations", "seconds", "difference", "alone", "cost above, alone", "ended"):
        table.add_column(heading, justify="left" if heading in ("method", "ended") else "right")
    least = min(result.found.cost for result in results.values())
    for method, result in results.items():
        alone = method in POLISHED
        table.add_row(
            method,
            f"{result.found.evaluations:,}",
            f"{result.seconds:.3f}",
            f"{result.difference:.0e}",
            f"{result.difference_alone:.0e}" if alone else "",
            f"{result.alone.cost - least:.1e}" if alone else "",
            "stopped" if "stopped" in result.alone.message else "converged",
        )
    console.print(table)


def main(evaluations: int = 20_000) -> None:
    """Print both tables, and what remains different."""
    console = Console(width=120, highlight=False)
    console.print(machine())
    for tried in cases():
        results = compare(tried, evaluations)
        print_table(console, tried, results)
        gradient, genetic = results["trust-region"], results["genetic"]
        console.print(
            f"Least cost {min(result.found.cost for result in results.values()):.3f}, half the sum of "
            f"{tried.objective.problem.count} squared residuals in standard deviations. The genetic search "
            f"took {genetic.found.evaluations / gradient.found.evaluations:,.0f} times the evaluations of "
            f"the trust region, and {genetic.seconds / gradient.seconds:,.0f} times its time."
        )
        if tried.sums:
            print_ways(console, tried, results)
        console.print()
    console.print(REMAINS)


def print_ways(console: Console, tried: Case, results: dict[str, Result]) -> None:
    """Print by what factors the methods differ in values of which only a sum is known."""
    stiffness = np.array(
        [tried.objective.parameters.stiffness(result.found.theta) for result in results.values()]
    )
    cost = np.array([result.found.cost for result in results.values()])
    told = {name for names in tried.sums for name in names}
    spread = stiffness.max(axis=0) / stiffness.min(axis=0)
    for name, factor in zip(tried.objective.parameters.names, spread, strict=True):
        if name in told:
            console.print(f"  {name}: the methods' values differ by up to a factor of {factor:.0e}")
    console.print(f"  at costs that differ by {np.ptp(cost) / cost.min():.0e} of it: springs in series")


if __name__ == "__main__":
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    if not threads.keys() <= os.environ.keys():  # numpy asks once, when it is imported
        sys.exit(subprocess.call([sys.executable, *sys.argv], env=threads | os.environ))
    main(*map(int, sys.argv[1:2]))
