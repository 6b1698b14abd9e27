"""From a maker's URDF and a tracker's table to a corrected KRL program, by commands alone.

A six-axis arm that does not come with beamstiff; its URDF knows nothing of stiffness. The real arm is
simulated (rigid bodies, nonlinear drives, equilibrium on the deformed machine; `beamstiff.exam`) and hides
three effects: an encoder that is off its zero, play in the drive of a2, and a floor that gives way. A tracker
in the robot's base frame reads where the tool is in 60 postures, and how five loads move it in each. Then:

    beamstiff convert arm.urdf --joint-stiffness '1.5e6 N*m/rad' --out arm.yaml
    beamstiff diagnose arm.yaml loads.csv --apply elastic.yaml
    beamstiff calibrate elastic.yaml unloaded.csv --fix base --out real.yaml
    beamstiff verify real.yaml fresh.csv
    beamstiff compensate arm.yaml part.src --actual real.yaml --wrench fz=-700N --out corrected.src

The real arm runs both programs under the load; how far its tool ends from the targets is printed before and
after. No target stood in the tracker's table.

Run `python examples/urdf_to_corrected_program.py [FOLDER [MACHINE]]` (a minute); files go to FOLDER (default
`examples/output`), another MACHINE (a number, default 3) has other drives, play and floor.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import numpy as np
from typer.testing import CliRunner
from urdf_to_stiffness import urdf

from beamstiff import load_robot, write_measurements
from beamstiff.cli.main import app
from beamstiff.compensation.formats import read_program
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.forms import draw_truth
from beamstiff.exam.simulate import draw_stiffness, simulate
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, rotation_from_vector

HERE = Path(__file__).resolve().parent
SIGMA = 2e-5  # m, of a component of the tracker's readings
LOAD = np.array([0.0, 0.0, -700.0, 0.0, 0.0, 0.0])  # N and N m, of the process
HOME = np.array([0.0, 0.7, -0.4, 0.0, 0.6, 0.0])
LOW, HIGH = np.array([1.0, -0.6, 0.5]), np.array([1.6, 0.6, 1.3])  # m: where the targets are
POSTURES, TARGETS = 60, 40


def run(*words: str) -> str:
    """Run a command as a shell would, and return what it printed."""
    print("$ beamstiff", " ".join(f"'{word}'" if " " in word else word for word in words))
    result = CliRunner().invoke(app, list(words), prog_name="beamstiff")
    if result.exit_code:
        raise SystemExit(result.output)
    return result.stdout


def hidden(robot: Robot, seed: int = 3) -> tuple[Robot, list[Truth]]:
    """Return the arm with the stiffness that its drives have, and what its model lacks."""
    random = np.random.default_rng(seed)
    real = robot.with_parameters(draw_stiffness(random, robot))
    return real, [
        Truth("geometry-error", "a3", "single", {"error": 1.2e-3}),
        draw_truth(random, robot, "backlash", 0.8, "a2", "smooth"),
        draw_truth(random, robot, "base-compliance", 0.6, None, "block"),
    ]


def measured(
    real: Robot,
    truths: list[Truth],
    q: Array,
    wrench: Array,
    seed: int | None,
    kind: Literal["absolute", "displacement"] = "absolute",
) -> Measurements:
    """Return what the tracker reads of the tool; without a seed without noise."""
    n = len(q)
    tcp, steps = np.full(n, real.tcp), np.arange(n, dtype=np.int64)
    sigma = 0.0 if seed is None else SIGMA
    campaign = SimulatedCampaign(
        *(q, wrench, np.unique(q, axis=0, return_inverse=True)[1].reshape(-1), steps),
        *(60.0 * np.arange(n), np.full(n, 20.0), tcp, tcp),
        kind=kind,
        sigma_position=sigma,
        claimed_position=SIGMA,
        rotations=False,
    )
    return simulate(real, truths, campaign, np.random.default_rng(seed))


def postures(count: int, seed: int) -> Array:
    """Return postures about the work, the tool turned at random."""
    random = np.random.default_rng(seed)
    return HOME + random.uniform(-1.0, 1.0, (count, 6)) * [0.6, 0.5, 0.6, 1.0, 0.8, 1.5]


def targets(robot: Robot, count: int, seed: int) -> tuple[Array, Array]:
    """Return poses (T, 4, 4) in reach with the tool turned a little, and the postures there."""
    random, kinematics = np.random.default_rng(seed), compile_kinematics(robot)
    at = np.tile(pose_of(kinematics, posture(kinematics, HOME), robot.tcp), (3 * count, 1, 1))
    at[:, :3, 3] = random.uniform(LOW, HIGH, (3 * count, 3))
    at[:, :3, :3] = rotation_from_vector(random.uniform(-0.2, 0.2, (3 * count, 3))) @ at[:, :3, :3]
    found = inverse_geometry(kinematics, at, start=HOME, seed=0)
    near = found.reached & (np.abs(found.q - HOME).max(axis=1) < 1.5)
    return at[near][:count], found.q[near][:count]


def krl(poses: Array) -> str:
    """Return a KRL program that goes to poses in a straight line each."""
    lines = ["DEF PART()", "; deburring, as programmed"]
    for pose in poses:
        a = np.arctan2(pose[1, 0], pose[0, 0])
        b = np.arctan2(-pose[2, 0], np.hypot(pose[0, 0], pose[1, 0]))
        c = np.arctan2(pose[2, 1], pose[2, 2])
        x, y, z = 1e3 * pose[:3, 3]
        numbers = zip("XYZABC", (x, y, z, *np.degrees([a, b, c])), strict=True)
        lines.append(f"LIN {{{', '.join(f'{name} {value:.5f}' for name, value in numbers)}}}")
    return "\n".join([*lines, "END"]) + "\n"


def errors(robot: Robot, real: Robot, truths: list[Truth], sent: Array, meant: Array, q: Array) -> Array:
    """Return how far the real, loaded tool ends from its targets, (T,), m."""
    found = inverse_geometry(compile_kinematics(robot), sent, start=q, restarts=0, tolerance=1e-9)
    reached = measured(real, truths, found.q, np.tile(LOAD, (len(q), 1)), None).position
    return np.asarray(np.linalg.norm(reached - meant[:, :3, 3], axis=1))


def main(folder: Path, machine: int = 3) -> float:
    folder.mkdir(parents=True, exist_ok=True)
    names = ("arm.urdf", "arm.yaml", "elastic.yaml", "real.yaml", "loads.csv", "unloaded.csv", "fresh.csv")
    arm, file, elastic, actual, loads, unloaded, fresh = (str(folder / name) for name in names)
    part, corrected = (str(folder / name) for name in ("part.src", "corrected.src"))
    Path(arm).write_text(urdf(), encoding="utf-8")
    run("convert", arm, "--joint-stiffness", "1.5e6 N*m/rad", "--out", file)
    robot = load_robot(file)
    real, truths = hidden(robot, machine)
    stands = postures(POSTURES, 1)
    q = np.repeat(stands, 5, axis=0)
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = np.random.default_rng(1).uniform(-900.0, 900.0, (len(q), 3))
    write_measurements(measured(real, truths, q, wrench, 1, "displacement"), loads, robot)
    write_measurements(measured(real, truths, stands, np.zeros((len(stands), 6)), 2), unloaded, robot)
    q = postures(30, 3)
    write_measurements(measured(real, truths, q, np.tile(LOAD, (len(q), 1)), 3), fresh, robot)
    print(run("diagnose", file, loads, "--apply", elastic))
    print(run("calibrate", elastic, unloaded, "--fix", "base", "--out", actual))
    print(run("verify", actual, fresh))
    meant, q = targets(robot, TARGETS, 7)
    Path(part).write_text(krl(meant), encoding="latin-1")
    at = ",".join(f"{one.name}={value!r}" for one, value in zip(robot.actuated, q[0].tolist(), strict=True))
    load = ("--wrench", "fz=-700N", "--q", at)
    print(run("compensate", file, part, "--actual", actual, *load, "--out", corrected))
    before, after = (
        errors(robot, real, truths, read_program(Path(name)).path.poses, meant, q)
        for name in (part, corrected)
    )
    closed = 1.0 - np.sqrt((after**2).mean() / (before**2).mean())
    print(
        f"The real arm at {len(meant)} fresh targets under {-LOAD[2]:.0f} N: {_told(before)} before, "
        f"{_told(after)} after: {closed:.1%} closed."
    )
    return float(closed)


def _told(error: Array) -> str:
    return f"{1e3 * np.sqrt((error**2).mean()):.4f} mm RMS (at most {1e3 * error.max():.4f})"


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "output", *map(int, sys.argv[2:]))
