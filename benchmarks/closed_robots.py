"""Maps, identification and exam of the closed robots of the library: ``python -m benchmarks.closed_robots``.

Each of them gets a map of its least translational stiffness over a grid of its drives; an identification
study: tests planned by `plan` (D-optimal), machines whose stiffness is drawn within a quarter of that of the
file, their displacements with noise, identified; and, with ``--exam``, cases of `beamstiff exam ROBOT`.
Before that, how far the compliance of the Stewart platform and the delta is from their closed forms.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

from beamstiff import Robot, examine, identify, load_robot, plan
from beamstiff.maps.run import map_workspace
from beamstiff.model.linear import predict_displacements
from tests.robots.test_closed_robots import POSES, delta_errors, stewart_error

ROBOTS = ("stewart", "delta", "five-bar", "palletizer")
GRID = {6: 4, 4: 6, 3: 9, 2: 31}  # values of each drive, by the number of drives
FORCE = {"stewart": 5000.0, "delta": 200.0, "five-bar": 100.0, "palletizer": 2000.0}  # N
NOISE = {"stewart": 1e-5, "delta": 3e-5, "five-bar": 3e-5, "palletizer": 3e-5}  # m, of each component read
TESTS, CAMPAIGNS = 30, 100
OFF = 0.25  # most that the stiffness of a machine is off that of the file


@dataclass(frozen=True)
class Study:
    """What identified values are worth: over campaigns, and the parameters that forces can tell."""

    told: int  # parameters
    expected: float  # largest relative standard error that the plan promises
    rms: float  # largest of any parameter, of its relative errors where it has a value
    bounded: float  # share of values that are bounded from above
    held: float  # share of 95 % intervals that hold the truth


def mapped(robot: Robot) -> tuple[int, int, np.ndarray]:
    """Return how many poses there are and how many close, and the stiffness at these, N/m."""
    values = GRID[len(robot.actuated)]
    over = {item.name: np.linspace(*(item.limits or (0.0, 0.0)), values) for item in robot.actuated}
    found = map_workspace(robot, over)["stiffness"].to_numpy().ravel()
    return len(found), int(np.isfinite(found).sum()), found[np.isfinite(found)]


def identified(robot: Robot, seed: int, campaigns: int) -> Study:
    """Return what planned tests tell of the stiffness of drawn machines."""
    rng, noise = np.random.default_rng(seed), NOISE[robot.name]
    campaign = plan(robot, tests=TESTS, force=FORCE[robot.name], sigma_position=noise, seed=seed).campaign
    tests, promised = campaign.tests, campaign.design.standard_errors
    errors, held = [], []
    for _ in range(campaigns):
        true = {
            name: robot.parameter(name) * (1 + OFF * float(rng.uniform(-1, 1))) for name in robot.identify
        }
        moved = predict_displacements(robot.with_parameters(true), tests)
        moved[:, :3] += noise * rng.standard_normal((len(tests), 3))
        moved[:, 3:] = np.nan
        read = replace(tests, displacement=moved, sigma_position=noise, sigma_rotation=None)
        found = {item.name: item for item in identify(robot, read, list(promised), folds=0).parameters}
        errors.append([(found[name].value or np.nan) / true[name] - 1 for name in promised])
        held += [
            (interval := found[name].interval) is not None and interval[0] <= true[name] <= interval[1]
            for name in promised
        ]
    rms = np.sqrt(np.nanmean(np.square(errors), axis=0))
    bounded = float(np.mean(np.isfinite(errors)))
    return Study(len(promised), max(promised.values()), float(rms.max()), bounded, float(np.mean(held)))


def examined(robot: Robot, cases: int, seed: int) -> str:
    """Return how many cases of each kind are answered exactly, in words."""
    records = examine(robot, cases=cases, seed=seed, compare=False, classes=["null", "single"]).records
    null = [one for one in records if one.label.kind == "null"]
    single = [one for one in records if one.label.kind != "null"]
    named = sum(one.answer.verdict == one.truth for one in single)
    in_set = sum(one.truth in (one.answer.verdict, *one.answer.indistinguishable) for one in single)
    quiet = sum(one.answer.verdict == one.truth for one in null)
    return f"{named} of {len(single)} | {in_set} of {len(single)} | {quiet} of {len(null)}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=CAMPAIGNS)
    parser.add_argument("--exam", type=int, default=0, help="cases of each robot")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robots", nargs="*", default=ROBOTS)
    given = parser.parse_args()
    print(f"compliance beside J k^-1 J^T at {POSES} postures, relative (asked: 1e-10)")
    rods, rigid, drives = delta_errors()
    print(f"stewart {stewart_error():.1e}; delta {rods:.1e}, with rigid rods {max(rigid, drives):.1e}\n")
    print("| robot | poses | close | least stiffness, N/m: worst | median | best |\n" + "| --- " * 6 + "|")
    for name in given.robots:
        poses, close, stiffness = mapped(load_robot(name))
        low, middle, high = np.percentile(stiffness, [0, 50, 100])
        print(f"| {name} | {poses} | {close} | {low:.3g} | {middle:.3g} | {high:.3g} |", flush=True)
    print(
        "\n| robot | parameters | expected | reached | bounded | 95 % intervals that hold |\n"
        + "| --- " * 6
        + "|"
    )
    for name in given.robots:
        robot = load_robot(name)
        found = identified(robot, given.seed, given.campaigns)
        print(
            f"| {name} | {found.told} of {len(robot.identify)} | {found.expected:.2%} | {found.rms:.2%} "
            f"| {found.bounded:.1%} | {found.held:.1%} |",
            flush=True,
        )
    if given.exam:
        print("\n| robot | exact | in its set | nulls left alone |\n" + "| --- " * 4 + "|")
        for name in given.robots:
            print(f"| {name} | {examined(load_robot(name), given.exam, given.seed)} |", flush=True)


if __name__ == "__main__":
    main()
