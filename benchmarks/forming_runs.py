"""Forming, learned from its runs: ``python -m benchmarks.forming_runs``.

The forming study of `compensation_study` (seed 003, section 4): the machine has ball screws that the fuzzy
model does not know, and friction between tool and beam that no model is told of. The path is corrected
without friction and run; a tracker of 0.035 mm reads the 46 targets; friction, stiffness and clamp of the
beam are fitted, and the path is corrected again; likewise a second time, with both runs. Or a load cell, of
wrong gain and mounted askew, reads the force in place of the beam's model. Errors are those of the machine,
without the tracker's noise. Target: at most 0.05 mm after the runs, 98 % of the error without correction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import load_robot
from beamstiff.compensation.correct import Correction, correct_path, errors_of
from beamstiff.compensation.learn import Learned, Run, learn
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.load import FromPath, Process, Together
from beamstiff.compensation.process.parameters import LoadCell
from beamstiff.model.protocol import Model
from beamstiff.se3 import Array, rotate_screw, rotation_from_vector
from benchmarks.compensation_study import WEIGHT, beam, forming_path, models, weightless

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
    learned: Learned


def study(
    name: str, model: Model, friction: float, *, cell: bool = False, off: bool = False, along: int = 40
) -> Row:
    """Return what two runs teach; the clamp and stiffness of the beam may be `off` what is believed."""
    path = forming_path(along=along)
    truth, machine = (
        Machine(weightless(load_robot("ir663-screws"))),
        Machine(weightless(load_robot("ir663")), elasticity=model),
    )
    true_beam = beam(friction=friction)
    if off:
        true_beam = _off(true_beam)
    load = Together((WEIGHT, true_beam))
    random = np.random.default_rng(int(1e3 * friction))
    as_it_is = correct_path(truth, path, load)
    found = correct_path(machine, path, Together((WEIGHT, beam())))
    error, seen = _run(truth, as_it_is, found, load, random)
    errors, runs = [error], [seen]
    for _ in range(2):
        own, process = path, Together((WEIGHT, beam()))
        if cell:
            read = _read(load, path, runs[-1].measured, random)
            runs[-1] = replace(runs[-1], wrench=read)
            own, process = replace(path, wrench=read), Together((WEIGHT, FromPath(), LoadCell()))
        learned = learn(machine, own, process, runs, SIGMA)
        found = correct_path(machine, own, learned.process)
        error, seen = _run(truth, as_it_is, found, load, random)
        errors.append(error)
        runs.append(seen)
    largest = [1e3 * float(np.linalg.norm(one, axis=1).max()) for one in (as_it_is.before[:, :3], *errors)]
    return Row(name, friction, largest[0], largest[1], tuple(largest[2:]), learned)


def _off(own: Cantilever) -> Cantilever:
    clamp = own.clamp.copy()
    clamp[:3, 3] += clamp[:3, :3] @ np.array(MOVED)
    return replace(own, clamp=clamp, modulus=BENT * own.modulus)


def _run(
    truth: Machine, as_it_is: Correction, found: Correction, load: Process, random: np.random.Generator
) -> tuple[Array, Run]:
    """Return the machine's error (N, 3) for commands, and what the tracker saw of it."""
    assert not found.reasons
    error = errors_of(truth, as_it_is, found.commands, load)[:, :3]
    at = as_it_is.targets[:, :3, 3] + error
    return error, Run(np.arange(len(at)), found.commands, at + random.normal(0.0, SIGMA, at.shape))


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
    fuzzy = models(("fuzzy",))["fuzzy"]
    for friction in FRICTIONS:
        yield study("fuzzy, elastica", fuzzy, friction)
    for friction in FRICTIONS[::3]:
        yield study("fuzzy, force measured", fuzzy, friction, cell=True)
    yield study("fuzzy, elastica; beam softer, clamp elsewhere", fuzzy, 0.15, off=True)


def main() -> None:
    """Print the table."""
    console = Console(width=118)
    columns = ("friction", "none", "without friction", "one run", "two runs", "closed, %", "friction found")
    title = f"Largest error, mm; target {TARGET}, {CLOSED:g} %"
    table = Table("model, process", *columns, title=title, title_justify="left")
    for row in rows():
        found = {one.name: one for one in row.learned.parameters}
        known = found.get("friction")
        cells = (
            row.name,
            f"{row.friction:g}",
            f"{row.none:.2f}",
            f"{row.first:.3f}",
            *(f"{one:.3f}" for one in row.after),
            f"{100 * (1 - row.after[-1] / row.none):.1f}",
            f"{known.value:.3f} +- {known.std:.3f}" if known else "-",
        )
        table.add_row(*cells)
        told = [
            f"{one.name} {one.value:.4g} +- {one.std:.2g}{'' if one.identifiable else ' (not identifiable)'}"
            for one in found.values()
        ]
        console.print(" | ".join(cells), "; ".join(told), style="dim")
    console.print(table)


if __name__ == "__main__":
    main()
