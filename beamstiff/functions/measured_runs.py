"""Measured runs of a path: files read, rows matched to targets, and the process that explains them."""

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from beamstiff.compensation.editing import read_bytes
from beamstiff.compensation.formats import Program, path_csv, read_program
from beamstiff.compensation.learn import Learned, Run, learn
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.process.load import FromPath, Process, beside_columns
from beamstiff.compensation.process.parameters import LoadCell
from beamstiff.compensation.rewrite import with_joint_targets
from beamstiff.errors import BeamstiffError, OptionError
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array
from beamstiff.units import quantity

EFFECTS = 2  # of the library that may be added beside the process
PathLike = str | os.PathLike[str]
_SIGMA = re.compile(r"^#\s*sigma_position\s*:\s*(?P<value>[^\r\n,;]+)", re.MULTILINE)


def learned_from(
    program: Program,
    machine: Machine,
    process: Process | None,
    beside: Process | None,
    measured: Sequence[PathLike],
    ran: Sequence[PathLike],
    start: Array | None,
) -> tuple[Program, Learned]:
    """Return the program, with the loads that the last run read, and what its measured runs teach.

    `process`: what is learned; by default a load cell where a run has loads. `beside`: what is known and acts
    too, as the loads of the path do. `measured`: tables of x y z, in the frame of the path, and of the loads
    fx to mz that a cell read, if any. `ran`: the programs that ran, one each; none: the program itself in all
    runs. `start`: as of `learn`.
    """
    if ran and len(ran) != len(measured):
        found = f"found {len(ran)} programs for {len(measured)} measured runs"
        raise OptionError("ran", f"{found}, expected as many")
    sent = [read_program(Path(one)) for one in ran] if ran else [program] * len(measured)
    runs, sigmas = [], []
    for file, one in zip(map(Path, measured), sent, strict=True):
        text = read_bytes(file)
        table = path_csv.read(text, str(file)).path
        if table.joints is not None:
            raise BeamstiffError(f"{file}: found no x, y, z, expected where the tool was measured")
        rows = _rows(table.names, program, str(file))
        sent_path = with_joint_targets(_same_targets(one, program).path, machine)
        commands = machine.frames.to_base(sent_path).poses
        seen = program.path.poses.copy()
        seen[rows, :3, 3] = table.poses[:, :3, 3]
        at = machine.frames.to_base(program.path.moved_to(seen)).poses
        runs.append(Run(rows, commands[rows], at[rows, :3, 3], table.wrench))
        if stated := _SIGMA.search(text):
            sigmas.append(quantity(stated["value"].strip(), "length"))
        if table.wrench is not None:
            if not isinstance(process, LoadCell | None) or len(rows) < len(program.path):
                raise BeamstiffError(
                    f"{file}: found measured loads, expected those of every target, and no process beside "
                    "them but a load-cell"
                )
            loads = np.zeros((len(program.path), 6))
            loads[rows] = table.wrench
            program = replace(program, path=replace(program.path, wrench=loads))
    if process is None:
        process = FromPath() if program.path.wrench is None else LoadCell()
    known = beside_columns(beside)
    path = machine.frames.to_base(with_joint_targets(program.path, machine))
    sigma = max(sigmas, default=0.0) or None
    return program, learn(machine, path, process, runs, sigma, start, EFFECTS, known)


def _rows(names: tuple[str, ...], program: Program, source: str) -> Integers:
    """Return the target of every row of a run: by its name, else by its order."""
    known = program.path.names
    if len(set(known)) == len(known) and set(names) <= set(known) and len(set(names)) == len(names):
        return np.array([known.index(name) for name in names], dtype=np.int64)
    if len(names) != len(known):
        raise BeamstiffError(
            f"{source}: found {len(names)} rows for {len(known)} targets of {program.path.source}, expected "
            "one each in their order, or a column name with the names of targets"
        )
    return np.arange(len(known), dtype=np.int64)


def _same_targets(ran: Program, program: Program) -> Program:
    """Return of a program that ran those targets that are corrected."""
    ran = ran.cut(program.chosen) if program.chosen and len(ran.path) > len(program.path) else ran
    if len(ran.path) != len(program.path):
        raise BeamstiffError(
            f"{ran.path.source}: found {len(ran.path)} targets, expected the {len(program.path)} of "
            f"{program.path.source}"
        )
    return ran
