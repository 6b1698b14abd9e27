"""Forming, learned from its runs, by commands and files alone: ``python -m benchmarks.forming_runs``.

The forming study of `compensation_study` (seed 003, section 4): the machine has ball screws that the fuzzy
model does not know, and friction between tool and beam that no model is told of. `identify --model fuzzy`
writes the robot from 126 readings, `compensate` the path without friction; it is run; a tracker of 0.035 mm
reads the 46 targets; `compensate --measured` fits friction, stiffness and clamp of the beam, and corrects
again; likewise a second time, with both runs. Or a load cell, of wrong gain and mounted askew, reads the
force in place of the beam's model. Errors are those of the machine, without the tracker's noise. Target: at
most 0.05 mm after the runs, 98 % of the error without correction.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import load_robot, write_measurements
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.path_correction import Correction, correct_path, errors_of
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.files import process_to_yaml
from beamstiff.compensation.process.load import Process, Together
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.rows import subset
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array, rotate_screw, rotation_from_vector
from benchmarks.compensation_study import FITTED_LOAD, WEIGHT, beam, forming_path, weightless
from benchmarks.ir663_models import campaign
from benchmarks.kr500_files import command, read_path

FRICTIONS = (0.0, 0.1, 0.2, 0.3)
TARGET, CLOSED = 0.05, 98.0  # mm, %
SIGMA = 35e-6  # m: of the tracker
CELL_GAIN, CELL_TURN, CELL_NOISE = 1.03, (0.0, np.radians(1.0), 0.0), 2.0  # N
BENT, MOVED = 0.93, (0.004, 0.0, -0.0015)  # true stiffness of the beam; m, where its clamp truly is


@dataclass(frozen=True)
class Row:
    """Largest errors in mm: without correction, corrected without knowing, after each run."""

    name: str
    friction: float
    none: float
    first: float
    after: tuple[float, ...]
    learned: dict[str, Any]  # by parameter, from the JSON of the last command


def robots(folder: Path) -> None:
    """Write the controller's robot, and the one with the fuzzy model of its readings."""
    robot, table, _ = campaign("ir663-screws")
    write_measurements(
        subset(table, split_rows(table, 0.0, FITTED_LOAD, 0).fitted), folder / "loads.csv", robot
    )
    (folder / "nominal.yaml").write_text(robot_to_yaml(weightless(load_robot("ir663"))))
    nominal, loads = str(folder / "nominal.yaml"), str(folder / "loads.csv")
    command(
        "identify", nominal, loads, "--model", "fuzzy", "--folds", "0", "--out", str(folder / "real.yaml")
    )


def study(
    name: str, folder: Path, friction: float, *, cell: bool = False, off: bool = False, along: int = 40
) -> Row:
    """Return what two runs teach; the clamp and stiffness of the beam may be `off` what is believed."""
    path, truth = forming_path(along=along), Machine(weightless(load_robot("ir663-screws")))
    true_beam = beam(friction=friction)
    if off:
        true_beam = _off(true_beam)
    load, random = Together((WEIGHT, true_beam)), np.random.default_rng(int(1e3 * friction))
    as_it_is = correct_path(truth, path, load)
    _write(folder / "path.csv", path, path.poses[:, :3, 3])
    (folder / "beam.yaml").write_text(process_to_yaml(beam()))

    def corrected(out: str, *more: str) -> Array:
        """Correct the path by command; return the commands that its file holds."""
        robots = (
            str(folder / "nominal.yaml"),
            str(folder / "path.csv"),
            "--actual",
            str(folder / "real.yaml"),
        )
        command("compensate", *robots, *more, "--wrench", f"fz={WEIGHT.value[2]}", "--out", str(folder / out))
        return read_path(folder / out)

    process = ("--process", str(folder / "beam.yaml"))
    error, seen = _run(truth, as_it_is, corrected("sent0.csv", *process), load, random)
    errors, runs = [error], list[str]()
    for turn in range(2):
        file = folder / f"run{turn}.csv"
        _write(file, path, seen, _read(load, path, seen, random) if cell else None)
        runs += ["--measured", str(file), "--ran", str(folder / f"sent{turn}.csv")]
        said = (*(() if cell else process), *runs, "--json", str(folder / "learned.json"))
        error, seen = _run(truth, as_it_is, corrected(f"sent{turn + 1}.csv", *said), load, random)
        errors.append(error)
    largest = [1e3 * float(np.linalg.norm(one, axis=1).max()) for one in (as_it_is.before[:, :3], *errors)]
    learned = json.loads((folder / "learned.json").read_text())["learned"]["parameters"]
    return Row(name, friction, largest[0], largest[1], tuple(largest[2:]), learned)


def _write(file: Path, path: ToolPath, at: Array, wrench: Array | None = None) -> None:
    """Write positions of the targets as a table, and the loads that a cell read at them."""
    loads = np.zeros((len(path), 0)) if wrench is None else wrench
    names = ["name", "x", "y", "z", *("fx", "fy", "fz", "mx", "my", "mz")[: loads.shape[1]]]
    lines = [f"# sigma_position: {SIGMA}", ",".join(names)]
    for name, values in zip(path.names, np.hstack([at, loads]).tolist(), strict=True):
        lines.append(",".join([name, *map(repr, values)]))
    file.write_text("\n".join(lines) + "\n")


def _off(own: Cantilever) -> Cantilever:
    clamp = own.clamp.copy()
    clamp[:3, 3] += clamp[:3, :3] @ np.array(MOVED)
    return replace(own, clamp=clamp, modulus=BENT * own.modulus)


def _run(
    truth: Machine, as_it_is: Correction, commands: Array, load: Process, random: np.random.Generator
) -> tuple[Array, Array]:
    """Return the machine's error (N, 3) for commands, and where the tracker saw its tool."""
    error = errors_of(truth, as_it_is, commands, load)[:, :3]
    at = as_it_is.targets[:, :3, 3] + error
    return error, at + random.normal(0.0, SIGMA, at.shape)


def _read(load: Process, path: ToolPath, at: Array, random: np.random.Generator) -> Array:
    """Return what a cell of wrong gain, mounted askew, reads of the beam's force, (N, 6)."""
    poses = path.poses.copy()
    poses[:, :3, 3] = at
    assert isinstance(load, Together)
    true = load.parts[1].wrench(poses, path)
    turn = rotation_from_vector(-np.array([CELL_TURN]))
    read = (rotate_screw(turn) @ true[..., None])[..., 0] / CELL_GAIN
    read[:, :3] += random.normal(0.0, CELL_NOISE, (len(read), 3))
    return np.asarray(read)


def rows() -> Iterator[Row]:
    """Yield the rows of the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robots(folder)
        for friction in FRICTIONS:
            yield study("fuzzy, elastica", folder, friction)
        for friction in FRICTIONS[::3]:
            yield study("fuzzy, force measured", folder, friction, cell=True)
        yield study("fuzzy, elastica; beam softer, clamp elsewhere", folder, 0.15, off=True)


def main() -> None:
    """Print the table."""
    console = Console(width=118)
    columns = ("friction", "none", "without friction", "one run", "two runs", "closed, %", "friction found")
    title = f"Largest error, mm; target {TARGET}, {CLOSED:g} %"
    table = Table("model, process", *columns, title=title, title_justify="left")
    for row in rows():
        known = row.learned.get("friction")
        cells = (
            row.name,
            f"{row.friction:g}",
            f"{row.none:.2f}",
            f"{row.first:.3f}",
            *(f"{one:.3f}" for one in row.after),
            f"{100 * (1 - row.after[-1] / row.none):.1f}",
            f"{known['value']:.3f} +- {known['std']:.3f}" if known else "-",
        )
        table.add_row(*cells)
        told = [
            f"{name} {one['value']:.4g} +- {one['std']:.2g}"
            f"{'' if one['identifiable'] else ' (not identifiable)'}"
            for name, one in row.learned.items()
        ]
        console.print(" | ".join(cells), "; ".join(told), style="dim")
    console.print(table)


if __name__ == "__main__":
    main()
