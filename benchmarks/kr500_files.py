"""Print the KR500 study of seed 001 by commands and files alone, beside the paper's figures.

Run as `python -m benchmarks.kr500_files` (some minutes). The machines are those of `benchmarks.kr500_grid`:
drives that ripple with their own angle, sized by the paper's first two figures; two other truths beside it:
drives that ripple with the posture, and levers, hardening and bending of usual size. Each machine has another
geometry than the robot's file, too: deviations of a millimetre and a milliradian, and a part of the encoders'
that changes from place to place, without which one set of kinematic parameters would do.

Every model is written by `identify --model` from tables of loaded displacements, and of unloaded positions;
`compensate` corrects a path through the 128 check points under the payload, and the machine says where its
tool ends: the error that remains is the figure, as in the paper's table. All measurements have noise (20 um
an axis), the check has none.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from typer.testing import CliRunner

from beamstiff import Robot, load_robot, write_measurements
from beamstiff.calibration.corrected import corrected
from beamstiff.cli.main import app
from beamstiff.exam.effect import Reality
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.grid_sampling import point_in_each, sample, sampling_points
from beamstiff.report.tables import table
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, vector_from_rotation
from benchmarks.kr500_grid import (
    CUBES,
    DOWN,
    HOME,
    LOW,
    PAYLOAD,
    SIGMA,
    SIZE,
    by_posture,
    measured,
    published,
    usual,
)

TRUTHS: dict[str, Callable[[Robot], Reality]] = {
    "ripple of the drives, sized by the paper": published,
    "ripple with the posture": by_posture,
    "levers, hardening, bending": usual,
}
GEOMETRY = {"f2.d": 8e-4, "f3.d": -6e-4, "f4.r": 5e-4, "q2": 6e-4, "q3": -8e-4, "q5": 5e-4, "f3.alpha": 4e-4}
WANDER, LENGTH = 3e-5, np.deg2rad(25.0)  # rad: of the encoders of joints 2, 3 and 5, and its wave length
PAPER = {
    "none": 0.2567,
    "one model, nominal kinematics": 0.1104,
    "one model": 0.1049,
    "2 cubes": 0.0989,
    "16 cubes": 0.0761,
    "128 cubes": 0.0581,
}


@dataclass(frozen=True)
class Bench:
    """A machine: its elasticity, and its geometry, which differs from the file's."""

    robot: Robot
    reality: Reality

    def undeformed(self, q: Array) -> Array:
        """Return where the real tool is without load, (N, 4, 4)."""
        wander = WANDER * np.sin(2 * np.pi * q / LENGTH) * [0, 1, 1, 0, 1, 0]
        real = corrected(self.robot, GEOMETRY, q[:1])
        kinematics = compile_kinematics(real)
        return pose_of(kinematics, posture(kinematics, q + wander), self.robot.tcp)

    def moved(self, q: Array, seed: int | None) -> Measurements:
        """Return displacements under the payload."""
        return measured(self.robot, self.reality, q, seed)

    def placed(self, q: Array, seed: int) -> Measurements:
        """Return absolute positions of the unloaded tool."""
        at = self.undeformed(q)[:, :3, 3] + SIGMA * np.random.default_rng(seed).standard_normal((len(q), 3))
        names = [variable.name for variable in self.robot.actuated]
        return make_measurements(names, q, tcp=self.robot.tcp, position=at, sigma_position=SIGMA)

    def errors(self, commands: Array, targets: Array, q: Array) -> Array:
        """Return the position errors (N,) of the real, loaded tool, m, for commands (N, 4, 4)."""
        kinematics = compile_kinematics(self.robot)
        sent = inverse_geometry(kinematics, commands, start=q, restarts=0, tolerance=1e-9).q
        reached = self.undeformed(sent)[:, :3, 3] + self.moved(sent, None).displacement[:, :3]
        return np.asarray(np.linalg.norm(reached - targets[:, :3, 3], axis=1))


def command(*words: str) -> None:
    """Run a command, which has to succeed."""
    result = CliRunner().invoke(app, [*words, "--quiet"], prog_name="beamstiff")
    if result.exit_code:
        raise RuntimeError(f"{' '.join(words)}: {result.output}")


def study(bench: Bench, folder: Path, sizes: Sequence[int] = (600, 300, 150)) -> dict[str, tuple[int, Array]]:
    """Return measurements and errors of every model at the check points."""
    robot, kinematics = bench.robot, compile_kinematics(bench.robot)
    (folder / "nominal.yaml").write_text(_weightless())
    points = point_in_each(CUBES[150], np.random.default_rng(5))
    q = sample(kinematics, points, DOWN, [0.0], HOME).q
    targets = pose_of(kinematics, posture(kinematics, q), robot.tcp)
    write_path(folder / "path.csv", targets)
    found = {"none": (0, bench.errors(targets, targets, q))}

    def corrected_by(name: str, rows: int) -> None:
        command(
            *("compensate", str(folder / "nominal.yaml"), str(folder / "path.csv"), "--actual"),
            *(str(folder / "real.yaml"), "--out", str(folder / "out.csv"), "--unreachable", "keep"),
            *("--q", ",".join(f"{v.name}={x!r}" for v, x in zip(robot.actuated, q[0].tolist(), strict=True))),
        )
        found[name] = (rows, bench.errors(read_path(folder / "out.csv"), targets, q))

    def write(at: Array, turns: Sequence[float] = (-10.0, 0.0, 10.0)) -> int:
        some = sample(kinematics, at, DOWN, turns, start=HOME)
        sent = some.q[some.reached]
        write_measurements(bench.moved(sent, 1), folder / "loads.csv", robot)
        write_measurements(bench.placed(sent, 2), folder / "unloaded.csv", robot)
        return len(sent)

    whole = replace(CUBES[600], counts=(1, 1, 1), low=np.zeros(3), size=1.0)
    nominal, real = str(folder / "nominal.yaml"), str(folder / "real.yaml")
    loads, unloaded = str(folder / "loads.csv"), str(folder / "unloaded.csv")
    identify = ("identify", nominal, loads, "--folds", "0", "--out", real)
    rows = write(sampling_points(whole) * SIZE + LOW)
    command(*identify)
    corrected_by("one model, nominal kinematics", rows)
    calibrated = str(folder / "calibrated.yaml")
    command("calibrate", real, unloaded, "--fix", "base", "--folds", "0", "--out", calibrated)
    Path(real).write_text(Path(calibrated).read_text())
    corrected_by("one model", rows)
    for size in sizes:
        cubes = CUBES[size]
        rows = write(sampling_points(cubes))
        side = ("--model", "grid", "--cube", f"{size}mm")
        for name, more in (
            (f"{cubes.count} cubes, one kinematics", ("--separate",)),
            (f"{cubes.count} cubes", ("--separate", "--positions", unloaded)),
            (f"{cubes.count} cubes, interpolated", ("--positions", unloaded)),
        ):
            command("calibrate", nominal, unloaded, "--fix", "base", "--folds", "0", "--out", calibrated)
            start = calibrated if "--positions" not in more else nominal
            command("identify", start, loads, "--folds", "0", "--out", real, *side, *more)
            corrected_by(name, rows)
    for count in (27, 108):
        random = np.random.default_rng(3)
        rows = write(LOW + np.array(SIZE) * random.uniform(size=(count, 3)), [0.0])
        command("calibrate", nominal, unloaded, "--fix", "base", "--folds", "0", "--out", calibrated)
        command("identify", calibrated, loads, "--folds", "0", "--out", real, "--model", "gaussian-process")
        corrected_by(f"gaussian process, {count} random poses", rows)
    return found


def _weightless() -> str:
    """Return the robot's file without gravity: the machines' readings hold none."""
    from beamstiff.robot.library import robot_path

    text = robot_path("kr500").read_text(encoding="utf-8")
    return text.replace("gravity: [0, 0, -9.81]", "gravity: [0, 0, 0]")


def write_path(file: Path, poses: Array) -> None:
    """Write a path with the payload as its load."""
    lines = ["# orientation: rotation vector", "x,y,z,a,b,c,fz"]
    turned = vector_from_rotation(poses[:, :3, :3])
    for at, turn in zip(poses[:, :3, 3].tolist(), turned.tolist(), strict=True):
        lines.append(",".join(repr(value) for value in (*at, *turn, PAYLOAD)))
    file.write_text("\n".join(lines) + "\n")


def read_path(file: Path) -> Array:
    """Return the poses (N, 4, 4) of a path."""
    from beamstiff.compensation.formats import read_program

    return read_program(file).path.poses


def main() -> None:
    """Print a table for each machine."""
    console = Console(width=130)
    for title, truth in TRUTHS.items():
        robot = load_robot("kr500")
        with tempfile.TemporaryDirectory() as folder:
            found = study(Bench(robot, truth(robot)), Path(folder))
        made = table(
            f"KR500, 128 check points, {title}", "model", "poses", "paper, mean", "mean, mm", "max, mm"
        )
        for name, (rows, errors) in found.items():
            paper = f"{PAPER[name]:.4f}" if name in PAPER and truth is published else ""
            made.add_row(name, str(rows), paper, f"{1e3 * errors.mean():.4f}", f"{1e3 * errors.max():.4f}")
        console.print(made)
        console.print()
        sys.stdout.flush()


if __name__ == "__main__":
    main()
