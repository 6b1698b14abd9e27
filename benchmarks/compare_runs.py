"""Print how often `compare_runs` raises false alarms, and how often it finds what changed.

Run as `python -m benchmarks.compare_runs [PAIRS]`: 200 pairs of each kind by default (ten minutes).
Every pair draws a machine whose springs differ from the published ones by 25 %, two sets of postures and
loads, and readings with noise; displacements of the KR240-2 come from the compliance at the tool, positions
of the KR 500 from forward kinematics and that compliance, in a measuring frame new for each campaign.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from beamstiff import Robot, compare_runs, forward_kinematics, load_robot, tcp_compliance
from beamstiff.diagnosis.changes import RunComparison
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array, rotation_from_vector

LEVEL = 0.05
SPREAD = 0.25  # of the machines, around the published stiffness
SIGMA = 3e-5  # m: of a displacement, and of a position
POSES = 60  # each campaign
FORCE = 1500.0  # N
PAYLOAD = 40.0  # kg, that the robot file knows as a cause


@dataclass
class Tally:
    """What came out of the pairs of one kind."""

    title: str
    alarms: int = 0  # something changed, it said
    right: int = 0  # what changed was named
    wrong: int = 0  # something else was named
    pairs: Counter[str] = field(default_factory=Counter)  # by what changed
    named: Counter[str] = field(default_factory=Counter)  # of these, those whose change was named

    def add(self, found: RunComparison, truth: str | None) -> None:
        """Count one pair; `truth`: what changed, or None."""
        named = {one.name for one in found.changes if one.changed}
        self.alarms += found.changed
        self.right += truth in named
        self.wrong += bool(named - {truth})
        self.pairs[str(truth)] += 1
        self.named[str(truth)] += truth in named


def drawn(robot: Robot, random: np.random.Generator, springs: Sequence[str]) -> Robot:
    """Return a machine whose springs differ from the robot's."""
    factors = np.exp(random.normal(0.0, SPREAD, len(springs)))
    return robot.with_parameters({n: robot.parameter(n) * f for n, f in zip(springs, factors, strict=True)})


def postures(robot: Robot, random: np.random.Generator, count: int) -> Array:
    """Return joint values (count, A) over the middle of the limits."""
    limits = np.array([one.limits or (-3.0, 3.0) for one in robot.actuated])
    low, high = limits.T
    return random.uniform(low + 0.1 * (high - low), high - 0.1 * (high - low), (count, len(limits)))


def loads(random: np.random.Generator, count: int) -> Array:
    """Return forces of any direction as wrenches (count, 6)."""
    force = random.normal(size=(count, 3))
    force *= FORCE / np.linalg.norm(force, axis=1)[:, None]
    return np.concatenate([force, np.zeros((count, 3))], axis=1)


def displacements(
    machine: Robot, random: np.random.Generator, stated: float | None, unmodelled: float = 0.0
) -> Measurements:
    """Return a campaign of displacements.

    `stated`: noise that the table states. `unmodelled`, m/N: compliance of the floor that the model lacks.
    """
    q, wrench = postures(machine, random, POSES), loads(random, POSES)
    moved = np.einsum("nij,nj->ni", tcp_compliance(machine, q), wrench)[:, :3] + unmodelled * wrench[:, :3]
    names = [one.name for one in machine.actuated]
    read = moved + random.normal(0.0, SIGMA, moved.shape)
    return make_measurements(
        names, q, tcp=machine.tcp, wrench=wrench, displacement=read, sigma_position=stated
    )


def positions(
    machine: Robot, random: np.random.Generator, zero: Array, payload: float = PAYLOAD
) -> Measurements:
    """Return a campaign of positions, half of them loaded; `zero` (A,), rad: errors of the encoders."""
    q = postures(machine, random, POSES)
    wrench = loads(random, len(q)) * (np.arange(len(q)) % 2)[:, None]
    weight = np.array([0.0, 0.0, -9.81 * payload, 0.0, 0.0, 0.0])
    compliance = tcp_compliance(machine, q + zero)
    at = forward_kinematics(machine, q + zero)[:, :3, 3]
    at = at + np.einsum("nij,nj->ni", compliance, wrench + weight)[:, :3]
    turn, shift = rotation_from_vector(random.normal(0.0, 0.5, 3)), random.normal(0.0, 2.0, 3)
    read = at @ turn.T + shift + random.normal(0.0, SIGMA, at.shape)
    names = [one.name for one in machine.actuated]
    return make_measurements(names, q, tcp=machine.tcp, wrench=wrench, position=read, sigma_position=SIGMA)


Pair = Callable[[np.random.Generator], tuple[RunComparison, str | None]]


def pair_of_displacements(change: float, stated: float | None, unmodelled: float = 0.0) -> Pair:
    """Return what compares two campaigns, one spring softer by `change` in the second."""
    robot = load_robot("kr240-2")

    def run(random: np.random.Generator) -> tuple[RunComparison, str | None]:
        before = drawn(robot, random, robot.identify)
        name = str(random.choice(robot.identify))
        after = before.with_parameters({name: before.parameter(name) * (1.0 - change)})
        a, b = (displacements(one, random, stated, unmodelled) for one in (before, after))
        return compare_runs(robot, a, b, level=LEVEL), f"1/{name}" if change else None

    return run


def pair_of_positions(zero: float = 0.0, payload: float = 0.0) -> Pair:
    """Return what compares two campaigns; one encoder's zero (rad), or the payload (kg), changes."""
    cause = AddedEffect(effect="payload-error", shape="mass", parameters={"mass": PAYLOAD})
    robot = load_robot("kr500").model_copy(update={"effects": (cause,)})
    springs = ("J2.torsional", "J3.torsional")
    sought = ("base", "offsets", "target")

    def run(random: np.random.Generator) -> tuple[RunComparison, str | None]:
        machine = drawn(robot.model_copy(update={"effects": ()}), random, springs)
        errors = random.normal(0.0, 5e-4, len(machine.actuated))
        number = int(random.choice([1, 2, 4]))  # that a position shows by itself
        later = errors + zero * (np.arange(len(errors)) == number)
        a = positions(machine, random, errors)
        b = positions(machine, random, later, PAYLOAD + payload)
        truth = machine.actuated[number].name if zero else "payload-error:null" if payload else None
        return compare_runs(robot, a, b, sought, compliances=springs, level=LEVEL), truth

    return run


KINDS: dict[str, Pair] = {
    "displacements, noise stated, no change": pair_of_displacements(0.0, SIGMA),
    "displacements, noise not stated, no change": pair_of_displacements(0.0, None),
    "displacements, half the noise stated, no change": pair_of_displacements(0.0, SIGMA / 2),
    "displacements, model lacks 0.1 um/N, no change": pair_of_displacements(0.0, SIGMA, 1e-7),
    "displacements, a spring 5 % softer": pair_of_displacements(0.05, SIGMA),
    "displacements, a spring 10 % softer": pair_of_displacements(0.10, SIGMA),
    "displacements, a spring 20 % softer": pair_of_displacements(0.20, SIGMA),
    "positions, no change": pair_of_positions(),
    "positions, a zero off by 0.05 mrad": pair_of_positions(zero=5e-5),
    "positions, a zero off by 0.2 mrad": pair_of_positions(zero=2e-4),
    "positions, payload 10 kg more": pair_of_positions(payload=10.0),
    "positions, payload 40 kg more": pair_of_positions(payload=40.0),
}


def study(pairs: int) -> Iterator[Tally]:
    """Yield what came out of each kind of pairs."""
    for number, (title, run) in enumerate(KINDS.items()):
        tally = Tally(title)
        for seed in range(pairs):
            tally.add(*run(np.random.default_rng([number, seed])))
        yield tally


def print_study(pairs: int) -> None:
    """Print the study as a table."""
    low, high = stats.binom.ppf([0.025, 0.975], pairs, LEVEL)
    print(f"{pairs} pairs a row. Without change {LEVEL:.0%} alarms are the level: {low:.0f} to {high:.0f} of")
    print(f"{pairs} (95 % of such studies). Named wrongly: also beside what changed.\n")
    print("| pairs | says that something changed | names what changed | names something else |")
    print("| --- | --- | --- | --- |")
    done = []
    for one in study(pairs):
        done.append(one)
        right = "-" if "no change" in one.title else f"{one.right / pairs:.1%}"
        print(f"| {one.title} | {one.alarms / pairs:.1%} | {right} | {one.wrong / pairs:.1%} |", flush=True)
    print("\nWhich change was named, of how many pairs:\n")
    for one in done:
        if len(one.pairs) > 1:
            told = (f"{name} {one.named[name]}/{count}" for name, count in sorted(one.pairs.items()))
            print(f"- {one.title}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    print_study(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
