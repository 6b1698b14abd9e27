"""Calibrate robots that others measured, and print what is left beside what they published.

A UR10 before a laser tracker (Landgraf et al., CASE 2021), and DLR's Agile Justin before cameras (Tenhumberg
and Baeuml, Humanoids 2021), stage by stage: where frames stand, encoders' zeros, all kinematics, compliances
under the own weight. A part of the postures is fitted, the others are held out.

The measurements are read from the folder of shared data (BEAMSTIFF_SHARED, default `../shared` beside the
repository). Run `python examples/geometric_calibration.py`; half a minute.
"""

from __future__ import annotations

import csv
import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from beamstiff import Robot, calibrate, load_robot
from beamstiff.calibration.result import Calibration
from beamstiff.calibration.validation import gap_of, in_base_frame
from beamstiff.measure.rows import concatenate, subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.tables import table
from beamstiff.se3 import Array

HERE = Path(__file__).resolve().parent
SHARED = HERE.parent / os.environ.get("BEAMSTIFF_SHARED", "../shared")
UR10 = Path("real") / "ipa_ur10_lasertracker"
SERIES = {
    "C": "Series_C_measurements_random_poses.csv",
    "B": "Series_B_measurements_joint_configurations.csv",
}
JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint")
JUSTIN = Path("real") / "dlr_agile_justin" / "measurements.csv"
TORSO = ("t1", "t2", "t3", "t4")
# where the paper's calibration starts: the robot's base in the measuring frame
TURN, SHIFT = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([-2.5, 2.0, 0.1])
POSTURES = 900  # of a UR10 series that are used
# mean position errors, mm: the UR10's held out, found with other tools (its authors print none); Justin's as
# published, of all postures
UR10_KNOWN = {"frames": {"C": 0.907, "B": 1.032}, "all kinematics": {"C": 0.439, "B": 0.401}}
JUSTIN_KNOWN = {
    "frames": 21.33,
    "encoder offsets": 18.18,
    "all kinematics": 10.5,
    "joint compliance": 5.64,
    "bearing compliance": 3.12,
    "bearings, not joints": 9.09,
}


@dataclass(frozen=True)
class Stage:
    """A calibration to some postures, and what it leaves on all.

    Attributes
    ----------
    name : str
    found : Calibration
    rows : Measurements
        All rows, in the base frame found.
    left : (N, 3) array, m
        Measured less predicted positions of all rows, those held out too, base frame.
    seconds : float
    """

    name: str
    found: Calibration
    rows: Measurements
    left: Array
    seconds: float

    @property
    def robot(self) -> Robot:
        return self.found.robot

    @property
    def errors(self) -> Array:
        """Sizes of what is left, (N,), mm."""
        return np.asarray(1e3 * np.linalg.norm(self.left, axis=1))


def stage(
    robot: Robot,
    rows: Measurements,
    train: Array,
    geometry: Sequence[str],
    compliances: Sequence[str] = (),
    name: str = "",
) -> Stage:
    """Calibrate geometry, and compliances along, to the rows `train` (N,) of absolute positions."""
    start = time.perf_counter()
    found = calibrate(robot, rows_of(rows, train), geometry, compliances=compliances, folds=0)
    seconds = time.perf_counter() - start
    rows = in_base_frame(found, rows)
    return Stage(name, found, rows, gap_of(found.robot, rows)[:, :3], seconds)


def held_out(count: int, share: float, seed: int = 0) -> Array:
    """Return which of some rows are to be fitted to (N,); the others are held out."""
    train = np.ones(count, dtype=np.bool_)
    train[np.random.default_rng(seed).permutation(count)[: round(share * count)]] = False
    return train


def rows_of(rows: Measurements, chosen: Array) -> Measurements:
    return subset(rows, np.flatnonzero(chosen))


def read_ur10(robot: Robot, series: str) -> Measurements:
    """Return the reflector's positions, in the tracker's frame."""
    path = SHARED / UR10 / SERIES[series]
    with path.open(encoding="utf-8-sig") as file:
        lines = list(csv.DictReader(file, delimiter=";"))

    def column(name: str) -> list[float]:
        return [float(line[name].replace(",", ".")) for line in lines]

    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.transpose([column(name) for name in (*JOINTS, "wrist_3_joint")]),
        tcp=robot.tcp,
        position=1e-3 * np.transpose([column(f"measurement_{axis}") for axis in "xyz"]),
        temperature=column("measurement_temperature"),
        source=path.name,
    )


UR10_STAGES = {
    "frames": ["base", "target"],
    "encoder offsets": ["base", "target", "offsets"],
    "all kinematics": ["base", "target", "offsets", "frames"],
}


def ur10_stages(robot: Robot, rows: Measurements, train: Array) -> list[Stage]:
    """Return the stages of a UR10; the last one with compliances of joints 2 to 6 under the own weight."""
    result = [stage(robot, rows, train, names, name=name) for name, names in UR10_STAGES.items()]
    joints = [f"J{k}.torsional" for k in range(2, 7)]
    every = UR10_STAGES["all kinematics"]
    return [*result, stage(robot, rows, train, every, joints, "joint compliance")]


def read_justin(robot: Robot, side: str) -> Measurements:
    """Return the marker of one hand in all postures, laid over the robot's base as published."""
    with (SHARED / JUSTIN).open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    numbers = re.compile(r"-?\d[\d.e+-]*")
    joints = np.array([[float(x) for x in numbers.findall(line["joints"])] for line in lines])
    markers = np.array([[float(x) for x in numbers.findall(line["markers"])] for line in lines])
    position = markers.reshape(-1, 2, 3)[:, "rl".index(side)]
    return make_measurements(
        [variable.name for variable in robot.actuated],
        joints[:, :17],  # the last two turn the head
        tcp=f"hand_{side}",
        position=(position - SHIFT) @ TURN,
        source=JUSTIN.name,
    )


def justin_stages(robot: Robot, sides: str, train: Array) -> list[Stage]:
    """Return the published stages, for the marker of one hand (``"r"``) or those of both (``"rl"``)."""
    rows = concatenate([read_justin(robot, side) for side in sides])
    robot = robot.model_copy(update={"tcp": f"hand_{sides[0]}"})
    train = np.tile(train, len(sides))
    chain = [*TORSO, *(f"{side}{k}" for side in sides for k in range(1, 8))]
    frames = ["base", "target", *(f"shoulder_{side}" for side in sides)]
    offsets = [*frames, *(name for name in chain if name != "t4")]  # t4 has no drive
    every = [*offsets, *(f"f_{name}" for name in chain)]
    joints = [f"{name.upper()}.torsional" for name in chain]
    bearings = [f"{name.upper()}.tilting" for name in chain]
    asked: dict[str, tuple[list[str], list[str]]] = {
        "frames": (frames, []),
        "encoder offsets": (offsets, []),
        "all kinematics": (every, []),
        "joint compliance": (every, joints),
        "bearing compliance": (every, [*joints, *bearings]),
        "bearings, not joints": (every, bearings),
    }
    return [stage(robot, rows, train, *what, name=name) for name, what in asked.items()]


def main() -> None:
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 110)
    for place in (UR10 / SERIES["C"], JUSTIN):
        if not (SHARED / place).exists():
            missing = f"{place} (set BEAMSTIFF_SHARED to the folder that holds it)"
            console.print(f"Skipped: shared data missing: {missing}")
            return
    columns = ("nominal", "fitted", "held out", "largest", "known", "parameters", "s")
    for series in SERIES:
        robot = load_robot(HERE / "data" / "ur10.yaml")
        rows = read_ur10(robot, series)
        some = subset(rows, np.sort(np.random.default_rng(0).permutation(len(rows))[:POSTURES]))
        train = held_out(POSTURES, 1 / 3)
        result = table(f"UR10, series {series}: mean position error, mm", "calibrated", *columns)
        for one in ur10_stages(robot, some, train):
            result.add_row(one.name, *cells(one, train, UR10_KNOWN.get(one.name, {}).get(series)))
        console.print(result)
        console.print()
    robot, train = load_robot(HERE / "data" / "agile_justin.yaml"), held_out(500, 0.3)
    result = table("Agile Justin, both hands at once: mean position error, mm", "calibrated", *columns)
    for one in justin_stages(robot, "rl", train):
        result.add_row(one.name, *cells(one, np.tile(train, 2), JUSTIN_KNOWN[one.name]))
    console.print(result)
    console.print(
        "\nNominal: laid over the readings as a rigid body. Known: the UR10's held out, with other tools; "
        "Justin's as its authors print it. Justin's masses are guessed, and its bearings have one compliance "
        "each: the authors' model has more."
    )


def cells(one: Stage, train: Array, known: float | None) -> list[str]:
    """Return a row of the table."""
    nominal = 1e3 * (one.found.before.position_mean or 0.0)
    fitted, tested = one.errors[train].mean(), one.errors[~train].mean()
    shown = "-" if known is None else f"{known:.3g}"
    count = str(len(one.found.identifiability.identified))
    return [
        f"{nominal:.3f}",
        f"{fitted:.3f}",
        f"{tested:.3f}",
        f"{one.errors.max():.2f}",
        shown,
        count,
        f"{one.seconds:.1f}",
    ]


if __name__ == "__main__":
    main()
