"""Print where to measure by seed 000's method, beside its published numbers, and what optimal designs gain.

Run as `python benchmarks/dexterity_study.py [SEEDS]`. The paper is Dumas, Caro, Cherif, Garnier and Furet on
joint stiffness identification of serial robots: dexterity zones of the KUKA KR240-2, influence of the
complementary stiffness K_C. Designs are compared with its choice of poses, with that of Marie, Courteille and
Maurine for the KUKA IR-663 (a grid of 63 poses, loads along x and z), and with random ones, for the same
number of tests, loads and noise: by the relative standard error expected of the worst parameter.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, compile_structure, load_robot, posture
from beamstiff.planning.candidates import Noise, candidate_poses, candidate_tests, force_loads, information
from beamstiff.planning.designs import choose_tests, how_many
from beamstiff.planning.dexterity import (
    characteristic_length,
    dexterity_map,
)
from beamstiff.planning.influence import influence_map
from beamstiff.planning.poses import joint_grid
from beamstiff.planning.zones import find_zones
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, twist_jacobian
from beamstiff.se3 import Array
from tests.fem.complementary_stiffness import complementary_stiffness

ZONES = {
    "Z1c": (0, 110, -245, -170),
    "Z2c": (0, 25, 0, 29),
    "Z3c": (100, 146, 0, 29),
}  # table 1, theta2, theta3, deg
WRIST = {"q4": np.pi / 4, "q5": np.pi / 4, "q6": np.pi / 4}
WRENCH = [0.0, 0.0, -2000.0, 200.0, 200.0, 0.0]  # section 3.2
GOOD, LENGTH = 0.36, 0.682
# a mass on a chain, straight down or over a pulley, at two lever arms; the paper does not list its loads
LOADS = [WRENCH, [0, 0, -2000, -200, 200, 0], [0, 2000, 0, 200, 0, 200], [2000, 0, 0, 0, 200, -200]]
KR240_NOISE = Noise(position=3e-5, rotation=5e-5, force=1.0)  # tracker 0.03 mm; spring balance 0.1 kg
IR663_NOISE = Noise(position=3.5e-5)
IR663_LOADS = force_loads(900.0, ["x", "z"])


def in_zones(count: int, random: np.random.Generator, wrist_at_45: bool) -> Array:
    """Return poses (count, 6) of the KR240-2 in the zones of table 1, each zone as often as the others."""
    boxes = np.radians(list(ZONES.values()))[random.integers(len(ZONES), size=count)]
    q = random.uniform(-np.pi, np.pi, (count, 6))
    q[:, 1], q[:, 2] = random.uniform(boxes[:, 0], boxes[:, 1]), random.uniform(boxes[:, 2], boxes[:, 3])
    q[:, 4] = random.uniform(*np.radians([-120, 120]), count)
    if wrist_at_45:
        q[:, 3:] = np.pi / 4
    return q


def paper_grid(robot: Robot) -> Array:
    """Return those poses of the IR-663's grid of 63 that it reaches within its limits, (P, 2)."""
    x, z = np.meshgrid(np.linspace(1.25, 2.25, 9), np.linspace(0.85, 2.15, 7))
    targets = np.stack([x.reshape(-1), np.zeros(63), z.reshape(-1)], axis=1)
    found = inverse_geometry(compile_kinematics(robot), targets, tolerance=1e-6)
    return found.q[found.reached]


@dataclass(frozen=True)
class Comparison:
    """Relative standard errors of the worst parameter: means over random choices, and of optimal ones."""

    title: str
    tests: int
    rows: dict[str, float]
    efficiency: float


def worst_of_random(
    robot: Robot,
    draw: object,
    loads: Array,
    noise: Noise,
    parameters: tuple[str, ...],
    tests: int,
    seeds: int,
) -> float:
    """Return the mean over random campaigns of the worst parameter's standard error."""
    found = []
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        poses = draw(tests, random)
        table = candidate_tests(robot, poses, loads)
        rows = np.arange(tests) * len(loads) + random.permutation(
            np.arange(tests) % len(loads)
        )  # all as often
        _, of_test = information(robot, table, noise, parameters)
        found.append(np.sqrt(np.diagonal(np.linalg.inv(of_test[rows].sum(axis=0)))).max())
    return float(np.mean(found))


def compare_kr240(
    tests: int, loads: Array, parameters: tuple[str, ...], seeds: int, title: str
) -> Comparison:
    """Compare choices of tests for the KR240-2."""
    robot = load_robot("kr240-2")
    kinematics = compile_kinematics(robot)
    random = np.random.default_rng(1000)
    sets = {
        "optimal, in the zones": in_zones(1500, random, wrist_at_45=False),
        "optimal, anywhere": candidate_poses(kinematics, 1500, seed=1000),
    }
    draws = {
        "random in the zones, wrist at 45 deg": lambda count, r: in_zones(count, r, wrist_at_45=True),
        "random in the zones": lambda count, r: in_zones(count, r, wrist_at_45=False),
        "random anywhere": lambda count, r: candidate_poses(kinematics, count, int(r.integers(2**31))),
    }
    rows = {
        name: worst_of_random(robot, draw, loads, KR240_NOISE, parameters, tests, seeds)
        for name, draw in draws.items()
    }
    efficiency = 0.0
    for name, poses in sets.items():
        names, of_test = information(robot, candidate_tests(robot, poses, loads), KR240_NOISE, parameters)
        design = choose_tests(of_test, tests, names, "A")
        rows[name], efficiency = design.worst, design.efficiency
    return Comparison(title, tests, rows, efficiency)


def compare_ir663(seeds: int) -> Comparison:
    """Compare choices of tests for the IR-663: as many poses as its grid has in reach, both loads at each."""
    robot = load_robot("ir663")
    kinematics, parameters = compile_kinematics(robot), robot.identify
    grid = paper_grid(robot)
    count = len(grid)

    def worst(poses: Array) -> float:
        _, found = information(robot, candidate_tests(robot, poses, IR663_LOADS), IR663_NOISE, parameters)
        return float(np.sqrt(np.diagonal(np.linalg.inv(found.sum(axis=0)))).max())

    rows = {f"the paper's grid, {count} of 63 poses in reach": worst(grid)}
    rows["random poses"] = float(
        np.mean([worst(candidate_poses(kinematics, count, seed)) for seed in range(seeds)])
    )
    names, of_test = information(
        robot,
        candidate_tests(robot, candidate_poses(kinematics, 1000, seed=1000), IR663_LOADS),
        IR663_NOISE,
        parameters,
    )
    both = of_test.reshape(-1, 2, *of_test.shape[1:]).sum(axis=1)
    design = choose_tests(both, count, names, "A")
    rows["optimal poses, both loads"] = design.worst
    design = choose_tests(of_test, 2 * count, names, "A")
    rows["optimal tests"] = design.worst
    return Comparison(f"IR-663: {', '.join(parameters)}", 2 * count, rows, design.efficiency)


def print_dexterity(console: Console) -> None:
    """Print characteristic length, zones and the influence of K_C."""
    robot = load_robot("kr240-2")
    structure = compile_structure(robot)
    kinematics = structure.kinematics
    found = characteristic_length(kinematics)
    table = Table("KR240-2", "here", "paper", title="Dexterity and influence of K_C")
    table.add_row("characteristic length, m", f"{found.length:.4f}", "0.682")
    table.add_row("smallest kappa_F", f"{found.condition:.4f}", "-")
    turn = np.radians(np.arange(-180, 180, 2))
    grid = joint_grid(robot, {"q2": turn, "q3": turn}, WRIST)
    dexterity = dexterity_map(kinematics, grid, LENGTH)
    limits = {v.name: np.degrees(v.limits) for v in robot.actuated if v.limits}
    inside = {name: np.radians(np.arange(*limits[name], 2)) for name in ("q2", "q3")}
    reach = dexterity_map(kinematics, joint_grid(robot, inside, WRIST), LENGTH).inverse_condition
    median = np.median(dexterity.inverse_condition)
    table.add_row("median 1/kappa_F, all joint space", f"{median:.3f}", "-")
    table.add_row("median 1/kappa_F, joint limits", f"{np.median(reach):.3f}", "-")
    for zone in find_zones(grid, dexterity.inverse_condition, least=GOOD):
        box = ", ".join(
            f"{name} {np.degrees(a):.0f}..{np.degrees(b):.0f}" for name, (a, b) in zone.ranges.items()
        )
        table.add_row(f"zone of 1/kappa_F >= {GOOD}, deg", f"{box}: {zone.share:.1%}", "-")
    other = robot.model_copy(
        update={
            "frames": tuple(f.model_copy(update={"r": -1.1}) if f.name == "f4" else f for f in robot.frames)
        }
    )
    for name, (low2, high2, low3, high3) in ZONES.items():
        over = {
            "q2": np.radians(np.linspace(low2, high2, 81)),
            "q3": np.radians(np.linspace(low3, high3, 81)),
        }
        shares = []
        for one in (robot, other):
            values = dexterity_map(
                compile_kinematics(one), joint_grid(one, over, WRIST), LENGTH
            ).inverse_condition
            shares.append(f"{(values >= GOOD).mean():.0%} (least {values.min():.3f})")
        table.add_row(f"{name}: share with 1/kappa_F >= {GOOD}", shares[0], "all of it")
        table.add_row(f"{name}: the same with RL4 = -1.1 m", shares[1], "-")
    influence = influence_map(structure, grid, WRENCH)
    table.add_row("largest nu_p", f"{influence.nu_p.max():.5f}", "<= 0.016")
    table.add_row("largest nu_r, deg", f"{np.degrees(influence.nu_r.max()):.6f}", "<= 0.025")
    console.print(table)
    q = np.random.default_rng(0).uniform(-3, 3, (200, 6))
    pose = posture(kinematics, q)
    torque = np.einsum("pab,a->pb", twist_jacobian(kinematics, pose, robot.tcp), WRENCH)
    k_c = np.abs(complementary_stiffness(structure, pose, np.array(WRENCH))).max()
    first = np.abs(torque[:, 0]).max()
    console.print(
        f"Under this wrench joint 1 carries {first:.1e} N m at most in 200 random poses: it cannot be\n"
        f"identified from it. K_C is at most {k_c:.0f} N m/rad there; the joints have 4.7e5 and more.\n"
    )


def print_enough(console: Console) -> None:
    """Print how many tests are enough for the KR240-2 (compare the paper's Figure 7: above six)."""
    robot = load_robot("kr240-2")
    poses = candidate_poses(compile_kinematics(robot), 1000, seed=1000)
    names, of_test = information(robot, candidate_tests(robot, poses, np.array(LOADS)), KR240_NOISE)
    curve = how_many(of_test, names, [2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25])
    table = Table(
        "tests", "worst standard error", "times root of tests", title="KR240-2: how many are enough"
    )
    for count, worst in zip(curve.counts, curve.worst, strict=True):
        table.add_row(str(count), f"{worst:.2%}", f"{worst * np.sqrt(count):.3f}")
    console.print(table)
    console.print(
        f"From {curve.knee} tests on more only average the noise; 1 % takes {curve.tests_for(0.01)}.\n"
    )


def print_comparison(console: Console, found: Comparison) -> None:
    """Print standard errors, and their ratio to the optimal choice's."""
    table = Table(
        f"{found.tests} tests",
        "worst standard error",
        "times the best",
        title=f"{found.title}: choice of tests",
    )
    best = min(found.rows.values())
    for name, value in found.rows.items():
        table.add_row(name, f"{value:.2%}", f"{value / best:.2f}")
    console.print(table)
    share = np.floor(1e3 * found.efficiency) / 10
    console.print(f"The last choice has at least {share:.1f} % of any choice's A-criterion.\n")


def main(seeds: int = 200) -> None:
    """Print everything."""
    console = Console(width=110)
    print_dexterity(console)
    everything, names = np.array(LOADS), load_robot("kr240-2").identify
    for tests in (10, 25):
        print_comparison(
            console,
            compare_kr240(tests, everything, names, seeds, "KR240-2, joints 1 to 6, loads down and sideways"),
        )
    print_comparison(
        console,
        compare_kr240(
            25, everything[:1], names[1:], seeds, "KR240-2, joints 2 to 6, the wrench of section 3.2"
        ),
    )
    print_comparison(console, compare_ir663(seeds))
    print_enough(console)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
