"""Correct the tool path of a robot that bends a beam, as in section 4 of Marie, Courteille and Maurine.

A KUKA IR-663 with 920 N on its flange presses a clamped aluminium beam 25 mm down near its free end and
slides 200 mm along it. The beam pushes back, the harder the nearer the tool comes to the clamp, and the robot
gives way. Commands (fake poses) are found that bring the tool to its path all the same. How the beam is
computed matters: by Euler and Bernoulli it pushes straight up, by an incremental analysis with large
displacements it pushes square to its bent face, and so along the path as well; friction adds to that.

The same from the command line:

    beamstiff compensate ir663 examples/data/forming_path.csv --process examples/data/forming.yaml --taught

Run `python examples/forming_compensation.py [FOLDER]`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from beamstiff import load_robot
from beamstiff.compensation.formats import read_program
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path_correction import errors_of
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.files import read_process
from beamstiff.compensation.process.load import Process, Together
from beamstiff.compensation.rewrite import compensate_program, size_of
from beamstiff.files import write_whole
from beamstiff.report.compensation import compensation_figure
from beamstiff.report.figures import save_figure
from beamstiff.report.tables import table

HERE = Path(__file__).resolve().parent
METHODS = ("euler-bernoulli", "incremental")


def by_method(process: Process, method: str, friction: float) -> Process:
    """Return a process with its beam computed in another way."""
    assert isinstance(process, Together)
    parts = [
        replace(part, method=method, friction=friction) if isinstance(part, Cantilever) else part
        for part in process.parts
    ]
    return Together(tuple(parts))


def main(folder: Path = HERE / "output") -> None:
    console = Console(width=110)
    program = read_program(HERE / "data" / "forming_path.csv")
    process = read_process(HERE / "data" / "forming.yaml")
    machine = Machine(load_robot("ir663"))
    real = compensate_program(program, machine, process, taught=True)
    before = size_of(real.correction.before)
    shown = table(
        "What the path is corrected for, and what is left on a beam with friction and large displacements",
        "correction", "RMS, mm", "largest, mm", "less error, %",
    )  # fmt: skip
    shown.add_row("none", f"{before.rms_mm:.3f}", f"{before.max_mm:.3f}", "")
    results = {
        method: compensate_program(program, machine, by_method(process, method, 0.0), taught=True)
        for method in METHODS
    }
    for name, result in (*results.items(), ("incremental, friction", real)):
        left = size_of(errors_of(machine, real.correction, result.correction.commands, process))
        less = f"{100 * (1 - left.rms_mm / before.rms_mm):.1f}"
        shown.add_row(name, f"{left.rms_mm:.3f}", f"{left.max_mm:.3f}", less)
    console.print(shown)
    ends = [1e3 * results[method].correction.before[-1, :3] for method in METHODS]
    console.print(
        "Near the clamp the two ways to compute the beam move the tool "
        f"{np.linalg.norm(ends[0] - ends[1]):.2f} mm apart (the paper: about 0.2 mm)."
    )
    folder.mkdir(parents=True, exist_ok=True)
    save_figure(compensation_figure(real, "Forming with a KUKA IR-663"), folder / "forming_path.png")
    write_whole(folder / "forming_corrected.csv", real.content)
    console.print(f"Path, picture: {folder / 'forming_corrected.csv'}, {folder / 'forming_path.png'}")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
